"""`weldsim execute`: bad input is one line, a refusal says why, neither moves anything; a weld leaves log and report."""

import copy
import json
import os
import shlex
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.controllers import served
from tests.machine import unless_held_up
from tests.path_files import document, written
from tests.ur_robots import PATIENT
from weldsim.cli import main
from weldsim.errors import InputError
from weldsim.execution.black_box import read_black_box
from weldsim.execution.simulated import SimulatedRobot
from weldsim.execution.ur_robot import UrRobot
from weldsim.scene.world import HOME


def changed(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    out = copy.deepcopy(document())
    change(out)
    return out


@pytest.fixture
def moves(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was sent to a simulated or real robot."""
    sent: list[str] = []
    true_servo, true_connect = SimulatedRobot.servo, SimulatedRobot.connect

    def servo(self: SimulatedRobot, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        sent.append("servo")
        return true_servo(self, q, qd)

    monkeypatch.setattr(SimulatedRobot, "servo", servo)
    monkeypatch.setattr(SimulatedRobot, "connect", lambda self: (sent.append("connect"), true_connect(self))[1])
    monkeypatch.setattr(UrRobot, "connect", lambda self: sent.append("connect"))
    return sent


SEAM = 0
BAD = {
    "malformed": '{"schema": ',
    "one point": changed(lambda d: d["seams"][SEAM].update(poses=d["seams"][SEAM]["poses"][:1])),
    "NaN": changed(lambda d: d["seams"][SEAM]["poses"][3].update(position=[float("nan"), 0.0, 0.0])),
    "quaternion": changed(lambda d: d["seams"][SEAM]["poses"][3].update(quaternion_wxyz=[1.0, 1.0, 0.0, 0.0])),
    "millimetres": changed(lambda d: [p.update(position=[1e3 * x for x in p["position"]]) for p in d["seams"][SEAM]["poses"]]),
    "far away": changed(lambda d: [p.update(position=[x + 400 for x in p["position"]]) for p in d["seams"][SEAM]["poses"]]),
    "no seam": changed(lambda d: d.update(seams=[])),
    "another schema": changed(lambda d: d.update(schema="weldsim.path/9")),
    "speed": changed(lambda d: d["seams"][SEAM].update(speed=-1.0)),
}


@pytest.mark.parametrize("robot", ["sim", "ur"])
@pytest.mark.parametrize("case", BAD)
def test_a_file_that_is_no_path(
    case: str, robot: str, tmp_path: Path, moves: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, BAD[case])
    assert main(["execute", file, "--robot", robot, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert said.err.startswith("weldsim: ")
    assert not said.out
    assert not moves
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "options",
    [
        ["--speed-scale", "0"],
        ["--speed-scale", "1.5"],
        ["--speed-scale", "nan"],
        ["--host", "127.0.0.1"],
        ["--seam", "2"],
        ["--seam", "0"],
        ["--scene", "nowhere"],
        ["--out", "."],
        ["--set", "execution.gate.tip_speed=1.0"],
    ],
)
def test_options_that_cannot_be(options: list[str], tmp_path: Path, moves: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["execute", written(tmp_path, document()), "--robot", "sim", "--out", str(tmp_path / "out"), *options]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not moves


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (document(shift=(0.0, -1.2, 0.1)), "unreachable"),
        (document(shift=(0.0, -0.48, -0.02)), "collision"),
        (document(speed=0.3), "speed"),
        (
            changed(lambda d: [p.update(quaternion_wxyz=[1.0, 0.0, 0.0, 0.0]) for p in d["seams"][SEAM]["poses"][15:]]),
            "orientation",
        ),
    ],
)
def test_what_a_dry_run_refuses_is_not_begun(
    content: dict[str, Any], why: str, tmp_path: Path, moves: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["execute", written(tmp_path, content), "--robot", "sim", "--out", str(out), "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert why in said["dry_run"]["trials"][0]["first_failure"]["verdict"]
    assert not said["moved"]
    assert not said["passed"]
    assert moves == ["connect"]
    assert sorted(path.name for path in out.iterdir()) == [
        "config.json",
        "contract.json",
        "dry_run.json",
        "path.json",
        "run.json",
    ]


def test_a_refusal_names_the_dry_run_that_repeats_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, document(shift=(0.0, -1.2, 0.1)))
    assert main(["execute", file, "--robot", "sim", "--scene", "plain", "--out", str(tmp_path / "out")]) == 1
    line = next(line for line in capsys.readouterr().out.splitlines() if "weldsim dry-run" in line)
    words = shlex.split(line.partition("fails; ")[2].removesuffix(" looks for a fix"))
    assert words[:5] == ["weldsim", "dry-run", file, "--scene", "plain"]
    assert main([*words[1:], "--no-fix"]) == 1
    assert "unreachable" in capsys.readouterr().out


def test_a_path_off_the_scenes_seam_is_asked_about_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[str] = []

    def connect(_: SimulatedRobot) -> None:
        told.append(capsys.readouterr().err)
        raise InputError("far enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(SimulatedRobot, "connect", connect)
    main(["execute", written(tmp_path, document(shift=(0.15, -0.6, 0.022))), "--robot", "sim", "--scene", "straight"])
    assert "off the nearest seam of the part in straight: is it that part's" in told[0]
    main(["execute", written(tmp_path, document(shift=(-0.015, -0.45, 0.022))), "--robot", "sim", "--scene", "straight"])
    assert "nearest seam" not in told[1]


def test_a_scenes_own_limits_are_those_of_the_json_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, file = tmp_path / "out", written(tmp_path, document(shift=(-0.015, -0.45, 0.022)))
    own = ["--scene", "straight", "--set", "scene.limits.max=0.0077"]
    main(["execute", file, "--robot", "sim", "--out", str(out), "--json", *own])
    checks = json.loads(capsys.readouterr().out)["report"]["checks"]
    assert "<= 7.7 mm" in [check["limit"] for check in checks]
    assert checks == json.loads((out / "report.json").read_text())["checks"]


def test_a_weld_leaves_log_and_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, file = tmp_path / "out", written(tmp_path, document())
    assert main(["execute", file, "--robot", "sim", "--arc", "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["passed"]
    assert said["contract"]["kept"]
    assert said["report"]["tracking_p95"] < 0.3e-3
    assert said["stopped"] is None
    log = np.load(out / "log.npz")
    assert log["arc_on"].any()
    assert (log["segments"][log["arc_on"]] == "weld").all()
    assert np.abs(log["q_act"][0] - HOME).max() < 1e-6
    assert (out / "report.html").stat().st_size > 1e6
    assert (out / "report.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((out / "run.json").read_text())["passed"]
    assert not list(tmp_path.glob("*.black-box"))


def test_without_permission_the_arc_stays_off_and_slower_is_slower(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, times = written(tmp_path, document()), []
    for scale in ("1", "0.5"):
        out = tmp_path / scale
        assert main(["execute", file, "--robot", "sim", "--speed-scale", scale, "--out", str(out), "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        log = np.load(out / "log.npz")
        assert not log["arc_on"].any()
        assert said["report"]["speed_error_p95"] < 0.02
        times.append(float(log["t"][-1]))
    assert times[1] == pytest.approx(2 * times[0], abs=0.5)


def test_a_stop_exits_1_keeps_the_log_and_says_where_the_black_box_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, file = tmp_path / "out", written(tmp_path, document())
    # A limit of tracking below what a good arm keeps to.
    code = main(["execute", file, "--robot", "sim", "--out", str(out), "--json", "--set", "execution.gate.tracking=2e-5"])
    assert code == 1
    said = json.loads(capsys.readouterr().out)
    assert said["stopped"]["rule"] == "tracking"
    assert said["stopped"]["text"] in said["report"]["reasons"]
    record = read_black_box(said["black_box"])
    assert "tracking" in record.reason
    assert Path(said["black_box"]).parent == tmp_path / "out.black-box"
    assert len(np.load(out / "log.npz")["t"]) > 1


def test_ctrl_c_exits_130_and_keeps_the_log_and_twice_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    true_set_arc, true_stop, calls = SimulatedRobot.set_arc, SimulatedRobot.stop, []
    stopped: list[bool] = []

    def set_arc(self: SimulatedRobot, on: bool) -> None:
        true_set_arc(self, on)
        calls.append(on)
        if sum(calls) == 50:
            os.kill(os.getpid(), signal.SIGINT)

    def stop(self: SimulatedRobot) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        true_stop(self)
        stopped.append(True)

    monkeypatch.setattr(SimulatedRobot, "set_arc", set_arc)
    monkeypatch.setattr(SimulatedRobot, "stop", stop)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    out = tmp_path / "out"
    assert main(["execute", written(tmp_path, document()), "--robot", "sim", "--arc", "--out", str(out), "--json"]) == 130
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    said = json.loads(capsys.readouterr().out)
    assert stopped
    assert said["stopped"]["text"].startswith("interrupted: the arc is off and the arm was stopped; black box: ")
    assert not said["passed"]
    log = np.load(out / "log.npz")
    assert 0 < log["arc_on"].sum() < len(log["t"])
    assert not log["arc_on"][-1]
    assert np.abs(log["qd_act"][-1]).max() < 5e-3
    assert "interrupted" in json.loads((out / "run.json").read_text())["stopped"]


def test_a_broken_contract_moves_nothing(
    tmp_path: Path, moves: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from dataclasses import replace

    true_facts = SimulatedRobot.facts
    monkeypatch.setattr(SimulatedRobot, "facts", lambda self: replace(true_facts(self), safety="protective stop"))
    assert main(["execute", written(tmp_path, document()), "--robot", "sim", "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out
    assert "REFUSED" in said
    assert "nothing has moved: simulated UR5: contract: safety: protective stop, expected normal" in said
    assert moves == ["connect"]


@pytest.mark.slow
@unless_held_up
def test_a_controller_on_the_network_welds_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    file = written(tmp_path, document())
    patience = [word for name, value in PATIENT.items() for word in ("--set", f"execution.ur.{name}={value}")]
    with served("--profile", "cb3") as host:
        main(["execute", file, "--robot", "ur", "--host", host, "--arc", "--out", str(tmp_path / "ur"), "--json", *patience])
    out, err = capsys.readouterr()
    assert out, err
    said = json.loads(out)
    assert said["contract"]["kept"], said["contract"]
    assert said["moved"]
    assert said["stopped"] is None, said["stopped"]
    assert said["report"]["tracking_p95"] < 0.3e-3
    log = np.load(tmp_path / "ur" / "log.npz")
    assert (log["segments"][1:][log["arc_on"][:-1] & log["arc_on"][1:]] != "air").all()


def test_no_controller_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--set", "execution.ur.connect_timeout=1"]
    file = written(tmp_path, document())
    assert main(["execute", file, "--robot", "ur", "--host", "127.9.9.9", "--out", str(tmp_path / "out"), *options]) == 1
    assert "127.9.9.9" in capsys.readouterr().err
