"""Seams: found ones with what the finder has to say about them, and the known one of a workpiece."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.counted import counted
from weldsim.errors import RecordError
from weldsim.records.checks import check_increasing, check_metres, check_unit, require, store

JOINED = 1e-6  # [m] between the ends of a ring
SAME_PLACE = 1e-9  # [m] between points that are one
BACK = -0.5  # cosine of the turn from which a line leads back over itself: 120 deg
LEAST_STEP = 0.5e-3  # [m] shorter steps may be noise of who measured the points
LEAST_ACROSS = 0.05  # share of a normal that must stand across travel

Reference = Literal["opening", "root", "gap_mid"]
Joint = Literal["groove", "butt", "lap", "fillet", "saddle"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Seam:
    """A weld seam found in a cloud, ordered along travel, expressed in the robot base.

    Attributes:
        points_B: (n, 3) the centre line at `reference` [m].
        s: (n,) arc length [m], from 0.
        tangents_B: (n, 3) unit, along travel.
        normals_B: (n, 3) unit, outward normal of the parent surface (for a groove, minus the inward bisector).
        left_B, right_B: (n, 3) the two lips or toes [m], left as seen looking along travel with the normal up; or None.
        sigma: (n,) standard deviation of the centre line across the seam [m], or None where the method gives none.
        width: mean distance between the lips [m].
        depth: mean depth of the root below the opening, as the sensor showed it [m]; None where not measured.
        step: how much higher the left lip lies than the right one [m]; 0 where the method sees none.
        residual: rms distance of the data from the fitted cross-sections [m].
        confidence: 0 to 1.
        joint, reference: which kind of joint, and which line of it `points_B` follows.
        closed: whether the seam is a ring: its last point then repeats its first.
        gaps: stretches (s0, s1) of arc length [m] that were not measured, ordered: under a clamp or a tack weld, say. The
            line is carried across them; whether a torch can pass is the user's to know.
    """

    points_B: Float[ndarray, "n 3"]
    s: Float[ndarray, "n"]
    tangents_B: Float[ndarray, "n 3"]
    normals_B: Float[ndarray, "n 3"]
    left_B: Float[ndarray, "n 3"] | None = None
    right_B: Float[ndarray, "n 3"] | None = None
    sigma: Float[ndarray, "n"] | None = None
    width: float = 0.0
    depth: float | None = None
    step: float = 0.0
    residual: float = 0.0
    confidence: float = 0.0
    joint: Joint = "groove"
    reference: Reference = "opening"
    closed: bool = False
    gaps: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        store(self, "points_B", self.points_B, shape=("n", 3))
        n = len(self.points_B)
        require(n >= 2, self, "points_B", f"{counted(n, 'point')}; a seam needs two")
        check_metres(self, "points_B", self.points_B)
        store(self, "s", self.s, shape=(n,))
        check_increasing(self, "s", self.s)
        for name in ("tangents_B", "normals_B"):
            store(self, name, getattr(self, name), shape=(n, 3))
            check_unit(self, name, getattr(self, name))
        for name in ("left_B", "right_B"):
            if getattr(self, name) is not None:
                store(self, name, getattr(self, name), shape=(n, 3))
        if self.sigma is not None:
            store(self, "sigma", self.sigma, shape=(n,))
            require(bool((self.sigma >= 0).all()), self, "sigma", "negative standard deviation")
        gap = float(np.linalg.norm(self.points_B[-1] - self.points_B[0])) if self.closed else 0.0
        require(gap <= JOINED, self, "closed", f"the ends lie {1e3 * gap:.3g} mm apart; a ring's last point repeats its first")
        require(0.0 <= self.confidence <= 1.0, self, "confidence", f"{self.confidence} is outside 0 to 1")
        bounds = [at for gap in self.gaps for at in gap]
        require(
            bounds == sorted(bounds) and all(self.s[0] <= at <= self.s[-1] for at in bounds),
            self,
            "gaps",
            f"{self.gaps} are not ordered stretches within 0 to {float(self.s[-1]):g} m",
        )

    @classmethod
    def along(
        cls,
        points: Any,
        normals: Any = (0.0, 0.0, 1.0),
        *,
        width: float = 0.0,
        confidence: float = 1.0,
        reference: Reference = "opening",
        joint: Joint = "groove",
    ) -> "Seam":
        """The seam along a polyline, closed where it ends within 1 um of its start; points that repeat are left out.

        Args:
            points: (n, 3) in B, ordered along travel [m].
            normals: (n, 3), or (3,) for all: out of the surface; what of them lies along travel is taken off.
            width: between the lips [m].  confidence: 0 to 1.  reference, joint: which line of which joint the points are.
        Raises:
            RecordError: fewer than two places, numbers that are not finite, points out of order, normals along travel.
        """
        try:
            line, up = np.asarray(points, float), np.asarray(normals, float)
        except (TypeError, ValueError):
            raise RecordError("Seam.points_B: no array of numbers; (n, 3) points in metres are wanted", field="points_B") from None
        if line.ndim != 2 or line.shape[1] != 3 or not np.isfinite(line).all():
            raise RecordError(f"Seam.points_B: shape {line.shape}, (n, 3) finite numbers are wanted", field="points_B")
        if up.shape not in ((3,), line.shape):
            raise RecordError(f"Seam.normals_B: shape {up.shape}, (3,) or {line.shape} is wanted", field="normals_B")
        keep = np.concatenate([[True], np.linalg.norm(np.diff(line, axis=0), axis=1) > SAME_PLACE])
        line, up = line[keep], np.broadcast_to(up, line.shape)[keep]
        if len(line) < 2:
            raise RecordError(f"Seam.points_B: {counted(len(line), 'place')}; a seam needs two", field="points_B")
        _check_turns(line)
        if not (np.linalg.norm(up, axis=1) > 0).all():
            raise RecordError("Seam.normals_B: a normal is zero", field="normals_B")
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        closed = len(line) > 3 and bool(np.linalg.norm(line[-1] - line[0]) <= JOINED)
        tangents = np.gradient(line, s, axis=0)
        if closed:
            tangents[0] = tangents[-1] = line[1] - line[-2]
        lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
        if not (lengths > 0).all():
            raise RecordError("Seam.tangents_B: the line turns back on itself", field="tangents_B")
        tangents = tangents / lengths
        across = up - np.einsum("ij,ij->i", up, tangents)[:, None] * tangents
        size = np.linalg.norm(across, axis=1, keepdims=True)
        if not (size > LEAST_ACROSS * np.linalg.norm(up, axis=1, keepdims=True)).all():
            raise RecordError("Seam.normals_B: along travel in places; give the surface's own normals", field="normals_B")
        return cls(
            points_B=line,
            s=s,
            tangents_B=tangents,
            normals_B=across / size,
            width=width,
            confidence=confidence,
            reference=reference,
            joint=joint,
            closed=closed,
        )

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self.s[-1] - self.s[0])


def _check_turns(line: Float[ndarray, "n 3"]) -> None:
    """Raises RecordError where a polyline [m] turns back on itself: points that are not in order do."""
    steps = np.diff(line, axis=0)
    length = np.linalg.norm(steps, axis=1)
    turn = np.einsum("ij,ij->i", steps[1:], steps[:-1]) / (length[1:] * length[:-1])
    back = np.flatnonzero((turn < BACK) & (np.minimum(length[1:], length[:-1]) > LEAST_STEP))
    if len(back):
        i = int(back[0]) + 1
        place = ", ".join(f"{value:.4f}" for value in line[i])
        raise RecordError(
            f"Seam.points_B: the line turns back on itself at point {i + 1}, ({place}) m; sort the points as the torch is to"
            " travel",
            field="points_B",
        )


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """A candidate that looked like a seam and was refused, and why.

    Attributes:
        position_B: its middle [m].  length: its extent [m].  reason: one clause, with the figure and the limit.
        doubtful: it has a groove's shape, and waves of the surface that it may be one of.
        sideless: what is wrong is the surface beside it, as where a part is narrow: at another level, or too little.
    """

    position_B: tuple[float, float, float]
    length: float
    reason: str
    doubtful: bool = False
    sideless: bool = False


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """The detection threshold that was chosen from the cloud itself, and how much it matters.

    Attributes:
        name: what is compared with it.  value, unit: the threshold.  noise: the cloud's own noise in the same unit.
        stability: {factor: greatest movement of the centre line [m] when the threshold is multiplied by factor};
            infinity where the seam is then lost.
    """

    name: str
    value: float
    unit: str
    noise: float
    stability: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class SeamFindings:
    """What a seam finder returns: seams best first, and why the others were refused.

    Attributes:
        seams: best first; empty when there is none.
        region: (n,) for each point of the cloud, 1 + index of the seam whose groove holds it, 0 for none.
        rejected: candidates refused.
        threshold: the threshold used.
        method: "profile" or "thesis".
    """

    seams: tuple[Seam, ...]
    region: Int[ndarray, "n"]
    rejected: tuple[Rejection, ...] = ()
    threshold: Threshold | None = None
    method: str = "profile"

    def __post_init__(self) -> None:
        store(self, "region", self.region, shape=("n",), dtype=np.int32)


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownSeam:
    """The true seam of a workpiece, in closed form and sampled; for `report` and tests alone.

    Attributes:
        opening_B: (n, 3) midpoint of the lips [m], at most 0.5 mm apart.
        root_B: (n, 3) the bottom of the groove [m].
        left_B, right_B: (n, 3) the lips [m], left as in `Seam`.
        tangents_B: (n, 3) unit.  bisectors_B: (n, 3) unit, inward: the ideal wire axis.
        s: (n,) arc length of the opening [m].
        name: workpiece and branch.
    """

    opening_B: Float[ndarray, "n 3"]
    root_B: Float[ndarray, "n 3"]
    left_B: Float[ndarray, "n 3"]
    right_B: Float[ndarray, "n 3"]
    tangents_B: Float[ndarray, "n 3"]
    bisectors_B: Float[ndarray, "n 3"]
    s: Float[ndarray, "n"]
    name: str = ""

    def __post_init__(self) -> None:
        store(self, "opening_B", self.opening_B, shape=("n", 3))
        n = len(self.opening_B)
        for name in ("root_B", "left_B", "right_B", "tangents_B", "bisectors_B"):
            store(self, name, getattr(self, name), shape=(n, 3))
        check_unit(self, "tangents_B", self.tangents_B)
        check_unit(self, "bisectors_B", self.bisectors_B)
        store(self, "s", self.s, shape=(n,))
        check_increasing(self, "s", self.s)

    @property
    def width(self) -> float:
        """Mean distance between the lips [m]; 0 where only the middle is known."""
        return float(np.linalg.norm(self.left_B - self.right_B, axis=1).mean())

    @property
    def length(self) -> float:
        """Arc length of the opening [m]."""
        return float(self.s[-1] - self.s[0])

    @property
    def closed(self) -> bool:
        """Whether the seam is a ring: its last point repeats its first."""
        return bool(np.linalg.norm(self.opening_B[-1] - self.opening_B[0]) <= JOINED)
