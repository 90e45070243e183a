"""Figures of a job against the known seam, and the verdict."""

from dataclasses import dataclass, field

from weldsim.records.seam import Reference


@dataclass(frozen=True, kw_only=True)
class LineError:
    """How far a line is from the known seam.

    Attributes:
        mean, rms, p95, max: cross-track distance [m].
        coverage: fraction of the known seam's length, without what was to be left out, that the line covers.
        start, end: distance of each end from the one asked for, along the seam [m]; positive = overshoot. Of a ring, end is
            the overlap.
        axis_median, axis_p95: angle between wire axis and the known bisector [rad].
        reference: which line of the groove it was measured against.
        closed: whether the known seam is a ring, on which an overlap is no overshoot.
    """

    mean: float
    rms: float
    p95: float
    max: float
    coverage: float
    start: float
    end: float
    axis_median: float
    axis_p95: float
    reference: Reference = "opening"
    closed: bool = False


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Torch speed over a stretch of weld with the arc on.

    Attributes:
        share: of the speed asked for; the metal laid down for each millimetre goes with its inverse.
        s_from, s_to: arc lengths of the path [m].
    """

    share: float
    s_from: float
    s_to: float


@dataclass(frozen=True, kw_only=True)
class WeldProgress:
    """How far a weld came.

    Attributes:
        length: of the whole seam [m].  s_from: where this weld was to begin [m].
        s_to: up to where it was welded [m]; what lies beyond is still to be welded.
        welded: length with the arc on [m], or of what was travelled where the arc was not to burn.
        arc: whether it burnt.  position_B: of the torch tip at s_to [m].
    """

    length: float
    s_from: float
    s_to: float
    welded: float
    arc: bool
    position_B: tuple[float, float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class WeldReport:
    """Figures of one job against the known seam (None where there is none), and the verdict.

    Attributes:
        passed: the verdict.  reasons: what decided it, a clause each.
        warnings: what a welder has to know though nothing failed, a clause each.
        plan: planned torch tip against the known seam.  executed: measured torch tip against the known seam.
        tracking_p95, tracking_max: executed tip from the planned line [m].
        speed_error_max, speed_error_p95: relative, on the weld.
        slowest, fastest: the stretch with the least and the greatest torch speed.  uneven: all that are off by more than told.
        interruptions: where the arc went out on the weld and where it was lit again, arc lengths [m].
        iou: overlap of the groove region found with the true one.
        widths: between the lips [m], as found and as known.
        phantom_seams: seams found that are no seam.
        unplanned: seams found along which no path can be laid, a clause each.
        unjudged: figures that nothing is known to judge by, and why.
        seam: number of the seam that the figures are of, from 1.  welded, seams: how many were welded, of how many there are.
        others: the same of the other seams of the job, without what is said of all of them together.
        stopped: why the arm was stopped before the end, or None.  progress: how far it came.  way_on: how to go on, in words.
        timing: seconds a stage.  seed, config_digest, versions: what it ran with; the seed of the twin's cameras, None for
            what no twin has seen.
    """

    passed: bool
    reasons: tuple[str, ...]
    scene: str
    method: str
    warnings: tuple[str, ...] = ()
    plan: LineError | None = None
    executed: LineError | None = None
    tracking_p95: float | None = None
    tracking_max: float | None = None
    speed_error_p95: float | None = None
    speed_error_max: float | None = None
    slowest: Pace | None = None
    fastest: Pace | None = None
    uneven: tuple[Pace, ...] = ()
    interruptions: tuple[tuple[float, float], ...] = ()
    iou: float | None = None
    widths: tuple[float, float] | None = None
    phantom_seams: int | None = None
    sigma_coverage: tuple[float, float] | None = None
    unplanned: tuple[str, ...] = ()
    unjudged: tuple[tuple[str, str], ...] = ()
    seam: int = 1
    welded: int = 0
    seams: int = 0
    others: "tuple[WeldReport, ...]" = ()
    stopped: str | None = None
    progress: WeldProgress | None = None
    way_on: str = ""
    timing: dict[str, float] = field(default_factory=dict)
    seed: int | None = None
    config_digest: str = ""
    versions: dict[str, str] = field(default_factory=dict)
