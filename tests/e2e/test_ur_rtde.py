"""The unmodified ur_rtde client against the virtual controller, over real sockets, both profiles."""

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from tests.controllers import UNLOCK_DELAY, served
from weldsim.frames import Transform
from weldsim.kinematics import flange_pose

SERIES = ("cb3", "e")
PERIOD = {"cb3": 0.008, "e": 0.002}


@pytest.fixture(scope="module", params=SERIES)
def series(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def seen(series: str) -> dict[str, Any]:
    """What the client was answered, see `tests.ur_tour`."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with served("--profile", series, "--unlock-delay", str(UNLOCK_DELAY)) as host:
        command = [sys.executable, "-m", "tests.ur_tour", host]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=os.environ, check=False)
    assert "ANSWERS" in done.stdout, done.stdout + done.stderr
    return json.loads(done.stdout.partition("ANSWERS ")[2])


def pose(values: list[float]) -> Transform:
    return Transform.from_rotation_vector("FT", np.array(values[3:]), np.array(values[:3]))


def test_controller_says_what_it_is(seen, series):
    assert seen["version"].startswith({"cb3": "3.15.", "e": "5.11."}[series])
    assert seen["model"] == "UR5"
    assert (seen["robot_mode"], seen["dashboard_mode"]) == (7, "Robotmode: RUNNING")
    assert seen["running"] == [True, 2, True]


def test_moves_arrive(seen):
    for name in ("moveJ", "moveL", "moveJ_IK", "path", "async"):
        assert seen[name] is True, name
    assert seen["moveJ_off"] < 5e-4
    assert seen["path_off"] < 5e-4
    assert seen["moveL_off"] < 3e-4
    assert seen["moveJ_IK_off"] < 3e-4


def test_asynchronous_move_is_stopped_on_its_way(seen):
    assert seen["async_progress"] >= 0
    assert seen["stopJ_speed"] < 5e-3
    assert seen["stopJ_short"] > 0.05


def test_kinematics_are_those_of_the_arm(seen):
    tool = [0.01, 0.02, 0.1, 0.1, 0.0, 0.0]
    np.testing.assert_allclose(seen["tcp_offset"], tool, atol=1e-12)
    assert (seen["payload"], seen["cog"]) == (1.3, [0.0, 0.01, 0.05])
    expected = flange_pose(np.array(seen["q"])) @ pose(tool)
    for key in ("fk", "tcp_pose"):
        found = Transform.from_rotation_vector("BT", np.array(seen[key][3:]), np.array(seen[key][:3]))
        np.testing.assert_allclose(found.p, expected.p, atol=1e-4)
        np.testing.assert_allclose(found.R, expected.R, atol=3e-4)
    np.testing.assert_allclose(seen["ik"], seen["q"], atol=2e-3)
    np.testing.assert_allclose(seen["ik_near"], seen["q"], atol=2e-3)
    assert seen["has_ik"] == [True, False]
    assert seen["safe"] == [True, True, True]


def test_signals_come_back(seen):
    assert seen["digital"] == [1 << 3 | 1 << 17, 0]
    np.testing.assert_allclose(seen["analog"], [2.5, 0.012])
    assert seen["slider"] == 0.5


def test_streams_are_followed(seen, series):
    assert seen["servo_count"] == 1.0
    assert seen["servoStop"] is seen["speedL"] is seen["speedStop"] is seen["speedJ"] is seen["speedStop2"] is True
    assert seen["servo_off"] < 1e-3
    np.testing.assert_allclose(seen["tcp_speed"], [0, 0, 0.04, 0, 0, 0], atol=2e-3)
    np.testing.assert_allclose(seen["joint_speed"], [0.2, 0, 0, 0, 0, 0], atol=5e-3)
    assert seen["rest"] < 5e-3
    assert seen["servo_period"] == pytest.approx(PERIOD[series], rel=0.25)  # the bench has the tight figure


def test_watchdog_ends_a_program_that_nobody_feeds(seen):
    assert seen["watchdog"] is True
    assert seen["after_watchdog"] == 1
    assert seen["reupload"] is True


def test_protective_stop_and_recovery(seen):
    assert seen["stopped"] == [True, 3, "Safetymode: PROTECTIVE_STOP"]
    assert seen["moveJ_stopped"] is False
    assert "Cannot unlock protective stop until" in seen["early_unlock"]
    assert seen["reupload2"] is True
    assert seen["recovered"] is True
    assert seen["recovered_off"] < 5e-4
    assert seen["stop_script"] == 1
    assert seen["still_connected"] is True
