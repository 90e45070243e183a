"""What a controller tells of itself while it moves, rests and has no power; and what an arm alone can do."""

import numpy as np
import pytest

from tests.controllers import new_machine, run_program
from weldsim.controller.dashboard import Dashboard
from weldsim.controller.inputs import InputRecipe
from weldsim.controller.machine import Machine
from weldsim.controller.outputs import find_output
from weldsim.controller.start import new_machine as new_machine_alone
from weldsim.execution.rtde_packet import layout
from weldsim.execution.ur_modes import RobotMode, SafetyMode
from weldsim.kinematics import SPEED_LIMIT
from weldsim.scene.world import HOME
from weldsim.urscript.poses import matrix_of

TARGET = HOME + np.array([0.4, -0.1, 0.1, 0.2, 0.1, -0.3])


@pytest.fixture(params=("cb3", "e"))
def machine(request: pytest.FixtureRequest) -> Machine:
    return new_machine(request.param)


def listed(values) -> str:
    return f"[{', '.join(f'{value:.9f}' for value in values)}]"


def reported(machine: Machine, name: str):
    found = find_output(name, machine.profile)
    assert found is not None
    return found[1](machine.snapshot)


def test_waypoint_is_where_the_move_will_end_until_it_has(machine):
    goal = machine.kinematics.tcp_pose(TARGET.tolist(), np.eye(4))
    assert machine.upload(f"movej({listed(TARGET)}, v=0.5)")
    machine.tick()
    assert machine.waypoint == pytest.approx(goal, abs=1e-7)
    machine.pause()
    machine.tick()
    assert machine.waypoint is not None
    machine.stop_program()
    assert machine.waypoint is None


def test_slider_changes_the_pace_gradually_and_is_reported_once(machine):
    assert machine.upload(f"movej({listed(TARGET)}, v=0.4, a=4)")
    speeds, step = [], 1.1 * 4.0 * machine.profile.period * 0.4
    for k in range(round(0.9 / machine.profile.period)):
        if k == round(0.4 / machine.profile.period):
            machine.io.slider = 0.5
        machine.tick()
        speeds.append(machine.reference.qd[0])
    assert np.abs(np.diff(speeds[round(0.3 / machine.profile.period) :])).max() < step
    assert speeds[-1] == pytest.approx(0.2, abs=1e-9)
    # Clients multiply the two to learn the speed: ur_rtde's getSpeedScalingCombined.
    assert (reported(machine, "speed_scaling"), reported(machine, "target_speed_fraction")) == (1.0, 0.5)


def test_straight_move_too_fast_for_the_joints_is_slowed_down(machine):
    pose = machine.snapshot.tcp_pose
    x = machine.kinematics.tcp_matrix(machine.reference.q, np.eye(4))[:3, 3]
    pose[2] += 0.1
    assert machine.upload(f"movel(p{listed(pose)}, a=150, v=3)")
    least, fastest, off = 1.0, 0.0, 0.0
    while machine.program_name and machine.t < 3:
        machine.tick()
        least, fastest = min(least, reported(machine, "speed_scaling")), max(fastest, *map(abs, machine.reference.qd))
        now = machine.kinematics.tcp_matrix(machine.reference.q, np.eye(4))[:3, 3]
        off = max(off, float(np.abs(now[:2] - x[:2]).max()))
    assert machine.safety_mode is SafetyMode.NORMAL
    np.testing.assert_allclose(machine.snapshot.tcp_pose_target[:3], pose[:3], atol=1e-6)
    assert 0.02 < least < 0.95
    assert fastest <= SPEED_LIMIT * 1.05
    assert off < 1e-6
    assert reported(machine, "speed_scaling") == 1.0


def test_force_mode_is_accepted_and_checked(machine):
    frame, six = "p[0,0,0,0,0,0]", "[0,0,0,0,0,0]"
    run_program(machine, f"def job():\n force_mode({frame}, [0,0,1,0,0,0], {six}, 2, {six})\n sync()\n textmsg(1)\nend")
    assert [text for _, text in machine.log] == ["1"]
    run_program(machine, f"force_mode({frame}, {six}, {six}, 4, {six})")
    assert "none of 1, 2, 3" in machine.log[-1][1]


def test_joints_without_power_say_so(machine):
    machine.tick()
    assert reported(machine, "joint_mode") == (253,) * 6
    assert max(map(abs, reported(machine, "actual_current"))) > 0.1
    for mode, code, voltage in ((RobotMode.IDLE, 255, 48.0), (RobotMode.POWER_OFF, 239, 0.0)):
        machine.robot_mode = mode
        machine.tick()
        assert reported(machine, "joint_mode") == (code,) * 6
        assert reported(machine, "actual_joint_voltage") == (voltage,) * 6
        assert reported(machine, "actual_current") == [0.0] * 6  # the brakes hold the arm


def test_elbow_and_accelerometer_agree_with_the_arm(machine):
    assert machine.upload("speedj([0.3, -0.2, 0.4, 0.1, 0.2, 0.3], a=5, t=1)")
    for _ in range(round(0.5 / machine.profile.period)):
        machine.tick()
    before, speed = np.array(reported(machine, "elbow_position")), np.array(reported(machine, "elbow_velocity"))
    machine.tick()
    mean = (speed + np.array(reported(machine, "elbow_velocity"))) / 2
    gone = (np.array(reported(machine, "elbow_position")) - before) / machine.profile.period
    assert np.linalg.norm(speed) > 0.05
    np.testing.assert_allclose(gone, mean, atol=2e-3)
    up = matrix_of(machine.snapshot.tcp_pose)[:3, :3] @ reported(machine, "actual_tool_accelerometer")
    np.testing.assert_allclose(up, [0, 0, 9.80665], atol=1e-9)


def test_tool_has_two_outputs(machine):
    recipe = InputRecipe(["tool_digital_output_mask", "tool_digital_output"], set())
    recipe.apply(layout(("UINT8", "UINT8")).pack(0b110, 0b110), machine.io)
    assert machine.io.digital_out == 0b10 << 16


def test_unknown_user_role_is_refused():
    say = Dashboard(new_machine("cb3")).answer
    assert [say("setUserRole operator"), say("setUserRole boss"), say("getUserRole")] == [
        "Setting user role: OPERATOR",
        "Failed setting user role: boss",
        "OPERATOR",
    ]


def test_an_arm_alone_has_nothing_to_run_into():
    """Poses of ur_rtde's own examples, and the arm below its base: with torch and table these were collisions."""
    from weldsim.controller.functions import builtins

    machine = new_machine_alone("cb3")
    machine.provide(builtins(machine))
    example = "[-1.54, -1.83, -2.28, -0.59, 1.60, 0.023]"
    pose = "p[-0.143, -0.435, {z}, -0.001, 3.12, 0.04]"
    moves = [f"movej({example}, v=2, a=4)", *(f"movel({pose.format(z=z)}, v=0.5)" for z in (0.20, -0.10))]
    for move in moves:
        run_program(machine, move)
    assert machine.safety_mode is SafetyMode.NORMAL, list(machine.log)
    np.testing.assert_allclose(machine.snapshot.tcp_pose[:3], [-0.143, -0.435, -0.10], atol=1e-3)
