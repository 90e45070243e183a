"""Runs a joint trajectory on a gated robot and returns what the robot did."""

import gc
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import ExecutionError, Interrupted
from weldsim.execution.config import ExecutionConfig
from weldsim.execution.gate import SafetyGate
from weldsim.execution.resample import at_period, started_at
from weldsim.frames import Transform
from weldsim.records import Event, ExecutionLog, JointTrajectory, RobotState, Segment

Progress = Callable[[float], None]
"""Told the fraction done, 0 to 1, a few times a second of robot time."""


@dataclass(eq=False)
class _Recorder:
    """Rows of the log as they come."""

    robot: SafetyGate
    states: list[RobotState] = field(default_factory=list)
    commands: list[Float[ndarray, "6"]] = field(default_factory=list)
    torques: list[Float[ndarray, "6"] | None] = field(default_factory=list)
    arcs: list[bool] = field(default_factory=list)
    labels: list[tuple[float, Segment]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def add(self, sent: Float[ndarray, "6"], s: float, segment: Segment) -> None:
        """The state now, and those before it that nobody had time to look at, which belong to the command before."""
        state, arc = self.robot.state(), self.robot.arc
        passed = self.robot.passed_over()
        if self.states:
            for earlier, burning in passed:
                self._row(earlier, burning, self.commands[-1], *self.labels[-1])
        self._row(state, arc, sent, s, segment)
        self.events.extend(self.robot.events())

    def end(self) -> None:
        """What the robot has reported on its way to rest."""
        now = self.robot.state(), self.robot.arc
        for state, burning in (*self.robot.passed_over(), now):
            if state.t > self.states[-1].t:
                self._row(state, burning, self.commands[-1], *self.labels[-1])
        self.events.extend(self.robot.events())

    def _row(self, state: RobotState, arc: bool, sent: Float[ndarray, "6"], s: float, segment: Segment) -> None:
        if arc != (self.arcs[-1] if self.arcs else False):
            self.events.append(Event(t=state.t, kind="arc", text=f"arc {'on' if arc else 'off'} at s = {1e3 * s:.1f} mm"))
        if not self.labels or self.labels[-1][1] != segment:
            self.events.append(Event(t=state.t, kind="segment", text=f"{segment.value} begins"))
        self.states.append(state)
        self.commands.append(sent)
        self.torques.append(self.robot.torque())
        self.arcs.append(arc)
        self.labels.append((s, segment))

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
    robot: SafetyGate, trajectory: JointTrajectory, config: ExecutionConfig | None = None, progress: Progress | None = None
) -> ExecutionLog:
    """What a connected robot did when sent the trajectory, one row a period of the robot; after a stop, down to rest.

    The arc burns only where the trajectory says so, its segment is WELD and the gate permits it; it is off when this returns,
    however it does. Every command is checked before the first is sent, and again as it is.

    Args:
        robot: behind its gate; another is not taken.
        trajectory: at any period; a start up to the gate's tolerance away from where the arm stands is led over smoothly.
        config: settling and blending.  progress: told of it.
    Raises:
        ExecutionError: the robot has no gate, the arm does not stand where the trajectory starts, a command breaks a rule,
            or the robot stopped; `data`: rule, value, limit, t, and `log` with what was done until then.
        Interrupted: by Ctrl-C; the arm was stopped first. The message says where the black box is, `log` has what was done.
    """
    if not isinstance(robot, SafetyGate):
        raise ExecutionError("no robot is moved without its safety gate: execute(SafetyGate(robot), ...)", rule="gate")
    config = config or ExecutionConfig()
    trajectory = at_period(trajectory, robot.period)
    robot.check(trajectory)
    trajectory = started_at(trajectory, robot.state().q, config.blend)
    robot.check(trajectory)
    robot.start_from(trajectory.q[0])
    recorder = _Recorder(robot)
    recorder.add(trajectory.q[0], float(trajectory.s[0]), trajectory.segments[0])
    last = len(trajectory.t) - 1
    collects = gc.isenabled()
    gc.disable()  # a sweep through all that a long log holds takes longer than a robot waits for its next command
    try:
        for k in range(1, last + 1 + round(config.settle / robot.period)):
            i = min(k, last)
            robot.label(trajectory.segments[i], float(trajectory.s[i]))
            robot.set_arc(robot.arc_permitted and bool(trajectory.arc_on[i]) and k <= last)
            sent = robot.servo(trajectory.q[i], trajectory.qd[i] if k <= last else np.zeros(6))
            recorder.add(sent, float(trajectory.s[i]), trajectory.segments[i])
            if progress is not None and k % 32 == 0:
                progress(min(1.0, k / last))
    except ExecutionError as error:  # the gate has stopped the arm
        recorder.end()
        error.data["log"] = recorder.log()
        raise
    except KeyboardInterrupt as interrupt:
        robot.stop()
        recorder.end()
        box = "" if robot.black_box is None else f"; black box: {robot.black_box}"
        s, segment = recorder.labels[-1]
        where = f"; it was at s = {1e3 * s:.1f} mm of the {segment.value}"
        raise Interrupted(f"interrupted: the arc is off and the arm was stopped{box}{where}", recorder.log()) from interrupt
    except BaseException:
        robot.stop()
        raise
    finally:
        if collects:
            gc.enable()
        robot.set_arc(False)
    return recorder.log()
