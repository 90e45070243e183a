"""Moves through the air between the start configuration and the rail, straight in joint space, over a lifted point, or round."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import Arm
from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT
from weldsim.motion.config import MotionConfig
from weldsim.motion.follow import LostPathError
from weldsim.motion.roam import roam
from weldsim.motion.sweep import Blocked, first_touch, posture_at, touched
from weldsim.motion.timing import Move, air_move

LIFTS = (0.0, 0.1, 0.2, 0.3)  # [m] how far back along the wire a detour begins, tried in order
HOP = 1.2  # [rad] a joint that turns further while the torch is lifted has changed branch
ROAMS = 2000  # tries of the search for a way round


def air_moves(
    q_home: Float[ndarray, "6"],
    q_rail: Float[ndarray, "6"],
    s: float,
    arm: Arm,
    config: MotionConfig,
    blocked: Blocked | None,
    back: bool = False,
    tries: int = ROAMS,
) -> list[Move]:
    """The moves from q_home to q_rail, or the other way with `back`, that touch nothing.

    A straight joint move if it is clear; else one that stops at a point lifted off the rail along the wire; else a way that a
    random search finds.

    Args:
        tries: of that search.
    Raises:
        LostPathError: neither is clear; `data`: s, reason.
    """
    touch: str | None = None
    for lift in LIFTS:
        stops = [q_home, q_rail]
        if lift > 0:
            lifted = _lifted(q_rail, lift, arm)
            if lifted is None:
                continue
            stops.insert(1, lifted)
        if back:
            stops.reverse()
        found = (
            None if blocked is None else next((t for a, b in pairwise(stops) if (t := touched(a, b, blocked)) is not None), None)
        )
        if found is None:
            return [air_move(a, b, s, config, arm) for a, b in pairwise(stops)]
        touch = touch or found
    if (
        blocked is not None
        and (corners := roam(*((q_rail, q_home) if back else (q_home, q_rail)), blocked, tries=tries)) is not None
    ):
        return [air_move(a, b, s, config, arm) for a, b in pairwise(corners)]
    ends = np.stack((q_rail, q_home) if back else (q_home, q_rail))
    straight = None if blocked is None else first_touch(ends, blocked)
    raise LostPathError(
        f"the air move {'home' if back else 'to the weld'}: {touch}",
        s=s,
        reason=f"{touch}",
        q=() if straight is None else tuple(posture_at(ends, straight[0])),
    )


def _lifted(q: Float[ndarray, "6"], lift: float, arm: Arm) -> Float[ndarray, "6"] | None:
    """Joint angles with the torch `lift` [m] back along the wire, in the same branch; None where there are none."""
    X_BT = arm.torch_pose(q)
    try:
        lifted = arm.inverse_near(Transform("BT", X_BT.R, X_BT.p - lift * X_BT.R[:, 2]) @ arm.X_FT.inverse(), q)
    except UnreachableError:
        return None
    return lifted if np.abs(lifted - q).max() < HOP and np.abs(lifted).max() <= JOINT_LIMIT else None
