"""Calibrated arms behind real sockets: what the contract says of them, and welds that are where they were planned."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.calibrations import PUBLISHED, calibrated, written
from tests.controllers import PATIENCE
from tests.machine import unless_held_up
from tests.torch_paths import OVER, START, flat_curve, torch_path
from tests.ur_robots import CONNECT_TIMEOUT, PATIENT, controlled, place, ur_robot
from weldsim.arm import UR5, Arm
from weldsim.cli import main
from weldsim.controller.ask import ask
from weldsim.controller.calibration import Calibration
from weldsim.execution.contract import Clause, check_contract, contract
from weldsim.execution.ur_arm import tell_arm
from weldsim.execution.ur_config import Series
from weldsim.kinematics import DH, torch_pose
from weldsim.records import TorchPath
from weldsim.report.tracking import tracking_error

pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")


DOWN = np.array([0.0, 0.0, -1.0])
MIDDLE = np.array([0.0, -0.48, 0.06])


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
    assert geometry(clauses).value == "0.20 mm from a nominal UR5 at the worst (calibrated)"
    assert 1e-5 < np.linalg.norm(here.X_BT.p - torch_pose(here.q).p) < 0.3e-3  # the tip is where the calibrated arm has it


def document(path: TorchPath) -> dict[str, Any]:
    """A path file of one seam."""
    X_BT = path.X_BT
    poses = [
        {"s": s, "position": p, "quaternion_wxyz": q}
        for s, p, q in zip(path.s.tolist(), X_BT.p.tolist(), X_BT.quaternion.tolist(), strict=True)
    ]
    seam = {"id": "seam-1", "joint": "groove", "reference": "opening", "speed": float(path.speed[0])}
    seam |= {"points": X_BT.p.tolist(), "poses": poses}
    units = {"length": "m", "angle": "rad"}
    return {"schema": "weldsim.path/1", "frame": "base", "units": units, "seams": [seam], "timing": {}, "input": {}}


def measured(run: Path, path: TorchPath, arm: Arm) -> float:
    """Distance [m] that 95 in 100 keep of the tip from the path while the arc burnt, by the angles that were reported."""
    log = np.load(run / "log.npz")
    on = log["arc_on"]
    # What the controller told of the tip is what its own figures make of the angles.
    assert np.abs(log["position_B"] - arm.torch_tip(log["q_act"])).max() < 1e-6
    return tracking_error(arm.torch_tip(log["q_act"])[on], path.X_BT.p).p95


@unless_held_up
@pytest.mark.parametrize(("dh", "kind"), [(PUBLISHED, "line"), (calibrated(0.015, 2).dh, "arc")])
def test_a_calibrated_arm_welds_the_path_itself(
    dh: np.ndarray, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A UR5 as its owner published it, hundreds of metres of d and all; and one that is five times as far off."""
    path, arm = torch_path(flat_curve(kind, 0.03) + MIDDLE, DOWN, speed=0.02), Arm(dh=dh)
    file = tmp_path / "path.json"
    file.write_text(json.dumps(document(path)))
    told = Calibration(*(tuple(map(float, row)) for row in (dh - DH).T), 2)
    with controlled("cb3", "--calibration", str(written(tmp_path, told))) as host:
        place(host, OVER)
        options = ["--robot", "ur", "--host", host, "--arc", "--out", str(tmp_path / "out"), "--json"]
        patience = [f"execution.ur.{name}={value}" for name, value in PATIENT.items()]
        for setting in ("motion.return_home=false", "motion.approach=20 mm", *patience):
            options += ["--set", setting]
        capsys.readouterr()
        main(["execute", str(file), *options])
    said = json.loads(capsys.readouterr().out)
    assert said["moved"], said
    assert said["stopped"] is None
    geometry = next(line for line in said["contract"]["clauses"] if line["name"] == "arm geometry")
    assert geometry["passed"]
    assert geometry["value"] == f"{1e3 * arm.deviation():.2f} mm from a nominal UR5 at the worst (calibrated)"
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["tracking_p95"] < 0.3e-3
    assert measured(tmp_path / "out", path, arm) < 0.3e-3
    # The nominal arm's tip at those angles is not where the weld is.
    log = np.load(tmp_path / "out" / "log.npz")
    assert np.linalg.norm(UR5.torch_tip(log["q_act"]) - log["position_B"], axis=1).max() > 0.5e-3


def test_an_arm_that_is_another_is_refused_before_anything_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("weldsim.execution.ur_link.tell_arm", partial(tell_arm, seconds=PATIENCE))  # however busy the machine is
    path, out = tmp_path / "path.csv", tmp_path / "out"
    path.write_text("".join(f"{-0.4 + 0.002 * k:.3f},-0.3,0.1,2.2,2.2,0\n" for k in range(20)))
    with controlled("cb3", "--calibration", str(written(tmp_path, calibrated(0.025)))) as host:
        before = ask(host, {"status": True})["q"]
        words = ["execute", str(path), "--robot", "ur", "--host", host, "--out", str(out), "--json"]
        assert main([*words, "--set", f"execution.ur.connect_timeout={CONNECT_TIMEOUT}"]) == 1
        said = json.loads(capsys.readouterr().out)
        assert np.abs(np.subtract(ask(host, {"status": True})["q"], before)).max() < 1e-4
        monkeypatch.setattr("weldsim.execution.ur_arm.PRIMARY", 30021)  # as where a firewall, or a setting, closes it
        with ur_robot(host) as robot:
            clause = next(clause for clause in contract(robot.facts(), robot.state()) if clause.name == "arm geometry")
            assert (clause.value, clause.passed) == ("not told: closed", None)
            assert "touch a measured point" in clause.advice
    assert not said["moved"]
    text = said["stopped"]["text"]
    assert "contract: arm geometry: 25.00 mm from a nominal UR5 at the worst (calibrated), expected <= 20 mm" in text
    assert "another arm" in text
    assert text.endswith("nothing has moved")
    assert "\n" not in text
    written_down = json.loads((out / "contract.json").read_text())
    values = [line["value"] for line in written_down["clauses"] if line["name"] == "arm geometry"]
    assert values == ["25.00 mm from a nominal UR5 at the worst (calibrated)"]
    assert written_down["facts"]["dh"] == calibrated(0.025).dh.tolist()
