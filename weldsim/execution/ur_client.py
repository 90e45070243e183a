"""The process that commands a UR controller: `python -m weldsim.execution.ur_client FD SETTINGS`.

It holds the ur_rtde clients, so that whatever they do can be ended by killing it. Messages are JSON lists, one a packet, over
the socket whose number it is given:

    ["servo", n, q, arc]   joins a queue and is answered as it is sent on: ["servo", n, done, time, why], host's monotonic time [s]
    ["stop", n]            arc off, then rest: ["stop", n, done]
    ["quit", n]            the same, then the program on the controller ends: ["quit", n, true], and the process ends

Targets leave the queue one a control period, by this process's own clock: who owns it may be `buffer` seconds late at times without
the arm noticing. The queue's length shows how the owner's pace, which is the controller's, differs; the clock follows it.

Once it can be used it says ["ready", tcp]; why it cannot be, ["failed", text]. When the other side hangs up it stops arm and arc
and ends. When a stream of servo messages breaks off for `stall` seconds it stops arm and arc, and says ["stall", gap].
"""

import json
import math
import os
import select
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from weldsim.execution.priority import hurry
from weldsim.execution.ur_rtde import Control, Signals, open_control, open_signals

MAX_MESSAGE = 4096  # [byte]
LAST_WORDS = 2.0  # [s] to stop the arm in, once nobody owns this process any longer
PULL = 0.1  # most that a period is stretched or shortened, when the queue is empty or twice as long as it should be
KICKS = 4  # a watchdog period: commands that keep it quiet while nothing moves


@dataclass(frozen=True)
class ClientSettings:
    """What the process needs to know.

    Attributes:
        host: of the controller.  period: of control [s].  arc_output: standard digital output.
        buffer [s]: length of the queue.  lookahead [s], gain: of servoJ.  watchdog_rate [Hz].  stall [s].
        stop_deceleration [rad/s2].
        tcp: X_FT as a pose [m, rad].  payload [kg], payload_cog [m].
    """

    host: str
    period: float
    arc_output: int
    buffer: float
    lookahead: float
    gain: float
    watchdog_rate: float
    stall: float
    stop_deceleration: float
    tcp: Sequence[float]
    payload: float
    payload_cog: Sequence[float]

    def to_text(self) -> str:
        """As one argument of a command."""
        return json.dumps(asdict(self))


