"""plan_motion on random seams: the tip stays on the path, the speed is the path's, the limits hold, verdicts are true."""

from dataclasses import replace

import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, random_path, torch_path
from weldsim.curves import arc_length
from weldsim.errors import ConfigError, MotionError, UnreachableError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import inverse, torch_pose
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import MotionPlan, plan_motion
from weldsim.mounts import X_FT
from weldsim.path.config import PathConfig
from weldsim.path.plan import plan_path
from weldsim.records import JointTrajectory, Seam, Segment, TorchPath

MIDDLE = np.array([0.0, -0.48, 0.06])
DOWN = np.array([0.0, 0.0, -1.0])
LINE = flat_curve("line", 0.12) + MIDDLE


def _is(trajectory: JointTrajectory, segment: Segment) -> np.ndarray:
    return np.array([name == segment for name in trajectory.segments])


def _tip_errors(plan: MotionPlan) -> tuple[np.ndarray, np.ndarray]:
    """Distance [m] and wire angle [rad] from the rail of every sample but those in the air."""
    trajectory = plan.trajectory
    reached, asked = torch_pose(trajectory.q), plan.rail.at(trajectory.s)
    sine = np.linalg.norm(np.cross(reached.R[..., 2], asked.R[..., 2]), axis=1)
    rail = ~_is(trajectory, Segment.AIR)
    return np.linalg.norm(reached.p - asked.p, axis=1)[rail], np.arcsin(np.minimum(sine, 1.0))[rail]


@pytest.mark.parametrize(("seed", "kind"), [(s, k) for s in range(5) for k in ("line", "arc", "wave")])
def test_random_seam(seed: int, kind: str) -> None:
    path = random_path(seed, kind)
    config = MotionConfig()
    plan = plan_motion(path, START, config)
    trajectory = plan.trajectory
    distance, angle = _tip_errors(plan)
    # The rail runs straight between the path's poses, the joint spline rounds their corners.
    assert distance.max() <= 3e-5
    assert angle.max() <= config.axis_tolerance

    assert np.abs(trajectory.qd).max() <= config.joint_speed_limit
    assert np.abs(trajectory.qdd).max() <= config.joint_acceleration_limit
    air = _is(trajectory, Segment.AIR)
    assert np.abs(trajectory.qd[air]).max() <= config.joint_speed + 1e-6
    assert np.abs(trajectory.qdd[air]).max() <= config.joint_acceleration + 1e-6
    assert np.abs(trajectory.q).max() <= 2 * np.pi - config.limit_margin + 1e-6
    step = np.diff(trajectory.q, axis=0) / config.period
    assert np.abs(step).max() <= config.joint_speed_limit
    # Speeds are the derivative of angles, accelerations of speeds: trapezoids agree to second order.
    assert np.abs(step - (trajectory.qd[1:] + trajectory.qd[:-1]) / 2).max() < 2e-3
    change = np.diff(trajectory.qd, axis=0) / config.period
    assert np.abs(change - (trajectory.qdd[1:] + trajectory.qdd[:-1]) / 2).max() < 0.2

    weld = _is(trajectory, Segment.WELD)
    assert (trajectory.arc_on == weld).all()
    assert np.isclose(trajectory.s[weld].min(), 0.0, atol=1e-4)
    assert np.isclose(trajectory.s[weld].max(), path.s[-1], atol=1e-9)
    assert (np.diff(trajectory.s) >= 0).all()
    assert np.allclose(trajectory.q[[0, -1]], START, atol=1e-9)
    assert np.abs(trajectory.qd[[0, -1]]).max() < 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_torch_speed_is_constant_on_the_weld(seed: int) -> None:
    path = random_path(seed, ("line", "arc", "wave")[seed % 3])
    plan = plan_motion(path, START)
    trajectory = plan.trajectory
    weld = _is(trajectory, Segment.WELD) & (trajectory.s > 0.002) & (trajectory.s < path.s[-1] - 0.002)
    tip = torch_pose(trajectory.q[weld]).p
    speed = np.linalg.norm(tip[2:] - tip[:-2], axis=1) / (trajectory.t[2] - trajectory.t[0])
    assert plan.slowest == 1.0
    assert plan.ramp < 0.002
    assert np.abs(speed / path.speed[0] - 1).max() < 0.01


