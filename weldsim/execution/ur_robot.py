"""A UR arm behind its controller: servoJ streamed at the controller's own pace, its reports read as they come.

Three parts watch one another. This process reads every state and judges it; the client process (`ur_client`) commands, and stops
arm and arc when this one falls silent or dies; the controller's watchdog ends the program when the client falls silent or dies.
The arc goes off first in every case: by the client, by a short program sent past it, and, when nobody is left to speak, by the
output's own setting on the controller, `Low when not running`, which cannot be read over the network: it has to be checked by hand.
"""

import math
import time
from collections import deque
from typing import NoReturn, final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import ExecutionError
from weldsim.execution.priority import Haste
from weldsim.execution.robot import Robot
from weldsim.execution.rtde_talk import LinkError
from weldsim.execution.ur_config import PERIODS, UrConfig
from weldsim.execution.ur_dashboard import Dashboard
from weldsim.execution.ur_halt import Halt
from weldsim.execution.ur_link import Link, open_link
from weldsim.execution.ur_process import ClientError
from weldsim.execution.ur_status import (
    Trouble,
    follow_distance,
    mode_word,
    program_trouble,
    robot_facts,
    robot_state,
    safety_trouble,
)
from weldsim.execution.ur_stream import Sample
from weldsim.records import Event, RobotFacts, RobotState

FOLLOW_SPAN = 0.15  # [s] beyond the look-ahead in which the controller's target must have passed one of our commands
FOLLOW_EVERY = 0.02  # [s] between two looks at that
ARC_DELAY = 0.06  # [s] after which an output that was sent on is reported on
GRACE = 0.02  # [s] for what came in while this process was held up
TAKEN = 2000  # states kept for `passed_over`: 4 s at 500 Hz
SILENT = 0.5  # [s] without a state after which `state` says that there is no link
EVIDENCE = 0.1  # [s] in which the state says why a command was refused
UNSEEN = "arc off and arm at rest were not seen: look at both"


