"""What somebody who knows a UR5 and ur_rtde, and not this controller, would try first; both profiles."""

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from tests.controllers import served


@pytest.fixture(scope="module", params=("cb3", "e"))
def seen(request: pytest.FixtureRequest) -> dict[str, Any]:
    """What the client was answered, see `tests.ur_stranger`."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with served("--profile", request.param, "--speed", "2") as host:
        command = [sys.executable, "-m", "tests.ur_stranger", host]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=os.environ, check=False)
    assert "ANSWERS" in done.stdout, done.stdout + done.stderr
    return json.loads(done.stdout.partition("ANSWERS ")[2])


def test_examples_of_ur_rtde_run(seen: dict[str, Any]) -> None:
    assert seen["examples"] == [True] * 3
    assert seen["examples_off"] < 5e-4
    assert seen["force"] == [True] * 3
    assert seen["again"] == [True] * 4


def test_straight_moves_start_where_the_tool_points_down(seen: dict[str, Any]) -> None:
    assert seen["down"] == [True] * 4
    assert seen["down_off"] < 5e-4


def test_moves_keep_their_laws(seen: dict[str, Any]) -> None:
    duration, peak, combined = seen["slow"]
    assert duration == pytest.approx((0.4 / 0.8 + 0.8 / 4.0) / 0.5, abs=0.1)
    assert (peak, combined) == pytest.approx((0.4, 0.5), abs=0.01)
    acceleration, stopped = seen["acceleration"]
    assert acceleration == pytest.approx(0.5, rel=0.2)
    assert stopped is True


def test_a_move_too_fast_for_the_arm_is_slowed_down(seen: dict[str, Any]) -> None:
    scaling, speed, safety = seen["limited"]
    assert (seen["fast"], safety) == (True, 1)
    assert scaling < 1.0
    assert speed < 3.4


def test_waypoint_and_pause(seen: dict[str, Any], request: pytest.FixtureRequest) -> None:
    if "[e]" in request.node.name:  # a CB3 has no such function
        np.testing.assert_allclose(*seen["waypoint"], atol=1e-3)
    state, speed = seen["paused"]
    assert state == 4
    assert speed < 5e-3
    assert seen["resumed_off"] < 1e-3


def test_power_is_reported(seen: dict[str, Any]) -> None:
    assert seen["power"] == [[3, 239, 0.0], [5, 255, 48.0], [7, 253, 48.0]]
    assert np.linalg.norm(seen["gravity"]) == pytest.approx(9.80665, abs=0.01)
