"""The line of a seam: stretches measured along rails, and what leads from one to the next, laid end to end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length, interpolate, tangents
from weldsim.frames import unit
from weldsim.records import Seam
from weldsim.seam.profile.ends import gaps
from weldsim.seam.profile.join import Piece

SAME_POINT = 1e-5  # [m] points of two stretches this close are one


@dataclass(frozen=True, eq=False)
class Course:
    """Attributes:
    points: (n, 3) in order of travel [m].  normals: (n, 3) unit, outward of the parent surface.
    sigma: (n,) standard deviation across the line [m].  width: (n,) between the lips [m].
    step: (n,) how much higher the left lip lies than the right one [m].
    gaps: stretches of arc length (s0, s1) [m] over which no groove was seen.
    pieces: those it was made of.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    sigma: Float[ndarray, "n"]
    width: Float[ndarray, "n"]
    step: Float[ndarray, "n"]
    gaps: tuple[tuple[float, float], ...] = ()
    pieces: tuple[Piece, ...] = ()

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(arc_length(self.points)[-1])

    def reversed(self) -> "Course":
        """The same line, travelled the other way."""
        whole = self.length
        turned = replace(self, **{name: getattr(self, name)[::-1] for name in ("points", "normals", "sigma", "width", "step")})
        gaps = tuple((whole - s1, whole - s0) for s0, s1 in self.gaps[::-1])
        return replace(turned, step=-turned.step, gaps=gaps, pieces=self.pieces[::-1])


def stretch(piece: Piece, start: float, stop: float) -> Course:
    """The part of a piece's rail from arc length start to stop [m]; beyond the rail's own ends it goes straight on."""
    fit, rail = piece.fit, piece.fit.rail
    at = np.arange(len(rail)) * rail.step
    stations = np.concatenate([[start], at[(at > start + 0.3 * rail.step) & (at < stop - 0.3 * rail.step)], [stop]])
    points = interpolate(at, rail.points, stations)
    for end in (0, -1):
        points[end] += (stations[end] - np.clip(stations[end], at[0], at[-1])) * rail.t[end]
    s = arc_length(points)
    unseen = [(max(s0, start), min(s1, stop)) for s0, s1 in gaps(fit, piece.span)]
    return Course(
        points=points,
        normals=unit(interpolate(at, rail.n, stations)),
        sigma=np.interp(stations, at, fit.sigma),
        width=np.full(len(points), fit.section.width),
        step=np.full(len(points), fit.section.step),
        gaps=tuple((float(np.interp(s0, stations, s)), float(np.interp(s1, stations, s))) for s0, s1 in unseen if s1 > s0),
        pieces=(piece,),
    )


def end_to_end(parts: Sequence[Course]) -> Course:
    """One course through all parts, in order; where one begins at the point at which another ends, that point counts once."""
    course = parts[0]
    for part in parts[1:]:
        step = float(np.linalg.norm(part.points[0] - course.points[-1]))
        first = 1 if step < SAME_POINT else 0
        offset = course.length + (0.0 if first else step)
        course = Course(
            points=np.concatenate([course.points, part.points[first:]]),
            normals=np.concatenate([course.normals, part.normals[first:]]),
            sigma=np.concatenate([course.sigma, part.sigma[first:]]),
            width=np.concatenate([course.width, part.width[first:]]),
            step=np.concatenate([course.step, part.step[first:]]),
            gaps=course.gaps + tuple((offset + s0, offset + s1) for s0, s1 in part.gaps),
            pieces=course.pieces + part.pieces,
        )
    return course


def to_seam(course: Course, sure: float) -> Seam:
    """The seam record of a course: lips beside its line on the parent surface, figures weighted by the pieces' lengths.

    Args:
        sure: its confidence.
    """
    points = course.points
    t, s = tangents(points), arc_length(points)
    n = unit(course.normals - np.einsum("ij,ij->i", course.normals, t)[:, None] * t)
    lip = 0.5 * (course.width[:, None] * np.cross(n, t) + course.step[:, None] * n)
    share = np.array([piece.span[1] - piece.span[0] for piece in course.pieces])
    sections = np.array([(piece.fit.section.width, piece.fit.depth, piece.fit.parent.noise) for piece in course.pieces])
    width, depth, noise = (share @ sections / share.sum()).tolist()
    return Seam(
        points_B=points,
        s=s,
        tangents_B=t,
        normals_B=n,
        left_B=points + lip,
        right_B=points - lip,
        sigma=course.sigma,
        width=width,
        depth=depth,
        step=float(course.step.mean()),
        residual=noise,
        confidence=sure,
        gaps=tuple((max(s0, 0.0), min(s1, float(s[-1]))) for s0, s1 in course.gaps),
    )
