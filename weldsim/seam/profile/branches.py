"""Grooves that others run into: parted where they turn there, and the ends of the others led to their line."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import Atlas
from weldsim.seam.profile.ends import station_mask
from weldsim.seam.profile.join import DISTURBED, END_REACH, Piece, piece_end, refit
from weldsim.seam.profile.refine import BRIDGE

WIDTHS = 1.5  # of the groove, from the end of a branch to the line it runs into
KINK = 0.35  # [rad] from which on a groove that another runs into is two grooves that meet the third
SHARE = 0.85  # of the stations of a groove that its two parts have to show again


def part_at_branches(pieces: list[Piece], atlas: Atlas, config: ProfileConfig) -> list[Piece]:
    """The pieces, those with a kink where another one ends at them parted there: three branches of one junction."""
    out: list[Piece] = []
    for piece in pieces:
        places = [_run_into(other, way, piece) for other in pieces if other is not piece for way in (-1, 1)]
        kinks = [at for at in places if at is not None]
        parts = next((parts for at in kinks if (parts := _parted(piece, at, atlas, config)) is not None), None)
        out += [piece] if parts is None else parts
    return out


def _run_into(branch: Piece, way: int, through: Piece) -> float | None:
    """Arc length [m] on a groove, well within it, that the end of another one comes near to; None where it does not."""
    tip = piece_end(branch, way).point
    rail = through.fit.rail
    distance = np.linalg.norm(rail.points - tip, axis=1)
    at = int(distance.argmin()) * rail.step
    least = DISTURBED + 0.5 * END_REACH
    inside = through.span[0] + least < at < through.span[1] - least
    return at if inside and distance.min() < WIDTHS * through.fit.section.width else None


def _parted(piece: Piece, at: float, atlas: Atlas, config: ProfileConfig) -> list[Piece] | None:
    """The two parts of a groove on either side of arc length `at` [m], each fitted by itself, or None without a kink."""
    fit, rail = piece.fit, piece.fit.rail
    before = station_mask(fit, (max(piece.span[0], at - DISTURBED - END_REACH), at - DISTURBED))
    after = station_mask(fit, (at + DISTURBED, min(piece.span[1], at + DISTURBED + END_REACH)))
    here, there = (_heading(rail.points[part]) for part in (before, after))
    bend = 2 * DISTURBED + END_REACH  # [m] between the middles of the two stretches
    if float(np.arccos(np.clip(here @ there, -1.0, 1.0))) < KINK or _evenly_bent(rail.points, before, after, bend):
        return None
    place = rail.points[round(at / rail.step)]
    kept = []
    for side, span in ((1, (piece.span[0], at - 0.5 * DISTURBED)), (0, (at + 0.5 * DISTURBED, piece.span[1]))):
        part = station_mask(fit, span)
        found = refit(rail.points[part], rail.n[part], replace(fit, bridge=BRIDGE), atlas, config)
        if found is not None:
            kept.append(_up_to(found, place, side))
    whole = sum(part.span[1] - part.span[0] for part in kept)
    return kept if len(kept) == 2 and whole > SHARE * (piece.span[1] - piece.span[0]) else None


def _up_to(piece: Piece, place: Float[ndarray, "3"], side: int) -> Piece:
    """The piece ended (side = 1) or begun (side = 0) at a point [m], beyond which it may have run on round the kink."""
    rail, (start, stop) = piece.fit.rail, piece.span
    at = int(np.linalg.norm(rail.points - place, axis=1).argmin()) * rail.step
    return replace(piece, span=(start, min(stop, at)) if side else (max(start, at), stop))


def _heading(points: Float[ndarray, "k 3"]) -> Float[ndarray, "3"]:
    return unit(points[-1] - points[0])


def _evenly_bent(points: Float[ndarray, "m 3"], before: ndarray, after: ndarray, apart: float) -> bool:
    """Whether the line bends beside the place as it does across it, as an arc does [m between the stretches' middles]."""
    turned = 0.0
    for part in (before, after):
        own = points[part]
        half = len(own) // 2
        if half < 2:
            return False
        cosine = float(_heading(own[: half + 1]) @ _heading(own[half:]))
        turned += float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    across = float(np.arccos(np.clip(_heading(points[before]) @ _heading(points[after]), -1.0, 1.0)))
    return across < 2.0 * turned / END_REACH * apart
