"""Tracking figures of logs written by hand: what is averaged, what stands for itself, which instants are judged."""

from dataclasses import replace

import numpy as np
import pytest

from tests.seams import found_seam, sine_seam, torch_path
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import ExecutionLog, Segment, TorchPath
from weldsim.report.tracking import SpeedRule, speed_error, thinned, torch_speed, tracking_error

PERIOD = 0.01  # [s]


def log_of(p: np.ndarray, s: np.ndarray, arc_on: np.ndarray | None = None, lean: np.ndarray | None = None) -> ExecutionLog:
    """A log of tip positions [m] at commanded arc lengths [m]; the wire leans by `lean` [rad] about x."""
    n = len(s)
    lean = np.zeros(n) if lean is None else lean
    R = matrix_from_rotation_vector(np.stack([lean, 0 * lean, 0 * lean], axis=1))
    q = np.zeros((n, 6))
    return ExecutionLog(
        t=PERIOD * np.arange(n),
        q_cmd=q,
        q_act=q,
        qd_act=q,
        X_BT_act=Transform("BT", R, p),
        s_cmd=s,
        arc_on=np.ones(n, bool) if arc_on is None else arc_on,
        segments=(Segment.WELD,) * n,
        period=PERIOD,
        robot="by hand",
    )


def along_x(x: np.ndarray) -> np.ndarray:
    return np.stack([x, 0 * x, 0 * x], axis=1)


