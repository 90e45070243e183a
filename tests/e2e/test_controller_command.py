"""`weldsim controller` as people start it: its speed, its addresses, its faults."""

import struct
import subprocess
import sys
import time
from pathlib import Path
from socket import create_connection
from typing import get_args

import pytest

from tests.controllers import free_address, served, wait_for
from weldsim.cli import main
from weldsim.controller.ask import ask
from weldsim.controller.fault_names import FaultName
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType
from weldsim.execution.ur_ports import REALTIME, RTDE

README = Path(__file__).parents[2] / "README.md"


def clock(host: str, seconds: float) -> tuple[float, float]:
    """Seconds that passed, and that the controller's timestamps say."""
    reader, stamps = PacketReader(), []
    with create_connection((host, RTDE), 5.0) as sock:
        setup = struct.pack(">d", 125.0) + b"timestamp"
        for kind, payload in (
            (PacketType.PROTOCOL_VERSION, b"\x00\x02"),
            (PacketType.SETUP_OUTPUTS, setup),
            (PacketType.START, b""),
        ):
            sock.sendall(Packet(kind, payload).encode())
        end = time.perf_counter() + seconds
        while (now := time.perf_counter()) < end:
            stamps += [
                (now, struct.unpack(">d", packet.payload[1:])[0])
                for packet in reader.feed(sock.recv(4096))
                if packet.type == PacketType.DATA
            ]
    return stamps[-1][0] - stamps[0][0], stamps[-1][1] - stamps[0][1]


@pytest.mark.parametrize("speed", [5.0, 0.5])
def test_simulated_time_passes_at_the_speed_asked_for(speed: float) -> None:
    with served("--speed", str(speed)) as host:
        real, simulated = clock(host, 2.0)
        lost = float(str(ask(host, {"status": True})["lost"]))
        # What a busy machine could not make up for is said, and missing.
        assert simulated == pytest.approx(speed * real, rel=0.03, abs=speed * (lost + 0.1))
        assert simulated > 0.5 * speed * real
        # A joint move of 0.2 rad takes as long as it should in simulated time.
        began = float(str(ask(host, {"status": True})["t"]))
        q = [float(x) for x in ask(host, {"status": True})["q"]]
        target = [q[0] + 0.2, *q[1:]]
        with create_connection((host, REALTIME), 5.0) as sock:
            sock.sendall(f"def go():\n  movej([{', '.join(map(str, target))}], a=2.0, v=0.4)\nend\n".encode())
            assert wait_for(lambda: abs(ask(host, {"status": True})["q"][0] - target[0]) < 1e-3, 15.0)
        took = float(str(ask(host, {"status": True})["t"])) - began
        assert 0.65 <= took < 0.7 + max(0.5, 0.4 * speed)


def test_addresses_that_cannot_be_had_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with served() as host:
        assert main(["controller", "--host", host]) == 2
        assert "holds a second controller" in capsys.readouterr().err
    assert main(["controller", "--host", "203.0.113.9"]) == 2  # nobody's
    assert "second controller" not in capsys.readouterr().err
    assert main(["controller", "--host", "no such host"]) == 2
    assert main(["controller", "--speed", "0"]) == 2
    assert main(["controller", "status", "--host", free_address()]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 3, lines


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["fault"], "protective-stop, emergency-stop"),
        (["fault", "protectve-stop"], "'protective-stop'"),
        (["status", "stall"], "weldsim controller fault stall"),
        (["fault", "none"], "invalid choice"),
        (["status", "--set", "path.speed=1"], "--set path.speed=1 changes nothing"),
        (["--config", "no-such.toml"], "--config no-such.toml changes nothing"),
    ],
)
def test_words_that_order_nothing_are_refused(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["controller", *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert says in said


def test_only_the_address_asked_for_is_served() -> None:
    with served() as host:
        other = ".".join([*host.split(".")[:3], "8"])
        with pytest.raises(OSError, match="refused"):
            create_connection((other, RTDE), 1.0)


def test_every_fault_is_documented_and_can_be_ordered() -> None:
    text = README.read_text()
    for name in get_args(FaultName):
        assert f"| `{name}`" in text or f", `{name}`" in text, name
    with served("--profile", "e") as host:
        for name in get_args(FaultName):
            command = [sys.executable, "-m", "weldsim", "controller", "fault", name, "--host", host, "--seconds", "0.2"]
            done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
            assert done.returncode == 0, done.stderr
            assert done.stdout.startswith(name)
            time.sleep(0.3)
        now = ask(host, {"status": True})
        assert (now["robot_mode"], now["safety_mode"], now["runtime"]) == ("RUNNING", "NORMAL", "STOPPED")
