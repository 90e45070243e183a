"""Figures of lines drawn by hand against a straight seam and a ring, each worked out on paper."""

from dataclasses import replace

import numpy as np
import pytest

from weldsim.frames import unit
from weldsim.records import KnownSeam, Seam
from weldsim.report.metrics import (
    MATCH,
    NEAR,
    STEP,
    Offsets,
    across,
    axis_angle,
    coverage,
    known_line,
    known_offsets,
    line_error,
    match_seams,
    offsets,
    region_overlap,
    sigma_coverage,
)

LENGTH, RADIUS = 0.1, 0.05  # [m]
DOWN = np.array([0.0, 0.0, -1.0])
ROUND = 2 * np.pi * RADIUS


def straight(shift: float = 0.0) -> KnownSeam:
    """Along x from 0 to LENGTH at y = shift, its root 8 mm deep."""
    x = np.linspace(0.0, LENGTH, 201)
    line = np.stack([x, 0 * x + shift, 0 * x], axis=1)
    return KnownSeam(
        opening_B=line,
        root_B=line + 0.008 * DOWN,
        left_B=line + np.array([0.0, 0.007, 0.0]),
        right_B=line - np.array([0.0, 0.007, 0.0]),
        tangents_B=np.tile([1.0, 0.0, 0.0], (201, 1)),
        bisectors_B=np.tile(DOWN, (201, 1)),
        s=x,
    )


def ring() -> KnownSeam:
    angle = np.linspace(0.0, 2 * np.pi, 2001)
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    line = RADIUS * out
    line[-1] = line[0]
    return KnownSeam(
        opening_B=line,
        root_B=line + 0.008 * DOWN,
        left_B=0.9 * line,
        right_B=1.1 * line,
        tangents_B=np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1),
        bisectors_B=np.tile(DOWN, (2001, 1)),
        s=RADIUS * angle,
    )


def arc(first: float, last: float, more: float = 0.0) -> np.ndarray:
    """Points on the ring between two shares of its round, `more` farther out [m]."""
    angle = 2 * np.pi * np.linspace(first, last, 4001)
    return (RADIUS + more) * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def along(x: np.ndarray, y: float | np.ndarray = 0.0, z: float | np.ndarray = 0.0) -> np.ndarray:
    return np.stack([x, 0 * x + y, 0 * x + z], axis=1)


def down(points: np.ndarray) -> np.ndarray:
    return np.tile(DOWN, (len(points), 1))


def test_offsets_are_square_to_the_line_which_goes_on_beyond_its_ends() -> None:
    line = along(np.array([0.0, 0.02, LENGTH]))
    points = np.array([[-0.01, 0.003, 0.004], [0.05, -0.002, 0.0], [0.13, 0.0, 0.001], [0.0, 0.001, 0.0], [LENGTH, 0.0, 0.002]])
    found = offsets(points, line)
    np.testing.assert_allclose(found.s, [-0.01, 0.05, 0.13, 0.0, LENGTH], atol=1e-12)
    np.testing.assert_allclose(found.distance, [0.005, 0.002, 0.001, 0.001, 0.002], atol=1e-12)
    np.testing.assert_allclose(found.vectors, points * [0.0, 1.0, 1.0], atol=1e-12)


def test_ends_known_better_turn_the_way_on() -> None:
    slant = np.array([0.8, 0.6, 0.0])
    line = along(np.array([0.0, LENGTH]))
    points = np.array([-0.01 * slant, line[1] + 0.02 * slant, [0.05, 0.001, 0.0]])
    found = offsets(points, line, np.stack([slant, slant]))
    np.testing.assert_allclose(found.s, [-0.01, LENGTH + 0.02, 0.05], atol=1e-12)
    np.testing.assert_allclose(found.distance, [0.0, 0.0, 0.001], atol=1e-12)
    assert offsets(points, line).distance[0] == pytest.approx(0.006)