@final
class UrRobot(Robot):
    """A UR5 on a CB3 (125 Hz) or e-Series (500 Hz) controller, real or virtual.

    Verified with the ur_rtde 1.6.5 client over sockets against the virtual controller, never on a real one.
    Times are the controller's, counted from `connect`; the base is B as the controller reports it. The thread that calls `servo`
    has real-time priority from a stream's first command to the stop, where the system allows it.
    """

    def __init__(self, config: UrConfig | None = None) -> None:
        """Touches no network; `connect` does."""
        self.config = config or UrConfig()
        self.name = f"UR at {self.config.host}"
        self.period = PERIODS["e" if self.config.series == "e" else "cb3"]
        self._link: Link | None = None
        self._sample: Sample | None = None
        self._origin, self._served = 0.0, -math.inf
        self._judged, self._judge_every = 0, 1
        self._arc, self._arc_asked = False, 0
        self._trouble: Trouble | None = None
        self._events: list[Event] = []
        self._sent: deque[list[float]] = deque()
        self._told: tuple[Sample, RobotState] | None = None
        self._taken: deque[Sample] = deque(maxlen=TAKEN)
        self._haste = Haste()

    @property
    def servo_times(self) -> tuple[float, ...]:
        """Host's monotonic times [s] of the last servoJ calls of this connection."""
        return tuple(self._link.client.times) if self._link else ()

    @property
    def client_pid(self) -> int | None:
        """Number of the process that commands, None when not connected."""
        return self._link.client.pid if self._link else None

    def connect(self) -> None:
        """Stops whatever program runs, uploads the control program, sets TCP and payload and reads them back."""
        if self._link is not None:
            if self._trouble is None:
                return
            self.disconnect()
        link = open_link(self.config, self.name)
        self._link, self._trouble, self.period = link, None, link.period
        self._origin, self._sample = link.first.timestamp, link.first
        self._events, self._arc, self._arc_asked = [], False, 0
        self._taken.clear()
        self._sent = deque(maxlen=math.ceil((self.config.buffer + self.config.lookahead + FOLLOW_SPAN) / self.period))
        self._judge_every = max(1, round(FOLLOW_EVERY / self.period))
        self._note("connection", f"{link.identity.model}, serial number {link.identity.serial}, software {link.identity.software}")
        if not link.identity.program.startswith("STOPPED"):
            self._note("connection", f"stopped what ran before: {link.identity.program}")

    def disconnect(self) -> None:
        link = self._link
        if link is None:
            return
        self._arc = False
        self._haste.end()
        self._settle(Halt(link, self.config, self._trouble, last=True))
        link.stream.close()
        self._link, self._served = None, -math.inf

    def facts(self) -> RobotFacts:
        link = self._require("asked for facts")
        try:
            with Dashboard(self.config.host, self.config.connect_timeout) as dashboard:
                identity = dashboard.identity()
        except LinkError as lost:
            raise ExecutionError(f"{self.name}: no facts: {lost}; connect again", rule="link", t=self._t) from None
        self._read_all(link)
        ours = self._trouble is None and link.client.alive
        return robot_facts(self._last, identity, link.series, link.arm, ours=ours, tcp=link.client.tcp)

    def state(self) -> RobotState:
        """The state that ended the last `servo`; the newest where nothing is being streamed, or the caller is late."""
        if self._link is not None and time.monotonic() - self._served > self._behind * self.period:
            self._read_all(self._link)
        silent = time.monotonic() - self._last.arrived > max(SILENT, self.config.silence)
        mode = "disconnected" if silent or self._link is None else mode_word(self._last)
        if self._told is None or self._told[0] is not self._last or self._told[1].mode != mode:  # asked for several times a period
            self._told = self._last, robot_state(self._last, self._origin, mode)
        return self._told[1]

    def torque(self) -> Float[ndarray, "6"] | None:
        """As measured, where the software reports it (5.23 and newer); its older figures are currents, or the model's own."""
        found = self._sample.actual_current_as_torque if self._sample else None
        return None if found is None else np.array(found)

    def set_arc(self, on: bool) -> None:
        self._arc = bool(on)

    @property
    def arc(self) -> bool:
        """The output as last reported, after `disconnect` too."""
        return self._sample is not None and bool(self._sample.actual_digital_output_bits >> self.config.arc_output & 1)

    def passed_over(self) -> tuple[tuple[RobotState, bool], ...]:
        taken, bit = list(self._taken)[:-1], self.config.arc_output
        self._taken.clear()
        return tuple(
            (robot_state(sample, self._origin, mode_word(sample)), bool(sample.actual_digital_output_bits >> bit & 1))
            for sample in taken
        )

    def events(self) -> tuple[Event, ...]:
        happened, self._events = tuple(self._events), []
        return happened

    def servo(self, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> Float[ndarray, "6"]:
        """As `Robot.servo`; qd is not sent: the controller makes its own of the targets."""
        link = self._require("commanded")
        if self._trouble is not None:
            raise self._trouble.error(self.name, self._t)
        target = [float(x) for x in q]
        if not all(map(math.isfinite, target)):
            raise ExecutionError(f"{self.name}: target {target} is not finite", rule="finite", t=self._t)
        if time.monotonic() - self._served > self.config.stall:  # a new stream: the commands of the last one say nothing
            self._haste.begin()
            self._sent.clear()
            if len(link.stream) > self._behind:
                self._read_all(link)
            if trouble := safety_trouble(self._last) or program_trouble(self._last, None):
                self._give_up(link, trouble)
        try:
            link.client.servo(target, self._arc)
            self._sent.append(target)
            self._arc_asked = self._arc_asked + 1 if self._arc else 0
            self._await_next(link)
        except ClientError as gone:
            self._give_up(link, self._why_gone(link, gone))
        except LinkError as lost:
            self._give_up(link, Trouble("link", f"{lost}; connect again"))
        if trouble := self._judge(link):
            self._give_up(link, trouble)
        self._served = time.monotonic()
        return np.array(target)

    def stop(self) -> None:
        self._arc = False
        self._haste.end()
        if self._link is not None:
            self._settle(Halt(self._link, self.config, self._trouble))
        self._served = -math.inf

    def _await_next(self, link: Link) -> None:
        """Take the next state, when it comes; raises LinkError, ClientError."""
        stream, limit = link.stream, self.config.silence
        if not (stream.wait(limit) or stream.wait(GRACE)):
            age = time.monotonic() - self._last.arrived
            text = f"no state for {age:.3f} s (limit {limit:g} s); see to the network, connect again"
            self._give_up(link, Trouble("silence", text, age, limit))
        link.client.pump()
        link.client.check()
        late = len(stream) - 1
        self._take(stream.take())
        if late > self._behind:
            self._note("late", f"this computer was {late} periods late; it goes on from here")
            self._read_all(link)

    def _judge(self, link: Link) -> Trouble | None:
        """What is wrong with the last state, or None."""
        sample, config = self._last, self.config
        trouble = safety_trouble(sample) or program_trouble(sample, None)
        if trouble is None and (refusal := link.client.refusal) is not None:
            if refusal.reason == "stall":
                text = f"{refusal.gap:.3f} s without a command (limit {config.stall:g} s): arc and arm were stopped; connect again"
                return Trouble("stall", text, refusal.gap, config.stall)
            return self._why_refused(link)
        if trouble is None and self._arc_asked * self.period > self.config.buffer + ARC_DELAY and not self.arc:
            text = f"output {config.arc_output} is off though the arc was asked for: something else switches it; connect again"
            trouble = Trouble("arc", text, False, True)
        self._judged += 1
        if trouble is None and self._judged % self._judge_every == 0 and len(self._sent) == self._sent.maxlen:
            off = follow_distance(sample.target_q, self._sent)
            if off > config.follow_limit:
                text = f"the arm is {off:.3f} rad from every command of the last moments (limit {config.follow_limit:g} rad)"
                trouble = Trouble("follow", f"{text}: something else moves or holds it; connect again", off, config.follow_limit)
        return trouble

    def _why_refused(self, link: Link) -> Trouble:
        """What the states that follow a refused command say."""
        end = time.monotonic() + EVIDENCE
        try:
            while (left := end - time.monotonic()) > 0 and link.stream.wait(left):
                self._take(link.stream.take())
                if trouble := safety_trouble(self._last) or program_trouble(self._last, None):
                    return trouble
        except LinkError as lost:
            return Trouble("link", f"{lost}; connect again")
        return Trouble("program", "the control program takes no commands; connect again")

    def _why_gone(self, link: Link, gone: ClientError) -> Trouble:
        """The client library dies of a lost link, sooner than we see it, and waits without end for a silent controller."""
        try:
            while link.stream.wait(EVIDENCE / 4):
                self._take(link.stream.take())
                if trouble := safety_trouble(self._last):
                    return trouble
                if self._last.arrived > time.monotonic() - self.period:
                    break
        except LinkError as lost:
            return Trouble("link", f"{lost}; connect again")
        return Trouble("client", f"{gone}; connect again")

    def _give_up(self, link: Link, trouble: Trouble) -> NoReturn:
        """Arc off and rest asked for at once; then the reason, as exactly as it can be found out."""
        self._arc = False
        self._haste.end()
        halt = Halt(link, self.config, trouble)
        self._trouble = trouble = halt.explain(self._last) or trouble
        self._note(trouble.rule, trouble.text)
        raise trouble.error(self.name, self._t)

    def _settle(self, halt: Halt) -> None:
        """Wait until arc and arm are seen at rest, and remember what was seen."""
        for sample in halt.wait():
            self._take(sample)
        for text in halt.notes:
            self._note("stop", text)
        if halt.unseen:
            self._note("unseen", UNSEEN)
        if self._trouble is None and halt.trouble is not None:
            self._trouble = halt.trouble
            self._note("cause", halt.trouble.text)
        self._sent.clear()

    def _read_all(self, link: Link) -> None:
        """Take every state that has come in; a lost link is remembered, not raised."""
        try:
            for sample in link.stream.take_all():
                self._take(sample)
        except LinkError as lost:
            if self._trouble is None:
                self._trouble = Trouble("link", f"{lost}; connect again")
                self._note("link", str(lost))

    def _take(self, sample: Sample) -> None:
        before, self._sample = self._sample, sample
        self._taken.append(sample)
        if before is not None and (was := mode_word(before)) != (now := mode_word(sample)):
            self._note("mode", f"{was} -> {now}".replace("_", " "))

    def _require(self, asked: str) -> Link:
        if self._link is None:
            raise ExecutionError(f"{self.name}: {asked} before connect()", rule="connection", t=self._t)
        return self._link

    @property
    def _behind(self) -> int:
        """Periods of lateness that are caught up with: as many as the client's queue bridges."""
        return max(2, round(self.config.buffer / self.period))

    @property
    def _last(self) -> Sample:
        if self._sample is None:
            raise ExecutionError(f"{self.name}: asked for its state before connect()", rule="connection", t=0.0)
        return self._sample

    @property
    def _t(self) -> float:
        return self._sample.timestamp - self._origin if self._sample else 0.0

    def _note(self, kind: str, text: str) -> None:
        self._events.append(Event(t=self._t, kind=kind, text=text))
