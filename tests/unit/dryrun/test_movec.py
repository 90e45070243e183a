"""movec in a robot program: the dry run checks the circle that the controller would follow."""

import numpy as np
import pytest

from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.try_script import try_script
from weldsim.dryrun.urscript import parse_script
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.kinematics import flange_pose
from weldsim.mounts import X_FT
from weldsim.scene.world import HOME

RADIUS = 0.04
START = (flange_pose(np.array(HOME)) @ X_FT).p + np.array([0.0, 0.0, 0.02])
CENTRE = START - [0.0, RADIUS, 0.0]
TURN = (flange_pose(np.array(HOME)) @ X_FT).rotation_vector


def at(angle: float, turn: np.ndarray = TURN) -> str:
    """The pose at an angle of the circle, as a program writes it."""
    place = CENTRE + RADIUS * np.array([np.sin(angle), np.cos(angle), 0.0])
    return f"p[{', '.join(f'{value:.9f}' for value in (*place, *turn))}]"


def program(*lines: str, tcp: Transform = X_FT):
    pose = ", ".join(f"{value:.9f}" for value in (*tcp.p, *tcp.rotation_vector))
    text = "\n".join([f"set_tcp(p[{pose}])", f"movej({list(map(float, HOME))})", f"movel({at(0.0)}, v=0.05)", *lines])
    return parse_script(text, source="weld.script", q_start=np.array(HOME))


@pytest.mark.parametrize("mode", [0, 1])
def test_the_torch_is_led_round_the_circle(mode: int) -> None:
    read = program(f"movec({at(1.0)}, {at(2.5)}, a=1.2, v=0.008, mode={mode})")
    motion = read.motions[-1]
    assert motion.command == "movec"
    off = motion.way.p - CENTRE
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), RADIUS, atol=1e-7)
    np.testing.assert_allclose(np.diff(np.unwrap(np.arctan2(off[:, 0], off[:, 1]))), 2.5 / len(off), atol=1e-6)
    np.testing.assert_allclose(motion.way.p[-1], motion.X_BT.p)
    turned = np.arccos((np.trace(motion.way.R[-1] @ (flange_pose(np.array(HOME)) @ X_FT).R.T) - 1) / 2)
    assert turned == pytest.approx(2.5 if mode else 0.0, abs=1e-3)
    trial = try_script(read, empty_cell(np.array(HOME)))
    assert trial.passed
    tips = trial.points_B
    after = tips[np.linalg.norm(tips - tips[-1], axis=1) < 2 * RADIUS]
    assert np.abs(np.linalg.norm(after[-len(motion.way.p) :] - CENTRE, axis=1) - RADIUS).max() < 1e-5
    assert trial.cycle > 2.5 * RADIUS / 0.008


def test_a_circle_of_another_tcp_is_that_tools_and_the_torch_goes_with_it() -> None:
    """The bare flange on a circle that keeps its angle to it: the torch, which hangs on it aslant, on a concentric one."""
    bare = Transform("FT", np.eye(3), np.zeros(3))
    motion = program(f"movec({at(0.5)}, {at(1.5)}, mode=1)", tcp=bare).motions[-1]
    flange = (motion.way @ X_FT.inverse()).p
    np.testing.assert_allclose(np.linalg.norm(flange - CENTRE, axis=1), RADIUS, atol=1e-7)
    away = np.linalg.norm((motion.way.p - CENTRE)[:, :2], axis=1)
    assert np.ptp(away) < 1e-6
    assert abs(away[0] - RADIUS) > 0.01


def test_two_halves_of_a_circle_do_not_turn_back_and_a_way_back_along_one_does() -> None:
    halves = [f"movep({at(0.0)})", f"movec({at(1.5)}, {at(3.0)}, v=0.05)", f"movec({at(4.5)}, {at(2 * np.pi)}, v=0.05)"]
    trial = try_script(program(*halves), empty_cell(np.array(HOME)))
    assert trial.passed
    assert trial.notes == ()
    back = [*halves[:2], f"movec({at(1.5)}, {at(0.0)}, v=0.05)"]
    assert try_script(program(*back), empty_cell(np.array(HOME))).notes == ("line 6 movec: travel turns back by 180 deg",)


def test_what_makes_no_circle_is_refused_with_its_line() -> None:
    for wrong, says in (
        (f"movec({at(0.0)}, {at(1.0)})", "line 4: movec: the three positions lie on one line"),
        (f"movec({at(0.5)}, {at(1.0)}, mode=2)", "line 4: movec: mode = 2"),
        (f"movec({list(map(float, HOME))}, {at(1.0)})", "line 4: movec: its poses must be p"),
        (f"movec({at(0.5)}, p[0, -450, 0, 0, 0, 0])", "line 4: movec: .*millimetres"),
    ):
        with pytest.raises(InputError, match=says):
            program(wrong)
    with pytest.raises(InputError, match="movec: where the arm is by then is not known; begin with movej to six joint angles"):
        parse_script(f"movec({at(0.5)}, {at(1.0)})", source="weld.script")


def test_what_the_reader_does_for_itself_is_no_function_of_a_program() -> None:
    with pytest.raises(InputError, match="there is no function 'to_pose'"):
        program(f"to_pose({at(0.5)})")
    here = program("movel(tool_pose())").motions
    np.testing.assert_allclose(here[-1].X_BT.p, here[-2].X_BT.p)
