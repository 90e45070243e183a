"""`weldsim dry-run --arm`: figures that a controller told, or keeps in its own file; what is none is one line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.calibrations import PUBLISHED, calibrated, written
from tests.torch_paths import OVER
from weldsim.arm import Arm
from weldsim.cli import main
from weldsim.kinematics import DH
from weldsim.records import RobotFacts
from weldsim.welding.folder import contract_json, read_told_arm

FACTS = RobotFacts(model="UR5", series="cb3", version="3.15.8", serial="1", dh=PUBLISHED)
START = ", ".join(map(str, OVER))
ROWS = "".join(f"{-0.01 + 0.001 * k:.3f},-0.48,0.06,3.141592653589793,0,0\n" for k in range(20))


def told(folder: Path, facts: RobotFacts | None) -> Path:
    path = folder / "contract.json"
    path.write_text(json.dumps(contract_json((), facts)))
    return path


def exported(folder: Path, arm: Path | None) -> np.ndarray:
    """Joint angles of the weld in the exported program."""
    (folder / "path.csv").write_text(ROWS)
    options = [] if arm is None else ["--arm", str(arm)]
    options += [
        "--start",
        START,
        "--roll",
        "--tool",
        "torch",
        "--no-fix",
        "--export",
        str(folder / "weld.script"),
        "--set",
        "motion.approach=20 mm",
    ]
    assert main(["dry-run", str(folder / "path.csv"), *options]) == 0
    lines = [line.partition("servoj([")[2].partition("]")[0] for line in (folder / "weld.script").read_text().splitlines()]
    return np.array([[float(word) for word in line.split(",")] for line in lines if line])


def test_figures_come_back_as_they_were_told(tmp_path: Path) -> None:
    assert (read_told_arm(told(tmp_path, FACTS)).dh == PUBLISHED).all()
    assert read_told_arm(told(tmp_path, replace(FACTS, dh=DH))).nominal


def test_an_arms_own_program_is_exported(tmp_path: Path) -> None:
    arm = calibrated(0.003)
    own, again = exported(tmp_path, told(tmp_path, replace(FACTS, dh=arm.dh))), exported(tmp_path, written(tmp_path, arm))
    assert (own == again).all()
    for q, which in ((own, Arm(dh=arm.dh)), (exported(tmp_path, None), Arm())):
        tips = which.torch_tip(q)
        assert np.abs(tips[:, 1:] - [-0.48, 0.06]).max() < 3e-5
    assert np.abs(Arm(dh=arm.dh).torch_tip(q)[:, 1:] - [-0.48, 0.06]).max() > 2e-4


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "no contract.json"),
        ("[]", "no contract.json"),
        ('{"facts": null}', "did not tell"),
        ('{"facts": {"dh": null}}', "did not tell"),
        ('{"facts": {"dh": [[1, 2], [3]]}}', "no contract.json"),
        ('{"facts": {"dh": [[1, 2, 3, 4]]}}', "six rows of four"),
        (json.dumps({"facts": {"dh": (DH + 0.05).tolist()}}), "another arm"),
        (None, "No such file"),
    ],
)
def test_what_is_no_arm(content: str | None, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, arm = tmp_path / "path.csv", tmp_path / "arm.json"
    path.write_text(ROWS)
    if content is not None:
        arm.write_text(content)
    assert main(["dry-run", str(path), "--arm", str(arm)]) == 2
    said = capsys.readouterr()
    assert says in said.err
    assert said.err.count("\n") == 1


def test_a_robot_program_has_its_arms_angles_already(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "go.script"
    path.write_text(2 * f"movej([{START}])\n")
    assert main(["dry-run", str(path), "--arm", str(told(tmp_path, FACTS))]) == 2
    assert "--arm is for paths" in capsys.readouterr().err
