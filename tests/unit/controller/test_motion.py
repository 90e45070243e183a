"""How programs move the arm: where they end, how fast, and what they refuse."""

import itertools

import numpy as np
import pytest

from tests.controllers import new_machine, run_program
from weldsim.controller.machine import Machine
from weldsim.controller.trapezoid import Trapezoid
from weldsim.execution.ur_modes import RuntimeState, SafetyMode
from weldsim.frames import Transform
from weldsim.kinematics import SPEED_LIMIT, flange_pose
from weldsim.scene.world import HOME

SERIES = ("cb3", "e")


@pytest.fixture(params=SERIES)
def machine(request: pytest.FixtureRequest) -> Machine:
    return new_machine(request.param)


def numbers(values) -> str:
    return ", ".join(f"{value:.9f}" for value in values)


def home_pose() -> list[float]:
    X_BF = flange_pose(HOME)
    return [*X_BF.p, *X_BF.rotation_vector]


def follow(machine: Machine, text: str, seconds: float = 10.0) -> tuple[np.ndarray, np.ndarray]:
    """Reference angles and speeds of every period of a program, and of the half second after it."""
    assert machine.upload(text), machine.log[-1]
    q, qd = [machine.reference.q], [machine.reference.qd]
    end = machine.t + seconds
    rest = 0.5
    while machine.t < end and rest > 0:
        machine.tick()
        q.append(machine.reference.q)
        qd.append(machine.reference.qd)
        rest -= 0 if machine.program_name else machine.profile.period
    return np.array(q), np.array(qd)


@pytest.mark.parametrize("seed", range(2))
def test_movej_gets_there_on_time_with_all_joints_together(machine, seed):
    random = np.random.default_rng(seed)
    target = HOME + random.uniform(-0.4, 0.4, 6)
    v, a = random.uniform(0.2, 1.5), random.uniform(0.5, 4.0)
    q, qd = follow(machine, f"movej([{numbers(target)}], a={a:.12f}, v={v:.12f})")
    np.testing.assert_allclose(q[-1], target, atol=1e-8)
    np.testing.assert_allclose(machine.arm.q, target, atol=3e-4)
    assert np.abs(qd).max() <= v + 1e-9
    assert np.abs(np.diff(qd, axis=0)).max() / machine.profile.period <= a * 1.01
    way = (q - HOME) / (target - HOME)  # the share of its way that each joint has gone
    assert np.abs(way - way[:, :1]).max() < 1e-6
    moving = np.flatnonzero(np.abs(qd).max(axis=1)).size * machine.profile.period
    assert moving == pytest.approx(Trapezoid(np.abs(target - HOME).max(), v, a).duration, abs=3 * machine.profile.period)


def test_movej_takes_the_time_it_is_given(machine):
    target = HOME + 0.2
    _, qd = follow(machine, f"movej([{numbers(target)}], t=1.5)")
    assert np.flatnonzero(np.abs(qd).max(axis=1)).size * machine.profile.period == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize("seed", range(2))
def test_movel_stays_on_its_line_at_its_speed(machine, seed):
    random = np.random.default_rng(seed)
    start = flange_pose(HOME)
    goal = np.array(home_pose())
    goal[:3] += random.uniform(-0.08, 0.08, 3)
    v = random.uniform(0.05, 0.2)
    q, _ = follow(machine, f"movel(p[{numbers(goal)}], a=1.0, v={v:.12f})")
    poses = flange_pose(q)
    way = goal[:3] - start.p
    along = (poses.p - start.p) @ way / (way @ way)
    np.testing.assert_allclose(poses.p, start.p + along[:, None] * way, atol=1e-6)
    np.testing.assert_allclose(poses.p[-1], goal[:3], atol=1e-6)
    np.testing.assert_allclose(poses.R, np.broadcast_to(start.R, poses.R.shape), atol=1e-6)
    speed = np.linalg.norm(np.diff(poses.p, axis=0), axis=1) / machine.profile.period
    assert speed.max() <= v * 1.001


