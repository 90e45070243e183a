"""Virtual controllers for tests: one without a network, and one in its own process."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from tests.arm_worlds import bare_model
from weldsim.controller.arm import Arm
from weldsim.controller.config import ControllerConfig
from weldsim.controller.functions import builtins, elsewhere
from weldsim.controller.machine import Machine
from weldsim.controller.profile import PROFILES, Series
from weldsim.execution.ur_ports import DASHBOARD, FAULTS, PRIMARY, PRIMARY_READ_ONLY, REALTIME, RTDE, SECONDARY
from weldsim.scene.world import HOME

PORTS = (DASHBOARD, PRIMARY, SECONDARY, REALTIME, RTDE, PRIMARY_READ_ONLY, FAULTS)
PATIENCE = 30.0  # [s] in which what must come has come, on a machine that others use too

UNLOCK_DELAY = 2.0  # [s] of the controller that `tests.ur_tour` tours: who tries too early must not come too late


def new_machine(series: Series = "cb3", config: ControllerConfig | None = None) -> Machine:
    """A controller over the bare arm, its arm at HOME."""
    profile = PROFILES[series]
    machine = Machine(profile, Arm(bare_model(), HOME.tolist(), profile), config)
    machine.provide(builtins(machine), elsewhere(machine))
    return machine


def run_program(machine: Machine, text: str, seconds: float = 10.0) -> float:
    """Time [s] that a program took, to its end or to `seconds`; says why where it was refused."""
    began = machine.t
    assert machine.upload(text), machine.log[-1]
    while machine.program_name and machine.t - began < seconds:
        machine.tick()
    return machine.t - began


@cache
def own_network() -> tuple[str, socket.socket]:
    """The first half of addresses that are this process's own, other tests run beside it, and the socket that reserves them."""
    for k in range(200):
        half = f"127.{20 + (os.getpid() + k) % 200}"
        mark = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            mark.bind((f"{half}.255.7", FAULTS))
        except OSError:
            mark.close()
            continue
        return half, mark
    raise AssertionError("no free loopback network")


def free_address() -> str:
    """A loopback address none of whose controller ports is in use."""
    half, _ = own_network()
    for k in range(250):
        host = f"{half}.{k}.7"
        try:
            for port in PORTS:
                with socket.socket() as probe:
                    probe.bind((host, port))
        except OSError:
            continue
        return host
    raise AssertionError("no free loopback address")


@contextmanager
def served(*options: str) -> Iterator[str]:
    """The address of a controller that runs in its own process until the block ends."""
    host = free_address()
    command = [sys.executable, "-m", "weldsim", "controller", "--host", host, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert host in line, process.stderr.read() if process.stderr else ""
        try:
            yield host
        finally:
            process.terminate()
            process.wait(PATIENCE)


def wait_for(condition: object, seconds: float = PATIENCE, step: float = 0.02) -> bool:
    """Whether `condition()` came true within `seconds`."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():  # type: ignore[operator]
            return True
        time.sleep(step)
    return False
