"""Blocks of stations averaged for the cross-section fit: those of one view that show the groove as deep as it usually is."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.profile.grid import Grid
from weldsim.seam.profile.section import Section
from weldsim.seam.profile.views import Blocks

BLOCK = 8  # stations averaged together for the cross-section fit
FEWEST_CELLS = 40  # fewer do not fix a cross-section
ALIKE = 0.35  # [rad] between two views that blur a groove alike: a window is 6 % wider on a surface at that slant
OTHER_VIEW = 0.08  # [rad] by which the sight turns from one block to the next only from view to view


def mean_blocks(grid: Grid, flanked: Bool[ndarray, "m"], start: Section) -> Blocks | None:
    """Blocks of stations that shape a section about as large as `start`, each with its own shear; None where they are too few.

    They are of the view that shows most of them, and of those that look at the groove from about there.

    Args:
        flanked: (m,) stations with parent surface on both sides.
    """
    seen = [found for view in grid.views or (grid,) if (found := _blocks(view, flanked, start)) is not None]
    if not seen:
        return None
    most = max(seen, key=lambda each: len(each[0].shear))[1]
    alike = [blocks for blocks, sight in seen if sight @ most > np.cos(ALIKE)]
    blocks = Blocks(
        grid.x,
        np.concatenate([each.at for each in alike]),
        np.concatenate([each.depth for each in alike]),
        np.concatenate([each.number for each in alike]),
        np.concatenate([each.shear for each in alike]),
        BLOCK,
    )
    return blocks if np.count_nonzero(blocks.number) >= FEWEST_CELLS else None


def _blocks(grid: Grid, flanked: Bool[ndarray, "m"], start: Section) -> tuple[Blocks, Float[ndarray, "3"]] | None:
    """Blocks of the cells of one view, and the mean direction in which it sees them; None where none shows the groove."""
    m = len(grid.depth) // BLOCK
    use = grid.depth[: m * BLOCK].reshape(m, BLOCK, -1)
    known = np.isfinite(use)
    number = known.sum(axis=1)
    mean = np.where(known, use, 0.0).sum(axis=1) / np.maximum(number, 1)
    off = np.where(known, grid.at[: m * BLOCK].reshape(m, BLOCK, -1) - grid.x, 0.0).sum(axis=1) / np.maximum(number, 1)
    shear = grid.shear[: m * BLOCK].reshape(m, BLOCK).mean(axis=1)
    sight = unit(grid.sight[: m * BLOCK].reshape(m, BLOCK, 3).mean(axis=1))
    # Only blocks that hold a groove of about the usual depth shape the section: ends and gaps would blunt it.
    inside = np.abs(grid.x) < 0.25 * start.width
    height = (mean * number)[:, inside].sum(axis=1) / np.maximum(number[:, inside].sum(axis=1), 1)
    candidates = flanked[: m * BLOCK].reshape(m, BLOCK).all(axis=1) & (height > 0.25 * start.depth)
    candidates = _from_one_place(sight, candidates)
    if not candidates.any():
        return None
    typical = np.median(height[candidates])
    keep = candidates & (height > 0.6 * typical) & (height < 1.6 * typical)
    if not keep.any():
        return None
    blocks = Blocks(grid.x, grid.x + off[keep], mean[keep], number[keep].astype(float), shear[keep], BLOCK)
    return blocks, unit(sight[keep].mean(axis=0))


def _from_one_place(sight: Float[ndarray, "b 3"], candidates: Bool[ndarray, "b"]) -> Bool[ndarray, "b"]:
    """Those of the blocks that one view shows, the one that shows the most of them.

    Two views differ in blur, in which way it runs, and in where they put the groove; a section that leans, or is wider,
    can make up for any of that.

    Args:
        sight: (b, 3) unit, in which direction each is seen.
    """
    jump = np.einsum("ij,ij->i", sight[1:], sight[:-1]) < np.cos(OTHER_VIEW)
    view = np.concatenate([[0], np.cumsum(jump)])
    return candidates & (view == np.bincount(view, weights=candidates).argmax())
