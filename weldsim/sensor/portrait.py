"""A picture of a scene: the cell, and beside it what the cameras see, colour and depth: each scan view, and from overhead."""

from typing import TYPE_CHECKING

import cv2
import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.mounts import KINECT_V2, X_WC_KINECT
from weldsim.records import CameraIntrinsics
from weldsim.scene.world import HOME
from weldsim.sensor.renderer import OPTICAL_FROM_MUJOCO, Renderer, make_renderer

if TYPE_CHECKING:
    from weldsim.scene.world import World

WIDTH, HEIGHT = 1280, 960
EDGE = 8  # [px] between the pictures
FONT, WHITE, DARK = cv2.FONT_HERSHEY_SIMPLEX, (255, 255, 255), (20, 20, 20)
ROWS = 3  # of views in a column, at most
ASIDE = HOME + np.array([np.pi, 0.0, 0.0, 0.0, 0.0, 0.0])  # [rad] the arm turned away from the table

Picture = UInt8[ndarray, "_ _ 3"]


def portrait(world: "World", camera: str = "overview", view: int = 0) -> bytes:
    """A PNG of a scene: the cell with the arm at a scan view, seen by one of its cameras, and what every camera sees.

    The wrist camera's pictures are taken with the arm where it holds the camera, the overhead camera's with it turned away.

    Raises:
        ViewError: a view that the arm cannot take.  SensorError: nothing draws here.
    """
    renderer = make_renderer(world.model)
    try:
        data = world.new_data(world.view_joints(view))
        cell = renderer.render(data, _camera_pose(world, data, camera), _camera_intrinsics(world, camera), depth=False).colour
        if cell is None:
            raise AssertionError("a renderer that was asked for colour gave none")
        rows = min(ROWS, len(world.views) + 1)
        pairs = []
        for i, X_BC in enumerate(world.views):
            at_view = world.new_data(world.view_joints(i))
            pairs.append(_pair(renderer, at_view, world.X_WB @ X_BC, world.intrinsics, f"view {i + 1}", rows))
        pairs.append(_pair(renderer, world.new_data(ASIDE), X_WC_KINECT, KINECT_V2, "overhead", rows))
    finally:
        renderer.close()
    picture = np.hstack([cell, *_columns(pairs)])
    return cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()


def _pair(
    renderer: Renderer, data: object, X_WC: Transform, intrinsics: CameraIntrinsics, caption: str, rows: int
) -> tuple[Picture, Picture]:
    """Colour with a caption, and depth, so high that `rows` fill HEIGHT."""
    seen = renderer.render(data, X_WC, intrinsics)  # type: ignore[arg-type]
    if seen.colour is None:
        raise AssertionError("a renderer that was asked for colour gave none")
    height = (HEIGHT - (rows - 1) * EDGE) // rows
    side = (round(height * intrinsics.width / intrinsics.height), height)
    low, high = depth_range(seen.depth)
    pictures = (seen.colour, _shaded(seen.depth, low, high))
    colour, depth = (cv2.resize(image, side, interpolation=cv2.INTER_AREA) for image in pictures)
    _caption(colour, caption)
    _scale(depth, low, high)
    return colour, depth


def _caption(picture: Picture, text: str) -> None:
    """`text` in the upper left corner."""
    (wide, high), below = cv2.getTextSize(text, FONT, 0.6, 1)
    cv2.rectangle(picture, (0, 0), (wide + 16, high + below + 10), WHITE, cv2.FILLED)
    cv2.putText(picture, text, (8, high + 6), FONT, 0.6, DARK, 1, cv2.LINE_AA)


def _scale(picture: Picture, low: float, high: float) -> None:
    """What the colours of a depth picture mean, in its lower left corner: a bar from `low` to `high` [m]."""
    ends = [f"{low:.2f} m", f"{high:.2f} m"]
    (wide, tall), _ = cv2.getTextSize(ends[1], FONT, 0.5, 1)
    bar, left, bottom = 110, 8, picture.shape[0] - 8
    cv2.rectangle(picture, (0, bottom - tall - 10), (left + 2 * wide + bar + 24, picture.shape[0]), WHITE, cv2.FILLED)
    cv2.putText(picture, ends[0], (left, bottom - 1), FONT, 0.5, DARK, 1, cv2.LINE_AA)
    cv2.putText(picture, ends[1], (left + wide + bar + 16, bottom - 1), FONT, 0.5, DARK, 1, cv2.LINE_AA)
    depths = np.broadcast_to(np.linspace(low, high, bar, dtype=np.float32), (tall, bar))
    picture[bottom - tall : bottom, left + wide + 8 : left + wide + 8 + bar] = _shaded(depths, low, high)


def _columns(pairs: list[tuple[Picture, Picture]]) -> list[Picture]:
    """Strips of HEIGHT: up to ROWS pairs of pictures below each other, colour left of depth."""
    strips = []
    for start in range(0, len(pairs), ROWS):
        column = pairs[start : start + ROWS]
        wide = max(colour.shape[1] for colour, _ in column)
        strip = np.full((HEIGHT, 2 * (wide + EDGE), 3), 255, np.uint8)
        top = 0
        for images in column:
            for i, image in enumerate(images):
                left = EDGE + i * (wide + EDGE)
                strip[top : top + image.shape[0], left : left + image.shape[1]] = image
            top += images[0].shape[0] + EDGE
        strips.append(strip)
    return strips


def _camera_pose(world: "World", data: object, camera: str) -> Transform:
    """X_WC of one of the model's cameras."""
    found = data.camera(camera)  # type: ignore[attr-defined]
    return Transform("WC", found.xmat.reshape(3, 3) @ OPTICAL_FROM_MUJOCO, found.xpos)


def _camera_intrinsics(world: "World", camera: str) -> CameraIntrinsics:
    """Of a WIDTH x HEIGHT picture with the camera's vertical field of view."""
    f = float(HEIGHT / 2 / np.tan(np.radians(float(world.model.camera(camera).fovy[0])) / 2))
    return CameraIntrinsics(width=WIDTH, height=HEIGHT, fx=f, fy=f, cx=WIDTH / 2, cy=HEIGHT / 2)


def depth_range(depth: Float32[ndarray, "h w"]) -> tuple[float, float]:
    """The depths [m] that colours are spread over: those of what is nearest, all within twice that distance."""
    seen = np.isfinite(depth)
    low = float(np.percentile(depth[seen], 2)) if seen.any() else 0.0
    near = seen & (depth < 2 * low)
    return low, float(np.percentile(depth[near], 98)) if near.any() else low + 1.0


def _shaded(depth: Float32[ndarray, "h w"], low: float, high: float) -> Picture:
    """Depth as colours, near bright, no return black."""
    seen = np.isfinite(depth)
    level = np.clip((high - np.where(seen, depth, high)) / max(high - low, 1e-6), 0, 1)
    colours = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    colours[~seen] = 0
    return cv2.cvtColor(colours, cv2.COLOR_BGR2RGB)
