"""What the arm would touch in a configuration: MuJoCo's own collision check on the compiled cell."""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.kinematics import JOINT_NAMES

ARM_ROOT = "ur5_base"


class CellCollision:
    """Callable: the first pair of bodies in contact, in words, or None when the arm is clear of everything.

    What collides with what is the model's business (contype, conaffinity, exclusions); contacts in which the arm takes
    no part, such as a clamp on the part, do not count.
    """

    def __init__(self, model: Any) -> None:
        """Args: model of a world with the arm, its joints named as in `weldsim.kinematics.JOINT_NAMES`."""
        self._model, self._data = model, mujoco.MjData(model)
        self._qpos = np.array([model.joint(name).qposadr[0] for name in JOINT_NAMES])
        root = model.body(ARM_ROOT).id
        self._arm = np.array([model.body_rootid[body] == model.body_rootid[root] for body in model.geom_bodyid])

    def __call__(self, q: Float[ndarray, "6"]) -> str | None:
        self._data.qpos[self._qpos] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        for k in range(self._data.ncon):
            geoms, depth = self._data.contact.geom[k], -1e3 * float(self._data.contact.dist[k])
            if depth > 0 and self._arm[geoms].any():
                first, second = (self._model.geom(int(g)).name.removesuffix("_collision") or f"geom {g}" for g in geoms)
                return f"{first} touches {second} ({depth:.1f} mm deep)"
        return None
