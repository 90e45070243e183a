"""What a weld must keep to: limits, and the checks that make the verdict."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from weldsim import units
from weldsim.quantity import Metre, Radian, require_within
from weldsim.records import LineError, Pace, WeldReport

DEGREE = math.pi / 180
RANGES = {  # below 0, or over all of the seam, nothing passes
    **dict.fromkeys(("mean", "p95", "max", "tracking"), (-1.0, 0.1)),
    "ends": (-1.0, 1.0),
    **dict.fromkeys(("axis_median", "axis_p95"), (-3.15, 3.15)),
    "coverage": (-1.0, 2.0),
    "speed": (-1.0, 100.0),
    "phantoms": (-1, 1000),
    "stretch": (1e-4, 1.0),
    "pace": (0.0, 100.0),
    "least_speed": (0.0, 2.0),
    "most_speed": (0.0, 100.0),
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
    ends: Metre = 3e-3
    """Length at each end of the known seam, or of what the trims leave of it, that may be left unwelded or welded beyond it; and
    of a gap where the arc was interrupted."""
    axis_median: Radian = 1.5 * DEGREE
    """Median angle between wire and the known bisector."""
    axis_p95: Radian = 4.0 * DEGREE
    """95th percentile of the same."""
    tracking: Metre = 0.3e-3
    """95th percentile of the executed tip's distance from the planned line."""
    speed: float = 0.02
    """95th percentile of the relative torch speed error on the weld, outside the ramps."""
    stretch: Metre = 5e-3
    """Length of bead over which torch speed is averaged for the limits below: of way, or of what should have been way meanwhile."""
    pace: float = 0.2
    """Share by which torch speed may be off the asked one over such a stretch before that is told in amber."""
    least_speed: float = 0.5
    """Share of the asked speed below which no such stretch may be: there is twice the metal at 0.5."""
    most_speed: float = 1.5
    """Share of the asked speed above which no such stretch may be."""
    phantoms: int = 0
    """Seams found where there is none."""
    reason: str = ""
    """Why limits are looser than the general ones, in a clause; a figure that needs them is told in amber with it."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "report")


GENERAL = ReportConfig()
REGION = "groove region overlap (IoU)"


@dataclass(frozen=True, kw_only=True)
class Check:
    """One figure beside its limit.

    Attributes:
        figure: its name.  value, limit: as text with unit.  passed: None where the figure is shown and not judged.
        amber: why it is to be looked at though it passed; empty where it is not.
    """

    figure: str
    value: str
    limit: str
    passed: bool | None
    amber: str = ""

    @property
    def clause(self) -> str:
        """The check in words."""
        return f"{self.figure} {self.value}" + (f" (limit {self.limit})" if self.limit else "")

    @property
    def warning(self) -> str:
        """The check and what makes it amber, in words."""
        return f"{self.clause}: {self.amber}"


def checks(report: WeldReport, config: ReportConfig) -> tuple[Check, ...]:
    """Every figure of the report that was measured, beside its limit; of the job's other seams too, by their numbers."""
    out = _own_checks(report, config)
    for other in report.others:
        out += [replace(check, figure=f"seam {other.seam}: {check.figure}") for check in _own_checks(other, config)]
    return tuple(out)


def _own_checks(report: WeldReport, config: ReportConfig) -> list[Check]:
    """Those of one seam."""
    out: list[Check] = []
    if report.plan is not None:
        out += line_checks("plan", report.plan, config)
    if report.executed is not None:
        out += line_checks("executed", report.executed, config)
    if report.tracking_p95 is not None:
        limit = _Limit(config, "tracking", units.to_mm, "mm")
        out.append(_at_most("executed tip from plan, p95", report.tracking_p95, _mm(report.tracking_p95), limit))
    if report.tracking_max is not None:
        out.append(_shown("executed tip from plan, max", _mm(report.tracking_max)))
    if report.speed_error_p95 is not None:
        limit = _Limit(config, "speed", _percent, "%")
        out.append(_at_most("torch speed error, p95", report.speed_error_p95, f"{100 * report.speed_error_p95:.2f} %", limit))
    if report.speed_error_max is not None:
        out.append(_shown("torch speed error, max", f"{100 * report.speed_error_max:.2f} %"))
    if report.slowest is not None:
        out.append(_slowest(report.slowest, config))
    if report.fastest is not None:
        out.append(_fastest(report.fastest, config))
    if report.interruptions:
        out.append(_gap(report.interruptions, config))
    if report.phantom_seams is not None:
        passed = report.phantom_seams <= config.phantoms
        out.append(Check(figure="phantom seams", value=str(report.phantom_seams), limit=str(config.phantoms), passed=passed))
    if report.iou is not None:
        out.append(_shown(REGION, f"{report.iou:.3f}"))
    if report.widths is not None:
        found, known = (units.to_mm(width) for width in report.widths)
        out.append(_shown("width of the opening", f"{found:.1f} mm, known {known:.1f} mm"))
    if report.sigma_coverage is not None:
        one, two = report.sigma_coverage
        out.append(_shown("errors within 1 and 2 sigma (normal: 68 %, 95 %)", f"{100 * one:.0f} %, {100 * two:.0f} %"))
    out += [Check(figure=figure, value="-", limit=why, passed=None) for figure, why in report.unjudged]
    return out


