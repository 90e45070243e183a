"""The first failure as a picture: the arm where it fails, bodies that touch in red, the torch's way, the place that fails."""

import copy
from typing import Any

import cv2
import mujoco
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.verdict import Trial
from weldsim.frames import Transform, unit
from weldsim.kinematics import JOINT_NAMES
from weldsim.mounts import X_WB
from weldsim.records import CameraIntrinsics
from weldsim.sensor.renderer import Render, make_renderer

WIDTH, HEIGHT = 1200, 800
FINER = 1.5  # the picture is drawn this much larger, and its edges are smooth without help of the back end
RED = (0.85, 0.12, 0.10, 0.75)  # of bodies that touch
LINE, PLACE = (255, 140, 13), (242, 26, 140)  # RGB of the torch's way and of the place that fails
PROUD = 0.001  # [m] by which a red body stands out of what it covers
DOTS = 120  # of the torch's way
DOT, SPOT = 0.002, 0.009  # [m] radius of a dot and of the place
HIDDEN = 0.006  # [m] a dot this far behind what is drawn there is not seen: the way lies in the groove
NEAR = 1.15  # [m] from the camera to the place
DOWN, ASIDE = np.deg2rad(22.0), np.deg2rad(65.0)  # the camera looks down by this, and past the place from this much aside
FIELD = np.deg2rad(45.0)  # of view, upright


def picture(trial: Trial, cell: Cell) -> bytes:
    """A PNG of the first failure, or of halfway through the motion where there is none.

    Raises:
        SensorError: nothing draws here, not even the ray caster.
    """
    failure = trial.failure
    model = copy.copy(cell.model)
    model.vis.quality.offsamples = 0  # see FINER
    names = () if failure is None else (failure.first, failure.second)
    for name in filter(None, names):
        for geom in range(model.ngeom):
            if model.geom(geom).name in (name, f"{name}_collision"):
                model.geom_matid[geom], model.geom_rgba[geom], model.geom_group[geom] = -1, RED, 0
                model.geom_size[geom] += PROUD
    q = trial.q_worst if trial.q_worst is not None else (trial.q[int(len(trial.q) / 2)] if len(trial.q) else cell.q_start)
    data = mujoco.MjData(model)
    for name, angle in zip(JOINT_NAMES, q, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    X_WC, intrinsics = _camera(_looked_at(trial, data)), _intrinsics()
    renderer = make_renderer(model)
    try:
        seen = renderer.render(data, X_WC, intrinsics)
    finally:
        renderer.close()
    image = _marked(seen, X_WC, intrinsics, trial)
    image = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].tobytes()


def _looked_at(trial: Trial, data: Any) -> Float[ndarray, "3"]:
    """The place that fails, or the middle of the torch's way, in B [m]; of a motion without one, the torch."""
    if trial.p_worst is not None:
        return trial.p_worst
    if len(trial.points_B):
        return trial.points_B.mean(axis=0)
    return X_WB.inverse().points(np.array(data.site("torch_tip").xpos)[None])[0]


def _camera(place_B: Float[ndarray, "3"]) -> Transform:
    """X_WC, looking at a little above the place from beside the line from the base to it: neither arm nor part hides the other."""
    target = X_WB.points((0.7 * place_B + 0.3 * np.array([0.0, -0.25, 0.25]))[None])[0]
    out = X_WB.R @ place_B
    heading = float(np.arctan2(out[1], out[0])) + np.pi - ASIDE
    z = np.array([np.cos(DOWN) * np.cos(heading), np.cos(DOWN) * np.sin(heading), -np.sin(DOWN)])
    x = unit(np.cross(z, [0.0, 0.0, 1.0]))
    return Transform("WC", np.stack([x, np.cross(z, x), z], axis=1), target - NEAR * z)


def _intrinsics() -> CameraIntrinsics:
    width, height = round(FINER * WIDTH), round(FINER * HEIGHT)
    f = float(height / 2 / np.tan(FIELD / 2))
    return CameraIntrinsics(width=width, height=height, fx=f, fy=f, cx=width / 2, cy=height / 2)


def _marked(seen: Render, X_WC: Transform, i: CameraIntrinsics, trial: Trial) -> UInt8[ndarray, "h w 3"]:
    """The drawing with the torch's way as dots where nothing hides it, and the place that fails: a disc, or a ring where hidden."""
    if seen.colour is None:
        raise AssertionError("a renderer that was asked for colour gave none")
    image = np.ascontiguousarray(seen.colour)
    depth = np.where(np.isfinite(seen.depth), seen.depth, np.inf)
    X_CB = X_WC.inverse() @ X_WB

    def mark(point_B: Float[ndarray, "3"], radius: float, colour: tuple[int, int, int], *, always: bool = False) -> None:
        x, y, z = X_CB.points(point_B[None])[0]
        if z <= 0.01:
            return
        u, v = int(i.fx * x / z + i.cx), int(i.fy * y / z + i.cy)
        if not (0 <= u < i.width and 0 <= v < i.height):
            return
        hidden = z > float(depth[v, u]) + HIDDEN
        if hidden and not always:
            return
        size = max(2, round(i.fx * radius / z))
        cv2.circle(image, (u, v), size, colour, max(3, size // 4) if hidden else cv2.FILLED, cv2.LINE_AA)

    for p in trial.points_B[:: max(1, len(trial.points_B) // DOTS)]:
        mark(p, DOT, LINE)
    if trial.p_worst is not None:
        mark(trial.p_worst, SPOT, PLACE, always=True)
    return image
