"""`weldsim controller` as people start it: its speed, its addresses, its faults."""

import subprocess
import sys
import time
from pathlib import Path
from socket import create_connection
from typing import Any, get_args

import pytest

from tests.controllers import PATIENCE, free_address, served, wait_for
from tests.ur_record import Recorder
from weldsim.cli import main
from weldsim.controller.ask import ask
from weldsim.controller.fault_names import FaultName
from weldsim.execution.ur_ports import REALTIME, RTDE

README = Path(__file__).parents[2] / "README.md"


CATCH_UP = 0.1  # [s] of lateness that a controller makes good, before it says that it has lost time


def clocks(host: str) -> tuple[float, float, float, float]:
    """Before and after it was asked [s], the controller's time [s], and what it has lost of it [s]."""
    before = time.perf_counter()
    said = ask(host, {"status": True})
    return before, time.perf_counter(), float(said["t"]), float(said["lost"])


@pytest.mark.parametrize("speed", [5.0, 0.5])
def test_simulated_time_passes_at_the_speed_asked_for(speed: float) -> None:
    with served("--speed", str(speed)) as host, Recorder(host, {"target_qd": "VECTOR6D"}) as recorder:
        first = clocks(host)
        time.sleep(2.0)
        last = clocks(host)
        simulated, lost = last[2] - first[2], last[3] - first[3]
        least, most = last[0] - first[1], last[1] - first[0]
        # What a busy machine could not make up for is said, and missing.
        assert speed * (0.99 * least - lost - CATCH_UP) <= simulated <= speed * (1.01 * most - lost + CATCH_UP)
        assert simulated > 0.5 * min(1.0, speed) * least
        # A joint move of 0.2 rad takes as long as it should in simulated time.
        q = [float(x) for x in ask(host, {"status": True})["q"]]
        target = [q[0] + 0.2, *q[1:]]

        def there(now: dict[str, Any]) -> bool:
            return abs(now["q"][0] - target[0]) < 1e-3 and not now["program"]

        def move() -> bool:
            with create_connection((host, REALTIME), PATIENCE) as sock:
                sock.sendall(f"def go():\n  movej([{', '.join(map(str, target))}], a=2.0, v=0.4)\nend\n".encode())
                return wait_for(lambda: there(ask(host, {"status": True})))

        arrived, rows = recorder.during(move)
    assert arrived
    moving = [t for t, qd in rows if abs(qd[0]) > 1e-6]
    assert moving[-1] - moving[0] == pytest.approx(0.7, abs=0.03)


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
        (["fault", "protectve-stop"], "did you mean protective-stop?"),
        (["stall"], "did you mean weldsim controller fault stall?"),
        (["status", "stall"], "weldsim controller fault stall"),
        (["fault", "none"], "'none' is not one of"),
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
            done = subprocess.run(command, capture_output=True, text=True, timeout=4 * PATIENCE, check=False)
            assert done.returncode == 0, done.stderr
            assert done.stdout.startswith(name)
            time.sleep(0.3)
        now = ask(host, {"status": True})
        assert (now["robot_mode"], now["safety_mode"], now["runtime"]) == ("RUNNING", "NORMAL", "STOPPED")
