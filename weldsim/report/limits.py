"""What a weld must keep to: limits, and the checks that make the verdict."""

import math
from dataclasses import dataclass

from weldsim import units
from weldsim.quantity import Metre, Radian, require_within
from weldsim.records import LineError, WeldReport

DEGREE = math.pi / 180
RANGES = {  # below 0, or over all of the seam, nothing passes
    **dict.fromkeys(("mean", "p95", "max", "tracking"), (-1.0, 1.0)),
    **dict.fromkeys(("axis_median", "axis_p95"), (-3.15, 3.15)),
    "coverage": (-1.0, 2.0),
    "speed": (-1.0, 100.0),
    "phantoms": (-1, 1000),
}


@dataclass(frozen=True, kw_only=True)
class ReportConfig:
    """Limits of the verdict. A figure that could not be measured is not judged."""

    mean: Metre = 0.4e-3
    """Mean cross-track distance from the known seam, of the plan and of the executed tip."""
    p95: Metre = 0.8e-3
    """95th percentile of the same."""
    max: Metre = 1.2e-3
    """Greatest of the same."""
    coverage: float = 0.95
    """Fraction of the known seam's length that must be covered."""
    axis_median: Radian = 1.5 * DEGREE
    """Median angle between wire and the known bisector."""
    axis_p95: Radian = 4.0 * DEGREE
    """95th percentile of the same."""
    tracking: Metre = 0.3e-3
    """95th percentile of the executed tip's distance from the planned line."""
    speed: float = 0.02
    """95th percentile of the relative torch speed error on the weld, outside the ramps."""
    phantoms: int = 0
    """Seams found where there is none."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "report")


@dataclass(frozen=True, kw_only=True)
class Check:
    """One figure beside its limit.

    Attributes:
        figure: its name.  value, limit: as text with unit.  passed: None where the figure is shown and not judged.
    """

    figure: str
    value: str
    limit: str
    passed: bool | None

    @property
    def clause(self) -> str:
        """The check in words."""
        return f"{self.figure} {self.value}" + (f" (limit {self.limit})" if self.limit else "")


def checks(report: WeldReport, config: ReportConfig) -> tuple[Check, ...]:
    """Every figure of the report that was measured, beside its limit."""
    out: list[Check] = []
    if report.plan is not None:
        out += line_checks("plan", report.plan, config)
    if report.executed is not None:
        out += line_checks("executed", report.executed, config)
    if report.tracking_p95 is not None:
        out.append(_length("executed tip from plan, p95", report.tracking_p95, config.tracking))
    if report.tracking_max is not None:
        out.append(_length("executed tip from plan, max", report.tracking_max, None))
    if report.speed_error_p95 is not None:
        out.append(_percent("torch speed error, p95", report.speed_error_p95, config.speed))
    if report.speed_error_max is not None:
        out.append(_percent("torch speed error, max", report.speed_error_max, None))
    if report.phantom_seams is not None:
        passed = report.phantom_seams <= config.phantoms
        out.append(Check(figure="phantom seams", value=str(report.phantom_seams), limit=str(config.phantoms), passed=passed))
    if report.iou is not None:
        out.append(Check(figure="groove region overlap (IoU)", value=f"{report.iou:.3f}", limit="", passed=None))
    if report.sigma_coverage is not None:
        one, two = report.sigma_coverage
        figure = "errors within 1 and 2 sigma (normal: 68 %, 95 %)"
        out.append(Check(figure=figure, value=f"{100 * one:.0f} %, {100 * two:.0f} %", limit="", passed=None))
    return tuple(out)


def verdict(report: WeldReport, found: int, config: ReportConfig) -> tuple[str, str]:
    """A headline and what decided it: PASSED or FAILED where figures were judged, or else how many seams were found."""
    judged = sum(check.passed is not None for check in checks(report, config))
    if not report.passed:
        first, *others = report.reasons
        return "FAILED", first + (f" (and {len(others)} more)" if others else "")
    if judged:
        return "PASSED", f"all {judged} limits kept"
    return f"{found} SEAM{'' if found == 1 else 'S'} FOUND", "no known seam to compare with"


def line_checks(who: str, error: LineError, config: ReportConfig) -> list[Check]:
    """The checks of one line against the known seam."""
    return [
        _length(f"{who}, cross-track mean", error.mean, config.mean),
        _length(f"{who}, cross-track rms", error.rms, None),
        _length(f"{who}, cross-track p95", error.p95, config.p95),
        _length(f"{who}, cross-track max", error.max, config.max),
        Check(
            figure=f"{who}, coverage",
            value=f"{100 * error.coverage:.1f} %",
            limit=f">= {100 * config.coverage:g} %",
            passed=error.coverage >= config.coverage,
        ),
        _length(f"{who}, start beyond the seam", error.start, None, sign=True),
        _length(f"{who}, end beyond the seam", error.end, None, sign=True),
        _angle(f"{who}, wire axis median", error.axis_median, config.axis_median),
        _angle(f"{who}, wire axis p95", error.axis_p95, config.axis_p95),
    ]


def _length(figure: str, value: float, limit: float | None, *, sign: bool = False) -> Check:
    text = f"{round(units.to_mm(value), 2) + 0.0:+.2f} mm" if sign else f"{units.to_mm(value):.3f} mm"
    return _at_most(figure, value, limit, text, f"{units.to_mm(limit or 0.0):g} mm")


def _angle(figure: str, value: float, limit: float | None) -> Check:
    return _at_most(figure, value, limit, f"{units.to_deg(value):.2f} deg", f"{units.to_deg(limit or 0.0):g} deg")


def _percent(figure: str, value: float, limit: float | None) -> Check:
    return _at_most(figure, value, limit, f"{100 * value:.2f} %", f"{100 * (limit or 0.0):g} %")


def _at_most(figure: str, value: float, limit: float | None, value_text: str, limit_text: str) -> Check:
    """A check that passes up to `limit`; a value that is no number fails."""
    if limit is None:
        return Check(figure=figure, value=value_text, limit="", passed=None)
    return Check(figure=figure, value=value_text, limit=f"<= {limit_text}", passed=value <= limit)
