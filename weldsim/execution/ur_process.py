"""The owner's side of the process that commands a UR controller (`ur_client`): started, spoken to without waiting, killed."""

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from weldsim.errors import WeldsimError
from weldsim.execution.ur_client import MAX_MESSAGE, ClientSettings

KEPT_TIMES = 200_000  # of the last commands: 6 minutes at 500 Hz
TAIL = 400  # [character] of what the library printed, told when it fails


class ClientError(WeldsimError):
    """The process has ended or does not answer. `data`: none."""


@dataclass(frozen=True)
class Refusal:
    """A command that was not passed on. Attributes: reason, "stall" or "program"; gap [s] between commands where known."""

    reason: str
    gap: float = 0.0


class ClientProcess:
    """A running `ur_client`.

    Attributes:
        pid: of the process.  tcp: X_FT as the controller says it has it, once ready.
        times: host's monotonic times [s] at which the last servoJ calls were made.
        refusal: the first command that was not passed on since the last stop, or None.
    """

    def __init__(self, settings: ClientSettings, answer_timeout: float) -> None:
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._channel.setblocking(False)
        self._timeout = answer_timeout
        self._noise = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `kill`; what the library prints; a pipe that nobody reads would fill up and block
        root = str(Path(__file__).resolve().parents[2])
        path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "weldsim.execution.ur_client", str(theirs.fileno()), settings.to_text()],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=self._noise,
                stderr=self._noise,
                env={**os.environ, "PYTHONPATH": path},
            )
        self.pid = self._process.pid
        self.tcp: list[float] = []
        self.times: deque[float] = deque(maxlen=KEPT_TIMES)
        self.refusal: Refusal | None = None
        self._count = 0
        self._waiting: deque[tuple[int, float]] = deque()  # number and time of servo commands not answered yet
        self._stopped: int | None = None  # number of the last stop that was answered
        self._ready, self._failure = False, ""
        self._ended = ""  # how, once it was killed

    def fileno(self) -> int:
        """For select: readable when the process has said something or has ended."""
        return self._channel.fileno()

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def wait_ready(self, seconds: float) -> None:
        """Until its clients can be used. Raises ClientError, saying why they cannot."""
        self._must_live()
        self._channel.settimeout(0.05)
        end = time.monotonic() + seconds
        while not self._ready:
            if time.monotonic() > end:
                raise ClientError(f"the client library was not ready within {seconds:g} s{self._said()}")
            self.pump(wait=True)
            if self._failure:
                raise ClientError(f"{self._failure}{self._said()}")
        self._channel.setblocking(False)

    def servo(self, q: list[float], arc: bool) -> None:
        """Pass on a target. Raises ClientError where earlier ones have waited too long for their answer."""
        self._count += 1
        self._waiting.append((self._count, time.monotonic()))
        self._send(["servo", self._count, q, arc])
        self.check()

    def stop(self) -> int:
        """Ask for arc off and rest; the number to look for in `stopped`. Raises ClientError."""
        self._count += 1
        self._waiting.clear()
        self.refusal = None
        self._send(["stop", self._count])
        return self._count

    def stopped(self, number: int) -> bool:
        """Whether that stop has been answered."""
        return self._stopped is not None and self._stopped >= number

    def check(self) -> None:
        """Nothing, where it lives and answers in time; else raises ClientError."""
        if self._overdue > 0:
            self.pump()  # the answer may have come while this process was held up
        if self._overdue > 0:
            waits = self._timeout + self._overdue
            raise ClientError(f"the client process has not answered for {waits:.3f} s (limit {self._timeout:g} s)")

    @property
    def _overdue(self) -> float:
        """By how much [s] the answer that is waited for longest is late; at most 0 where it is not."""
        return time.monotonic() - self._waiting[0][1] - self._timeout if self._waiting else 0.0

    def pump(self, wait: bool = False) -> None:
        """Read what it has said; with `wait`, for a moment. Raises ClientError where it has ended."""
        while True:
            self._must_live()
            try:
                data = self._channel.recv(MAX_MESSAGE)
            except (BlockingIOError, TimeoutError):
                return
            except OSError:
                data = b""
            if not data:
                raise ClientError(self._epitaph())
            self._hear(json.loads(data))
            if wait:
                return

    def _hear(self, message: list) -> None:
        match message:
            case ["servo", number, done, when, why]:
                while self._waiting and self._waiting[0][0] <= number:
                    self._waiting.popleft()
                self.times.append(when)
                if not done and self.refusal is None:
                    self.refusal = Refusal(why)
            case ["stop" | "quit", number, _]:
                self._stopped = number
            case ["ready", tcp]:
                self.tcp, self._ready = tcp, True
            case ["failed", text]:
                self._failure = text
            case ["stall", gap]:
                self.refusal = Refusal("stall", gap)

    def close(self, seconds: float) -> bool:
        """End it in order: arc off, rest, program on the controller ended; killed where it takes too long. Whether in order;
        False where it had been killed."""
        if self._ended:
            return False
        number, orderly = self._count + 1, False
        end = time.monotonic() + seconds
        try:
            self._channel.settimeout(0.05)
            self._send(["quit", number])
            while time.monotonic() < end and not orderly:
                self.pump(wait=True)
                orderly = self.stopped(number)
        except ClientError:
            orderly = orderly or self.stopped(number)
        self.kill()
        return orderly

    def kill(self) -> None:
        """End it at once; harmless when it has ended."""
        if not self._ended:
            self._process.kill()
            self._process.wait()
            self._ended = self._epitaph()
            self._channel.close()
            self._noise.close()

    def _must_live(self) -> None:
        if self._ended:
            raise ClientError(self._ended)

    def _send(self, words: list) -> None:
        self._must_live()
        try:
            self._channel.send(json.dumps(words).encode())
        except BlockingIOError:
            raise ClientError("the client process does not take commands any longer") from None
        except OSError:
            raise ClientError(self._epitaph()) from None

    def _epitaph(self) -> str:
        try:
            code = self._process.wait(0.2)
        except subprocess.TimeoutExpired:
            return "the client process has hung up"
        cause = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return f"the client process {cause}{self._said()}"

    def _said(self) -> str:
        """The last that the library printed; nothing once `kill` has let go of it."""
        if self._noise.closed:
            return ""
        descriptor = self._noise.fileno()
        start = max(0, os.fstat(descriptor).st_size - 4 * TAIL)
        text = " ".join(os.pread(descriptor, 4 * TAIL, start).decode(errors="replace").split())  # its own offset stays
        return f" (it printed: {text[-TAIL:]})" if text else ""