def _over_an_edge(angle: float, heading: float, middle: np.ndarray) -> Seam:
    """80 mm on either side of an edge that is rounded by 3 mm, faces `angle` [rad] apart; the edge is square to `heading` [rad]."""
    along = np.arange(-0.08, 0.08, 0.0005)
    tilt = angle * np.clip(along / (0.003 * angle), -0.5, 0.5)
    flat = np.stack([np.cos(tilt), 0 * tilt, -np.sin(tilt)], axis=1)
    points = np.cumsum(flat * 0.0005, axis=0)
    points -= points[len(points) // 2]
    turn = matrix_from_rotation_vector(np.array([0.0, 0.0, heading]))
    normals = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=1)
    points = points @ turn.T + middle
    return Seam(points_B=points, s=arc_length(points), tangents_B=flat @ turn.T, normals_B=normals @ turn.T)


@pytest.mark.parametrize("heading", [0.0, 0.8, 2.2])
@pytest.mark.parametrize("angle", [0.6, 1.2, 1.57])
def test_the_joints_do_not_slow_a_weld_over_an_edge_down(angle: float, heading: float) -> None:
    """The wire turns at the path's limit there, which takes an eighth of the joints' speed; it must not begin to do so at once."""
    seam = _over_an_edge(angle, heading, np.array([0.0, -0.5, 0.25]))
    plan = plan_motion(plan_path(seam), START)
    assert plan.slowest >= 0.95


@pytest.mark.parametrize("jerk", [60.0, 350.0])
@pytest.mark.parametrize("speed", [0.008, 0.05, 0.2])
@pytest.mark.parametrize("heading", [0.0, 2.2])
def test_a_wire_that_begins_to_turn_at_once_slows_the_weld_as_far_as_the_limits_ask_for(
    heading: float, speed: float, jerk: float
) -> None:
    """Passed at a steady speed such a bend leaves the joints all their acceleration and jerk: none is set aside for a ramp."""
    seam = _over_an_edge(1.2, heading, np.array([0.0, -0.5, 0.25]))
    config = MotionConfig(joint_jerk_limit=jerk)
    plan = plan_motion(plan_path(seam, PathConfig(smoothing=0.0, speed=speed)), START, config)
    trajectory = plan.trajectory
    most = np.abs(np.diff(trajectory.qdd, axis=0)).max() / config.period
    assert most <= jerk
    assert np.abs(trajectory.qdd).max() <= config.joint_acceleration_limit
    assert np.abs(trajectory.qd).max() <= config.joint_speed_limit
    tip = np.diff(trajectory.s) / config.period
    assert tip[_is(trajectory, Segment.WELD)[1:]].max() <= speed * (1 + 1e-6)
    if jerk == 350.0 and speed == 0.008:
        assert plan.slowest > 0.5


def test_speed_of_each_part_of_the_path() -> None:
    path = torch_path(LINE, DOWN)
    speed = np.where(path.s < 0.05, 0.004, 0.010)
    two = TorchPath(X_BT=path.X_BT, s=path.s, speed=speed, arc_on=path.arc_on, segments=path.segments)
    trajectory = plan_motion(two, START).trajectory
    weld = _is(trajectory, Segment.WELD)
    s, rate = trajectory.s[weld], np.gradient(trajectory.s[weld], 0.008)
    assert np.allclose(rate[(s > 0.002) & (s < 0.048)], 0.004, rtol=1e-3)
    assert np.allclose(rate[(s > 0.052) & (s < path.s[-1] - 0.002)], 0.010, rtol=1e-3)
    assert rate.max() <= 0.010 * (1 + 1e-6)


def test_roll_is_kept_where_it_is_not_free() -> None:
    path = torch_path(LINE, DOWN, roll_free=False)
    plan = plan_motion(path, START)
    weld = _is(plan.trajectory, Segment.WELD)
    reached, asked = torch_pose(plan.trajectory.q[weld]), plan.rail.at(plan.trajectory.s[weld])
    assert np.abs(reached.R - asked.R).max() < 1e-3


def test_full_circle_without_a_jump() -> None:
    angle = np.linspace(0, 2 * np.pi, 500)
    circle = np.stack([0.06 * np.cos(angle), 0.06 * np.sin(angle) - 0.48, np.full(500, 0.06)], axis=1)
    plan = plan_motion(torch_path(circle, DOWN), START)
    weld = _is(plan.trajectory, Segment.WELD)
    assert np.abs(np.diff(plan.trajectory.q[weld], axis=0)).max() < 0.01
    assert _tip_errors(plan)[0].max() < 3e-5