class Client:
    """The ur_rtde clients and the conversation with who owns them."""

    def __init__(self, channel: socket.socket, settings: ClientSettings, control: Control, signals: Signals) -> None:
        self._channel, self._settings, self._control, self._signals = channel, settings, control, signals
        self._arc = False
        self._streaming, self._stalled, self._kicking = False, False, True
        self._heard = 0.0
        self._queue: deque[tuple[int, list[float], bool]] = deque()
        self._depth = max(1, round(settings.buffer / settings.period))
        self._due = math.inf  # when the next target leaves the queue

    def prepare(self) -> None:
        """Arc off, TCP, payload and watchdog set. Raises RuntimeError for what the controller refuses."""
        settings = self._settings
        self._signals.setStandardDigitalOut(settings.arc_output, False)
        for name, done in (
            ("set_tcp", self._control.setTcp(list(settings.tcp))),
            ("set_payload", self._control.setPayload(settings.payload, list(settings.payload_cog))),
        ):
            if not done:
                raise RuntimeError(f"the controller refused {name}")
        tcp = self._control.getTCPOffset()
        if not self._control.setWatchdog(settings.watchdog_rate):
            raise RuntimeError("the controller refused its watchdog")
        self._say("ready", tcp)

    def run(self) -> None:
        """Serve until told to quit, or until the other side has gone."""
        idle = 1.0 / self._settings.watchdog_rate / KICKS
        while True:
            now = time.monotonic()
            if now >= self._due:
                self._send_on(now)
            silent = self._heard + self._settings.stall
            patience = min(self._due, silent) - now if self._streaming else idle
            readable, _, _ = select.select([self._channel], [], [], max(0.0, patience))
            if readable:
                message = self._receive()
                if message is None:
                    signal.signal(signal.SIGALRM, signal.SIG_DFL)
                    signal.setitimer(signal.ITIMER_REAL, LAST_WORDS)  # ends the process, whatever the library waits for by then
                    self._come_to_rest()
                    self._control.stopScript()
                    return
                if not self._handle(message):
                    return
            elif self._streaming:
                if (gap := time.monotonic() - self._heard) >= self._settings.stall:
                    self._stalled = True
                    self._say("stall", gap)  # first, or the owner sees the arc go off and does not know why
                    self._come_to_rest()
            elif self._kicking:
                self._kicking = self._control.kickWatchdog()

    def _handle(self, message: list) -> bool:
        """Whether to go on."""
        what, number = message[0], message[1]
        if what == "servo":
            self._queue_up(number, message[2], message[3])
            return True
        done = self._come_to_rest()
        self._stalled = False
        if what == "quit":
            self._control.stopScript()
        self._say(what, number, done)
        return what != "quit"

    def _queue_up(self, number: int, q: list[float], arc: bool) -> None:
        self._heard = time.monotonic()
        if self._stalled:
            self._say("servo", number, False, self._heard, "stall")
            return
        self._queue.append((number, q, arc))
        if not self._streaming:
            self._streaming, self._due = True, self._heard + (self._depth - 1) * self._settings.period

    def _send_on(self, now: float) -> None:
        """The target that is due; nothing where the owner is later than the queue was long: the arm waits for it."""
        excess = max(-1.0, min(1.0, (len(self._queue) - self._depth) / self._depth))
        self._due = max(self._due + self._settings.period * (1.0 - PULL * excess), now)
        if not self._queue:
            return
        settings, (number, q, arc) = self._settings, self._queue.popleft()
        if not arc:
            self._switch(False)
        done = self._control.servoJ(q, 0.0, 0.0, settings.period, settings.lookahead, settings.gain)
        if arc and done:
            self._switch(True)
        elif not done:
            self._switch(False)
            self._drop_queue()
        self._say("servo", number, done, now, "" if done else "program")

    def _drop_queue(self) -> None:
        self._queue.clear()
        self._streaming, self._due = False, math.inf

    def _switch(self, on: bool) -> None:
        if on != self._arc:
            self._signals.setStandardDigitalOut(self._settings.arc_output, on)
            self._arc = on

    def _come_to_rest(self) -> bool:
        """Arc off, then rest; whether the controller did it."""
        self._signals.setStandardDigitalOut(self._settings.arc_output, False)  # whatever it was thought to be
        self._arc = False
        self._drop_queue()
        return bool(self._control.servoStop(self._settings.stop_deceleration))

    def _receive(self) -> list | None:
        try:
            data = self._channel.recv(MAX_MESSAGE)
        except OSError:
            return None
        return json.loads(data) if data else None

    def _say(self, *words: object) -> None:
        say(self._channel, *words)


def say(channel: socket.socket, *words: object) -> None:
    """One message; lost where nobody listens any longer."""
    try:
        channel.send(json.dumps(words).encode())
    except OSError:
        return


def main(descriptor: str, text: str) -> None:
    """Connect, and serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the owner, who then stops us in order
    settings = ClientSettings(**json.loads(text))
    with socket.socket(fileno=int(descriptor)) as channel:
        try:
            client = Client(channel, settings, open_control(settings.host), open_signals(settings.host))
            client.prepare()
            hurry()
        except Exception as error:  # the library raises whatever it likes; the owner is told
            say(channel, "failed", " ".join(str(error).split())[:1000])
        else:
            client.run()
    os._exit(0)  # threads of the library may wait for ever, and its destructors with them


if __name__ == "__main__":
    main(*sys.argv[1:])
