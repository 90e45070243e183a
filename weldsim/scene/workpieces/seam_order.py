"""Whether the points of a seam file are in order along the seam: shuffled ones make a line that jumps and turns back."""

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