def test_servoj_follows_late_by_its_lookahead_and_stops_at_the_end(machine):
    rate, h = 0.1, machine.profile.period
    lookahead = 0.1
    text = f"""
def p():
  q = [{numbers(HOME)}]
  i = 0
  while i < {round(1.0 / h)}:
    q[0] = q[0] + {rate * h}
    servoj(q, t={h}, lookahead_time={lookahead}, gain=300)
    i = i + 1
  end
end"""
    q, _ = follow(machine, text)
    last = round(1.0 / h)
    goal = HOME[0] + rate * h * np.arange(1, last + 1)
    lag = (goal - q[1 : last + 1, 0])[last // 2 :] / rate
    assert lag == pytest.approx(lookahead, abs=2 * h)
    assert max(abs(speed) for speed in machine.reference.qd) == 0.0


@pytest.mark.parametrize("axis", range(6))
def test_speedl_moves_the_tcp_and_stopl_rests(machine, axis):
    xd = [0.0] * 6
    xd[axis] = 0.04 if axis < 3 else 0.2
    q, _ = follow(machine, f"set_tcp(p[0, 0, 0.1, 0, 0, 0])\nspeedl([{numbers(xd)}], a=0.8, t=0.6)\nstopl(1.0)")
    X_FT = Transform("FT", np.eye(3), np.array([0.0, 0.0, 0.1]))
    k = round(0.4 / machine.profile.period)
    X = [flange_pose(q[i]) @ X_FT for i in (k, k + 1)]
    velocity = (X[1].p - X[0].p) / machine.profile.period
    turn = Transform("BB", X[1].R @ X[0].R.T, np.zeros(3)).rotation_vector / machine.profile.period
    np.testing.assert_allclose([*velocity, *turn], xd, atol=2e-3)
    np.testing.assert_allclose(q[-1], q[-2], atol=1e-12)


@pytest.mark.parametrize("move", ["movej(get_target_joint_positions())", "movel(get_target_tcp_pose())", "stopj(2)", "stopl(2)"])
def test_move_to_where_the_arm_is_takes_a_period(machine, move):
    assert machine.upload(f"while True:\n {move}\nend")
    for _ in range(10):
        machine.tick()
    assert machine.runtime is RuntimeState.PLAYING, machine.log[-1]


def test_arm_rests_in_time_when_its_program_is_stopped(machine):
    assert machine.upload("while True:\n speedj([2.5, 0, 0, 0, 0, 0], 8, 0.1)\nend")
    for _ in range(round(0.6 / machine.profile.period)):
        machine.tick()
    assert machine.arm.qd[0] == pytest.approx(2.5, abs=0.05)
    machine.stop_program()
    for _ in range(round(0.3 / machine.profile.period)):
        machine.tick()
    assert max(abs(speed) for speed in machine.arm.qd) < 0.01


def test_pause_and_play_end_where_the_move_was_to_end(machine):
    target = HOME + 0.3
    assert machine.upload(f"movej([{numbers(target)}], v=0.5)")
    for _ in range(round(0.4 / machine.profile.period)):
        machine.tick()
    assert machine.pause()
    for _ in range(round(0.4 / machine.profile.period)):
        machine.tick()
    held = list(machine.reference.q)
    assert machine.reference.resting
    assert machine.runtime is RuntimeState.PAUSED
    assert machine.play()
    for _ in range(round(4 / machine.profile.period)):
        machine.tick()
    assert np.abs(np.array(held) - target).max() > 0.05
    np.testing.assert_allclose(machine.reference.q, target, atol=1e-8)


def test_slider_slows_a_move_down(machine):
    target = HOME + np.array([0.2, 0, 0, 0, 0, 0])
    text = f"movej([{numbers(target)}], v=0.4, a=4)"
    fast = run_program(machine, text)
    machine.io.slider = 0.5
    for _ in range(round(0.2 / machine.profile.period)):
        machine.tick()  # the pace follows the slider gradually
    slow = run_program(machine, f"movej([{numbers(HOME)}], v=0.4, a=4)")
    assert slow == pytest.approx(2 * fast, rel=0.1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("movel(p[3, 0, 0, 0, 0, 0])", "cannot reach"),
        ("movej([1, 2])", "expected six numbers"),
        ("movej([0, 0, 0, 0, 0, 1 / 0])", "division by zero"),
        ("movej(get_actual_joint_positions(), a=-1)", "must be positive"),
        ("servoj(get_actual_joint_positions(), lookahead_time=1)", "outside 0.03 to 0.2"),
        ("get_inverse_kin(p[3, 0, 0, 0, 0, 0])", "no joint angles"),
    ],
)
def test_what_the_arm_cannot_do_ends_the_program_and_moves_nothing(machine, text, said):
    run_program(machine, text, 1.0)
    assert said in " ".join(message for _, message in machine.log)
    assert machine.runtime is RuntimeState.STOPPED
    np.testing.assert_allclose(machine.arm.q, HOME, atol=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "speedl([0, -0.25, 0, 0, 0, 0], a=1, t=8)",  # out to where the arm is stretched
        "servoj([7, 0, 0, 0, 0, 0], t=9)",  # beyond the range of joint 0
    ],
)
def test_a_motion_that_cannot_go_on_is_a_protective_stop_within_limits(machine, text):
    assert machine.upload(text)
    speeds = []
    for _ in range(round(4 / machine.profile.period)):
        machine.tick()
        speeds.append(max(abs(speed) for speed in machine.reference.qd))
    assert machine.safety_mode is SafetyMode.PROTECTIVE_STOP
    assert max(speeds) <= SPEED_LIMIT * 1.05
    assert machine.reference.resting


