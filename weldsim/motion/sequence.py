"""Several paths welded one after the other, with air moves from each to the next, and home after the last."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.errors import MotionError
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import MotionPlan, plan_motion
from weldsim.motion.sweep import Blocked
from weldsim.records import TorchPath


def plan_sequence(
    paths: Sequence[TorchPath],
    q_start: Float[ndarray, "6"],
    config: MotionConfig | None = None,
    arm: Arm = UR5,
    blocked: Blocked | None = None,
    names: Sequence[str] = (),
) -> tuple[MotionPlan, ...]:
    """A plan for each path; each starts where the last one ended, the first at q_start [rad], to which the last one returns.

    Args:
        paths, q_start, config, arm, blocked: see `plan_motion`.  names: of the paths, for errors.
    Raises:
        MotionError: one of them cannot be welded; nothing is planned then.
    """
    config = config or MotionConfig()
    plans: list[MotionPlan] = []
    q = q_start
    for i, path in enumerate(paths):
        last = i == len(paths) - 1
        try:
            plans.append(plan_motion(path, q, config if last else replace(config, return_home=False), arm, blocked, home=q_start))
        except MotionError as error:
            if len(paths) == 1:
                raise
            error.args = (f"{names[i] if names else f'path {i + 1}'}: {error}", *error.args[1:])
            raise
        q = np.array(plans[-1].trajectory.q[-1])
    return tuple(plans)