def line_checks(who: str, error: LineError, config: ReportConfig) -> list[Check]:
    """The checks of one line against the known seam."""

    def length(figure: str, value: float, name: str) -> Check:
        return _at_most(f"{who}, {figure}", value, _mm(value), _Limit(config, name, units.to_mm, "mm"))

    def angle(figure: str, value: float, name: str) -> Check:
        return _at_most(f"{who}, {figure}", value, f"{units.to_deg(value):.2f} deg", _Limit(config, name, units.to_deg, "deg"))

    return [
        length("cross-track mean", error.mean, "mean"),
        _shown(f"{who}, cross-track rms", _mm(error.rms)),
        length("cross-track p95", error.p95, "p95"),
        length("cross-track max", error.max, "max"),
        Check(
            figure=f"{who}, coverage",
            value=f"{100 * error.coverage:.1f} %",
            limit=f">= {100 * config.coverage:g} %",
            passed=error.coverage >= config.coverage,
        ),
        _end(f"{who}, start of the seam", error.start, config),
        _end(f"{who}, end of the seam", error.end, config, ring=error.closed),
        angle("wire axis median", error.axis_median, "axis_median"),
        angle("wire axis p95", error.axis_p95, "axis_p95"),
    ]


@dataclass(frozen=True)
class _Limit:
    """A limit of the config and the general one of that name. Attributes: shown, from SI to what is written; unit."""

    config: ReportConfig
    name: str
    shown: Callable[[float], float]
    unit: str

    @property
    def value(self) -> float:
        return float(getattr(self.config, self.name))

    @property
    def general(self) -> float:
        return float(getattr(GENERAL, self.name))

    def text(self, value: float) -> str:
        return f"{self.shown(value):g} {self.unit}"

    def amber(self, *, kept: bool, in_general: bool) -> str:
        """Why a value that keeps this limit is to be looked at; empty where it keeps the general one too."""
        if not kept or in_general:
            return ""
        return f"the general limit is {self.text(self.general)}" + (f"; {self.config.reason}" if self.config.reason else "")


def _end(figure: str, beyond: float, config: ReportConfig, *, ring: bool = False) -> Check:
    """One end of a line, `beyond` the known one [m]; a ring may overlap."""
    off = max(0.0, -beyond) if ring else abs(beyond)
    word = "short" if beyond < 0 else "overlap" if ring else "beyond"
    return _at_most(figure, off, f"{_mm(abs(beyond), 2)} {word}", _Limit(config, "ends", units.to_mm, "mm"))


def _gap(interruptions: tuple[tuple[float, float], ...], config: ReportConfig) -> Check:
    """The longest stretch between two pieces of weld that was left out; an interruption is amber however short."""
    out, lit = max(interruptions, key=lambda each: each[1] - each[0])
    gap = max(0.0, lit - out)
    limit = _Limit(config, "ends", units.to_mm, "mm")
    kept = gap <= limit.value
    places = ", ".join(f"{units.to_mm(s):.0f}" for s, _ in interruptions)
    return Check(
        figure="left out where the arc was interrupted",
        value=f"{_mm(gap, 2)} at s = {units.to_mm(out):.0f} mm",
        limit=f"<= {limit.text(limit.value)}",
        passed=kept,
        amber=limit.amber(kept=kept, in_general=gap <= limit.general)
        or f"the arc stops and starts on the weld, at s = {places} mm",
    )


def _slowest(pace: Pace, config: ReportConfig) -> Check:
    """The slowest stretch, which must be fast enough, and is amber where it is noticeably off."""
    figure, value = f"slowest {_stretch(config)} of weld", _pace_text(pace)
    limit, kept = _Limit(config, "least_speed", _percent, "%"), pace.share >= config.least_speed
    amber = limit.amber(kept=kept, in_general=pace.share >= GENERAL.least_speed)
    if kept and not amber and pace.share < 1 - config.pace:
        amber = f"more metal for each millimetre: {1 / max(pace.share, 1e-3):.2g} times what was planned"
    return Check(figure=figure, value=value, limit=f">= {limit.text(limit.value)} of the speed asked for", passed=kept, amber=amber)


def _fastest(pace: Pace, config: ReportConfig) -> Check:
    """The fastest stretch likewise."""
    figure, value = f"fastest {_stretch(config)} of weld", _pace_text(pace)
    limit, kept = _Limit(config, "most_speed", _percent, "%"), pace.share <= config.most_speed
    amber = limit.amber(kept=kept, in_general=pace.share <= GENERAL.most_speed)
    if kept and not amber and pace.share > 1 + config.pace:
        amber = f"less metal for each millimetre: {1 / pace.share:.2g} times what was planned"
    return Check(figure=figure, value=value, limit=f"<= {limit.text(limit.value)} of the speed asked for", passed=kept, amber=amber)


def _stretch(config: ReportConfig) -> str:
    return f"{units.to_mm(config.stretch):g} mm"


def _pace_text(pace: Pace) -> str:
    return f"{100 * pace.share:.0f} % at s = {units.to_mm(pace.s_from):.0f} mm"


def _percent(share: float) -> float:
    return 100 * share


def _mm(value: float, digits: int = 3) -> str:
    return f"{units.to_mm(value):.{digits}f} mm"


def _shown(figure: str, value: str) -> Check:
    """A figure without a limit."""
    return Check(figure=figure, value=value, limit="", passed=None)


def _at_most(figure: str, value: float, text: str, limit: _Limit) -> Check:
    """A check that passes up to the limit; a value that is no number fails."""
    kept = value <= limit.value
    amber = limit.amber(kept=kept, in_general=value <= limit.general)
    return Check(figure=figure, value=text, limit=f"<= {limit.text(limit.value)}", passed=kept, amber=amber)