def test_the_line_of_a_reference() -> None:
    known = straight()
    assert known_line(known) is known.opening_B
    assert known_line(known, "gap_mid") is known.opening_B
    assert known_line(known, "root") is known.root_B


def test_left_of_travel_is_positive_and_depth_does_not_count_across() -> None:
    points = along(np.array([-0.01, 0.02, 0.05, 0.11]), np.array([0.001, -0.002, 0.003, 0.004]), 0.005)
    found = known_offsets(points, straight())
    np.testing.assert_allclose(across(found, straight()), [0.001, -0.002, 0.003, 0.004], atol=1e-12)
    inside = known_offsets(arc(0.1, 0.2, -0.002), ring())
    np.testing.assert_allclose(across(inside, ring()), 0.002, atol=1e-6)


def test_offsets_from_a_ring_have_no_ends() -> None:
    points = arc(-0.05, 0.05, 0.001)[::1000]
    found = known_offsets(points, ring())
    np.testing.assert_allclose(found.s / ROUND, [0.95, 0.975, 0.0, 0.025, 0.05], atol=1e-5)
    np.testing.assert_allclose(found.distance, 0.001, atol=1e-6)


def test_figures_of_a_line_that_drifts_off() -> None:
    """From 0 to 1 mm aside over the seam: mean a half, root mean square 1 / sqrt 3, 95 % below 0.95."""
    x = np.linspace(0.0, LENGTH, 7)
    error = line_error(along(x, 0.01 * x), down(along(x)), straight())
    assert error.mean == pytest.approx(0.5e-3, rel=1e-3)
    assert error.rms == pytest.approx(1e-3 / np.sqrt(3), rel=5e-3)
    assert error.p95 == pytest.approx(0.95e-3, rel=1e-3)
    assert error.max == pytest.approx(1e-3, rel=1e-6)
    assert error.coverage == pytest.approx(1.0)
    assert error.reference == "opening"
    assert error.axis_p95 == pytest.approx(0.0, abs=1e-9)


def test_figures_weigh_by_length_not_by_points() -> None:
    x = np.concatenate([np.linspace(0.0, 0.01, 1000), [0.02, LENGTH, LENGTH]])
    error = line_error(along(x, np.where(x > 0.015, 1e-3, 0.0)), down(along(x)), straight())
    assert error.mean == pytest.approx(0.85e-3, rel=0.01)


@pytest.mark.parametrize("backwards", [False, True])
def test_ends_and_coverage_of_a_line_that_begins_late_and_runs_on(backwards: bool) -> None:
    line = along(np.linspace(0.012, 0.107, 50))[:: -1 if backwards else 1]
    error = line_error(line, down(line), straight())
    assert (error.start, error.end) == pytest.approx((-0.012, 0.007))
    assert error.coverage == pytest.approx(0.88)
    trims = (0.02, 0.01) if backwards else (0.01, 0.02)
    asked = line_error(line, down(line), straight(), trims=trims)
    assert (asked.start, asked.end) == pytest.approx((-0.002, 0.027))
    assert asked.coverage == pytest.approx(0.068 / 0.07)


@pytest.mark.parametrize("backwards", [False, True])
def test_wire_axes_go_with_their_points(backwards: bool) -> None:
    """The first half of the seam's axis leans by 0.1 rad, as the known bisectors there do; the line has both or none."""
    lean = np.where(np.linspace(0.0, LENGTH, 201) < LENGTH / 2, 0.1, 0.0)
    known = replace(straight(), bisectors_B=np.stack([0 * lean, np.sin(lean), -np.cos(lean)], axis=1))
    order = slice(None, None, -1) if backwards else slice(None)
    error = line_error(known.opening_B[order], known.bisectors_B[order], known)
    assert error.axis_p95 < 1e-3
    other = line_error(known.opening_B[order], down(known.opening_B), known)
    assert other.axis_p95 == pytest.approx(0.1, abs=1e-6)
    assert other.axis_median < 0.1
    third = np.where(known.s < 0.03, 0.2, 0.1)
    tilted = np.stack([np.sin(third), 0 * third, -np.cos(third)], axis=1)
    error = line_error(known.opening_B[order], tilted[order], straight())
    assert (error.axis_median, error.axis_p95) == pytest.approx((0.1, 0.2))


