"""Whether the points of a seam file are in order along the seam: shuffled ones make a line that jumps and turns back."""

from itertools import combinations
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.frames import unit
from weldsim.quantity import Metre

TURN = np.cos(np.radians(120))  # of a line from one point to the next: no torch follows a sharper one
LEAST: Metre = 0.5e-3  # steps shorter than this may be noise of who measured the points
FAR = 4.0  # times the usual step: a jump
MOST_LINES = 20  # that are told apart
NEXT = 2.0  # times the usual step: a point so near is a neighbour on the seam


def check_order(path: Path, points: Float[ndarray, "n 3"]) -> None:
    """Nothing, when the points follow one another along the seam.

    Args:
        path: of the file.  points: as they stand in it [m], neighbours apart.
    Raises:
        SceneError: the line turns back at a point, or jumps past points that come elsewhere in the file; names both ends.
    """
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    if len(points) < 3:
        return
    _refuse_several(path, points, steps, length)
    turn = np.einsum("ij,ij->i", unit(steps[1:]), unit(steps[:-1]))
    back = np.flatnonzero((turn < TURN) & (np.minimum(length[1:], length[:-1]) > LEAST))
    if len(back):
        i = int(back[0])
        raise _out_of_order(
            path, points, i + 1, f"the line turns back there by {np.degrees(np.arccos(max(turn[i], -1.0))):.0f} deg"
        )
    usual = float(np.median(length))
    jumps = np.flatnonzero((length > FAR * usual) & (length > LEAST))
    if not len(jumps):
        return
    run = np.searchsorted(jumps, np.arange(len(points)), side="left")  # which stretch without a jump each point is of
    for i in _ends(jumps, len(points)):
        apart = np.linalg.norm(points - points[i], axis=1)
        apart[run == run[i]] = np.inf
        k = int(apart.argmin())
        if 0 < apart[k] < NEXT * usual:  # a ring that closes ends where it begins
            raise _out_of_order(path, points, int(jumps[0]), f"and point {k + 1} is {1e3 * apart[k]:.1f} mm from point {i + 1}")


def _refuse_several(path: Path, points: Float[ndarray, "n 3"], steps: Float[ndarray, "m 3"], length: Float[ndarray, "m"]) -> None:
    """Raises SceneError where the points are of several lines one behind the other: each in order, and apart from the others."""
    usual = float(np.median(length))
    jumps = np.flatnonzero((length > FAR * usual) & (length > LEAST))
    runs = np.split(np.arange(len(points)), jumps + 1)
    if not 1 <= len(jumps) <= MOST_LINES or min(map(len, runs)) < 3:
        return
    turn = np.einsum("ij,ij->i", unit(steps[1:]), unit(steps[:-1]))
    inside = np.ones(len(turn), bool)
    for jump in jumps:
        inside[max(jump - 1, 0) : jump + 1] = False
    if (turn[inside] < TURN).any():
        return
    for one, other in combinations(runs, 2):
        apart = np.linalg.norm(points[one][:, None] - points[other][[0, -1]][None], axis=2).min()
        if apart < NEXT * usual:  # parts of one line, in another order
            return
    turned = [jump for jump in jumps if (turn[max(jump - 1, 0) : jump + 1] < TURN).any()]
    if turned:
        first = int(turned[0])
        raise SceneError(
            f"mesh.seam {path}: its points make {len(runs)} lines, the second from point {first + 2} on,"
            f" {1e3 * length[first]:.1f} mm away: a part has one seam; keep one line in the file",
            path=str(path),
            key="seam",
            points=(first + 1, first + 2),
        )


def _ends(jumps: Int[ndarray, "j"], count: int) -> list[int]:
    """The first and last point of each stretch between jumps."""
    return sorted({0, count - 1, *(int(i) for i in jumps), *(int(i) + 1 for i in jumps)})


def _out_of_order(path: Path, points: Float[ndarray, "n 3"], i: int, why: str) -> SceneError:
    """The error about the way from point i to the next one."""
    (a, b), jump = points[i : i + 2], float(np.linalg.norm(points[i + 1] - points[i]))
    places = " to ".join("({})".format(", ".join(f"{v:.4f}" for v in p)) for p in (a, b))
    return SceneError(
        f"mesh.seam {path}: its points are not in order along the seam: point {i + 1} to {i + 2} jumps {1e3 * jump:.1f} mm, from"
        f" {places} m, {why}; sort them as the torch is to travel",
        path=str(path),
        key="seam",
        points=(i + 1, i + 2),
    )
