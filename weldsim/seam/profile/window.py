"""One camera, one window: the sections of several grooves brought to the blur they have in common.

A narrow deep groove under a wide support window looks much like a wider shallower one under a smaller window. A short
piece may take one for the other; all pieces together, which one camera saw, seldom do.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.blocks import mean_blocks
from weldsim.seam.profile.join import Piece
from weldsim.seam.profile.lean import section_at_blur
from weldsim.seam.profile.refine import Fit, sided

ODD = 0.15  # of the median blur, from which on a piece's own counts less in the mean
ALIEN = 0.75  # of the mean; a piece further off has been seen otherwise and keeps its own
SAME = 0.02  # of the mean; a piece this close keeps its section


def at_one_window(pieces: list[Piece], viewpoints: Float[ndarray, "v 3"], config: ProfileConfig) -> list[Piece]:
    """The pieces, each with the section that fits it best at the blur all of them have in common.

    A support window is as wide in every image [px], so on a surface it grows in proportion to the distance.

    Args:
        viewpoints: (v, 3) [m], none where they are unknown.
    """
    if len(pieces) < 2:
        return pieces
    away = np.array([_distance(piece.fit, viewpoints) for piece in pieces])
    own = np.array([piece.fit.section.blur for piece in pieces]) / away
    middle = float(np.median(own))
    length = np.array([piece.span[1] - piece.span[0] for piece in pieces])
    weight = length / (1.0 + ((own - middle) / max(ODD * middle, 1e-9)) ** 2)
    shared = float(weight @ own / weight.sum())
    off = np.abs(own - shared) / max(shared, 1e-9)
    return [
        _at_blur(piece, shared * distance, config) if SAME < apart < ALIEN else piece
        for piece, distance, apart in zip(pieces, away.tolist(), off.tolist(), strict=True)
    ]


def _at_blur(piece: Piece, blur: float, config: ProfileConfig) -> Piece:
    """The piece with the width, depth and floor that fit it best at a blur [m]; where its middle is has been settled."""
    fit = piece.fit
    blocks = mean_blocks(fit.grid, sided(fit.parent, config), fit.section)
    if blocks is None:
        return piece
    found = section_at_blur(blocks, fit.section, fit.parent.noise, blur)
    return replace(piece, fit=replace(fit, section=replace(found, middle=fit.section.middle)))


def _distance(fit: Fit, viewpoints: Float[ndarray, "v 3"]) -> float:
    """Distance of a groove [m] from the viewpoint that most of it was seen from; 1 where that is unknown."""
    if len(viewpoints) == 0:
        return 1.0
    away = fit.rail.points.mean(axis=0) - viewpoints
    sight = unit(np.median(fit.grid.sight, axis=0))
    return float(np.linalg.norm(away[int(np.argmax(unit(away) @ sight))]))
