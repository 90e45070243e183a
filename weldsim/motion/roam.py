"""A way through the air where the straight joint move is blocked: ompl's RRT-Connect (Kuffner and LaValle 2000), then shortened.

The same question always gets the same answer: the search is seeded and stops after a number of looks, never after a time.
"""

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.kinematics import JOINT_LIMIT
from weldsim.motion.sweep import Blocked, touched

STEP = 0.03  # [rad] between looks of the search itself; the way found is looked at again in the steps of `touched`
STRIDE = 0.35  # [rad] a tree grows by at most so much at once
ROOM = 1.6  # [rad] how far beyond start and goal each joint may go
SHORTCUTS = 80
SEEDS = 3  # searches, each looking twice as closely as the one before, until a way is found that is clear all along

Joints = Float[ndarray, "6"]


@cache
def _ompl() -> tuple[Any, Any, Any]:
    """The library's modules: it takes a tenth of a second to load, and most jobs never need it."""
    from ompl import base, geometric, util

    util.noOutputHandler()
    return base, geometric, util


def roam(start: Joints, goal: Joints, blocked: Blocked, *, tries: int = 3000, seed: int = 0) -> list[Joints] | None:
    """Corners of a clear way from start to goal, both included, straight in joint space between them; None where none was found.

    Args:
        start, goal: joint angles [rad].  blocked: what a configuration touches, or None.
        tries: how often the trees may grow.  seed: of the random directions.
    """
    if blocked(start) is not None or blocked(goal) is not None:
        return None
    if touched(start, goal, blocked) is None:
        return [start, goal]
    for attempt in range(SEEDS):
        corners = _search(start, goal, blocked, tries, SEEDS * seed + attempt + 1, STEP / 2**attempt)
        if corners is None:
            return None
        if all(touched(a, b, blocked) is None for a, b in pairwise(corners)):
            return _shortened(corners, blocked, np.random.default_rng(seed))
    return None


def _search(start: Joints, goal: Joints, blocked: Blocked, tries: int, seed: int, step: float) -> list[Joints] | None:
    """Corners of a way that is clear as far as looks `step` [rad] apart show; None after `tries` growths of the trees."""
    base, geometric, util = _ompl()
    low = np.maximum(np.minimum(start, goal) - ROOM, -JOINT_LIMIT)
    high = np.minimum(np.maximum(start, goal) + ROOM, JOINT_LIMIT)
    space, bounds = base.RealVectorStateSpace(6), base.RealVectorBounds(6)
    for i in range(6):
        bounds.setLow(i, float(low[i]))
        bounds.setHigh(i, float(high[i]))
    space.setBounds(bounds)
    util.RNG.setSeed(seed)
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: blocked(_joints(state)) is None)
    information.setStateValidityCheckingResolution(step / float(np.linalg.norm(high - low)))
    information.setup()
    problem = base.ProblemDefinition(information)
    ends = [information.allocState(), information.allocState()]
    for state, q in zip(ends, (start, goal), strict=True):
        for i in range(6):
            state[i] = float(q[i])
    problem.setStartAndGoalStates(*ends)
    planner = geometric.RRTConnect(information)
    planner.setRange(STRIDE)
    planner.setProblemDefinition(problem)
    planner.setup()
    looks = iter(range(tries))
    planner.solve(base.PlannerTerminationCondition(lambda: next(looks, None) is None))
    if not problem.hasExactSolution():
        return None
    return [np.array(start), *(_joints(state) for state in problem.getSolutionPath().getStates()[1:-1]), np.array(goal)]


def _joints(state: Any) -> Joints:
    return np.array([state[i] for i in range(6)])


def _shortened(corners: list[Joints], blocked: Blocked, rng: np.random.Generator) -> list[Joints]:
    """The way with corners cut between random places wherever that is clear."""
    for _ in range(SHORTCUTS):
        if len(corners) < 3:
            break
        lengths = np.cumsum([0.0, *(np.abs(b - a).max() for a, b in pairwise(corners))])
        s, t = np.sort(rng.uniform(0.0, lengths[-1], 2))
        i, j = (int(np.clip(np.searchsorted(lengths, x, side="right") - 1, 0, len(corners) - 2)) for x in (s, t))
        if i == j:
            continue
        p, q = (
            corners[k] + (x - lengths[k]) / max(lengths[k + 1] - lengths[k], 1e-12) * (corners[k + 1] - corners[k])
            for k, x in ((i, s), (j, t))
        )
        if touched(p, q, blocked) is None:
            corners = [*corners[: i + 1], p, q, *corners[j + 1 :]]
    out = [corners[0]]
    for corner in corners[1:]:
        if np.abs(corner - out[-1]).max() > 1e-6:
            out.append(corner)
    return out
