"""Calibrated arms behind real sockets: what the contract says of them before anything moves."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.calibrations import calibrated, written
from tests.machine import unless_held_up
from tests.torch_paths import START
from tests.ur_robots import CONNECT_TIMEOUT, controlled, ur_robot
from weldsim.cli import main
from weldsim.controller.ask import ask
from weldsim.execution.config import ContractConfig
from weldsim.execution.contract import Clause, check_contract
from weldsim.execution.ur_config import Series
from weldsim.kinematics import torch_pose

pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")


def geometry(clauses: tuple[Clause, ...]) -> Clause:
    return next(clause for clause in clauses if clause.name == "arm geometry")


@unless_held_up
@pytest.mark.parametrize("series", ["cb3", "e"])
def test_a_calibration_of_a_fifth_of_a_millimetre_is_kept(series: Series, tmp_path: Path) -> None:
    arm = calibrated(0.0002)
    with controlled(series, "--calibration", str(written(tmp_path, arm))) as host, ur_robot(host, START) as robot:
        facts, clauses = robot.facts(), check_contract(robot)
        here = robot.state()
        robot.servo(here.q, np.zeros(6))  # and it takes commands
    assert facts.dh is not None
    assert (facts.dh == arm.dh).all()
    assert geometry(clauses).passed
    assert geometry(clauses).value == "0.20 mm from ours at the worst (calibrated)"
    assert 1e-5 < np.linalg.norm(here.X_BT.p - torch_pose(here.q).p) < 0.3e-3  # the tip is where the calibrated arm has it


def test_a_calibration_of_three_millimetres_is_refused_before_anything_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, out = tmp_path / "path.csv", tmp_path / "out"
    path.write_text("".join(f"{-0.4 + 0.002 * k:.3f},-0.3,0.1,2.2,2.2,0\n" for k in range(20)))
    with controlled("cb3", "--calibration", str(written(tmp_path, calibrated(0.003)))) as host:
        before = ask(host, {"status": True})["q"]
        words = ["execute", str(path), "--robot", "ur", "--host", host, "--out", str(out), "--json"]
        assert main([*words, "--set", f"execution.ur.connect_timeout={CONNECT_TIMEOUT}"]) == 1
        said = json.loads(capsys.readouterr().out)
        assert np.abs(np.subtract(ask(host, {"status": True})["q"], before)).max() < 1e-4
        with ur_robot(host) as robot:  # who knows what it costs may have it
            assert geometry(check_contract(robot, ContractConfig(calibration=0.0035))).passed
        monkeypatch.setattr("weldsim.execution.ur_arm.PRIMARY", 30021)  # as where a firewall, or a setting, closes it
        with ur_robot(host) as robot:
            clause = geometry(check_contract(robot))
            assert (clause.value, clause.passed) == ("not told: closed", None)
    assert not said["moved"]
    text = said["stopped"]["text"]
    assert "contract: arm geometry: 3.00 mm from ours at the worst (calibrated), expected <= 1 mm; " in text
    assert "touch a measured point" in text
    assert "raise execution.contract.calibration above this figure" in text
    assert text.endswith("nothing has moved")
    assert "\n" not in text
    written_down = json.loads((out / "contract.json").read_text())
    values = [line["value"] for line in written_down["clauses"] if line["name"] == "arm geometry"]
    assert values == ["3.00 mm from ours at the worst (calibrated)"]
    assert written_down["facts"]["dh"] == calibrated(0.003).dh.tolist()