def test_path_with_leads_of_its_own_gets_no_others() -> None:
    n = len(LINE)
    above = np.linspace(LINE[0] + [0, 0, 0.03], LINE[0], 10)[:-1]
    after = np.linspace(LINE[-1], LINE[-1] + [0, 0, 0.02], 10)[1:]
    weld = torch_path(LINE, DOWN)
    R = np.concatenate([np.repeat(weld.X_BT.R[:1], 9, 0), weld.X_BT.R, np.repeat(weld.X_BT.R[-1:], 9, 0)])
    points = np.concatenate([above, LINE, after])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    segments = (Segment.APPROACH,) * 9 + (Segment.WELD,) * n + (Segment.RETRACT,) * 9
    on = np.array([segment == Segment.WELD for segment in segments])
    path = TorchPath(
        X_BT=Transform("BT", R, points), s=s, speed=np.where(on, 0.008, 0.05), arc_on=on, segments=segments, roll_free=True
    )
    plan = plan_motion(path, START)
    assert np.isclose(plan.rail.s[0], 0.0)
    assert np.isclose(plan.rail.s[-1], s[-1])
    weld_samples = _is(plan.trajectory, Segment.WELD)
    assert np.isclose(plan.trajectory.s[weld_samples].max(), s[9 + n - 1])
    assert (plan.trajectory.arc_on == weld_samples).all()


@pytest.mark.parametrize("speed", [0.1, 0.4, 1.0])
def test_limits_hold_and_slowness_is_said(speed: float) -> None:
    config = MotionConfig(joint_speed_limit=0.8, joint_acceleration_limit=2.0, joint_speed=0.8, joint_acceleration=2.0)
    plan = plan_motion(torch_path(flat_curve("wave", 0.2) + MIDDLE, DOWN, speed=speed), START, config)
    assert np.abs(plan.trajectory.qd).max() <= config.joint_speed_limit
    assert np.abs(plan.trajectory.qdd).max() <= config.joint_acceleration_limit
    if speed >= 0.4:
        assert plan.slowest < 1.0
        assert any("slow" in note for note in plan.notes)


@pytest.mark.parametrize("limit", [30.0, 350.0])
@pytest.mark.parametrize(("seed", "kind", "speed"), [(20, "wave", 0.008), (21, "arc", 0.25), (22, "wave", 0.1), (23, "line", 0.03)])
def test_jerk_is_never_exceeded(seed: int, kind: str, speed: float, limit: float) -> None:
    path = random_path(seed, kind)
    path = replace(path, speed=np.full(len(path.s), speed))
    config = MotionConfig(joint_jerk_limit=limit)
    trajectory = plan_motion(path, START, config).trajectory
    jerk = np.diff(trajectory.qdd, axis=0) / config.period
    assert np.abs(jerk).max() <= limit
    # The speed is asked for wherever it can be kept: a jerk limit of the default size never slows a weld.
    if limit == 350.0 and speed <= 0.03:
        weld = _is(trajectory, Segment.WELD)
        tip = np.diff(trajectory.s[weld]) / config.period
        inner = np.abs(trajectory.s[weld][1:] - path.s[-1] / 2) < 0.4 * path.s[-1]
        assert np.abs(tip[inner] / speed - 1).max() < 0.01


def _reachable(X_BT: Transform) -> bool:
    """Whether any of 180 rotations about the wire has a joint solution."""
    for roll in np.linspace(0, 2 * np.pi, 180, endpoint=False):
        turn = Transform.from_rotation_vector("TT", np.array([0.0, 0.0, roll]), np.zeros(3))
        if len(inverse(X_BT @ turn @ X_FT.inverse())):
            return True
    return False


