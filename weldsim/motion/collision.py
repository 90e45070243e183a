"""What the arm would touch in a configuration: MuJoCo's own collision check on the compiled cell."""

import copy
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.kinematics import JOINT_NAMES

ARM_ROOT = "ur5_base"
NEAR = 0.03  # [m] gaps wider than this count as this
SHALLOW = 5e-5  # [m] what rounds to 0.0 mm


@dataclass(frozen=True, kw_only=True)
class Touch:
    """Two bodies in contact. Attributes: first, second, their names (all in first where they are not told apart); depth [m]."""

    first: str
    second: str
    depth: float

    def __str__(self) -> str:
        first, second = in_words(self.first), in_words(self.second)
        return f"{first} touches {second} ({deep(self.depth)})" if second else first


def deep(depth: float) -> str:
    """A depth [m] in words."""
    return f"{1e3 * depth:.1f} mm deep" if depth >= SHALLOW else f"under {2e3 * SHALLOW:.1f} mm deep"


def in_words(name: str) -> str:
    """A body's name as people say it: of a part in pieces the part; clamps and bolts keep theirs, `fixture.without` takes it."""
    if name.startswith("part_collision_"):
        return "part"
    return name if name.startswith("clamp_") else name.replace("_", " ")


class CellCollision:
    """Callable: the pair of bodies deepest in contact, in words, or None when the arm is clear of everything.

    What collides with what is the model's business (contype, conaffinity, exclusions); contacts in which the arm takes
    no part, such as a clamp on the part, do not count. The wire has no collision body: it may touch the seam.
    """

    def __init__(self, model: Any) -> None:
        """Args: model of a world with the arm, its joints named as in `weldsim.kinematics.JOINT_NAMES`."""
        self._model, self._data = model, mujoco.MjData(model)
        self._wide = copy.copy(model)
        # The margins of both geoms of a pair add up; bodies farther apart than their own margins are not looked at.
        self._wide.geom_margin[:] = self._wide.body_margin[:] = NEAR / 2
        self._wide_data = mujoco.MjData(self._wide)
        self._qpos = np.array([model.joint(name).qposadr[0] for name in JOINT_NAMES])
        root = model.body(ARM_ROOT).id
        self._arm = np.array([model.body_rootid[body] == model.body_rootid[root] for body in model.geom_bodyid])
        # Links two joints apart are always near each other: that says nothing about the posture.
        link = np.array([_depth(model, int(body)) for body in model.geom_bodyid])
        apart = np.abs(link[:, None] - link[None, :])
        self._telling = (self._arm[:, None] | self._arm) & ~(self._arm[:, None] & self._arm & (apart <= 2))

    def __call__(self, q: Float[ndarray, "6"]) -> str | None:
        touch = self.touch(q)
        return None if touch is None else str(touch)

    def touch(self, q: Float[ndarray, "6"]) -> Touch | None:
        """The deepest contact of the arm at joint angles q [rad], or None."""
        data = self._data
        data.qpos[self._qpos] = q
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_collision(self._model, data)
        if data.ncon == 0:
            return None
        pairs, distance = data.contact.geom, data.contact.dist
        distance = np.where(self._arm[pairs].any(axis=1), distance, 0.0)
        deepest = int(distance.argmin())
        if distance[deepest] >= 0:
            return None
        first, second = (_said(self._model.geom(int(g)).name) or f"geom {g}" for g in pairs[deepest])
        return Touch(first=first, second=second, depth=-float(distance[deepest]))

    def touches(self, q: Float[ndarray, "6"]) -> bool:
        """Whether the arm touches anything at q [rad]."""
        data = self._data
        data.qpos[self._qpos] = q
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_collision(self._model, data)
        return data.ncon > 0 and bool((self._arm[data.contact.geom].any(axis=1) & (data.contact.dist < 0)).any())

    def gap(self, q: Float[ndarray, "6"]) -> float:
        """Distance [m] of the arm at q [rad] from the nearest other body or far link, negative in contact, NEAR at most."""
        return self.nearest(q)[0]

    def nearest(self, q: Float[ndarray, "6"]) -> tuple[float, str, str]:
        """Distance [m] of the arm at q [rad] from the nearest other body or far link, and the names of the two; NEAR and no names
        where nothing is as near as that."""
        model, data = self._wide, self._wide_data
        data.qpos[self._qpos] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if data.ncon == 0:
            return NEAR, "", ""
        pairs = data.contact.geom
        gaps = np.where(self._telling[pairs[:, 0], pairs[:, 1]], data.contact.dist, NEAR)
        least = int(gaps.argmin())
        if gaps[least] >= NEAR:
            return NEAR, "", ""
        first, second = (_said(model.geom(int(g)).name) or f"geom {g}" for g in pairs[least])
        return float(gaps[least]), first, second

    def shift(self, body: str, position: Float[ndarray, "3"], quaternion: Float[ndarray, "4"]) -> None:
        """Put a fixed body elsewhere in its parent [m], wxyz: `fixture` carries the part and what holds it."""
        for model in (self._model, self._wide):
            index = model.body(body).id
            model.body_pos[index], model.body_quat[index] = position, quaternion


def _said(name: str) -> str:
    """A geom's name as people are told it."""
    return name.removesuffix("_collision").removesuffix("_core")


def _depth(model: Any, body: int) -> int:
    """How many bodies lie between one and the world; the tool counts as the link it hangs on."""
    depth = 0
    while body:
        depth += int(model.body_jntnum[body] > 0)
        body = int(model.body_parentid[body])
    return depth