def test_the_root_is_its_own_line() -> None:
    line = along(np.linspace(0.0, LENGTH, 50), 0.0, -0.007)
    error = line_error(line, down(line), straight(), "root")
    assert error.mean == pytest.approx(0.001)
    assert error.reference == "root"


@pytest.mark.parametrize(
    ("first", "last", "end", "covered"), [(0.1, 0.85, -0.25, 0.75), (0.3, 1.3, 0.0, 1.0), (0.6, 1.7, 0.1, 1.0)]
)
@pytest.mark.parametrize("backwards", [False, True])
def test_a_ring_is_judged_by_how_far_round_a_line_goes(
    first: float, last: float, end: float, covered: float, backwards: bool
) -> None:
    line = arc(first, last, 1e-3)[:: -1 if backwards else 1]
    error = line_error(line, down(line), ring())
    assert error.start == 0.0
    assert error.end == pytest.approx(end * ROUND, abs=1e-5)
    assert error.coverage == pytest.approx(covered, abs=1e-3)
    assert error.max == pytest.approx(1e-3, rel=1e-2)
    assert error.axis_p95 == pytest.approx(0.0, abs=1e-9)


def test_trims_of_a_ring_shorten_what_is_asked_for() -> None:
    line = arc(0.2, 1.1)
    error = line_error(line, down(line), ring(), trims=(0.04 * ROUND, 0.06 * ROUND))
    assert error.end == pytest.approx(0.0, abs=1e-5)
    assert error.coverage == pytest.approx(1.0, abs=1e-3)


def swept(*s: float, distance: float | tuple[float, ...] = 0.0) -> Offsets:
    at = np.array(s)
    return Offsets(s=at, distance=np.broadcast_to(distance, at.shape).astype(float), vectors=np.zeros((len(at), 3)))


def test_coverage_is_what_consecutive_samples_sweep() -> None:
    fine = np.arange(0.0, 0.0601, STEP)
    assert coverage(swept(*fine), 0.0, 0.1) == pytest.approx(0.6)
    assert coverage(swept(*fine), 0.05, 0.1) == pytest.approx(0.2)
    assert coverage(swept(*fine[::-1]), 0.0, 0.1) == pytest.approx(0.6)
    assert coverage(swept(*fine, *fine), 0.0, 0.1) == pytest.approx(0.6), "what is swept twice counts once"
    assert coverage(swept(*fine[:41], *fine[60:]), 0.0, 0.1) == pytest.approx(0.5), "a jump covers nothing"
    assert coverage(swept(0.0, 4 * STEP), 0.0, 4 * STEP) == 1.0
    assert coverage(swept(0.0, 4.1 * STEP), 0.0, 4 * STEP) == 0.0
    assert coverage(swept(*fine), 0.02, 0.02) == 1.0
    assert coverage(swept(*fine), 0.0, 0.06) == pytest.approx(1.0)
    assert coverage(swept(0.01), 0.0, 0.1) == 0.0


def test_coverage_needs_both_samples_near() -> None:
    at = (0.0, 0.0005, 0.0010, 0.0015)
    assert coverage(swept(*at, distance=NEAR), 0.0, 0.0015) == 1.0
    assert coverage(swept(*at, distance=1.01 * NEAR), 0.0, 0.0015) == 0.0
    assert coverage(swept(*at, distance=(0.0, 0.0, 1.0, 0.0)), 0.0, 0.0015) == pytest.approx(1 / 3)
    assert coverage(swept(*at, distance=(1.0, 0.0, 0.0, 0.0)), 0.0, 0.0015) == pytest.approx(2 / 3)
    assert coverage(swept(*at, distance=0.002), 0.0, 0.0015, near=0.001) == 0.0


