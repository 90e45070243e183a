"""How far a weld came: by the torch, not by what it was told; pieces, gaps, a dark arc and a path of few poses."""

from dataclasses import replace

import numpy as np
import pytest

from tests.seams import findings, found_seam, sine_seam, torch_path, weld_log
from weldsim.frames import Transform
from weldsim.motion.cut import cut_path
from weldsim.records import ExecutionLog, TorchPath, WeldReport
from weldsim.report.limits import ReportConfig, checks
from weldsim.report.progress import weld_progress
from weldsim.report.verdict import STOPPED, verdict
from weldsim.report.weld import weld_report

KNOWN = sine_seam(np.random.default_rng(2))
PATH = torch_path(found_seam(KNOWN, np.zeros(len(KNOWN.s))))
LOG = weld_log(PATH, np.random.default_rng(0))
LENGTH = float(PATH.s[-1])


def until(s: float, log: ExecutionLog = LOG, begin: float = 0.0) -> ExecutionLog:
    """The log with the arc on between two arc lengths alone [m]."""
    return replace(log, arc_on=log.arc_on & (log.s_cmd <= s) & (log.s_cmd >= begin))


def sparse(every: int) -> TorchPath:
    """The path with a pose every so many."""
    keep = np.unique([*range(0, len(PATH.s), every), len(PATH.s) - 1])
    return TorchPath(
        X_BT=PATH.X_BT[keep],
        s=PATH.s[keep],
        speed=PATH.speed[keep],
        arc_on=PATH.arc_on[keep],
        segments=tuple(PATH.segments[i] for i in keep),
    )


@pytest.mark.parametrize("every", [1, 50])
@pytest.mark.parametrize("s", [0.03, 0.069, 0.15])
def test_a_weld_that_was_stopped_is_welded_up_to_there(s: float, every: int) -> None:
    path = sparse(every)
    far = weld_progress(until(s), path, path, arc=True)
    assert far.s_to == pytest.approx(s, abs=2e-4)
    assert far.welded == pytest.approx(s, abs=2e-4)
    assert far.length == pytest.approx(LENGTH)
    place = np.array([np.interp(s, PATH.s, column) for column in PATH.X_BT.p.T])
    assert np.linalg.norm(np.array(far.position_B) - place) < 5e-4


def test_an_arm_that_trails_its_commands_has_welded_less_than_it_was_told() -> None:
    lag = 0.3  # s, at 6 mm/s
    late = np.stack([np.interp(LOG.t - lag, LOG.t, column) for column in LOG.X_BT_act.p.T], axis=1)
    log = replace(LOG, X_BT_act=Transform("BT", LOG.X_BT_act.R, late))
    far = weld_progress(until(0.1, log), PATH, PATH, arc=True)
    assert far.s_to == pytest.approx(0.1 - lag * 6e-3, abs=2e-4)


def test_the_way_between_pieces_is_not_welded() -> None:
    log = replace(LOG, arc_on=LOG.arc_on & ((LOG.s_cmd < 0.05) | (LOG.s_cmd > 0.08)))
    far = weld_progress(until(0.12, log), PATH, PATH, arc=True)
    assert far.s_to == pytest.approx(0.12, abs=2e-4)
    assert far.welded == pytest.approx(0.09, abs=4e-4)


@pytest.mark.parametrize(("begin", "end", "passed"), [(0.05, 0.0502, True), (0.05, 0.0525, True), (0.05, 0.062, False)])
def test_a_gap_in_the_weld_is_told_and_held_to_the_limit_of_the_ends(begin: float, end: float, passed: bool) -> None:
    """The line through what was welded has no gap: no figure of it would show one."""
    log = replace(LOG, arc_on=LOG.arc_on & ((LOG.s_cmd < begin) | (LOG.s_cmd > end)))
    seam = found_seam(KNOWN, np.zeros(len(KNOWN.s)))
    report = weld_report(findings((seam,), np.zeros(5, bool)), (PATH,), scene="x", log=log, known=(KNOWN,))
    assert report.executed is not None
    assert report.executed.coverage > 0.99
    ((out, lit),) = report.interruptions
    assert (out, lit) == pytest.approx((begin, end), abs=2e-4)
    assert report.passed == passed
    told = report.warnings if passed else report.reasons
    assert any(text.startswith("left out where the arc was interrupted") and "at s = 50 mm" in text for text in told)
    assert not any("interrupted" in check.figure for check in checks(replace(report, interruptions=()), ReportConfig()))


def test_a_rest_counts_from_where_it_began() -> None:
    rest = cut_path(PATH, (0.06,))[1]
    far = weld_progress(until(0.15, begin=0.06), rest, PATH, arc=True)
    assert (far.s_from, far.length) == pytest.approx((0.06, LENGTH))
    assert far.welded == pytest.approx(0.09, abs=4e-4)


def test_without_the_arc_the_way_counts_and_before_the_weld_there_is_none() -> None:
    dark = replace(LOG, arc_on=np.zeros(len(LOG.t), bool))
    assert weld_progress(dark, PATH, PATH, arc=False).welded == pytest.approx(LENGTH, abs=2e-4)
    none = weld_progress(dark, PATH, PATH, arc=True)
    assert (none.welded, none.s_to) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("s", "arc", "says"),
    [
        (0.069, True, "at s = 69.0 mm: welded 69 of 209 mm"),
        (0.069, False, "at s = 69.0 mm: travelled with the arc off 69 of 209 mm"),
        (None, True, "before the weld began: 0 of 209 mm welded"),
    ],
)
def test_the_headline_of_a_stop(s: float | None, arc: bool, says: str) -> None:
    far = weld_progress(LOG, PATH, PATH, arc=True)
    far = replace(far, s_to=s or 0.0, welded=s or 0.0, arc=arc, length=0.209)
    report = WeldReport(passed=False, reasons=("a stop",), scene="x", method="m", stopped="a stop", progress=far, seams=1)
    assert verdict(report, 1, ReportConfig()) == (STOPPED, says)
