"""Where a found seam runs that is not the known one: beside it, or above it, as one that was given by its root lies."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from weldsim import units
from weldsim.curves import interpolate
from weldsim.frames import unit
from weldsim.quantity import Metre
from weldsim.records import KnownSeam, Seam
from weldsim.report.metrics import known_line, known_offsets

FURTHEST: Metre = 0.03  # [m] a seam further off is another one
STEADY: Metre = 1.5e-3  # [m] by which the distance of a line that runs along another may vary (standard deviation)
ALONG = 0.5  # share of the known seam that the found one must run along


@dataclass(frozen=True, kw_only=True)
class Beside:
    """A line that runs along another. Attributes: above, along the outward normal, and left of it, seen along travel [m]."""

    above: Metre
    left: Metre

    @property
    def text(self) -> str:
        """ "6.0 mm above it"; what is under a tenth of the rest is left out."""
        parts = [
            (abs(self.above), "above" if self.above > 0 else "below"),
            (abs(self.left), "to the left of" if self.left > 0 else "to the right of"),
        ]
        most = max(size for size, _ in parts)
        return " and ".join(f"{units.to_mm(size):.1f} mm {word}" for size, word in parts if size >= most / 10) + " it"

    @property
    def advice(self) -> str:
        """What is to be looked at; empty where nothing speaks for it."""
        if self.above > 4 * abs(self.left):
            return "is the known line the groove's root? Its opening is wanted, the middle between the lips"
        return "check the frame and the unit of the known line"


def beside(seam: Seam, known: KnownSeam) -> Beside | None:
    """How a found seam runs beside a known one, at the seam's own reference; None where it does not run along it."""
    line = known_line(known, seam.reference)
    found = known_offsets(seam.points_B, known, seam.reference)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    within = (found.s >= 0) & (found.s <= length)
    if within.sum() < 2 or np.ptp(found.s[within]) < ALONG * length:
        return None
    up = unit(interpolate(known.s, -known.bisectors_B, found.s))
    left = np.cross(up, unit(interpolate(known.s, known.tangents_B, found.s)))
    above, aside = (np.einsum("ij,ij->i", found.vectors, axis)[within] for axis in (up, left))
    if max(np.std(above), np.std(aside)) > STEADY or np.median(found.distance[within]) > FURTHEST:
        return None
    return Beside(above=float(np.median(above)), left=float(np.median(aside)))


def miss(known: KnownSeam, number: int, seams: Mapping[int, Seam]) -> str:
    """The clause of a known seam that was not found, with the found one that runs beside it, where there is one.

    Args:
        known: the seam.  number: its own, from 1.  seams: found ones that are no other known seam, by their numbers from 1.
    """
    said = f"known seam {known.name or number} was not found"
    near = [(found, i) for i, seam in seams.items() if (found := beside(seam, known)) is not None]
    if not near:
        return said
    nearest, index = min(near, key=lambda pair: np.hypot(pair[0].above, pair[0].left))
    which = "a seam" if len(seams) == 1 else f"seam {index}"
    return f"{said}; {which} was found {nearest.text}: {nearest.advice}"


def steady_offset(seam: Seam, known: KnownSeam, limit: Metre) -> str:
    """A clause for a seam that keeps off the known line by more than `limit` [m] all along; empty where it does not."""
    found = beside(seam, known)
    if found is None or np.hypot(found.above, found.left) <= limit:
        return ""
    return f"the seam was found {found.text[:-3]} the known line all along: {found.advice}"
