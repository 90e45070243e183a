"""A torch path cut into pieces that are welded one after the other."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from weldsim.frames import Transform, slerp
from weldsim.records import TorchPath

SAME = 1e-6  # [m] a cut so near to a pose is at it


def cut_path(path: TorchPath, cuts: Sequence[float]) -> list[TorchPath]:
    """The pieces between arc lengths `cuts` [m], increasing and inside the weld; neighbours share the pose at the cut.

    Their arc lengths are those of the whole path.
    """
    whole = path
    for s in cuts:
        whole = _with_pose_at(whole, s)
    edges = [float(whole.s[0]), *cuts, float(whole.s[-1])]
    return [_between(whole, a, b) for a, b in pairwise(edges)]


def _with_pose_at(path: TorchPath, s: float) -> TorchPath:
    """The path with one more pose at s, in between its neighbours; as it is where it has one."""
    if np.abs(path.s - s).min() <= SAME:
        return path
    k = int(np.searchsorted(path.s, s))
    u = float((s - path.s[k - 1]) / (path.s[k] - path.s[k - 1]))
    p, q = path.X_BT.p, path.X_BT.quaternion
    middle = slerp(q[k - 1 : k], q[k : k + 1], np.array([u]))
    X = Transform.from_quaternion("BT", np.insert(q, k, middle, axis=0), np.insert(p, k, p[k - 1] + u * (p[k] - p[k - 1]), axis=0))
    sigma = None if path.sigma is None else np.insert(path.sigma, k, np.interp(s, path.s, path.sigma))
    return replace(
        path,
        X_BT=X,
        s=np.insert(path.s, k, s),
        speed=np.insert(path.speed, k, np.interp(s, path.s, path.speed)),
        arc_on=np.insert(path.arc_on, k, path.arc_on[k - 1]),
        segments=(*path.segments[:k], path.segments[k - 1], *path.segments[k:]),
        sigma=sigma,
    )


def _between(path: TorchPath, a: float, b: float) -> TorchPath:
    """The poses from arc length a to b [m], both included."""
    mine = np.flatnonzero((path.s >= a - SAME) & (path.s <= b + SAME))
    return replace(
        path,
        X_BT=Transform("BT", path.X_BT.R[mine], path.X_BT.p[mine]),
        s=path.s[mine],
        speed=path.speed[mine],
        arc_on=path.arc_on[mine],
        segments=tuple(path.segments[i] for i in mine),
        sigma=None if path.sigma is None else path.sigma[mine],
    )
