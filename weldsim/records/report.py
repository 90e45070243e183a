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


@dataclass(frozen=True, eq=False, kw_only=True)
class WeldReport:
    """Figures of one job against the known seam (None where there is none), and the verdict.

    Attributes:
        passed: the verdict.  reasons: what decided it, a clause each.
        plan: planned torch tip against the known seam.  executed: measured torch tip against the known seam.
        tracking_p95, tracking_max: executed tip from the planned line [m].
        speed_error_max, speed_error_p95: relative, on the weld.
        iou: overlap of the groove region found with the true one.
        phantom_seams: seams found that are no seam.
        unplanned: seams found along which no path can be laid, a clause each.
        timing: seconds a stage.  seed, config_digest, versions: what it ran with.
    """

    passed: bool
    reasons: tuple[str, ...]
    scene: str
    method: str
    plan: LineError | None = None
    executed: LineError | None = None
    tracking_p95: float | None = None
    tracking_max: float | None = None
    speed_error_p95: float | None = None
    speed_error_max: float | None = None
    iou: float | None = None
    phantom_seams: int | None = None
    sigma_coverage: tuple[float, float] | None = None
    unplanned: tuple[str, ...] = ()
    timing: dict[str, float] = field(default_factory=dict)
    seed: int = 0
    config_digest: str = ""
    versions: dict[str, str] = field(default_factory=dict)