def test_two_threads_cannot_move_the_arm(machine):
    text = """
def p():
  thread other():
    while True: speedj([0.1, 0, 0, 0, 0, 0], 1, 0.1) end
  end
  run other()
  movej(get_actual_joint_positions())
  speedj([0, 0.1, 0, 0, 0, 0], 1, 1)
end"""
    run_program(machine, text, 3.0)
    assert "another thread" in " ".join(message for _, message in machine.log)


def test_trapezoid_covers_its_distance_within_its_limits():
    random = np.random.default_rng(0)
    for distance, speed, acceleration in random.uniform(0.01, 3.0, (60, 3)):
        profile = Trapezoid(distance, speed, acceleration)
        t = np.linspace(0, profile.duration * 1.1, 400)
        s, v = np.array([profile.at(x) for x in t]).T
        assert s[-1] == distance
        assert (np.diff(s) >= -1e-12).all()
        assert v.max() <= speed * (1 + 1e-12)
        np.testing.assert_allclose(np.gradient(s, t)[5:-60:10], v[5:-60:10], atol=0.02 * speed + acceleration * t[1])


def test_trapezoid_lasts_as_long_as_asked():
    for distance, duration, acceleration in itertools.product((0.01, 1.0), (0.1, 3.0), (0.5, 20.0)):
        assert Trapezoid.lasting(distance, duration, acceleration).duration == pytest.approx(duration)


@pytest.mark.parametrize("series", ["cb3", "e"])
def test_a_joint_driven_into_the_end_of_its_range_stops_there(series):
    machine = new_machine(series)
    start = machine.arm.q[0]
    assert machine.upload("speedj([-3.0, 0, 0, 0, 0, 0], 20.0, 5.0)")
    for _ in range(round(6.0 / machine.profile.period)):
        machine.tick()
    assert machine.safety_mode is SafetyMode.PROTECTIVE_STOP
    assert "beyond its range" in " ".join(text for _, text in machine.log)
    assert -2 * np.pi - 0.01 < machine.arm.q[0] < start - 4.0
    assert max(map(abs, machine.arm.qd)) < 1e-2