@pytest.mark.parametrize("seed", range(4))
def test_unreachable_names_the_place(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-2.2, -0.9)
    outward = np.array([np.cos(angle), np.sin(angle), 0.0])
    points = np.linspace(0.5 * outward, 1.3 * outward, 800) + np.array([0.0, 0.0, rng.uniform(0.02, 0.1)])
    path = torch_path(points, DOWN)
    with pytest.raises(UnreachableError) as caught:
        plan_motion(path, START)
    s, index = caught.value.data["s"], caught.value.data["index"]
    assert abs(path.s[index] - s) < 1.1e-3
    assert f"{1e3 * s:.1f} mm" in str(caught.value)
    assert _reachable(path.X_BT[index - 5])
    assert not _reachable(path.X_BT[index + 5])


def test_everything_out_of_reach_fails_at_the_lead_in() -> None:
    with pytest.raises(UnreachableError, match="lead-in") as caught:
        plan_motion(torch_path(LINE + np.array([0.0, -1.0, 0.0]), DOWN), START)
    assert caught.value.data["index"] == 0


def test_turn_in_place_and_empty_weld_are_refused() -> None:
    path = torch_path(LINE, DOWN)
    R, p = np.array(path.X_BT.R), np.array(path.X_BT.p)
    p[50] = p[49]
    R[50] = R[50] @ np.diag([-1.0, -1.0, 1.0])
    with pytest.raises(MotionError, match="pose 50"):
        plan_motion(
            TorchPath(X_BT=Transform("BT", R, p), s=path.s, speed=path.speed, arc_on=path.arc_on, segments=path.segments), START
        )
    still = Transform("BT", path.X_BT.R[:2], np.repeat(p[:1], 2, axis=0))
    with pytest.raises(MotionError, match="no length"):
        plan_motion(
            TorchPath(X_BT=still, s=np.zeros(2), speed=np.ones(2), arc_on=np.ones(2, bool), segments=(Segment.WELD,) * 2), START
        )


@pytest.mark.parametrize("bad", [np.nan, np.inf, 6.4, -7.0])
def test_start_beyond_the_stops_is_refused(bad: float) -> None:
    with pytest.raises(MotionError, match="elbow"):
        plan_motion(torch_path(LINE, DOWN), np.where(np.arange(6) == 2, bad, START))


def test_what_is_blocked_is_not_used() -> None:
    path = torch_path(LINE, DOWN)
    free = plan_motion(path, START).trajectory
    middle = free.q[list(free.segments).index(Segment.APPROACH) // 2]
    ball, radius = torch_pose(middle).p, 0.03

    def blocked(q: np.ndarray) -> str | None:
        return "torch touches ball" if np.linalg.norm(torch_pose(q).p - ball) < radius else None

    assert blocked(middle)
    found = plan_motion(path, START, blocked=blocked).trajectory
    # Between looks the tip moves on by at most a few millimetres.
    assert np.linalg.norm(torch_pose(found.q).p - ball, axis=1).min() > radius - 0.005


def test_all_blocked_says_by_what() -> None:
    path = torch_path(LINE, DOWN)
    with pytest.raises(MotionError, match="start: torch touches clamp"):
        plan_motion(path, START, blocked=lambda _: "torch touches clamp")
    with pytest.raises(MotionError, match="torch touches clamp"):
        plan_motion(path, START, blocked=lambda q: "torch touches clamp" if np.abs(q - START).max() > 0.5 else None)


def test_the_arm_goes_around_a_ring() -> None:
    angle = np.linspace(0, 2 * np.pi, 181)
    points = np.array([0.0, -0.45, 0.1]) + 0.06 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points[-1] = points[0]
    travel = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (len(angle), 1))
    seam = Seam(points_B=points, s=arc_length(points), tangents_B=travel, normals_B=up, closed=True)
    motion = plan_motion(plan_path(seam), START)
    weld = _is(motion.trajectory, Segment.WELD)
    assert motion.position_error < 0.05e-3
    # Rotation about the wire is free, so no joint is wound up on the way around.
    assert np.abs(motion.trajectory.q[weld][-1] - motion.trajectory.q[weld][0]).max() < 0.02


@pytest.mark.parametrize("name", ["period", "tip_acceleration", "joint_speed", "joint_jerk", "grid", "limit_margin", "tip_jerk"])
@pytest.mark.parametrize("value", [1e-9, 1e9])
def test_limits_of_no_use_to_an_arm_are_refused_at_once(name: str, value: float) -> None:
    if name == "limit_margin" and value < 1:
        value = -1.0
    with pytest.raises(ConfigError, match=f"motion.{name}"):
        MotionConfig(**{name: value})
