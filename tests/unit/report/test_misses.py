"""A known line that runs beside the seam, given by its root or in another frame, is told with how far off it is."""

from dataclasses import replace

import numpy as np
import pytest

from tests.seams import findings, found_seam, left_of, sine_seam, torch_path
from weldsim.records import KnownSeam, Seam, WeldReport
from weldsim.report.misses import beside
from weldsim.report.weld import weld_report

TRUE = sine_seam(np.random.default_rng(9))
FOUND = found_seam(TRUE, np.zeros(len(TRUE.s)))


def moved(up: float, left: float = 0.0) -> KnownSeam:
    """The known seam as somebody has it who is so far off [m]."""
    shift = -up * TRUE.bisectors_B + left * left_of(TRUE)
    return replace(TRUE, opening_B=TRUE.opening_B + shift, root_B=TRUE.root_B + shift, name="mine")


def report(known: KnownSeam, *seams: Seam) -> WeldReport:
    found = seams or (FOUND,)
    return weld_report(findings(found, np.zeros(5, bool)), tuple(map(torch_path, found)), scene="mine", known=(known,))


def test_a_root_given_as_opening_is_told_and_the_opening_passes() -> None:
    depth = float(np.linalg.norm(TRUE.opening_B - TRUE.root_B, axis=1).mean())
    judged = report(moved(up=-depth))
    assert not judged.passed
    (reason,) = [reason for reason in judged.reasons if "was not found" in reason]
    assert reason.startswith(
        "known seam mine was not found; a seam was found 8.0 mm above it: is the known line the groove's root?"
    )
    assert report(moved(up=0.0)).passed


@pytest.mark.parametrize(
    ("up", "left", "says"),
    [
        (-0.006, 0.0, "6.0 mm above it"),
        (0.009, 0.0, "9.0 mm below it: check the frame and the unit"),
        (0.0, 0.012, "12.0 mm to the right of it: check the frame"),
        (0.0, -0.02, "20.0 mm to the left of it"),
        (-0.006, 0.012, "6.0 mm above and 12.0 mm to the right of it: check the frame"),
    ],
)
def test_a_line_beside_the_seam_is_told_by_how_much(up: float, left: float, says: str) -> None:
    assert any(says in reason for reason in report(moved(up, left)).reasons)


def test_a_shallow_root_is_near_enough_to_be_judged_and_is_told_too() -> None:
    judged = report(moved(up=-0.003))
    assert judged.plan is not None
    assert judged.plan.mean == pytest.approx(3e-3, abs=1e-4)
    assert any(reason.startswith("the seam was found 3.0 mm above the known line all along: is the") for reason in judged.reasons)


def test_what_is_far_off_or_runs_another_way_is_not_it() -> None:
    assert beside(FOUND, moved(up=0.0, left=0.05)) is None
    turned = replace(TRUE, opening_B=TRUE.opening_B[::-1])
    assert beside(found_seam(turned, np.zeros(len(TRUE.s))), TRUE) is not None  # travelled the other way it is the same
    crossing = np.linspace(-0.02, 0.02, len(TRUE.s))
    assert beside(found_seam(TRUE, crossing), TRUE) is None
    (reason,) = [reason for reason in report(moved(up=0.0, left=0.05)).reasons if "was not found" in reason]
    assert reason == "known seam mine was not found"


def test_the_found_seam_is_named_where_there_are_several() -> None:
    far = found_seam(moved(up=0.0, left=0.06), np.zeros(len(TRUE.s)))
    reasons = report(moved(up=-0.008), far, FOUND).reasons
    assert any("seam 2 was found 8.0 mm above it" in reason for reason in reasons)
