"""A picture of a scene: the cell, and beside it what the wrist camera sees."""

from typing import TYPE_CHECKING

import cv2
import numpy as np

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import build_world
from weldsim.sensor.renderer import OPTICAL_FROM_MUJOCO, make_renderer

if TYPE_CHECKING:
    from weldsim.scene.world import World

WIDTH, HEIGHT = 1280, 960
EDGE = 8  # [px] between the pictures


def portrait(scene: SceneConfig, camera: str = "overview", view: int = 0) -> bytes:
    """A PNG: the cell with the arm at a scan view, seen by one of its cameras, and the images of that view beside it.

    Raises:
        SceneError: a scene that contradicts itself.  UnreachableError: a view that the arm cannot take.
        SensorError: nothing draws here.
    """
    world = build_world(scene)
    data = world.new_data(world.view_joints(view))
    renderer = make_renderer(world.model)
    try:
        cell = renderer.render(data, _camera_pose(world, data, camera), _camera_intrinsics(world, camera), depth=False).colour
        seen = renderer.render(data, world.X_WB @ world.views[view], world.intrinsics)
    finally:
        renderer.close()
    if cell is None or seen.colour is None:
        raise AssertionError("a renderer that was asked for colour gave none")
    half = (HEIGHT - EDGE) // 2
    side = (round(half * world.intrinsics.width / world.intrinsics.height), half)
    images = [cv2.resize(image, side, interpolation=cv2.INTER_AREA) for image in (seen.colour, _shaded(seen.depth))]
    canvas = np.full((HEIGHT, WIDTH + EDGE + side[0], 3), 255, np.uint8)
    canvas[:, :WIDTH] = cell
    canvas[:half, WIDTH + EDGE :], canvas[HEIGHT - half :, WIDTH + EDGE :] = images
    return cv2.imencode(".png", cv2.cvtColor(canvas, cv2.COLOR_RGB2BGR))[1].tobytes()


def _camera_pose(world: "World", data: object, camera: str) -> Transform:
    """X_WC of one of the model's cameras."""
    found = data.camera(camera)  # type: ignore[attr-defined]
    return Transform("WC", found.xmat.reshape(3, 3) @ OPTICAL_FROM_MUJOCO, found.xpos)


def _camera_intrinsics(world: "World", camera: str) -> CameraIntrinsics:
    """Of a WIDTH x HEIGHT picture with the camera's vertical field of view."""
    f = float(HEIGHT / 2 / np.tan(np.radians(float(world.model.camera(camera).fovy[0])) / 2))
    return CameraIntrinsics(width=WIDTH, height=HEIGHT, fx=f, fy=f, cx=WIDTH / 2, cy=HEIGHT / 2)


def _shaded(depth: np.ndarray) -> np.ndarray:
    """Depth as colours, near bright, no return black; the range is that of the middle 96 %."""
    seen = np.isfinite(depth)
    low, high = np.percentile(depth[seen], [2, 98]) if seen.any() else (0.0, 1.0)
    level = np.clip((high - np.where(seen, depth, high)) / max(high - low, 1e-6), 0, 1)
    colours = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    colours[~seen] = 0
    return cv2.cvtColor(colours, cv2.COLOR_BGR2RGB)