def test_coverage_of_a_ring_counts_each_place_once_wherever_it_begins() -> None:
    def going(first: float, last: float) -> Offsets:
        return swept(*np.arange(first, last + STEP / 2, STEP))

    for start in (0.0, 0.07, -0.03, 0.21):
        assert coverage(going(start, start + 0.05), 0.0, 0.1, ring=0.1) == pytest.approx(0.5)
        assert coverage(going(start, start + 0.13), 0.0, 0.1, ring=0.1) == pytest.approx(1.0)
        assert coverage(going(start, start + 0.05), 0.0, 0.05, ring=0.1) == pytest.approx(1.0)
        assert coverage(going(start, start + 0.04), 0.01, 0.06, ring=0.1) == pytest.approx(0.8)


def test_about_a_corner_the_wire_may_point_anywhere_between() -> None:
    """A right angle at 50 mm: within 25 mm of it either side's bisector and all between are right; beyond its own alone."""
    s = np.linspace(0.0, 0.1, 101)
    bisectors = np.where((s < 0.05)[:, None], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    middle = unit(np.array([1.0, 1.0, 0.0]))
    at = np.array([0.0, 0.0235, 0.0245, 0.05, 0.0745, 0.0765, 0.1])
    near = np.array([0, 0, 1, 1, 1, 0, 0])
    np.testing.assert_allclose(axis_angle(np.tile(middle, (7, 1)), at, s, bisectors), np.where(near, 0.0, np.pi / 4), atol=1e-3)
    other = axis_angle(np.tile([0.0, 1.0, 0.0], (7, 1)), at, s, bisectors)
    np.testing.assert_allclose(other, [np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    up = axis_angle(np.tile(unit(np.array([1.0, 1.0, 1.0])), (7, 1)), at, s, bisectors)
    np.testing.assert_allclose(up[near == 1], np.arccos(np.sqrt(2 / 3)), atol=1e-6)
    gentle = np.stack([np.cos(3 * s), np.sin(3 * s), 0 * s], axis=1)  # 0.03 rad from one to the next: no corner
    np.testing.assert_allclose(axis_angle(np.tile([1.0, 0.0, 0.0], (2, 1)), np.array([0.0, 0.1]), s, gentle), [0.0, 0.3], atol=1e-9)


def seam(first: float, last: float, y: float | tuple[float, float] = 0.0) -> Seam:
    """Along x between two places, at y or from one y to another."""
    low, high = y if isinstance(y, tuple) else (y, y)
    points = np.array([[first, low, 0.0], [last, high, 0.0]])
    length = float(np.linalg.norm(points[1] - points[0]))
    tangent = (points[1] - points[0]) / length
    return Seam(points_B=points, s=np.array([0.0, length]), tangents_B=np.tile(tangent, (2, 1)), normals_B=np.tile(-DOWN, (2, 1)))


def test_which_found_seam_is_which_known_one() -> None:
    known = (straight(), straight(0.05), straight(0.2))
    found = (seam(0.0, 0.04), seam(0.0, 0.1, 0.051), seam(0.05, 0.1, 0.001), seam(0.0, 0.1, 0.1), seam(0.0, 0.03, 0.048))
    match = match_seams(found, known)
    assert match.pairs == ((1, 1), (2, 0))
    assert match.fragments == (0, 4)
    assert match.phantoms == (3,)
    assert match.missed == (2,)
    assert match.phantom_length == pytest.approx(0.1)
    assert match.owners == (0, 1, 0, -1, 1)


def test_a_seam_is_one_where_half_of_it_lies_within_five_millimetres() -> None:
    assert match_seams((seam(0.0, 0.1, 0.999 * MATCH),), (straight(),)).phantoms == ()
    assert match_seams((seam(0.0, 0.1, 1.001 * MATCH),), (straight(),)).phantoms == (0,)
    assert match_seams((seam(0.0, 0.1, (0.0, 2.05 * MATCH)),), (straight(),)).phantoms == (0,)
    assert match_seams((seam(0.0, 0.1, (0.0, 1.95 * MATCH)),), (straight(),)).phantoms == ()
    assert match_seams((seam(0.0, 0.19),), (straight(),)).phantoms == ()
    assert match_seams((seam(0.0, 0.22),), (straight(),)).phantoms == (0,)
    assert match_seams((seam(0.0, 0.1, 0.01),), (straight(),), within=0.011).phantoms == ()
    assert match_seams((seam(0.0, 0.22),), (straight(),), share=0.4).phantoms == ()
    # Half of it lies along one, half along another: no phantom, though neither has half of it.
    assert match_seams((seam(0.0, 0.1, (-0.001, 0.021)),), (straight(), straight(0.02))).phantoms == ()


def test_no_seams_match_nothing() -> None:
    none = match_seams((), ())
    assert (none.pairs, none.fragments, none.phantoms, none.missed, none.phantom_length, none.owners) == ((), (), (), (), 0.0, ())
    lone = match_seams((seam(0.0, 0.1), seam(0.0, 0.05)), ())
    assert lone.phantoms == (0, 1)
    assert lone.owners == (-1, -1)
    assert lone.phantom_length == pytest.approx(0.15)


def test_errors_of_one_and_two_sigma_are_within_them() -> None:
    points = along(np.linspace(0.01, 0.09, 5), np.array([0.0, 0.5e-3, -1e-3, 1.5e-3, -2.5e-3]), 0.003)
    assert sigma_coverage(points, np.full(5, 1.0001e-3), straight()) == pytest.approx((0.6, 0.8))
    assert sigma_coverage(points, np.full(5, 0.9999e-3), straight()) == pytest.approx((0.4, 0.8))
    assert sigma_coverage(points, np.array([0.0, 1.0, 1.0, 1.0, 0.0]), straight()) == pytest.approx((0.8, 0.8))
    assert sigma_coverage(points, np.zeros(5), straight(), "root") == pytest.approx((0.2, 0.2))


def test_overlap_is_both_over_either() -> None:
    found, true = np.array([True, True, False, False, True]), np.array([True, False, True, False, True])
    assert region_overlap(found, true) == 0.5
    assert region_overlap(found & False, true & False) == 1.0
    assert region_overlap(found, true & False) == 0.0


def test_of_a_wire_that_leans_ever_more_the_median_and_the_95th_percentile_are_told() -> None:
    """By 0 to 0.2 rad, evenly along the line: half of it by less than 0.1 rad, and 95 % by less than 0.19 rad."""
    x = np.linspace(0.0, LENGTH, 2001)
    lean = 0.2 * x / LENGTH
    axes = np.stack([0 * x, np.sin(lean), -np.cos(lean)], axis=1)
    error = line_error(along(x), axes, straight())
    assert error.axis_median == pytest.approx(0.1, abs=1e-5)
    assert error.axis_p95 == pytest.approx(0.19, abs=1e-5)


def test_a_line_goes_on_along_its_own_first_and_last_direction() -> None:
    """A polyline that turns left by 90 deg, and a quarter of the ring: each goes on straight from either end."""
    corner = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.01, 0.01, 0.0]])
    found = offsets(np.array([[-0.005, 0.001, 0.0], [0.012, 0.015, 0.0]]), corner)
    np.testing.assert_allclose(found.s, [-0.005, 0.025], atol=1e-12)
    np.testing.assert_allclose(found.distance, [0.001, 0.002], atol=1e-12)
    whole, quarter = ring(), slice(0, 501)
    parts = ("opening_B", "root_B", "left_B", "right_B", "tangents_B", "bisectors_B", "s")
    known = replace(whole, **{name: getattr(whole, name)[quarter] for name in parts})
    beyond = np.array([[RADIUS + 0.001, -0.004, 0.0], [-0.004, RADIUS - 0.002, 0.0]])
    found = known_offsets(beyond, known)
    np.testing.assert_allclose(found.s, [-0.004, ROUND / 4 + 0.004], atol=1e-6)
    np.testing.assert_allclose(found.distance, [0.001, 0.002], atol=1e-6)
