"""Torch speed over stretches of bead: a slow place, a fast one and a torch that stands are seen, with where; ramps are not."""

import numpy as np
import pytest

from tests.seams import findings, found_seam, sine_seam, torch_path, weld_log
from weldsim.records import Pace, WeldReport
from weldsim.report.limits import ReportConfig
from weldsim.report.pace import paces
from weldsim.report.verdict import AMBER, FAILED, PASSED, verdict
from weldsim.report.weld import weld_report

KNOWN = sine_seam(np.random.default_rng(5))
SEAM = found_seam(KNOWN, np.full(len(KNOWN.s), 1e-4))
PATH = torch_path(SEAM)


def seen(**how: object) -> tuple[Pace, Pace, tuple[Pace, ...]]:
    slowest, fastest, uneven = paces(weld_log(PATH, np.random.default_rng(0), jitter=1e-6, **how), PATH, 5e-3, 0.2)  # type: ignore[arg-type]
    assert slowest is not None
    assert fastest is not None
    return slowest, fastest, uneven


def judged(config: ReportConfig | None = None, **how: object) -> WeldReport:
    log = weld_log(PATH, np.random.default_rng(0), jitter=1e-6, **how)  # type: ignore[arg-type]
    return weld_report(findings((SEAM,), np.zeros(5, bool)), (PATH,), scene="sine", log=log, known=(KNOWN,), config=config)


def test_an_even_weld_has_one_pace() -> None:
    slowest, fastest, uneven = seen()
    assert slowest.share == pytest.approx(1.0, abs=0.01)
    assert fastest.share == pytest.approx(1.0, abs=0.01)
    assert uneven == ()


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_slow_stretch_is_told_where_it_is_and_how_slow(share: float) -> None:
    slowest, fastest, uneven = seen(slow=(0.10, 0.12, share))
    assert slowest.share == pytest.approx(share, rel=0.03)
    assert 0.10 - 1e-3 < slowest.s_from < slowest.s_to < 0.12 + 1e-3
    assert fastest.share < 1.01
    (place,) = uneven
    assert place.share == slowest.share
    assert (place.s_from, place.s_to) == pytest.approx((0.10, 0.12), abs=1e-3)


def test_a_fast_stretch_lays_down_too_little() -> None:
    slowest, fastest, uneven = seen(slow=(0.05, 0.07, 1.8))
    assert fastest.share == pytest.approx(1.8, rel=0.03)
    assert slowest.share > 0.98
    assert [place.share for place in uneven] == [fastest.share]


def test_a_torch_that_stands_is_seen_by_its_time_not_its_way() -> None:
    """2 s at 6 mm/s are 12 mm of bead in one place, a blob that no length of seam shows."""
    slowest, _, uneven = seen(dwell=(0.08, 2.0))
    assert slowest.share < 0.05
    assert slowest.s_from == pytest.approx(0.08, abs=1e-3)
    assert len(uneven) == 1


def test_what_is_short_is_averaged_out_and_what_is_mild_is_not_told() -> None:
    assert seen(slow=(0.10, 0.1008, 0.5))[2] == ()  # 0.8 mm at half speed: 0.8 mm more bead
    assert seen(slow=(0.10, 0.14, 0.85))[2] == ()


def test_two_places_are_two() -> None:
    uneven = seen(slow=(0.10, 0.12, 0.4), dwell=(0.05, 2.0))[2]
    assert [round(place.s_from, 2) for place in uneven] == [0.05, 0.10]


def test_a_weld_shorter_than_a_stretch_is_judged_whole() -> None:
    log = weld_log(PATH, np.random.default_rng(0), factor=0.4)
    slowest, _, _ = paces(log, PATH, 10.0, 0.2)
    assert slowest is not None
    assert slowest.share == pytest.approx(0.4, rel=0.02)


@pytest.mark.parametrize("how", [{"slow": (0.10, 0.106, 0.4)}, {"dwell": (0.08, 2.0)}, {"slow": (0.10, 0.106, 1.8)}])
def test_half_the_speed_or_half_as_much_again_fails_with_its_place(how: dict[str, object]) -> None:
    report = judged(**how)
    assert not report.passed
    (reason,) = [reason for reason in report.reasons if reason.startswith(("slowest", "fastest"))]
    assert "of the speed asked for" in reason
    assert "at s = " in reason
    assert verdict(report, 1, ReportConfig())[0] == FAILED


def test_a_third_too_slow_is_amber_with_its_place() -> None:
    report = judged(slow=(0.10, 0.106, 0.67))
    assert report.passed
    (warning,) = report.warnings
    assert warning.startswith("slowest 5 mm of weld 6")
    assert "1.5 times what was planned" in warning
    assert verdict(report, 1, ReportConfig()) == (AMBER, "all 21 limits kept, 1 warning")
    assert verdict(judged(), 1, ReportConfig())[0] == PASSED


def test_a_scenes_own_limit_is_told_with_its_reason_and_is_a_limit() -> None:
    own = ReportConfig(least_speed=0.3, reason="the arm swings the wire round an edge there")
    report = judged(own, slow=(0.10, 0.102, 0.35))
    assert report.passed
    (warning,) = report.warnings
    assert warning.endswith("the general limit is 50 %; the arm swings the wire round an edge there")
    assert verdict(report, 1, own)[0] == AMBER
    assert not judged(own, slow=(0.10, 0.102, 0.25)).passed
    assert judged(own).warnings == ()  # nothing to tell where it is not needed
