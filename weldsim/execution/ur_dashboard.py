"""A UR controller's dashboard and its port for short programs, asked over plain sockets that never wait for long."""

import re
import socket
from contextlib import suppress
from dataclasses import dataclass

from weldsim.execution.rtde_talk import LinkError
from weldsim.execution.ur_ports import DASHBOARD, SECONDARY

LOCAL = "not allowed due to safety reasons"  # what an e-Series in local control answers
MAX_LINE = 4096
LINGER = 0.05  # [s]


@dataclass(frozen=True, kw_only=True)
class Identity:
    """What the dashboard says the controller is.

    Attributes:
        model: of the arm.  serial: of the arm.  software: version, "3.15.8" say.
        remote_control: None where there is no such switch (CB3).  program: what `programState` says.
    """

    model: str
    serial: str
    software: str
    remote_control: bool | None
    program: str


class Dashboard:
    """One conversation; a `with` block ends it."""

    def __init__(self, host: str, timeout: float) -> None:
        """Raises LinkError where nobody answers within `timeout` [s]."""
        try:
            self._socket = socket.create_connection((host, DASHBOARD), timeout)
        except OSError as error:
            raise LinkError(f"{host} port {DASHBOARD}: {error.strerror or error}") from None
        self._rest = b""
        try:
            self._line()  # the banner
        except LinkError:
            self._socket.close()
            raise

    def ask(self, command: str) -> str:
        """The answer to one line. Raises LinkError."""
        try:
            self._socket.sendall(f"{command}\n".encode())
        except OSError as error:
            raise LinkError(f"dashboard: {error.strerror or error}") from None
        return self._line()

    def identity(self) -> Identity:
        """What this is. Raises LinkError."""
        software = re.search(r"\d+\.\d+\.\d+", self.ask("PolyscopeVersion"))
        version = software.group() if software else "unknown"
        return Identity(
            model=self.ask("get robot model"),
            serial=self.ask("get serial number"),
            software=version,
            remote_control=self.remote_control() if not version.startswith("3.") else None,
            program=self.ask("programState"),
        )

    def remote_control(self) -> bool | None:
        """Whether an e-Series takes commands from outside; None where it has no such switch."""
        answer = self.ask("is in remote control").strip().lower()
        return {"true": True, "false": False}.get(answer)

    def stop_program(self) -> bool:
        """End whatever program runs; whether the controller did."""
        return LOCAL not in self.ask("stop")

    def _line(self) -> str:
        try:
            while b"\n" not in self._rest and len(self._rest) < MAX_LINE:
                data = self._socket.recv(MAX_LINE)
                if not data:
                    raise LinkError("the dashboard hung up")
                self._rest += data
        except TimeoutError:
            raise LinkError("the dashboard accepts, but does not answer") from None
        except OSError as error:
            raise LinkError(f"dashboard: {error.strerror or error}") from None
        line, _, self._rest = self._rest.partition(b"\n")
        return line.decode(errors="replace").strip()

    def __enter__(self) -> "Dashboard":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()


def switch_off(host: str, output: int, timeout: float) -> bool:
    """Tell the controller to drop a standard digital output, beside whatever program runs; whether it could be told.

    A secondary program: it needs none of the RTDE inputs that another client may hold.
    """
    text = f"sec weldsim_arc_off():\n  set_standard_digital_out({output}, False)\nend\n"
    try:
        with socket.create_connection((host, SECONDARY), timeout) as sock:
            sock.sendall(text.encode())
            sock.shutdown(socket.SHUT_WR)
            # A real controller streams its state here; hanging up on what was not read could take the program with it.
            sock.settimeout(LINGER)
            with suppress(TimeoutError):
                while sock.recv(MAX_LINE):
                    pass
    except OSError:
        return False
    return True
