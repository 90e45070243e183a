"""Limits as they are told, and what is told in amber: values at the limit, on either side of it, worked out on paper."""

import math
from dataclasses import replace

import pytest

from weldsim.records import LineError, Pace, WeldReport
from weldsim.report.limits import Check, ReportConfig, checks, line_checks

LINE = LineError(mean=1e-4, rms=2e-4, p95=3e-4, max=4e-4, coverage=0.97, start=-1e-3, end=2e-3, axis_median=0.01, axis_p95=0.05)
CONFIG = ReportConfig()


def only(report: WeldReport) -> Check:
    (check,) = checks(report, CONFIG)
    return check


def report(**figures: object) -> WeldReport:
    return replace(WeldReport(passed=True, reasons=(), scene="by hand", method="none"), **figures)  # type: ignore[arg-type]


def test_a_line_is_told_with_its_units_and_limits() -> None:
    told = [(check.figure.removeprefix("plan, "), check.value, check.limit) for check in line_checks("plan", LINE, CONFIG)]
    assert told == [
        ("cross-track mean", "0.100 mm", "<= 0.4 mm"),
        ("cross-track rms", "0.200 mm", ""),
        ("cross-track p95", "0.300 mm", "<= 0.8 mm"),
        ("cross-track max", "0.400 mm", "<= 1.2 mm"),
        ("coverage", "97.0 %", ">= 95 %"),
        ("start of the seam", "1.00 mm short", "<= 3 mm"),
        ("end of the seam", "2.00 mm beyond", "<= 3 mm"),
        ("wire axis median", f"{math.degrees(0.01):.2f} deg", "<= 1.5 deg"),
        ("wire axis p95", f"{math.degrees(0.05):.2f} deg", "<= 4 deg"),
    ]


@pytest.mark.parametrize(
    ("closed", "end", "value", "passed"),
    [
        (False, 4e-3, "4.00 mm beyond", False),
        (False, -4e-3, "4.00 mm short", False),
        (True, 4e-3, "4.00 mm overlap", True),
        (True, -4e-3, "4.00 mm short", False),
        (True, -2e-3, "2.00 mm short", True),
        (False, 0.0, "0.00 mm beyond", True),
        (True, 0.0, "0.00 mm overlap", True),
    ],
)
def test_a_ring_may_overlap_and_a_line_may_not(closed: bool, end: float, value: str, passed: bool) -> None:
    check = line_checks("executed", replace(LINE, closed=closed, end=end), CONFIG)[6]
    assert (check.figure, check.value, check.passed) == ("executed, end of the seam", value, passed)


@pytest.mark.parametrize(
    ("share", "passed", "amber"),
    [
        (1 - CONFIG.pace, True, ""),
        (0.7999, True, "more metal for each millimetre: 1.3 times what was planned"),
        (0.5, True, "more metal for each millimetre: 2 times what was planned"),
        (0.4999, False, ""),
    ],
)
def test_a_slow_stretch_has_more_metal(share: float, passed: bool, amber: str) -> None:
    check = only(report(slowest=Pace(share=share, s_from=0.012, s_to=0.017)))
    assert (check.passed, check.amber) == (passed, amber)
    assert (check.figure, check.limit) == ("slowest 5 mm of weld", ">= 50 % of the speed asked for")
    assert check.value == f"{100 * share:.0f} % at s = 12 mm"


@pytest.mark.parametrize(
    ("share", "passed", "amber"),
    [
        (1 + CONFIG.pace, True, ""),
        (1.25, True, "less metal for each millimetre: 0.8 times what was planned"),
        (1.5, True, "less metal for each millimetre: 0.67 times what was planned"),
        (1.5001, False, ""),
    ],
)
def test_a_fast_stretch_has_less_metal(share: float, passed: bool, amber: str) -> None:
    check = only(report(fastest=Pace(share=share, s_from=0.012, s_to=0.017)))
    assert (check.passed, check.amber) == (passed, amber)
    assert (check.figure, check.limit) == ("fastest 5 mm of weld", "<= 150 % of the speed asked for")


def test_figures_are_told_in_percent() -> None:
    assert only(report(sigma_coverage=(0.683, 0.9949))).value == "68 %, 99 %"
    check = only(report(speed_error_p95=0.0123))
    assert (check.value, check.limit, check.passed) == ("1.23 %", "<= 2 %", True)
    assert only(report(speed_error_max=0.5)).value == "50.00 %"
