"""More of what the unmodified ur_rtde client can ask, on both profiles: files, power, reports, jogging, paths, refusals."""

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from tests.controllers import served
from weldsim.frames import Transform


@pytest.fixture(scope="module", params=("cb3", "e"))
def series(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def seen(series: str) -> dict[str, Any]:
    """What the client was answered, see `tests.ur_visit`."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with served("--profile", series) as host:
        command = [sys.executable, "-m", "tests.ur_visit", host]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=os.environ, check=False)
    assert "ANSWERS" in done.stdout, done.stdout + done.stderr
    return json.loads(done.stdout.partition("ANSWERS ")[2])


def test_a_program_file_can_be_played(seen: dict[str, Any]) -> None:
    states = ["PLAYING weld.urp", "PAUSED weld.urp", "PLAYING weld.urp", "STOPPED weld.urp"]
    assert seen["files"] == ["Loaded program: weld.urp", *states, "File not found: weld.txt"]
    assert seen["power"] == [f"Robotmode: {mode}" for mode in ("POWER_OFF", "IDLE", "RUNNING", "RUNNING")]


def test_every_report_can_be_read(seen: dict[str, Any], series: str) -> None:
    complaints = {name: value for name, value in seen["reports"].items() if isinstance(value, str)}
    assert set(complaints) == ({"getFtRawWrench"} if series == "cb3" else set())  # a CB3 has no such sensor
    reports = seen["reports"]
    assert len(reports) > 40
    assert reports["getJointMode"] == [253] * 6
    assert (reports["getRobotStatus"], reports["getSafetyStatusBits"]) == (0b1011, 1)
    np.testing.assert_allclose(reports["getTargetQ"], reports["getActualQ"], atol=1e-3)
    # The weight of arm and torch is held by the middle joints.
    assert np.abs(reports["getTargetMoment"][1:3]).min() > 5.0
    head, rows, columns = seen["recorded"]
    assert head == ["timestamp", "actual_q_0"]
    assert rows > 20
    assert columns >= 7


def test_tool_and_kinematics(seen: dict[str, Any]) -> None:
    assert seen["setTcp"] is True
    assert max(seen["fk"]) < 2e-3
    np.testing.assert_allclose(seen["pose_trans"], [0.1, 0.3, 0.3, 0, 0, 1.5707963], atol=1e-6)
    np.testing.assert_allclose(seen["flange"][0][:3], seen["flange"][1][:3], atol=1e-3)
    assert all(seen["plain"])
    assert seen["still"] == [True, 0, True]


def test_custom_scripts_and_registers(seen: dict[str, Any]) -> None:
    assert seen["custom"] is True
    assert seen["custom2"] is True
    assert seen["copied"] == [-7, 2.5]
    assert seen["outs"] == [True, True, False]
    assert seen["after_custom"] is True


def test_streams_and_jogging(seen: dict[str, Any]) -> None:
    assert seen["servoL_off"] < 5e-4
    assert seen["servoL_stop"] is True
    (base, _), (tool, pose) = seen["jogs"]
    np.testing.assert_allclose(base, [0, 0, 0.02, 0, 0, 0], atol=1e-3)
    along = Transform.from_rotation_vector("BT", np.array(pose[3:]), np.zeros(3)).R[:, 2]
    np.testing.assert_allclose(tool[:3], 0.02 * along, atol=1e-3)
    assert seen["watchdog"]
    assert seen["fed"]
    assert seen["reupload"]


def test_paths_and_progress(seen: dict[str, Any]) -> None:
    assert seen["movePath"] is True
    assert max(seen["movePath_off"], seen["path_off"]) < 5e-4
    # Each of its two pieces is told, then that it is over.
    assert {0, 1} <= set(seen["progress"])
    assert min(seen["progress"]) < 0
    assert 0.01 < seen["stopL_left"] < 0.049
    assert seen["stopL_speed"] < 5e-3


@pytest.mark.parametrize("call", ["moveJ", "moveL", "moveJ_IK", "ik"])
def test_what_cannot_be_done_is_refused_without_hanging(seen: dict[str, Any], call: str) -> None:
    refused = seen["refused"][call]
    assert refused["took"] < 1.0
    assert refused["ended"]
    assert refused["again"] is True
    assert refused["answer"] == ([] if call == "ik" else False)
    assert seen["has_ik"] is False
