"""A coarse look at whether the arm could sweep along a path: a sieve for many places, not a verdict."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.motion.air import air_moves
from weldsim.motion.config import MotionConfig
from weldsim.motion.ladder import Hold, climb, near
from weldsim.motion.rail import Rail, make_rail
from weldsim.motion.rungs import Rungs, branch_of, make_rungs, places, turned
from weldsim.records import TorchPath

ROLLS = 18  # rotations about the wire that are tried
LENGTH, TURN = 0.03, 0.25  # [m], [rad] of the torch between the places looked at first
BETWEEN = 0.004  # [m] between those looked at along a sweep that was found
ROAMS = 200  # tries of the search for a way through the air
SWEEPS = 2  # that are looked at closely


def quick(path: TorchPath, cell: Cell, config: MotionConfig, *, first: float | None = None, air: bool = False) -> bool:
    """Whether a sweep along the path is found that is clear, and turns no joint too fast, at places BETWEEN apart.

    Args:
        first: arc length to be looked at before all others [m].
        air: whether the arm must also get from where it stands to the path and back.
    """

    def blocked(q: Float[ndarray, "6"]) -> str | None:
        return "something" if cell.collision.touches(q) else None

    rail = make_rail(path, config)
    # Its ends first, and where it failed before: most places that will not do fail there.
    suspects = [] if first is None else [first]
    coarse = replace(config, rolls=min(config.rolls, ROLLS), clearance=0.0)
    if make_rungs(rail, cell.arm, coarse, blocked, at=np.unique([rail.s[0], rail.s[-1], *suspects])).first_refused is not None:
        return False
    rungs = make_rungs(rail, cell.arm, coarse, blocked, at=places(rail, LENGTH, TURN))
    if rungs.first_refused is not None:
        return False
    banned = np.zeros(rungs.cost.shape, bool)
    for attempt in range(SWEEPS):
        hold = climb(rungs, cell.q_start, cell.arm, config, None, banned)
        if hold is None:
            return False
        fault = _first_fault(rail, rungs, hold, cell, config)
        if fault is None and not (air and _cut_off(rail, hold, cell, config)):
            return True
        banned |= near(rungs, hold, float(rail.s[0]) if fault is None else fault, reach=1 + attempt)
    return False


def _first_fault(rail: Rail, rungs: Rungs, hold: Hold, cell: Cell, config: MotionConfig) -> float | None:
    """Arc length [m] at which the sweep leaves its branch, turns a joint too fast or touches something; None where it does not."""
    s = np.linspace(rail.s[0], rail.s[-1], max(3, int(np.ceil((rail.s[-1] - rail.s[0]) / BETWEEN)) + 1))
    X_BT = rail.at(s)
    R = turned(_frames_between(rungs, s, X_BT), np.interp(s, hold.s, hold.roll)) if rail.roll_free else X_BT.R
    solutions, pose = cell.arm.inverse_of_many((Transform("BT", R, X_BT.p) @ cell.arm.X_FT.inverse()).matrix)
    mine = branch_of(solutions) == hold.branch
    q = np.full((len(s), 6), np.nan)
    q[pose[mine]] = solutions[mine]
    lost = np.isnan(q[:, 0])
    if lost.any():
        return float(s[lost.argmax()])
    turn = np.abs((np.diff(q, axis=0) + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
    fast = turn > config.joint_rate * np.diff(s)
    if fast.any():
        return float(s[fast.argmax()])
    return next((float(at) for at, posture in zip(s, q, strict=True) if cell.collision.touches(posture)), None)


def _frames_between(rungs: Rungs, s: Float[ndarray, "n"], X_BT: Transform) -> Float[ndarray, "n 3 3"]:
    """Frames at arc lengths s [m] whose z is the wire there and whose x lies between those of the neighbouring rungs."""
    i = np.clip(np.searchsorted(rungs.s, s, side="right") - 1, 0, len(rungs.s) - 2)
    u = ((s - rungs.s[i]) / (rungs.s[i + 1] - rungs.s[i]))[:, None]
    z = X_BT.R[:, :, 2]
    x = (1 - u) * rungs.frames[i, :, 0] + u * rungs.frames[i + 1, :, 0]
    x -= np.sum(x * z, axis=1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _cut_off(rail: Rail, hold: Hold, cell: Cell, config: MotionConfig) -> bool:
    """Whether no way through the air is found to the sweep's first posture, or back from its last one."""
    ends = [(hold.q[0], float(rail.s[0]), False)]
    if config.return_home:
        ends.append((hold.q[-1], float(rail.s[-1]), True))
    try:
        for q, s, back in ends:
            air_moves(cell.q_start, q, s, cell.arm, config, cell.collision, back=back, tries=ROAMS)
    except MotionError:
        return True
    return False