@pytest.mark.parametrize("line", ["movej([7, -1.3, -1.9, -1.5, 1.57, 0])", "movel([0, -1.3, -1.9, -1.5, 1.57, -6.4])"])
def test_a_target_beyond_a_joints_range_is_refused_before_it_moves(line):
    machine = new_machine()
    run_program(machine, f"def job():\n  {line}\nend")
    assert "its range is" in machine.log[-1][1]
    assert machine.safety_mode is SafetyMode.NORMAL
    np.testing.assert_allclose(machine.arm.q, HOME, atol=1e-3)


def arc_of(machine: Machine, q: np.ndarray) -> np.ndarray:
    """Flange positions along joint angles."""
    tcp = machine.tool.tcp_matrix
    return np.array([machine.kinematics.tcp_pose(row, tcp) for row in q.tolist()])


@pytest.mark.parametrize("mode", [0, 1])
def test_movec_keeps_to_its_circle(mode):
    machine, random = new_machine("cb3"), np.random.default_rng(mode)
    x, y, z, *turn = start = home_pose()
    radius, plane = random.uniform(0.03, 0.08), random.uniform(0, np.pi)
    across = np.array([np.cos(plane), 0.0, np.sin(plane)])
    centre = np.array([x, y, z]) + radius * across

    def on_circle(angle: float) -> np.ndarray:
        return centre + radius * (-np.cos(angle) * across + np.sin(angle) * np.array([0.0, -1.0, 0.0]))

    angle = random.uniform(2.0, 4.0)
    via, end = ([*on_circle(share * angle), *turn] for share in (random.uniform(0.3, 0.7), 1.0))
    q, _ = follow(machine, f"movec(p[{numbers(via)}], p[{numbers(end)}], a=1.0, v=0.08, mode={mode})", 20.0)
    poses = arc_of(machine, q)
    np.testing.assert_allclose(poses[-1, :3], end[:3], atol=1e-7)
    leg = poses[:, :3] - centre
    np.testing.assert_allclose(np.linalg.norm(leg, axis=1), radius, atol=1e-6)
    np.testing.assert_allclose(leg @ np.array([-across[2], 0.0, across[0]]), 0.0, atol=1e-6)
    speed = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1) / machine.profile.period
    assert speed.max() == pytest.approx(0.08, rel=0.01)
    turned = np.linalg.norm(np.diff(arc_of(machine, q[[0, -1]])[:, 3:], axis=0))
    assert (turned < 1e-6) == (mode == 0)
    assert start[:3] != end[:3]


def test_movec_goes_on_after_a_pause():
    machine = new_machine("cb3")
    x, y, z, *turn = home_pose()
    via, end = [x + 0.05, y, z + 0.05, *turn], [x + 0.1, y, z, *turn]
    assert machine.upload(f"movec(p[{numbers(via)}], p[{numbers(end)}], v=0.1)")
    poses = []
    for k in range(round(4.0 / machine.profile.period)):
        if k == round(1.1 / machine.profile.period):  # beyond `via`
            machine.pause()
        if k == round(1.6 / machine.profile.period):
            machine.play()
        machine.tick()
        poses.append(machine.kinematics.tcp_pose(machine.reference.q, machine.tool.tcp_matrix))
    assert (machine.safety_mode, machine.runtime) == (SafetyMode.NORMAL, RuntimeState.STOPPED)
    np.testing.assert_allclose(poses[-1][:3], end[:3], atol=1e-7)
    off = np.linalg.norm(np.array(poses)[:, :3] - [x + 0.05, y, z], axis=1) - 0.05
    assert np.abs(off).max() < 1e-3


def test_movec_on_a_line_or_out_of_reach_is_refused(machine):
    x, y, z, *turn = home_pose()
    for via, end, word in (
        ([x + 0.05, y, z, *turn], [x + 0.1, y, z, *turn], "no circle"),
        ([x + 2.0, y, z, *turn], [x + 0.1, y, z, *turn], "cannot reach"),
    ):
        run_program(machine, f"movec(p[{numbers(via)}], p[{numbers(end)}])")
        assert word in machine.log[-1][1]
        assert machine.safety_mode is SafetyMode.NORMAL
