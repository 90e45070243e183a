"""One connection to a UR controller: made in the one order that works, and every step of it within a time."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from weldsim.errors import ExecutionError
from weldsim.execution.rtde_talk import LinkError, commanded_by_another
from weldsim.execution.ur_arm import ArmTold, tell_arm
from weldsim.execution.ur_client import ClientSettings
from weldsim.execution.ur_config import PERIODS, Series, UrConfig
from weldsim.execution.ur_dashboard import Dashboard, Identity
from weldsim.execution.ur_modes import RuntimeState
from weldsim.execution.ur_process import ClientError, ClientProcess
from weldsim.execution.ur_status import LOCAL, Trouble, foreign_trouble, safety_trouble
from weldsim.execution.ur_stream import Sample, StateStream

READY = 1  # output_int_register_0 while ur_rtde's script waits for a command
HANDED_BACK = 1.0  # [s] in which a client that has just gone must have given back what it commanded by
ON_ITS_WAY = 3  # states that a network may hold
PROOF = 0.2  # [s] in which the states show what is wrong
READ_BACK = 1e-6  # [m], [rad], [kg] that a setting may differ by when read back


@dataclass(eq=False)
class Link:
    """What a connection consists of.

    Attributes:
        series, period [s]: of the controller.  identity: what the dashboard says.  arm: its own figures.
        stream: of states.  client: the process that commands.  first: the state when all was ready.
    """

    series: Series
    period: float
    identity: Identity
    arm: ArmTold
    stream: StateStream
    client: ClientProcess
    first: Sample


def open_link(config: UrConfig, name: str) -> Link:
    """A connection whose control program runs and waits, arc off, TCP and payload as configured.

    A controller that another client commands is left to it. Whatever program runs otherwise is stopped: with one running, and a
    ready flag left behind by an earlier client, the client library waits for minutes.

    Raises:
        ExecutionError: nobody answers, remote control is off, another client commands, the arm is stopped, a setting is not
            taken; `data`: rule, value, limit.
    """

    def refuse(trouble: Trouble) -> ExecutionError:
        return trouble.error(name)

    stream: StateStream | None = None
    client: ClientProcess | None = None
    try:
        identity = _greet(config)
        arm = tell_arm(config.host)
        stream = StateStream(config.host, config.connect_timeout)
        series = _series(config, stream)
        sample = _await(stream, lambda sample: True, config.connect_timeout)
        if trouble := safety_trouble(sample):
            raise refuse(trouble)
        _await(stream, lambda sample: sample.runtime_state == RuntimeState.STOPPED, config.connect_timeout, "end the old program")
        client = ClientProcess(client_settings(config, PERIODS[series]), config.answer_timeout)
        client.wait_ready(config.connect_timeout)
        _skip_old(stream, config.connect_timeout)
        first = _first(stream, config)
        for trouble in (_tcp_trouble(config, client.tcp), _payload_trouble(config, first)):
            if trouble is not None:
                raise refuse(trouble)
        return Link(series=series, period=PERIODS[series], identity=identity, arm=arm, stream=stream, client=client, first=first)
    except (LinkError, ClientError) as error:
        hint = "" if isinstance(error, ClientError) else "; is it switched on, and is that its address (--host, execution.ur.host)?"
        trouble = _meanwhile(config, stream) or Trouble("connection", f"not connected: {error}{hint}")
        _abandon(stream, client)
        raise refuse(trouble) from None
    except ExecutionError:
        _abandon(stream, client)
        raise


def client_settings(config: UrConfig, period: float) -> ClientSettings:
    """What the client process is told."""
    return ClientSettings(
        host=config.host,
        period=period,
        arc_output=config.arc_output,
        buffer=config.buffer,
        lookahead=config.lookahead,
        gain=config.gain,
        watchdog_rate=config.watchdog_rate,
        stall=config.stall,
        stop_deceleration=config.stop_deceleration,
        tcp=config.tcp,
        payload=config.payload,
        payload_cog=config.payload_cog,
    )


def _greet(config: UrConfig) -> Identity:
    """Who it is, once whatever program it ran is stopped. Raises LinkError, ExecutionError."""
    with Dashboard(config.host, config.connect_timeout) as dashboard:
        identity = dashboard.identity()
        if identity.remote_control is False:
            raise LOCAL.error(f"UR at {config.host}")
        _leave_to_another(config)
        if not dashboard.stop_program():
            raise LinkError("the dashboard does not obey; is the pendant in local control?")
    return identity


def _leave_to_another(config: UrConfig) -> None:
    """Nothing, where no other client commands: stopping its program would stop its weld. Raises LinkError, ExecutionError."""
    end = time.monotonic() + HANDED_BACK
    while commanded_by_another(config.host, config.connect_timeout):
        if time.monotonic() > end:
            raise ExecutionError(
                f"UR at {config.host}: another client commands it, a second weldsim or a fieldbus adapter say; end that, connect"
                " again",
                rule="other_client",
            )
        time.sleep(0.1)


def _series(config: UrConfig, stream: StateStream) -> Series:
    found: Series = "cb3" if stream.version[0] <= 3 else "e"
    if config.series not in ("auto", found):
        raise ExecutionError(
            f"UR at {config.host}: its software {'.'.join(map(str, stream.version[:3]))} is of series {found}, ur.series says"
            f" {config.series}; correct it, or leave it at auto",
            rule="series",
            value=found,
            limit=config.series,
        )
    return found


def _await(stream: StateStream, condition: Callable[[Sample], bool], seconds: float, goal: str = "send its state") -> Sample:
    """The first sample that fulfils a condition. Raises LinkError where none comes within `seconds`."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        if stream.wait(left):
            sample = stream.take()
            if condition(sample):
                return sample
    raise LinkError(f"the controller did not {goal} within {seconds:g} s")


