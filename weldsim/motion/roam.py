"""A way through the air where the straight joint move is blocked: two random trees that grow towards each other (RRT-Connect,
Kuffner and LaValle 2000), then shortened. The same question always gets the same answer."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.kinematics import JOINT_LIMIT
from weldsim.motion.posture import Blocked

STEP = 0.02  # [rad] of the fastest joint between collision checks
STRIDE = 0.35  # [rad] a tree grows by at most so much at once
ROOM = 1.6  # [rad] how far beyond start and goal each joint may go
SHORTCUTS = 80

Joints = Float[ndarray, "6"]


def touched(a: Joints, b: Joints, blocked: Blocked) -> str | None:
    """What the straight joint move from a to b touches first, or None; the ends are looked at first."""
    n = int(np.ceil(np.abs(b - a).max() / STEP))
    order = np.concatenate([[0, n + 1], np.arange(1, n + 1)])
    return next((touch for k in order if (touch := blocked(a + k / (n + 1) * (b - a))) is not None), None)


def roam(start: Joints, goal: Joints, blocked: Blocked, *, tries: int = 1500, seed: int = 0) -> list[Joints] | None:
    """Corners of a clear way from start to goal, both included, straight in joint space between them; None where none was found.

    Args:
        start, goal: joint angles [rad].  blocked: what a configuration touches, or None.
        tries: how often the trees may grow.  seed: of the random directions.
    """
    if blocked(start) is not None or blocked(goal) is not None:
        return None
    if touched(start, goal, blocked) is None:
        return [start, goal]
    rng = np.random.default_rng(seed)
    low = np.maximum(np.minimum(start, goal) - ROOM, -JOINT_LIMIT)
    high = np.minimum(np.maximum(start, goal) + ROOM, JOINT_LIMIT)
    trees, parents = ([start], [goal]), ([-1], [-1])
    for k in range(tries):
        one, two = k % 2, 1 - k % 2
        reached = _grow(trees[one], parents[one], rng.uniform(low, high), blocked)
        if reached is None:
            continue
        while True:
            met = _grow(trees[two], parents[two], trees[one][reached], blocked)
            if met is None:
                break
            if np.abs(trees[two][met] - trees[one][reached]).max() < 1e-9:
                first, last = _branch(trees[one], parents[one], reached), _branch(trees[two], parents[two], met)
                corners = [*first[::-1], *last[1:]] if one == 0 else [*last[::-1], *first[1:]]
                return _shortened(corners, blocked, rng)
    return None


def _grow(tree: list[Joints], parents: list[int], towards: Joints, blocked: Blocked) -> int | None:
    """Index of a new node one stride from the nearest one towards a point; None where that is blocked."""
    nearest = int(np.linalg.norm(np.array(tree) - towards, axis=1).argmin())
    step = towards - tree[nearest]
    node = tree[nearest] + step * min(1.0, STRIDE / max(float(np.abs(step).max()), 1e-12))
    if touched(tree[nearest], node, blocked) is not None:
        return None
    tree.append(node)
    parents.append(nearest)
    return len(tree) - 1


def _branch(tree: list[Joints], parents: list[int], leaf: int) -> list[Joints]:
    """Nodes from a leaf to its tree's root."""
    out = []
    while leaf >= 0:
        out.append(tree[leaf])
        leaf = parents[leaf]
    return out


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
