"""The virtual controller on its sockets: one thread that keeps time, serves every client, and moves the arm.

A control period begins at an absolute deadline, so lateness never adds up; what clients send in between is handled as it
comes and counts from the next period on.
"""

import errno
import gc
import selectors
import socket
import time
from collections.abc import Callable

from weldsim.controller.connection import Connection, Session
from weldsim.controller.dashboard import Dashboard, DashboardSession
from weldsim.controller.faults import FaultSession
from weldsim.controller.functions import builtins, elsewhere
from weldsim.controller.machine import Machine
from weldsim.controller.primary import PrimarySession
from weldsim.controller.realtime import RealtimeSession
from weldsim.controller.rtde import Claims, RtdeSession
from weldsim.errors import InputError
from weldsim.execution.ur_ports import DASHBOARD, FAULTS, PRIMARY, REALTIME, RTDE, SECONDARY

CATCH_UP = 0.1  # [s] of lateness made good by periods without a pause; what is more is lost time


class Server:
    """All ports of one controller on one address.

    Attributes:
        machine: what it serves.  host: where.
        overruns: control periods that began late by more than one.  lost: time [s] that was not made good.
    """

    def __init__(self, machine: Machine, host: str = "127.0.0.1") -> None:
        """Raises InputError where an address or port cannot be had."""
        self.machine, self.host = machine, host
        machine.provide(builtins(machine), elsewhere(machine))
        dashboard, claims = Dashboard(machine), Claims()
        sessions: dict[int, Callable[[], Session]] = {
            DASHBOARD: lambda: DashboardSession(dashboard),
            PRIMARY: lambda: PrimarySession(machine),
            SECONDARY: lambda: PrimarySession(machine),
            REALTIME: lambda: RealtimeSession(machine),
            RTDE: lambda: RtdeSession(machine, claims),
            FAULTS: lambda: FaultSession(self),
        }
        # select() waits to the microsecond where epoll() waits to the millisecond.
        self._selector = selectors.SelectSelector()
        self._connections: list[Connection] = []
        self._stalled_until = self._cut_until = 0.0
        self.overruns, self.lost = 0, 0.0
        self._stopping = False
        for port, session in sessions.items():
            self._listen(port, session)

    def _listen(self, port: int, session: Callable[[], Session]) -> None:
        try:
            listener = socket.create_server((self.host, port))
        except OSError as error:
            self.close()
            reason = str(error.strerror or error).partition(" (")[0]
            taken = error.errno == errno.EADDRINUSE
            hint = "another address, 127.0.0.2 say, holds a second controller" if taken else "give an address of this machine"
            raise InputError(
                f"controller: {self.host} port {port}: {reason}; {hint}",
                host=self.host,
                port=port,
            ) from None
        listener.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ, session)

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until `stop` is called, or `until` says so after a control period."""
        gc.collect()
        gc.freeze()  # what is there now is never garbage: collections stay short
        interval = self.machine.profile.period / self.machine.config.speed
        deadline = time.perf_counter() + interval
        try:
            while not self._stopping:
                now = time.perf_counter()
                if now < deadline:
                    self._serve(deadline - now)
                    continue
                self._serve(0.0)
                self._period()
                late = time.perf_counter() - deadline
                deadline += interval
                if late > interval:
                    self.overruns += 1
                if late > CATCH_UP:
                    self.lost += late
                    self.machine.say(f"{late:.3f} s lost: this machine did not keep up")
                    deadline = time.perf_counter() + interval
                if until():
                    return
        finally:
            self.close()

    def stop(self) -> None:
        """Make `run` return; may be called from a signal handler."""
        self._stopping = True

    def _period(self) -> None:
        """One control period, and what the clients are sent after it."""
        began = time.perf_counter()
        self.machine.tick()
        if not self._stalled:
            for connection in self._connections:
                # A client that does not keep up loses packets, never parts of one.
                if connection.stream is not None and not connection.behind:
                    connection.send(connection.stream.data())
        self._forget_closed()
        self.machine.busy = time.perf_counter() - began

    @property
    def _stalled(self) -> bool:
        return time.perf_counter() < self._stalled_until

    def _serve(self, timeout: float) -> None:
        """Handle what clients send within `timeout` [s], or the first of it."""
        if self._stalled:
            time.sleep(min(timeout, max(0.0, self._stalled_until - time.perf_counter())))
            return
        for key, _ in self._selector.select(timeout):
            if isinstance(key.fileobj, Connection):
                key.fileobj.receive()
            else:
                self._accept(key.fileobj, key.data)
        for connection in self._connections:
            if connection.behind:
                connection.flush()
        self._forget_closed()

    def _accept(self, listener: object, session: Callable[[], Session]) -> None:
        if not isinstance(listener, socket.socket):
            return
        try:
            sock, _ = listener.accept()
        except OSError:
            return  # gone again before it was served
        client = session()
        if time.perf_counter() < self._cut_until and not isinstance(client, FaultSession):
            sock.close()
            return
        connection = Connection(sock, client)
        self._connections.append(connection)
        self._selector.register(connection, selectors.EVENT_READ)

    def _forget_closed(self) -> None:
        """Hang up on clients whose session has ended."""
        for connection in [connection for connection in self._connections if not connection.open]:
            self._selector.unregister(connection)
            self._connections.remove(connection)
            connection.release()

    def stall(self, seconds: float) -> None:
        """Be silent for `seconds`: nothing is read or sent, while program and arm go on."""
        self._stalled_until = time.perf_counter() + seconds

    def drop_links(self, seconds: float) -> None:
        """Hang up on every client, and on whoever comes within `seconds`, but for those of the fault port."""
        self._cut_until = time.perf_counter() + seconds
        for connection in self._connections:
            if not isinstance(connection.session, FaultSession):
                connection.close()

    def restore_links(self) -> None:
        """Take clients again, and hear them."""
        self._stalled_until = self._cut_until = 0.0

    def status(self) -> dict[str, object]:
        """What a person wants to know."""
        machine = self.machine
        return {
            "t": round(machine.t, 6),
            "profile": machine.profile.series,
            "robot_mode": machine.robot_mode.name,
            "safety_mode": machine.safety_mode.name,
            "program": machine.program_name,
            "runtime": machine.runtime.name,
            "remote_control": machine.remote,
            "q": list(machine.arm.q),
            "qd": list(machine.arm.qd),
            "digital_out": machine.io.digital_out,
            "clients": len(self._connections),
            "overruns": self.overruns,
            "lost": self.lost,
            "log": [[round(t, 3), text] for t, text in list(machine.log)[-10:]],
        }

    def close(self) -> None:
        """Hang up on everybody and free the ports."""
        for connection in self._connections:
            connection.release()
        for key in list(self._selector.get_map().values()):
            if isinstance(key.fileobj, socket.socket):
                key.fileobj.close()
        self._connections = []
        self._selector.close()
