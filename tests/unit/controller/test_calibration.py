"""A calibrated arm: its file, its kinematics, and what port 30001 says of it."""

import time
from pathlib import Path

import numpy as np
import pytest

from tests.calibrations import CONF, calibrated, written
from tests.controllers import new_machine, run_program
from weldsim.arm import Arm
from weldsim.controller.calibration import Calibration, read_calibration
from weldsim.controller.config import ControllerConfig
from weldsim.controller.kinematics import Kinematics
from weldsim.controller.primary import PERIOD, PrimarySession
from weldsim.errors import ConfigError
from weldsim.execution.primary_packet import ROBOT_MESSAGE, ROBOT_STATE, MessageReader, kinematics_in, sub_packages
from weldsim.kinematics import DH
from weldsim.mounts import X_FT
from weldsim.urscript.poses import matrix_of


def test_a_controllers_own_file_is_read(tmp_path: Path) -> None:
    found = read_calibration(written(tmp_path, calibrated(0.003)))
    assert found == calibrated(0.003)
    assert found.calibration_status == 2
    assert (Calibration().dh == DH).all()


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("[mounting]", "", "no table"),
        ("[mounting]", "[mounting", "TOML|calibration.conf"),
        ("delta_a", "delta_b", "delta_a = None"),
        ("delta_d = [", "delta_d = [0.0, ", "delta_d"),
        ("delta_alpha = [", "delta_alpha = [nan, ", "delta_alpha"),
        ("delta_alpha = [", "delta_alpha = 3 # ", "delta_alpha"),
        ("calibration_status = 2", "calibration_status = 9", "0, 1 or 2"),
        ("calibration_status = 2", "calibration_status = []", "0, 1 or 2"),
    ],
)
def test_a_file_that_cannot_be_is_named(old: str, new: str, why: str, tmp_path: Path) -> None:
    path = written(tmp_path, calibrated(0.001))
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=why):
        read_calibration(path)


@pytest.mark.parametrize("bad", ["[0, 0, 0, 0, 0, true]", "[0, 0, 0, 0, 0, inf]", "[0, 0, 0, 0, 0, 2]", "[0, 0, 0, 0, 0, '0']"])
def test_a_correction_that_cannot_be_is_refused(bad: str, tmp_path: Path) -> None:
    path = tmp_path / CONF
    path.write_text(
        f"[mounting]\ndelta_theta = [0,0,0,0,0,0]\ndelta_a = {bad}\ndelta_d = [0,0,0,0,0,0]\ndelta_alpha = [0,0,0,0,0,0]\n"
    )
    with pytest.raises(ConfigError, match="delta_a"):
        read_calibration(path)


def test_no_file_and_no_text(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        read_calibration(tmp_path / "nowhere.conf")
    (tmp_path / "binary.conf").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"calibration\.conf"):
        read_calibration(tmp_path / "binary.conf")


@pytest.mark.parametrize("size", [0.0002, 0.001, 0.003])
@pytest.mark.parametrize("seed", range(3))
def test_a_test_arm_is_off_by_what_was_asked_though_its_figures_are_off_by_metres(size: float, seed: int) -> None:
    arm = calibrated(size, seed)
    assert Arm(dh=arm.dh).deviation() == pytest.approx(size, rel=0.05)
    assert np.abs(arm.dh - DH).max() > 5.0


@pytest.mark.parametrize("seed", range(10))
def test_a_calibrated_arm_comes_back_to_its_joints_and_is_not_the_nominal_one(seed: int) -> None:
    rng, arm, tcp = np.random.default_rng(seed), Kinematics(calibrated(0.003, seed).dh), X_FT.matrix
    q = rng.uniform(-2.5, 2.5, 6)
    q[4] = 1.0 + rng.uniform(-0.5, 0.5)  # the wrist out of its singularity
    q[2] = rng.choice([-1, 1]) * rng.uniform(0.4, 2.5)  # nor the arm stretched out
    pose = arm.tcp_pose(q.tolist(), tcp)
    assert 1e-5 < np.abs(np.array(pose[:3]) - Kinematics().tcp_pose(q.tolist(), tcp)[:3]).max() < 0.006
    found = arm.pose_joints(pose, tcp, (q + 0.01).tolist())
    assert found is not None
    np.testing.assert_allclose(found, q, atol=1e-8)
    J, h = arm.jacobian(q.tolist(), tcp), 1e-6
    for joint in range(6):
        moved = arm.tcp_pose((q + h * np.eye(6)[joint]).tolist(), tcp)
        np.testing.assert_allclose(J[:3, joint], (np.array(moved[:3]) - pose[:3]) / h, atol=1e-5)


def test_a_program_moves_the_calibrated_arm_to_the_pose_itself() -> None:
    machine = new_machine(config=ControllerConfig(calibration=calibrated(0.003)))
    start = machine.arm.q
    pose = machine.kinematics.tcp_pose(start, np.eye(4))
    pose[2] -= 0.02
    run_program(machine, f"movel(p[{', '.join(map(str, pose))}], a=1, v=0.1)")
    np.testing.assert_allclose(machine.kinematics.tcp_pose(machine.reference.q, np.eye(4))[:3], pose[:3], atol=1e-9)
    assert np.abs(Kinematics().tcp_matrix(machine.reference.q, np.eye(4)) - matrix_of(pose)).max() > 1e-4
    assert np.abs(np.array(machine.snapshot.tcp_pose_target[:3]) - pose[:3]).max() < 1e-9


def test_the_primary_port_tells_its_arm_ten_times_a_second_and_takes_programs() -> None:
    machine = new_machine(config=ControllerConfig(calibration=calibrated(0.003)))
    began, sent, times = time.perf_counter(), b"", []
    session = PrimarySession(machine)
    assert session.greeting() == b""
    assert session.data() == b""
    while len(times) < 3:
        if data := session.data():
            sent += data
            times.append(time.perf_counter() - began)
        time.sleep(0.001)
    assert (np.array(times) >= PERIOD * np.arange(1, 4)).all()
    messages = list(MessageReader().feed(sent))
    assert [kind for kind, _ in messages] == [ROBOT_MESSAGE, ROBOT_STATE, ROBOT_STATE, ROBOT_STATE]
    assert b"URControl\x03\x0f" in messages[0][1]
    for _, state in messages[1:]:
        assert [kind for kind, _ in sub_packages(state)] == list(range(9))
        found = kinematics_in(state)
        assert found is not None
        assert (found.dh == calibrated(0.003).dh).all()
        assert found.status == 2
    assert session.received(b"def job():\n  while True:\n    sync()\n  end\nend\n") == b""
    assert machine.program_name == "job"