def test_tips_are_averaged_over_half_millimetres_and_the_ends_stand_for_themselves() -> None:
    s = 0.13e-3 * np.arange(19)  # 4, 4, 4, 4 and 3 in each half millimetre
    x = 0.2 + s
    y = 1e-5 * (-1.0) ** np.arange(19)  # noise that averages out
    tip, wire = thinned(log_of(np.stack([x, y, 0 * x], axis=1), s, lean=0.1 * (-1.0) ** np.arange(19)))
    groups = [np.arange(19)[k : k + 4] for k in (0, 4, 8, 12, 16)]
    wanted = np.array([[x[g].mean(), y[g].mean(), 0.0] for g in groups])
    wanted[0], wanted[-1] = [x[0], y[0], 0.0], [x[18], y[18], 0.0]
    np.testing.assert_allclose(tip, wanted, atol=1e-15)
    assert tip[0, 0] == 0.2, "an average would begin 0.195 mm later"
    assert tip[-1, 0] == 0.2 + 18 * 0.13e-3, "an average would end 0.13 mm earlier"
    np.testing.assert_allclose(wire[1:4], np.tile([0.0, 0.0, 1.0], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(wire[[0, -1]], np.tile([0.0, -np.sin(0.1), np.cos(0.1)], (2, 1)), atol=1e-12)


def test_what_is_thinned_is_the_arc_alone_and_one_group_is_its_mean() -> None:
    s = 1e-4 * np.arange(9)
    on = np.zeros(9, bool)
    on[2:5] = True
    tip, wire = thinned(log_of(along_x(s), s, on))
    np.testing.assert_allclose(tip, [[3e-4, 0.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(wire, [[0.0, 0.0, 1.0]])
    dark, no_wire = thinned(log_of(along_x(s), s, np.zeros(9, bool)))
    assert dark.shape == no_wire.shape == (0, 3)


@pytest.fixture(scope="module")
def path() -> TorchPath:
    """Straight along x for 60 mm at 6 mm/s."""
    known = sine_seam(np.random.default_rng(0), length=0.06, amplitude=0.0)
    one = torch_path(found_seam(known, np.zeros(len(known.s)), every=1), speed=6e-3)
    return replace(one, X_BT=Transform("BT", np.tile(np.eye(3), (len(one.s), 1, 1)), along_x(one.s)))


def test_a_log_that_is_late_or_early_is_on_the_line(path: TorchPath) -> None:
    """Repeated points of the plan and places beyond its ends are no errors either; a step aside is one, of every figure."""
    line = np.concatenate([path.X_BT.p[:5], path.X_BT.p[4:5], path.X_BT.p[5:]])
    x = np.linspace(-0.002, 0.062, 100)
    assert tracking_error(along_x(x), line).max < 1e-12
    y = np.where(np.arange(100) < 10, 3e-4, 1e-4)
    error = tracking_error(np.stack([x, y, 0 * x], axis=1), line)
    assert error.mean == pytest.approx(1.2e-4)
    assert error.p95 == pytest.approx(3e-4)
    assert error.max == pytest.approx(3e-4)
    np.testing.assert_allclose(error.offsets.distance, y, atol=1e-15)


def weld(path: TorchPath, speeds: np.ndarray, on: np.ndarray | None = None, command: float = 6e-3) -> ExecutionLog:
    """A log driven at a speed from each instant to the next [m/s], commanded to go at `command`."""
    x = np.concatenate([[0.0], np.cumsum(speeds * PERIOD)])
    return log_of(along_x(x), command * PERIOD * np.arange(len(x)), on)


def test_speed_is_the_way_over_the_window_and_the_ramps_are_not_judged(path: TorchPath) -> None:
    speeds = np.full(300, 6e-3)
    speeds[:20] = 0.0  # within the ramp
    speeds[150] = 12e-3  # for one period of ten in the window
    speed = speed_error(weld(path, speeds), path)
    assert speed is not None
    assert speed.max == pytest.approx(0.1)
    assert speed.p95 == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_array_equal(np.flatnonzero(~speed.judged), [*range(30), *range(271, 301)])
    np.testing.assert_allclose(speed.planned, 6e-3)
    np.testing.assert_allclose(speed.s, 6e-5 * np.arange(301))
    np.testing.assert_allclose(speed.speed[200:290], 6e-3)
    np.testing.assert_allclose(speed.speed[[145, 146, 155, 156]], [6e-3, 6.6e-3, 6.6e-3, 6e-3])
    np.testing.assert_allclose(speed.speed[:10], 0.0, atol=1e-12)


def test_plan_is_looked_up_where_the_arm_was_sent(path: TorchPath) -> None:
    """Twice as fast over the second half of the plan."""
    faster = replace(path, speed=np.where(path.s < 0.03, 6e-3, 12e-3))
    speed = speed_error(weld(path, np.full(900, 6e-3)), faster)
    assert speed is not None
    np.testing.assert_allclose(speed.planned[[100, 800]], [6e-3, 12e-3])
    assert speed.max == pytest.approx(0.5)


def test_windows_of_two_welds_end_where_their_arcs_do(path: TorchPath) -> None:
    """The torch stands still while the arc is out, and moves as asked from the first instant to the last of each weld."""
    on = np.ones(301, bool)
    on[120:180] = False
    speeds = np.where(on[:-1] & on[1:], 6e-3, 0.5)
    speed = speed_error(weld(path, speeds, on), path, SpeedRule(window=0.2, ramp=0.095))
    assert speed is not None
    assert speed.max < 1e-9
    assert len(speed.s) == 241
    np.testing.assert_array_equal(np.flatnonzero(~speed.judged), [*range(10), *range(110, 130), *range(231, 241)])


def test_no_arc_or_a_short_one_has_no_speed(path: TorchPath) -> None:
    log = weld(path, np.full(59, 6e-3))
    assert speed_error(log, path) is None, "0.59 s is shorter than its ramps of 0.3 s"
    assert speed_error(weld(path, np.full(62, 6e-3)), path) is not None
    assert speed_error(replace(log, arc_on=np.arange(60) == 5), path) is None
    assert speed_error(replace(log, arc_on=np.zeros(60, bool)), path) is None


def test_a_plan_that_stands_still_at_its_ends_goes_on_straight_beyond_them() -> None:
    planned = along_x(np.array([0.0, 0.0, 0.0, 0.05, 0.1, 0.1]))
    tip = np.array([[-0.01, 0.001, 0.0], [0.05, -0.002, 0.0], [0.11, 0.0, 0.003]])
    found = tracking_error(tip, planned)
    np.testing.assert_allclose(found.offsets.distance, [0.001, 0.002, 0.003], atol=1e-12)
    np.testing.assert_allclose(found.offsets.s, [-0.01, 0.05, 0.11], atol=1e-12)
    assert found.mean == pytest.approx(0.002)


def test_an_arc_that_is_out_for_one_instant_makes_two_pieces() -> None:
    x = 1e-3 * np.arange(101)
    on = np.ones(101, bool)
    on[50] = False
    path = TorchPath(
        X_BT=Transform("BT", np.tile(np.eye(3), (101, 1, 1)), along_x(x)),
        s=x,
        speed=np.full(101, 0.1),
        arc_on=on,
        segments=(Segment.WELD,) * 101,
    )
    found = torch_speed(log_of(along_x(x), x, on), path)
    assert found is not None
    t = PERIOD * np.arange(101)
    np.testing.assert_allclose(found.lit, np.where(t[on] < 0.5, 0.0, 0.51), atol=1e-12)
    np.testing.assert_allclose(found.out, np.where(t[on] < 0.5, 0.49, 1.0), atol=1e-12)