def _meanwhile(config: UrConfig, stream: StateStream | None) -> Trouble | None:
    """What has come into the way of a connection that was being made: the library does not say. None where nothing is found."""
    if stream is None:
        return None
    end = time.monotonic() + PROOF
    try:
        while (left := end - time.monotonic()) > 0 and stream.wait(left):  # what waits already may be older than the trouble
            if trouble := safety_trouble(stream.take()):
                return trouble
        with Dashboard(config.host, PROOF) as dashboard:
            return LOCAL if dashboard.remote_control() is False else foreign_trouble(dashboard.ask("programState"))
    except LinkError:
        return None


def _skip_old(stream: StateStream, seconds: float) -> None:
    """Nothing, once what was on its way before this call is taken. Raises LinkError.

    States carry the moment at which they were read, together with all that had come in by then: where this process was held up
    that is much later than they were sent, so the first lot that is read after this call is old too.
    """
    lot = time.monotonic()
    for _ in range(2):
        lot = _await(stream, lambda sample, after=lot: sample.arrived > after, seconds).arrived
    for _ in range(ON_ITS_WAY):
        _await(stream, lambda sample: True, seconds)


def _first(stream: StateStream, config: UrConfig) -> Sample:
    """The first state in which all is ready; a payload that was set may take some of them to be told. Raises LinkError."""
    end = time.monotonic() + PROOF
    while True:
        first = _await(stream, lambda sample: _ready(sample, config), config.connect_timeout, "wait for commands with the arc off")
        if _payload_trouble(config, first) is None or time.monotonic() > end:
            return first


def _ready(sample: Sample, config: UrConfig) -> bool:
    return (
        sample.runtime_state == RuntimeState.PLAYING
        and sample.output_int_register_0 == READY
        and not sample.actual_digital_output_bits >> config.arc_output & 1
    )


def _tcp_trouble(config: UrConfig, tcp: list[float]) -> Trouble | None:
    off = float(np.abs(np.array(tcp) - config.tcp).max()) if len(tcp) == 6 else np.inf
    if off <= READ_BACK:
        return None
    return Trouble(
        "tcp", f"TCP {config.tcp} was set, {tcp} is read back; is a program or a safety setting in its way?", off, READ_BACK
    )


def _payload_trouble(config: UrConfig, sample: Sample) -> Trouble | None:
    """None too where the controller does not report it (software before 3.11)."""
    if sample.payload is None:
        return None
    cog = sample.payload_cog or config.payload_cog
    off = max(abs(sample.payload - config.payload), *(abs(a - b) for a, b in zip(cog, config.payload_cog, strict=True)))
    if off <= READ_BACK:
        return None
    said = f"{sample.payload:g} kg at {tuple(cog)}"
    return Trouble("payload", f"payload {config.payload:g} kg at {config.payload_cog} was set, {said} is read back", off, READ_BACK)


def _abandon(stream: StateStream | None, client: ClientProcess | None) -> None:
    if client is not None:
        client.close(1.0)
    if stream is not None:
        stream.close()
