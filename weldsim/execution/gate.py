"""The safety gate: a robot around any robot, which lets through what keeps to its rules and stops the arm at what does not.

Nothing is clipped or repaired on the way: a command goes through as it is, or the arc is dropped, the arm brought to rest, and
`ExecutionError` says which rule, value and limit, when and where on the path.
"""

from collections import deque
from pathlib import Path
from typing import NoReturn, final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.errors import ExecutionError, WeldsimError
from weldsim.execution.black_box import BlackBox, BlackBoxRow
from weldsim.execution.config import GateConfig
from weldsim.execution.limits import HISTORY, Breach, motion_breach, off_the_way
from weldsim.execution.robot import Robot
from weldsim.kinematics import JOINT_NAMES
from weldsim.records import Event, JointTrajectory, RobotFacts, RobotState, Segment

PASSED = 4000  # states kept for `passed_over`: 8 s at 500 Hz


@final
class SafetyGate(Robot):
    """A robot that obeys the rules of `GateConfig`, whatever is asked of it.

    Attributes:
        inner: the robot behind it.  config: the rules.  arc_permitted: whether the arc may burn at all.
        arm: by whose kinematics the torch tip is judged, of commands and of reports alike; where the robot tells its own figures,
            theirs (`contract.own_arm`), before anything is commanded.
        black_box: where the last one was written, or None.
    """

    def __init__(
        self,
        inner: Robot,
        config: GateConfig | None = None,
        *,
        arc: bool = False,
        folder: Path | None = None,
        arm: Arm = UR5,
    ) -> None:
        """Args: inner, not yet connected; arc, permission to burn; folder, for black boxes, none where None; arm, kinematics."""
        if isinstance(inner, SafetyGate):
            raise ExecutionError(f"{inner.name}: stands behind a gate already", rule="gate")
        self.inner, self.config, self.arc_permitted = inner, config or GateConfig(), arc
        self.name, self.period = inner.name, inner.period
        self.black_box: Path | None = None
        self._folder, self.arm = folder, arm
        self._events: list[Event] = []
        self._passed: deque[tuple[RobotState, bool]] = deque(maxlen=PASSED)
        self._looked: tuple[RobotState, bool] | None = None  # the newest that the gate itself has seen
        self._shown: RobotState | None = None  # the newest that the caller has seen
        self._connected, self._asked, self._segment, self._s = False, False, Segment.AIR, 0.0
        self._forget()

        self._box = BlackBox(self.config.memory, inner.period, inner.name)

    def _forget(self) -> None:
        """Before the first command, and after a stop: the arm is at rest, and the next command must be where it stands."""
        n = max(2, round(self.config.lag / self.period))
        self._sent: deque[tuple[ndarray, ndarray, ndarray]] = deque(maxlen=HISTORY)  # q, qd, tip
        self._way: deque[tuple[ndarray, ndarray]] = deque(maxlen=n)  # q, tip
        self._origin: Float[ndarray, "6"] | None = None
        self._stamp, self._same, self._lingers = -np.inf, 0, 0

    def connect(self) -> None:
        self.inner.connect()
        self._connected = True
        if self.inner.period != self.period:  # which some learn only now
            self.period = self.inner.period
            self._box = BlackBox(self.config.memory, self.period, self.name)
        self._passed.clear()
        self._looked = self._shown = None
        self.inner.passed_over()  # what is left of an earlier connection
        self._forget()

    def disconnect(self) -> None:
        self._connected, self._asked = False, False
        self.inner.disconnect()

    def __enter__(self) -> "SafetyGate":
        self.connect()
        return self

    def state(self) -> RobotState:
        self._shown = self.inner.state()
        return self._shown

    def facts(self) -> RobotFacts:
        return self.inner.facts()

    def torque(self) -> Float[ndarray, "6"] | None:
        return self.inner.torque()

    def passed_over(self) -> tuple[tuple[RobotState, bool], ...]:
        """The inner robot's, and those that the gate alone has looked at."""
        self._catch_up()
        shown = self._shown
        if shown is None:
            return ()
        if self._looked is None or shown.t > self._looked[0].t:
            self._see(shown, *self._command(shown))
        passed = tuple(pair for pair in self._passed if pair[0].t < shown.t)
        self._passed = deque((pair for pair in self._passed if pair[0].t > shown.t), PASSED)
        return passed

    def events(self) -> tuple[Event, ...]:
        """The inner robot's, and the gate's own: stops."""
        self._keep(self.inner.events())
        happened, self._events = tuple(self._events), []
        return happened

    @property
    def arc(self) -> bool:
        return self.inner.arc

    def label(self, segment: Segment, s: float) -> None:
        """What the next command belongs to, and its arc length [m]: the arc may burn in WELD alone, errors say where it was."""
        self._segment, self._s = segment, s

    def set_arc(self, on: bool) -> None:
        """Raises ExecutionError, at rest, when the arc is asked for without permission or outside WELD."""
        if on and not self.arc_permitted:
            self._breach(Breach(rule="arc", what="arc", value=1.0, limit=0.0, text="asked for without permission (--arc)"))
        if on and self._segment != Segment.WELD:
            self._breach(self._stray())
        self._asked = bool(on)
        self.inner.set_arc(self._asked)

    def check(self, trajectory: JointTrajectory) -> None:
        """Nothing, when every command of a trajectory, at this robot's period and from here, keeps to the rules.

        Raises:
            ExecutionError: the first that does not; nothing has moved. `data`: rule, value, limit, t, s.
        """
        self._check_start(self.inner.state(), trajectory.q[0])
        stray = np.flatnonzero(trajectory.arc_on & np.array([segment != Segment.WELD for segment in trajectory.segments]))
        if len(stray):
            i = int(stray[0])
            raise ExecutionError(
                f"trajectory: the arc is on at {trajectory.t[i]:.3f} s, in {trajectory.segments[i].value};"
                " it may burn in weld alone",
                rule="arc",
                t=float(trajectory.t[i]),
                s=float(trajectory.s[i]),
            )
        rest = np.zeros((HISTORY, 6))
        q = np.concatenate(
            [np.repeat(trajectory.q[:1], HISTORY, axis=0), trajectory.q, np.repeat(trajectory.q[-1:], HISTORY, axis=0)]
        )
        found = motion_breach(q, np.concatenate([rest, trajectory.qd, rest]), self.arm.torch_tip(q), self.period, self.config)
        if found is not None:
            row, breach = found
            i = min(row - HISTORY, len(trajectory.t) - 1)
            t, s = float(trajectory.t[i]), float(trajectory.s[i])
            raise ExecutionError(
                f"trajectory: {breach.rule}: {breach.text} at {t:.3f} s, s = {1e3 * s:.1f} mm of the"
                f" {trajectory.segments[i].value}; nothing has moved, plan it slower or elsewhere",
                rule=breach.rule,
                what=breach.what,
                value=breach.value,
                limit=breach.limit,
                t=t,
                s=s,
            )

    def start_from(self, q: Float[ndarray, "6"]) -> None:
        """The motion that is sent next begins at rest at q [rad], which is not sent itself; without this, at its first command."""
        self._sent.clear()
        self._origin = np.array(q)

    def servo(self, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> Float[ndarray, "6"]:
        """What was sent: q itself. Raises ExecutionError, with the arc off and the arm at rest, when a rule is broken."""
        if not self._connected:
            raise ExecutionError(f"{self.name}: commanded before connect()", rule="connection")
        tip = self._before(q, qd)
        try:
            sent = self.inner.servo(q, qd)
        except ExecutionError as error:
            self._give_up(error)
            raise
        except Exception as error:
            raise self._defect(error) from error
        state = self._reported()
        self._catch_up()
        self._sent.append((q, qd, tip))
        self._way.append((q, tip))
        self._see(state, q, qd)
        self._keep(self.inner.events())
        self._after(state)
        return sent

    def stop(self) -> None:
        """Drop the arc, bring the arm to rest, write the black box."""
        self._stop("stopped on request")

    def _before(self, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> Float[ndarray, "3"]:
        """The torch tip of a command that keeps to the rules."""
        if not (np.isfinite(q).all() and np.isfinite(qd).all()):
            bad = int((~np.isfinite(np.concatenate([q, qd]))).argmax()) % 6
            text = f"{JOINT_NAMES[bad]} is told a number that is not finite"
            self._breach(Breach(rule="command", what=JOINT_NAMES[bad], value=float("nan"), limit=0.0, text=text))
        tip = self.arm.torch_tip(q)
        if not self._sent:
            origin = q if self._origin is None else self._origin
            self._check_start(self._reported(), origin, moving=True)
            self._sent.extend([(origin, np.zeros(6), self.arm.torch_tip(origin))] * HISTORY)
            self._origin = None
        rows = [*self._sent, (q, qd, tip)]
        columns = [np.stack(column) for column in zip(*rows, strict=True)]
        found = motion_breach(columns[0], columns[1], columns[2], self.period, self.config)
        if found is not None:
            self._breach(found[1])
        if self._asked and self._segment != Segment.WELD:
            self._breach(self._stray())
        return tip

    def _after(self, state: RobotState) -> None:
        """Nothing, when the arm is where it was sent lately, what it reports is fresh, and its arc output obeys."""
        self._same = self._same + 1 if state.t <= self._stamp else 0
        if state.t < self._stamp:
            text = f"time stamp went back from {self._stamp:.3f} to {state.t:.3f} s"
            self._breach(Breach(rule="stale state", what="time stamp", value=state.t, limit=self._stamp, text=text))
        self._stamp = state.t
        age = self._same * self.period
        if age > self.config.stale * (1 + 1e-9):
            text = f"nothing new from the robot for {age:.3f} s (limit {self.config.stale:g} s)"
            self._breach(Breach(rule="stale state", what="time stamp", value=age, limit=self.config.stale, text=text))
        off = np.abs(off_the_way(state.q, np.array([q for q, _ in self._way])))
        joint = int(off.argmax())
        if off[joint] > self.config.tracking:
            text = (
                f"{JOINT_NAMES[joint]} is {np.rad2deg(off[joint]):.2f} deg off (limit {np.rad2deg(self.config.tracking):.2f} deg)"
            )
            self._breach(
                Breach(rule="tracking", what=JOINT_NAMES[joint], value=float(off[joint]), limit=self.config.tracking, text=text)
            )
        if self._segment == Segment.WELD:
            self._check_tip(state)
        self._lingers = self._lingers + 1 if self.arc and not self._asked else 0
        if self._lingers * self.period > self.config.arc_lag * (1 + 1e-9):
            late = self._lingers * self.period
            text = f"output still on {late:.3f} s after it was told to go off (limit {self.config.arc_lag:g} s)"
            self._breach(Breach(rule="arc", what="arc output", value=late, limit=self.config.arc_lag, text=text))

    def _check_tip(self, state: RobotState) -> None:
        # Not as reported: by the kinematics that the commands are judged by, or two calibrations would count as straying.
        tip = self.arm.torch_tip(state.q)
        off = float(np.linalg.norm(off_the_way(tip, np.array([p for _, p in self._way]))))
        if off > self.config.tracking_tip:
            text = f"torch tip is {1e3 * off:.2f} mm off the weld (limit {1e3 * self.config.tracking_tip:.2f} mm)"
            self._breach(Breach(rule="tracking", what="torch tip", value=off, limit=self.config.tracking_tip, text=text))

    def _check_start(self, state: RobotState, q: Float[ndarray, "6"], moving: bool = False) -> None:
        away = np.abs(state.q - q)
        joint, limit = int(away.argmax()), self.config.start_tolerance
        if away[joint] <= limit:
            return
        text = f"{JOINT_NAMES[joint]} stands {np.rad2deg(away[joint]):.2f} deg from the trajectory's first point"
        text += f" (limit {np.rad2deg(limit):.2f} deg); plan again from where the arm is"
        breach = Breach(rule="start", what=JOINT_NAMES[joint], value=float(away[joint]), limit=limit, text=text)
        if moving:
            self._breach(breach)
        raise ExecutionError(f"start: {text}", rule="start", what=breach.what, value=breach.value, limit=limit, t=state.t)

    def _stray(self) -> Breach:
        return Breach(
            rule="arc", what="arc", value=1.0, limit=0.0, text=f"asked for in {self._segment.value}; it may burn in weld alone"
        )

    def _reported(self) -> RobotState:
        """What the robot reports; a report that is none, a joint angle that is no number say, is a breach."""
        try:
            return self.inner.state()
        except ExecutionError as error:
            self._give_up(error)
            raise
        except WeldsimError as error:
            self._breach(Breach(rule="stale state", what="report", value=float("nan"), limit=0.0, text=str(error)))
        except Exception as error:
            raise self._defect(error) from error

    def _give_up(self, error: ExecutionError) -> None:
        """Stop, write, and add to the inner robot's own error where that was."""
        found = [text for text in self._stop(str(error)) if text not in str(error)]
        error.args = ("; ".join([str(error), *found]), *error.args[1:])
        error.data.setdefault("s", self._s)
        error.data.setdefault("segment", self._segment.value)
        error.data["black_box"] = self.black_box

    def _defect(self, error: Exception) -> ExecutionError:
        """What to raise, at rest, where the inner robot's own code failed."""
        out = ExecutionError(f"{self.name}: {type(error).__name__}: {error}; the arc is off and the arm was stopped", rule="robot")
        self._give_up(out)
        return out

    def _breach(self, breach: Breach) -> NoReturn:
        """Stop, write, raise."""
        t = self._stamp if np.isfinite(self._stamp) else 0.0
        where = f"at {t:.3f} s, s = {1e3 * self._s:.1f} mm of the {self._segment.value}"
        message = f"{breach.rule}: {breach.text} {where}; the arc is off and the arm was stopped"
        message += "".join(f"; {text}" for text in self._stop(message))
        if self.black_box is not None:
            message += f"; black box: {self.black_box}"
        raise ExecutionError(
            message,
            rule=breach.rule,
            what=breach.what,
            value=breach.value,
            limit=breach.limit,
            t=t,
            s=self._s,
            segment=self._segment.value,
            black_box=self.black_box,
        )

    def _stop(self, reason: str) -> list[str]:
        """What the robot found out about the cause, or could not see. The arc off first, then the arm at rest, then the black box;
        whatever fails of these is told and keeps none of the others from being done."""
        self._asked = False
        t = self._stamp if np.isfinite(self._stamp) else 0.0
        self._keep([Event(t=t, kind="stop", text=reason)])
        for act, name in ((lambda: self.inner.set_arc(False), "arc off"), (self.inner.stop, "stop")):
            try:
                act()
            except Exception as error:  # of any kind: what is still to be done is done
                self._keep([Event(t=t, kind="fault", text=f"{name}: {type(error).__name__}: {error}")])
        causes: list[str] = []
        try:
            found = self.inner.events()
            causes = [event.text for event in found if event.kind in ("cause", "unseen")]
            self._keep(found)
            at_rest = self.inner.state()
            self._catch_up()
            self._see(at_rest, at_rest.q, np.zeros(6))
        except Exception as error:
            self._keep([Event(t=t, kind="fault", text=f"no report after the stop: {type(error).__name__}: {error}")])
        self._forget()
        if self._folder is None:
            return causes
        try:
            self.black_box = self._box.write(self._folder, reason)
            self._keep([Event(t=t, kind="black box", text=f"written to {self.black_box}")])
        except WeldsimError as error:
            self._keep([Event(t=t, kind="fault", text=f"black box: {error}")])
        return causes

    def _see(self, state: RobotState, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> None:
        """The newest report, into the black box; it is passed over where the caller sees a newer one only."""
        if self._looked is None or state.t > self._looked[0].t:
            self._looked = state, self.arc
            self._passed.append(self._looked)
        self._record(state, self.arc, q, qd)

    def _catch_up(self) -> None:
        """What the inner robot has reported since, which nobody had time to look at: it belongs to the command before."""
        for state, arc in self.inner.passed_over():
            if self._looked is None or state.t > self._looked[0].t:
                self._passed.append((state, arc))
                self._record(state, arc, *self._command(state))

    def _command(self, state: RobotState) -> tuple[Float[ndarray, "6"], Float[ndarray, "6"]]:
        """What was sent last, q and qd; rest where the arm is when nothing was."""
        return self._sent[-1][:2] if self._sent else (state.q, np.zeros(6))

    def _record(self, state: RobotState, arc: bool, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> None:
        row = BlackBoxRow(q=q, qd=qd, state=state, arc_asked=self._asked, arc=arc, s=self._s, segment=self._segment)
        self._box.rows.append(row)

    def _keep(self, events: "tuple[Event, ...] | list[Event]") -> None:
        self._events.extend(events)
        self._box.events.extend(events)
