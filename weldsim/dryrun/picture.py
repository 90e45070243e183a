"""The first failure as a picture: the arm where it fails, bodies that touch in red, the torch's way, the place that fails."""

import copy
import os
from typing import Any

import cv2
import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.verdict import Trial
from weldsim.errors import SensorError
from weldsim.kinematics import JOINT_NAMES
from weldsim.mounts import X_WB

WIDTH, HEIGHT = 1200, 800
RED, PLACE, LINE = (0.85, 0.12, 0.10, 0.75), (0.95, 0.10, 0.55, 1.0), (1.0, 0.55, 0.05, 1.0)
PROUD = 0.001  # [m] by which a red body stands out of what it covers
DOTS = 120  # of the torch's way
NEAR = 1.15  # [m] from the camera to the place


def picture(trial: Trial, cell: Cell) -> bytes:
    """A PNG of the first failure, or of halfway through the motion where there is none.

    Raises:
        SensorError: nothing draws here.
    """
    failure = trial.failure
    model = copy.copy(cell.model)
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
    return _drawn(model, data, trial)


def _drawn(model: Any, data: Any, trial: Trial) -> bytes:
    place = trial.p_worst if trial.p_worst is not None else trial.points_B.mean(axis=0)
    renderer = _renderer(model)
    try:
        camera = mujoco.MjvCamera()
        camera.lookat[:] = X_WB.points((0.7 * place + 0.3 * np.array([0.0, -0.25, 0.25]))[None])[0]
        camera.distance, camera.elevation = NEAR, -22.0
        # From beside the line from the base to the place: neither the arm nor the part is in front of the other.
        out = X_WB.R @ place
        camera.azimuth = float(np.rad2deg(np.arctan2(out[1], out[0]))) + 180.0 - 65.0
        option = mujoco.MjvOption()
        option.geomgroup[:] = [group < 3 for group in range(6)]
        option.sitegroup[:] = 0
        renderer.update_scene(data, camera=camera, scene_option=option)
        stride = max(1, len(trial.points_B) // DOTS)
        for p in X_WB.points(trial.points_B[::stride]) if len(trial.points_B) else ():
            _ball(renderer.scene, p, 0.002, LINE)
        if trial.p_worst is not None:
            _ball(renderer.scene, X_WB.points(trial.p_worst[None])[0], 0.009, PLACE)
        image = renderer.render()
    finally:
        renderer.close()
    return cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1].tobytes()


def _renderer(model: Any) -> Any:
    try:
        return mujoco.Renderer(model, HEIGHT, WIDTH)
    except (AttributeError, ImportError, RuntimeError, mujoco.FatalError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise SensorError(
            f"picture: no OpenGL back end ({reason}); `weldsim doctor` says what is missing",
            backend=os.environ.get("MUJOCO_GL", ""),
            reason=reason,
        ) from error


def _ball(scene: Any, p: Float[ndarray, "3"], radius: float, rgba: tuple[float, ...]) -> None:
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    colour = np.array(rgba, np.float32)
    mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, radius), np.array(p, float), np.eye(3).ravel(), colour)
    scene.ngeom += 1
