"""One client's socket: never waited for, and never sent half a message."""

import socket
from typing import Any, Protocol, runtime_checkable

RECEIVE_SIZE = 65536
BACKLOG_LIMIT = 1 << 20  # [byte] a client this far behind is given up


@runtime_checkable
class Session(Protocol):
    """What answers one client."""

    def received(self, data: bytes) -> bytes:
        """The answer to bytes that have come in, or nothing."""
        ...

    def greeting(self) -> bytes:
        """What the client is told first, or nothing."""
        ...

    def ended(self) -> None:
        """The client has gone."""
        ...


@runtime_checkable
class Stream(Protocol):
    """A session whose client is told something without asking."""

    def data(self) -> bytes:
        """What is due after one more control period, or nothing."""
        ...


class Connection:
    """A non-blocking socket with what could not be sent yet.

    Attributes:
        session: what answers.  stream: the same, where it tells without being asked.  open: whether the client is still there.
    """

    def __init__(self, sock: socket.socket, session: Session) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if (size := getattr(session, "send_buffer", None)) is not None:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, size)
        self.socket, self.session, self.open = sock, session, True
        self.stream = session if isinstance(session, Stream) else None  # looked up once: it takes 15 us, a period has 2000
        self._waiting = bytearray()
        self.send(session.greeting())

    @property
    def behind(self) -> bool:
        """Whether something could not be sent yet."""
        return bool(self._waiting)

    def send(self, data: bytes) -> None:
        """Send now what the socket takes, the rest later; closes when the client has gone or reads nothing."""
        if not data or not self.open:
            return
        self._waiting += data
        self.flush()
        if len(self._waiting) > BACKLOG_LIMIT:
            self.close()

    def flush(self) -> None:
        """Send what is waiting."""
        try:
            while self._waiting:
                sent = self.socket.send(self._waiting)
                del self._waiting[:sent]
        except BlockingIOError:
            return
        except OSError:
            self._hear_out()
            self.close()

    def _hear_out(self) -> None:
        """Let the session have what a client that is gone had still sent: a program, and hung up with our packets unread."""
        self._waiting.clear()
        try:
            while data := self.socket.recv(RECEIVE_SIZE):
                self.session.received(data)
        except OSError:
            return

    def receive(self) -> None:
        """Let the session answer what has come in."""
        try:
            data = self.socket.recv(RECEIVE_SIZE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self.send(self.session.received(data))
        if not data or getattr(self.session, "finished", False):
            self.close()

    def close(self) -> None:
        """End the session; the socket stays until `release`, so that who waits for it can let go first."""
        if self.open:
            self.open = False
            self.session.ended()

    def release(self) -> None:
        """Hang up."""
        self.close()
        self.socket.close()

    def fileno(self) -> Any:
        return self.socket.fileno()
