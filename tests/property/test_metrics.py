"""Metrics: known offsets give known figures, and the way a line is posed, sampled or walked changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.seams import found_seam, left_of, sine_seam, torch_path, weld_log
from weldsim.curves import arc_length, interpolate, project, resample
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.records import ExecutionLog, KnownSeam, Segment
from weldsim.report.metrics import across, known_offsets, line_error, match_seams, region_overlap, sigma_coverage
from weldsim.report.tracking import SpeedRule, speed_error, tracking_error

seeds = st.integers(0, 10_000)
few = settings(max_examples=15)


def axes(known: KnownSeam) -> np.ndarray:
    return known.bisectors_B


def figures(error) -> np.ndarray:
    return np.array([error.mean, error.rms, error.p95, error.max, error.coverage, error.start, error.end, error.axis_p95])


@few
@given(seeds, st.floats(-2e-3, 2e-3), st.floats(-2e-3, 2e-3))
def test_a_constant_offset_is_every_figure(seed: int, side: float, up: float) -> None:
    known = sine_seam(np.random.default_rng(seed))
    line = known.opening_B + side * left_of(known) - up * known.bisectors_B
    error = line_error(line, axes(known), known)
    expected = float(np.hypot(side, up))
    assert np.allclose([error.mean, error.rms, error.p95, error.max], expected, atol=2e-6)
    assert error.coverage > 0.995
    assert abs(error.start) < 1e-5
    assert abs(error.end) < 1e-5
    assert np.allclose(across(known_offsets(line, known), known), side, atol=2e-6)


@few
@given(seeds, st.integers(0, 200), st.integers(1, 200))
def test_a_short_line_loses_coverage_and_nothing_else(seed: int, first: int, cut: int) -> None:
    known = sine_seam(np.random.default_rng(seed))
    part = slice(first, len(known.s) - cut)
    error = line_error(known.opening_B[part], axes(known)[part], known)
    kept = known.s[part]
    assert error.max < 5e-6
    assert abs(error.coverage - (kept[-1] - kept[0]) / known.length) < 1e-3
    assert abs(error.start + kept[0]) < 1e-6
    assert abs(error.end - (kept[-1] - known.length)) < 1e-6


@few
@given(seeds, st.floats(1e-3, 0.02), st.floats(1e-3, 0.02))
def test_running_on_is_an_end_error_and_no_cross_track_error(seed: int, before: float, after: float) -> None:
    known = sine_seam(np.random.default_rng(seed))
    t = known.tangents_B
    line = np.concatenate([[known.opening_B[0] - before * t[0]], known.opening_B, [known.opening_B[-1] + after * t[-1]]])
    wire = np.concatenate([axes(known)[:1], axes(known), axes(known)[-1:]])
    error = line_error(line, wire, known)
    assert error.max < 5e-6
    assert error.coverage > 0.999
    assert abs(error.start - before) < 1e-6
    assert abs(error.end - after) < 1e-6


@few
@given(seeds)
def test_pose_direction_and_sampling_change_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    known = sine_seam(rng)
    wave = 1e-3 * np.sin(known.s / 0.02 + rng.uniform(0, 6))
    line, wire = known.opening_B + wave[:, None] * left_of(known), axes(known)
    base = figures(line_error(line, wire, known))
    assert np.allclose(figures(line_error(line[::-1], wire[::-1], known)), base, atol=2e-6)
    fine = resample(np.concatenate([line, wire], axis=1), 1.3e-4)
    assert np.allclose(figures(line_error(fine[:, :3], fine[:, 3:], known)), base, atol=1e-5)

    X = Transform("BP", matrix_from_rotation_vector(rng.normal(size=3)), rng.normal(size=3))
    moved = KnownSeam(
        opening_B=X.points(known.opening_B),
        root_B=X.points(known.root_B),
        left_B=X.points(known.left_B),
        right_B=X.points(known.right_B),
        tangents_B=X.vectors(known.tangents_B),
        bisectors_B=X.vectors(known.bisectors_B),
        s=known.s,
    )
    assert np.allclose(figures(line_error(X.points(line), X.vectors(wire), moved)), base, atol=1e-8)


@few
@given(seeds, st.floats(0.0, 0.5))
def test_a_tilted_wire_is_its_angle_and_the_root_is_its_depth(seed: int, angle: float) -> None:
    known = sine_seam(np.random.default_rng(seed))
    wire = np.cos(angle) * known.bisectors_B + np.sin(angle) * left_of(known)
    error = line_error(known.opening_B, wire, known)
    assert abs(error.axis_median - angle) < 1e-5
    assert abs(error.axis_p95 - angle) < 1e-5
    root = line_error(known.opening_B, wire, known, "root")
    assert root.reference == "root"
    assert abs(root.mean - 0.008) < 1e-6


@few
@given(seeds, st.floats(1e-5, 1e-3))
def test_sigma_that_is_true_covers_as_a_normal_distribution_does(seed: int, sigma: float) -> None:
    rng = np.random.default_rng(seed)
    known = sine_seam(rng)
    line = known.opening_B + (sigma * rng.normal(size=len(known.s)))[:, None] * left_of(known)
    one, two = sigma_coverage(line, np.full(len(line), sigma), known)
    assert abs(one - 0.683) < 0.09
    assert abs(two - 0.954) < 0.05


@few
@given(seeds, st.floats(0.02, 0.18))
def test_matching_pairs_fragments_phantoms_and_misses(seed: int, split: float) -> None:
    rng = np.random.default_rng(seed)
    known = sine_seam(rng)
    zero = np.zeros(len(known.s))
    whole, far = found_seam(known, zero + 1e-3), found_seam(known, zero + 0.03)
    match = match_seams((far, whole), (known,))
    assert match.pairs == ((1, 0),)
    assert match.phantoms == (0,)
    assert match.missed == ()
    assert match.phantom_length == pytest.approx(far.length)
    alone = match_seams((far,), (known,))
    assert alone.pairs == ()
    assert alone.missed == (0,)
    assert match_seams((whole,), ()).phantoms == (0,)
    assert match_seams((), (known,)).missed == (0,)
    # A line within 5 mm over less than half of its length is no seam.
    off = np.where(known.s < split, 0.0, np.minimum(0.03, (known.s - split) * 20))
    straying = found_seam(known, off)
    near = float(np.clip(split + 0.005 / 20, 0, known.length))
    length = arc_length(straying.points_B)[-1]
    if abs(near / length - 0.5) > 0.1:
        assert (match_seams((straying,), (known,)).phantoms == (0,)) == (near / length < 0.5)
    short = found_seam(known, zero)
    assert match_seams((short, whole), (known,)).fragments == ((1,) if short.length >= whole.length else (0,))


@few
@given(st.lists(st.booleans(), min_size=1, max_size=40), seeds)
def test_overlap_is_symmetric_one_for_equals_and_counts_points(mask: list[bool], seed: int) -> None:
    a = np.array(mask)
    b = np.random.default_rng(seed).random(len(a)) < 0.5
    assert region_overlap(a, a) == 1.0
    assert region_overlap(a, b) == region_overlap(b, a)
    union = set(np.flatnonzero(a)) | set(np.flatnonzero(b))
    both = set(np.flatnonzero(a)) & set(np.flatnonzero(b))
    assert region_overlap(a, b) == (len(both) / len(union) if union else 1.0)


@few
@given(seeds, st.floats(-1e-3, 1e-3), st.floats(0.9, 1.1))
def test_tracking_and_speed_see_what_was_put_in(seed: int, side: float, factor: float) -> None:
    rng = np.random.default_rng(seed)
    known = sine_seam(rng)
    path = torch_path(found_seam(known, np.zeros(len(known.s)), every=1), speed=8e-3)
    log = weld_log(path, rng, factor=factor)
    tip = log.X_BT_act.p[log.arc_on] + side * np.stack([np.interp(log.s_cmd[log.arc_on], known.s, c) for c in left_of(known).T], 1)
    error = tracking_error(tip, path.X_BT.p)
    assert abs(error.mean - abs(side)) < 5e-6
    assert abs(error.max - abs(side)) < 5e-6
    speed = speed_error(log, path)
    assert speed is not None
    assert abs(speed.max - abs(factor - 1)) < 2e-3
    assert speed_error(log, path, SpeedRule(ramp=1e3)) is None


@few
@given(seeds, st.floats(0.9, 1.1))
def test_speed_is_judged_in_each_piece_of_an_interrupted_weld(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    known = sine_seam(rng)
    path = torch_path(found_seam(known, np.zeros(len(known.s)), every=1), speed=8e-3)
    log = weld_log(path, rng, factor=factor)
    burning = np.flatnonzero(log.arc_on)
    cut = burning[rng.integers(len(burning) // 4, 3 * len(burning) // 4)]
    # Between the pieces the torch is far off for a second, the arc out.
    away = Transform("BT", np.repeat(log.X_BT_act.R[cut : cut + 1], 125, 0), log.X_BT_act.p[cut] + np.full((125, 3), 0.2))
    log = _with_pause(log, int(cut), away)
    speed = speed_error(log, path)
    assert speed is not None
    assert abs(speed.max - abs(factor - 1)) < 2e-3


def _with_pause(log: ExecutionLog, at: int, away: Transform) -> ExecutionLog:
    """The log with the instants of `away` put in before the one at `at`, the arc off."""
    n = len(away.p)

    def more(values: np.ndarray, extra: np.ndarray | None = None) -> np.ndarray:
        filling = np.repeat(values[at : at + 1], n, axis=0) if extra is None else extra
        return np.concatenate([values[:at], filling, values[at:]])

    X = log.X_BT_act
    return replace(
        log,
        q_cmd=more(log.q_cmd),
        q_act=more(log.q_act),
        qd_act=more(log.qd_act),
        s_cmd=more(log.s_cmd),
        torque=None if log.torque is None else more(log.torque),
        t=log.period * np.arange(len(log.t) + n) + log.t[0],
        X_BT_act=Transform("BT", more(X.R, away.R), more(X.p, away.p)),
        arc_on=more(log.arc_on, np.zeros(n, bool)),
        segments=(*log.segments[:at], *(Segment.AIR,) * n, *log.segments[at:]),
    )


@pytest.mark.parametrize("seed", range(8))
def test_nothing_on_a_closed_polyline_is_off_it(seed: int) -> None:
    # Its first and last points are one up to rounding: whichever is found the nearer, both their neighbours count.
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, rng.integers(6, 400))
    points = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points[-1] = points[0] + 1e-15 * rng.normal(size=3)
    along = arc_length(points)
    on = interpolate(along, points, np.concatenate([rng.uniform(0, along[-1], 300), along[[0, -1]]]))
    assert project(on, points)[0].max() < 1e-9


def test_wire_axes_are_interpolated_as_directions() -> None:
    known = sine_seam(np.random.default_rng(1))
    pair = known.opening_B[[0, -1]]
    error = line_error(pair, unit(np.array([known.bisectors_B[0], known.bisectors_B[-1]])), known)
    assert error.axis_p95 < 1e-9
    assert error.max < 0.013


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_what_was_to_be_left_out_is_not_missed(seed: int, backwards: bool) -> None:
    known = sine_seam(np.random.default_rng(seed))
    first, last = np.random.default_rng(seed + 100).uniform(0.005, 0.06, 2)
    part = (known.s >= first) & (known.s <= known.length - last)
    step = -1 if backwards else 1
    line, wire = known.opening_B[part][::step], axes(known)[part][::step]
    trims = (last, first) if backwards else (first, last)
    asked = line_error(line, wire, known, trims=trims)
    assert asked.coverage > 0.99
    assert abs(asked.start) < 0.5e-3
    assert abs(asked.end) < 0.5e-3
    assert line_error(line, wire, known).coverage == pytest.approx(1 - (first + last) / known.length, abs=0.005)
    assert line_error(line[len(line) // 2 :], wire[len(line) // 2 :], known, trims=trims).coverage < 0.6
