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
OTHER_VIEW = 0.08  # [rad] by which the sight turns from one block to the next only from view to view


def mean_blocks(grid: Grid, flanked: Bool[ndarray, "m"], start: Section) -> Blocks | None:
    """Blocks of stations that shape a section about as large as `start`, each with its own shear; None where they are too few.

    Args:
        flanked: (m,) stations with parent surface on both sides.
    """
    m = len(grid.depth) // BLOCK
    use = grid.depth[: m * BLOCK].reshape(m, BLOCK, -1)
    known = np.isfinite(use)
    number = known.sum(axis=1)
    mean = np.where(known, use, 0.0).sum(axis=1) / np.maximum(number, 1)
    off = np.where(known, grid.at[: m * BLOCK].reshape(m, BLOCK, -1) - grid.x, 0.0).sum(axis=1) / np.maximum(number, 1)
    shear = grid.shear[: m * BLOCK].reshape(m, BLOCK).mean(axis=1)
    # Only blocks that hold a groove of about the usual depth shape the section: ends and gaps would blunt it.
    inside = np.abs(grid.x) < 0.25 * start.width
    height = (mean * number)[:, inside].sum(axis=1) / np.maximum(number[:, inside].sum(axis=1), 1)
    candidates = flanked[: m * BLOCK].reshape(m, BLOCK).all(axis=1) & (height > 0.25 * start.depth)
    candidates = _from_one_place(unit(grid.sight[: m * BLOCK].reshape(m, BLOCK, 3).mean(axis=1)), candidates)
    if not candidates.any():
        return None
    typical = np.median(height[candidates])
    keep = candidates & (height > 0.6 * typical) & (height < 1.6 * typical)
    if not keep.any() or np.count_nonzero(number[keep]) < FEWEST_CELLS:
        return None
    return Blocks(grid.x, grid.x + off[keep], mean[keep], number[keep].astype(float), shear[keep], BLOCK)


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
