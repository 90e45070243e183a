"""A picture of a scene: the cell, and beside it what the cameras see, colour and depth: each scan view, and from overhead."""

from typing import TYPE_CHECKING

import cv2
import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.mounts import KINECT_V2, X_WC_KINECT
from weldsim.records import CameraIntrinsics
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import HOME, build_world
from weldsim.sensor.renderer import OPTICAL_FROM_MUJOCO, Renderer, make_renderer

if TYPE_CHECKING:
    from weldsim.scene.world import World

WIDTH, HEIGHT = 1280, 960
EDGE = 8  # [px] between the pictures
ROWS = 3  # of views in a column, at most
ASIDE = HOME + np.array([np.pi, 0.0, 0.0, 0.0, 0.0, 0.0])  # [rad] the arm turned away from the table

Picture = UInt8[ndarray, "_ _ 3"]


def portrait(scene: SceneConfig, camera: str = "overview", view: int = 0) -> bytes:
    """A PNG: the cell with the arm at a scan view, seen by one of its cameras, and what every camera sees.

    The wrist camera's pictures are taken with the arm where it holds the camera, the overhead camera's with it turned away.

    Raises:
        SceneError: a scene that contradicts itself.  ViewError: a view that the arm cannot take.
        SensorError: nothing draws here.
    """
    world = build_world(scene)
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
    colour, depth = (cv2.resize(image, side, interpolation=cv2.INTER_AREA) for image in (seen.colour, _shaded(seen.depth)))
    (wide, high), below = cv2.getTextSize(caption, cv2.FONT_HERSHEY_SIMPLEX, 0.6, 1)
    cv2.rectangle(colour, (0, 0), (wide + 16, high + below + 10), (255, 255, 255), cv2.FILLED)
    cv2.putText(colour, caption, (8, high + 6), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (20, 20, 20), 1, cv2.LINE_AA)
    return colour, depth


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


def _shaded(depth: np.ndarray) -> np.ndarray:
    """Depth as colours, near bright, no return black; the range is that of what is nearest: all within twice that distance."""
    seen = np.isfinite(depth)
    low = float(np.percentile(depth[seen], 2)) if seen.any() else 0.0
    near = seen & (depth < 2 * low)
    high = float(np.percentile(depth[near], 98)) if near.any() else low + 1.0
    level = np.clip((high - np.where(seen, depth, high)) / max(high - low, 1e-6), 0, 1)
    colours = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    colours[~seen] = 0
    return cv2.cvtColor(colours, cv2.COLOR_BGR2RGB)
