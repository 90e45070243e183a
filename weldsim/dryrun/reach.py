"""Where on the table a part could stand so that its whole seam can be welded: a map, by the coarse look at each place."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell, shifted
from weldsim.dryrun.sieve import quick
from weldsim.errors import MotionError
from weldsim.motion.config import MotionConfig
from weldsim.records import TorchPath
from weldsim.report.style import BAD, GOOD, GRID, INK, SEAM, SOFT
from weldsim.scene.cell import TABLE

PITCH = 0.05  # [m] between places


@dataclass(frozen=True, eq=False, kw_only=True)
class ReachMap:
    """Places on a grid.

    Attributes:
        x, y: (c,), (r,) of the middle of the seam in B [m].  good: (r, c) whether the whole seam can be welded there.
        tried: (r, c) whether part and fixture can stand there: on the table, clear of the arm's base; good places are among them.
        now: (2,) where its middle is [m].
        points_B: (n, 3) the seam where it is [m].
    """

    x: Float[ndarray, "c"]
    y: Float[ndarray, "r"]
    good: Bool[ndarray, "r c"]
    tried: Bool[ndarray, "r c"]
    now: Float[ndarray, "2"]
    points_B: Float[ndarray, "n 3"]

    @property
    def share(self) -> float:
        """Of the places where the part can stand, how many are good."""
        return float(self.good.sum() / max(1, self.tried.sum()))


def reach_map(
    path: TorchPath,
    cell: Cell,
    config: MotionConfig | None = None,
    *,
    pitch: float = PITCH,
    tell: Callable[[float], None] = lambda done: None,
) -> ReachMap:
    """The map of a seam, the part and its fixture moved with it, without turning.

    Args:
        path: where the seam is now.  cell: with the part, or empty.
        pitch: between places [m].  tell: told the fraction done.
    """
    config = config or MotionConfig()
    points = path.X_BT.p
    now = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
    half = np.ptp(points[:, :2], axis=0) / 2
    # Places are whole steps away from where it is now, so that now is one of them.
    axes = [
        now[k]
        + pitch * np.arange(np.ceil((TABLE[0, k] + half[k] - now[k]) / pitch), (TABLE[1, k] - half[k] - now[k]) / pitch + 1e-9)
        for k in range(2)
    ]
    x, y = axes
    good, tried = np.zeros((len(y), len(x)), bool), np.zeros((len(y), len(x)), bool)
    for i, at_y in enumerate(y):
        tell(i / len(y))
        for j, at_x in enumerate(x):
            move = np.array([at_x - now[0], at_y - now[1], 0.0])
            tried[i, j] = cell.misplaced(move, points) is None
            good[i, j] = tried[i, j] and _weldable(path, move, cell, config)
    return ReachMap(x=x, y=y, good=good, tried=tried, now=now, points_B=points)


def _weldable(path: TorchPath, move: Float[ndarray, "3"], cell: Cell, config: MotionConfig) -> bool:
    from weldsim.scene.world import AWAY, HOME

    there = cell.moved(move)
    # Where it stands now, or where a scene has it wait otherwise: one must be clear, or no job can begin.
    if all(there.collision.touches(np.asarray(q, float)) for q in (cell.q_start, HOME, AWAY)):
        return False
    moved = TorchPath(
        X_BT=shifted(path.X_BT, move),
        s=path.s,
        speed=path.speed,
        arc_on=path.arc_on,
        segments=path.segments,
        roll_free=path.roll_free,
    )
    try:
        return quick(moved, there, config)
    except MotionError:
        return False


def reach_json(found: ReachMap) -> dict[str, Any]:
    """The map as one JSON object: metres, rows along y, columns along x."""
    return {
        "x": np.round(found.x, 6).tolist(),
        "y": np.round(found.y, 6).tolist(),
        "weldable": found.good.tolist(),
        "can_stand": found.tried.tolist(),
        "now": np.round(found.now, 6).tolist(),
        "share": round(found.share, 4),
    }


def reach_picture(found: ReachMap, name: str) -> bytes:
    """A PNG of the table from above: places that do and do not, the seam where it is, the arm's base."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Rectangle

    figure = Figure(figsize=(9, 8), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.09, 0.08, 0.86, 0.82))
    low, size = TABLE[0] * 1e3, (TABLE[1] - TABLE[0]) * 1e3
    axes.add_patch(Rectangle((low[0], low[1]), size[0], size[1], facecolor="#f3f5f7", edgecolor=SOFT))
    gx, gy = np.meshgrid(1e3 * found.x, 1e3 * found.y)
    axes.scatter(
        gx[found.good], gy[found.good], s=95, marker="s", color=GOOD, alpha=0.75, label="whole seam weldable", linewidths=0
    )
    for which, mark, colour, name_of in (
        (found.tried & ~found.good, "x", BAD, "not weldable"),
        (~found.tried, ".", SOFT, "part cannot stand there"),
    ):
        axes.scatter(gx[which], gy[which], s=26, marker=mark, color=colour, alpha=0.7, label=name_of)
    axes.plot(1e3 * found.points_B[:, 0], 1e3 * found.points_B[:, 1], color=SEAM, lw=3, label="the seam as it is")
    axes.plot(*(1e3 * found.now), "o", color=SEAM, ms=7)
    axes.add_patch(Circle((0, 0), 76, facecolor="#c9d3dc", edgecolor=INK))
    axes.annotate("arm's base", (0, 0), ha="center", va="center", fontsize=8, color=INK)
    axes.set_aspect("equal")
    axes.set_axisbelow(True)
    axes.set_xlim(low[0] - 40, low[0] + size[0] + 40)
    axes.set_ylim(low[1] - 40, low[1] + size[1] + 110)
    axes.grid(color=GRID, lw=0.6)
    axes.set_xlabel("x of the seam's middle in the base [mm]")
    axes.set_ylabel("y [mm]")
    axes.set_title(f"{name}: {100 * found.share:.0f} % of the places where it can stand would do", loc="left", color=INK)
    axes.legend(loc="upper right", ncols=4, fontsize=8, framealpha=1)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": "weldsim"})
    return buffer.getvalue()
