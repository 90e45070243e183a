"""An arm or torch that runs right through a thin slab touches it, however deep: judged by points inside the bodies."""

import mujoco
import numpy as np

from weldsim.dryrun.cell import empty_cell, scene_cell
from weldsim.kinematics import JOINT_NAMES
from weldsim.scene.config import SceneConfig

CLEARLY = 0.002  # [m] inside both bodies


def _inside(model: mujoco.MjModel, data: mujoco.MjData, capsule: int, block: int) -> bool:
    """Whether a point of the capsule's axis lies clearly inside the box."""
    radius, half = model.geom_size[capsule, :2]
    axis = data.geom_xmat[capsule].reshape(3, 3)[:, 2]
    points = data.geom_xpos[capsule] + np.linspace(-half, half, 101)[:, None] * axis
    local = (points - data.geom_xpos[block]) @ data.geom_xmat[block].reshape(3, 3)
    return bool((np.abs(local) < model.geom_size[block] - min(CLEARLY, radius / 4)).all(axis=1).any())


def test_arm_through_table_or_part_is_never_clear() -> None:
    """Random postures: every pair of capsule and box that share points of the axis is told as a contact."""
    rng = np.random.default_rng(0)
    pierced = 0
    for cell in (empty_cell(), scene_cell(SceneConfig())):
        model = cell.model
        data = mujoco.MjData(model)
        solid = np.flatnonzero(model.geom_contype)
        kinds = model.geom_type[solid]
        # Fixed boxes alone: the arm's own boxes and capsules are built into one another.
        fixed = model.body_weldid[model.geom_bodyid[solid]] == 0
        blocks = solid[(kinds == mujoco.mjtGeom.mjGEOM_BOX) & fixed]
        capsules = solid[(kinds == mujoco.mjtGeom.mjGEOM_CAPSULE) & ~fixed]
        assert len(blocks)
        assert len(capsules)
        for q in rng.uniform(-np.pi, np.pi, (1500, 6)):
            for name, angle in zip(JOINT_NAMES, q, strict=True):
                data.joint(name).qpos[0] = angle
            mujoco.mj_kinematics(model, data)
            if any(_inside(model, data, c, b) for c in capsules for b in blocks):
                pierced += 1
                assert cell.collision.touches(q)
                assert cell.collision.touch(q) is not None
                assert cell.collision.gap(q) < 0
    assert pierced > 100
