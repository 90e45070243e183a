"""Runs a joint trajectory on a robot and returns what the robot did."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import CubicHermiteSpline

from weldsim.errors import ExecutionError
from weldsim.execution.config import ExecutionConfig
from weldsim.execution.robot import Robot
from weldsim.frames import Transform
from weldsim.records import Event, ExecutionLog, JointTrajectory, RobotState, Segment

Progress = Callable[[float], None]
"""Told the fraction done, 0 to 1, a few times a second of robot time."""

SAME_PERIOD = 1e-9  # [s]


@dataclass(eq=False)
class _Recorder:
    """Rows of the log as they come."""

    robot: Robot
    states: list[RobotState] = field(default_factory=list)
    commands: list[Float[ndarray, "6"]] = field(default_factory=list)
    torques: list[Float[ndarray, "6"] | None] = field(default_factory=list)
    arcs: list[bool] = field(default_factory=list)
    labels: list[tuple[float, Segment]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def add(self, sent: Float[ndarray, "6"], s: float, segment: Segment) -> None:
        state = self.robot.state()
        arc = self.robot.arc
        if arc != (self.arcs[-1] if self.arcs else False):
            self.events.append(Event(t=state.t, kind="arc", text=f"arc {'on' if arc else 'off'} at s = {1e3 * s:.1f} mm"))
        if not self.labels or self.labels[-1][1] != segment:
            self.events.append(Event(t=state.t, kind="segment", text=f"{segment.value} begins"))
        self.states.append(state)
        self.commands.append(sent)
        self.torques.append(self.robot.torque())
        self.arcs.append(arc)
        self.labels.append((s, segment))
        self.events.extend(self.robot.events())

    def log(self) -> ExecutionLog:
        states = self.states
        poses = [state.X_BT for state in states]
        torques = [torque for torque in self.torques if torque is not None]
        return ExecutionLog(
            t=np.array([state.t for state in states]),
            q_cmd=np.stack(self.commands),
            q_act=np.stack([state.q for state in states]),
            qd_act=np.stack([state.qd for state in states]),
            X_BT_act=Transform("BT", np.stack([X.R for X in poses]), np.stack([X.p for X in poses])),
            s_cmd=np.array([s for s, _ in self.labels]),
            arc_on=np.array(self.arcs),
            segments=tuple(segment for _, segment in self.labels),
            period=self.robot.period,
            robot=self.robot.name,
            torque=np.stack(torques) if len(torques) == len(states) else None,
            events=tuple(sorted(self.events, key=lambda event: event.t)),
        )


def execute(
    robot: Robot, trajectory: JointTrajectory, config: ExecutionConfig | None = None, progress: Progress | None = None
) -> ExecutionLog:
    """What a connected robot did when sent the trajectory, one row a period of the robot.

    The arc burns only where the trajectory says so and its segment is WELD; it is off when this returns, however it does.

    Raises:
        ExecutionError: the arm does not stand where the trajectory starts, the trajectory asks for the arc outside WELD,
            or the robot stopped; `data`: rule, value, limit, t, and `log` with what was done until then.
    """
    config = config or ExecutionConfig()
    trajectory = at_period(trajectory, robot.period)
    _check_start(robot.state(), trajectory, config)
    recorder = _Recorder(robot)
    recorder.add(trajectory.q[0], float(trajectory.s[0]), trajectory.segments[0])
    last = len(trajectory.t) - 1
    try:
        for k in range(1, last + 1 + round(config.settle / robot.period)):
            i = min(k, last)
            robot.set_arc(bool(trajectory.arc_on[i]) and k <= last)
            sent = robot.servo(trajectory.q[i], trajectory.qd[i] if k <= last else np.zeros(6))
            recorder.add(sent, float(trajectory.s[i]), trajectory.segments[i])
            if progress is not None and k % 32 == 0:
                progress(min(1.0, k / last))
    except ExecutionError as error:
        robot.stop()
        recorder.events.append(Event(t=robot.state().t, kind="stop", text=str(error)))
        error.data["log"] = recorder.log()
        raise
    finally:
        robot.set_arc(False)
    return recorder.log()


def _check_start(state: RobotState, trajectory: JointTrajectory, config: ExecutionConfig) -> None:
    """Nothing moves from the wrong place, and no arc is asked for outside the weld."""
    away = np.abs(state.q - trajectory.q[0])
    joint = int(away.argmax())
    if away[joint] > config.start_tolerance:
        raise ExecutionError(
            f"start: {trajectory.joint_names[joint]} stands {np.rad2deg(away[joint]):.2f} deg from the trajectory's first point"
            f" (limit {np.rad2deg(config.start_tolerance):.2f} deg); plan again from where the arm is",
            rule="start",
            value=float(away[joint]),
            limit=config.start_tolerance,
            t=state.t,
        )
    weld = np.array([segment == Segment.WELD for segment in trajectory.segments])
    stray = np.flatnonzero(trajectory.arc_on & ~weld)
    if len(stray):
        t = float(trajectory.t[stray[0]])
        raise ExecutionError(
            f"trajectory: the arc is on at {t:.3f} s, in {trajectory.segments[stray[0]].value}; it may burn in weld alone",
            rule="arc",
            t=t,
        )


def at_period(trajectory: JointTrajectory, period: float) -> JointTrajectory:
    """The trajectory resampled to a robot's period, by cubics through its angles and speeds; itself if it fits already."""
    t = trajectory.t
    if len(t) < 2 or np.abs(np.diff(t) - period).max() < SAME_PERIOD:
        return trajectory
    at = np.append(np.arange(0.0, t[-1] - t[0], period), t[-1] - t[0] if (t[-1] - t[0]) % period < SAME_PERIOD else np.zeros(0))
    if at[-1] < t[-1] - t[0] - SAME_PERIOD:
        at = np.append(at, at[-1] + period)
    inside = np.minimum(at, t[-1] - t[0]) + t[0]
    spline = CubicHermiteSpline(t, trajectory.q, trajectory.qd)
    # A sample belongs to the move that is under way, as in the trajectory itself: rounded up to the next one.
    label = np.clip(np.searchsorted(t, inside - SAME_PERIOD), 0, len(t) - 1)
    return JointTrajectory(
        t=at,
        q=spline(inside),
        qd=spline(inside, 1),
        qdd=np.stack([np.interp(inside, t, column) for column in trajectory.qdd.T], axis=1),
        s=np.interp(inside, t, trajectory.s),
        arc_on=trajectory.arc_on[label],
        segments=tuple(trajectory.segments[i] for i in label),
        joint_names=trajectory.joint_names,
    )
