"""Every line of the contract: kept by our own arm, broken by exactly the robot it is there for, and nothing moves then."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.arm_worlds import bare_model
from tests.calibrations import ADDED, PUBLISHED
from tests.torch_paths import START
from weldsim.arm import Arm
from weldsim.errors import ExecutionError
from weldsim.execution.config import ContractConfig
from weldsim.execution.contract import Clause, check_contract, contract, own_arm
from weldsim.execution.gate import SafetyGate
from weldsim.execution.simulated import SimulatedRobot
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import DH, flange_pose, torch_pose
from weldsim.mounts import PAYLOAD, PAYLOAD_COG, X_FT
from weldsim.records import RobotFacts, RobotState

FACTS = RobotFacts(
    model="UR5", series="cb3", version="3.15.8", serial="1", dh=DH, X_FT=X_FT, payload_kg=PAYLOAD, payload_cog=PAYLOAD_COG
)
STATE = RobotState(t=0.0, q=START, qd=np.zeros(6), X_BT=torch_pose(START), mode="running")
BARE = Transform("FT", np.eye(3), np.zeros(3))


def moved(length: float, angle: float) -> Transform:
    """The mount, off by so much [m], [rad]."""
    return Transform("FT", X_FT.R @ matrix_from_rotation_vector(np.array([angle, 0.0, 0.0])), X_FT.p + np.array([length, 0.0, 0.0]))


def calibrated(seed: int, size: float) -> np.ndarray:
    """DH figures off as a factory calibration has them: lengths by `size` [m], angles by as much over half a metre; the
    shoulder's d off by a metre, and the elbow's by as much the other way."""
    rng = np.random.default_rng(seed)
    out = DH + rng.normal(size=(6, 4)) * size * np.array([0.5, 1.0, 1.0, 0.5])
    out[1, 2] += 1.0
    out[2, 2] -= 1.0
    return out


def broken(clauses: tuple[Clause, ...]) -> list[str]:
    return [clause.name for clause in clauses if clause.passed is False]


def test_our_own_arm_keeps_every_line() -> None:
    assert not broken(contract(FACTS, STATE))
    assert all(clause.passed for clause in contract(replace(FACTS, remote_control=True), STATE))


def test_the_model_is_told_with_its_serial_number_where_the_arm_has_one() -> None:
    """ "UR5 0" is no model: a number without a name, and the twin's arm has none."""
    told = [contract(replace(FACTS, serial=serial), STATE)[0] for serial in ("2013350001", "")]
    assert [clause.name for clause in told] == ["arm model", "arm model"]
    assert [clause.value for clause in told] == ["UR5, serial number 2013350001", "UR5"]


@pytest.mark.parametrize(
    ("change", "name", "advice"),
    [
        ({"model": "UR10"}, "arm model", "UR5"),
        ({"model": "UR5e"}, "arm model", "UR5"),
        ({"version": "3.9.1"}, "controller", "update"),
        ({"version": "5.11.0"}, "controller", "update"),
        ({"version": "unknown"}, "controller", "update"),
        ({"series": "e", "version": "5.26.0"}, "controller", "update"),
        ({"series": "x"}, "controller", "not known"),
        ({"dh": np.array([[0, 0, 0.1625, np.pi / 2], *DH[1:]])}, "arm geometry", "another arm"),
        ({"X_FT": moved(0.0002, 0.0)}, "tool centre point", "TCP"),
        ({"X_FT": moved(0.0, 0.002)}, "tool centre point", "TCP"),
        ({"payload_kg": PAYLOAD + 0.2}, "payload", "sag"),
        ({"payload_kg": 0.0}, "payload", "sag"),
        ({"payload_cog": PAYLOAD_COG + np.array([0.0, 0.0, 0.03])}, "payload's centre", "gravity"),
        ({"remote_control": False}, "remote control", "pendant"),
        ({"safety": "protective stop"}, "safety", "unlock"),
        ({"safety": "reduced"}, "safety", "unlock"),
        ({"mode": "idle"}, "arm", "brakes"),
        ({"program_running": True}, "another program", "stop it"),
    ],
)
def test_a_fact_that_is_wrong_breaks_its_line_alone(change: dict[str, Any], name: str, advice: str) -> None:
    state = STATE
    if "X_FT" in change:  # the controller reports what its TCP makes of it
        state = replace(STATE, X_BT=flange_pose(START) @ change["X_FT"])
    if "dh" in change:  # and what its arm does
        state = replace(STATE, X_BT=Arm(dh=change["dh"]).torch_pose(START))
    clauses = contract(replace(FACTS, **change), state)
    assert broken(clauses) == [name]
    clause = next(clause for clause in clauses if clause.name == name)
    assert advice in clause.advice
    assert clause.value
    assert clause.expected


@pytest.mark.parametrize(
    ("state", "name", "advice"),
    [
        (replace(STATE, q=np.rad2deg(START)), "unit of angles", "degrees"),
        (replace(STATE, X_BT=Transform("BT", STATE.X_BT.R, 1e3 * STATE.X_BT.p)), "unit of lengths", "millimetres"),
        (
            replace(STATE, X_BT=Transform("BT", np.diag([-1, -1, 1]) @ STATE.X_BT.R, np.diag([-1, -1, 1]) @ STATE.X_BT.p)),
            "base and kinematics",
            "base_link",
        ),
        (replace(STATE, X_BT=Transform("BT", STATE.X_BT.R, STATE.X_BT.p + 0.004)), "base and kinematics", "another arm"),
        (replace(STATE, qd=np.array([0, 0, 0, 0.02, 0, 0])), "at rest", "stands still"),
    ],
)
def test_a_report_that_is_wrong_breaks_its_line(state: RobotState, name: str, advice: str) -> None:
    clauses = contract(FACTS, state)
    assert name in broken(clauses)
    assert advice in next(clause for clause in clauses if clause.name == name).advice


@pytest.mark.parametrize("size", [0.0002, 0.003, 0.015])
@pytest.mark.parametrize("seed", range(3))
def test_an_arm_with_a_factory_calibration_is_planned_for_as_it_is(seed: int, size: float) -> None:
    facts = replace(FACTS, dh=calibrated(seed, size / 4))
    arm = own_arm(facts)
    clauses = contract(facts, replace(STATE, X_BT=arm.torch_pose(START)))
    assert not broken(clauses)
    assert arm.deviation() > size / 8
    assert (arm.dh == facts.dh).all()
    # With other figures than the controller moves by the weld would be off by what they differ: its own pose gives them away.
    if np.linalg.norm(arm.torch_tip(START) - STATE.X_BT.p) > ContractConfig().own_position:
        assert broken(contract(facts, STATE)) == ["base and kinematics"]
        clause = next(clause for clause in contract(facts, STATE) if clause.name == "base and kinematics")
        assert "not those it moves by" in clause.advice


def test_an_arm_that_tells_no_figures_is_the_nominal_one() -> None:
    assert own_arm(replace(FACTS, dh=None)).nominal
    assert own_arm(FACTS).nominal


@pytest.mark.parametrize(("dh", "off"), [(PUBLISHED, 3.03), (ADDED, 3.34)])
def test_published_figures_of_two_real_arms_put_the_flange_millimetres_off(dh: np.ndarray, off: float) -> None:
    """Hundreds of metres of d cancel: only so if figures that were sent are whole, and those of calibration.conf added."""
    facts = replace(FACTS, dh=dh, dh_note="calibrated")
    state = replace(STATE, X_BT=own_arm(facts).torch_pose(START))
    clause = next(clause for clause in contract(facts, state) if clause.name == "arm geometry")
    assert clause.passed
    assert clause.value == f"{off:.2f} mm from a nominal UR5 at the worst (calibrated)"
    strict = contract(facts, state, ContractConfig(calibration=0.001))
    assert broken(strict) == ["arm geometry"]
    advice = next(clause for clause in strict if clause.name == "arm geometry").advice
    assert "raise execution.contract.calibration" in advice


def test_what_a_robot_cannot_say_is_not_held_against_it() -> None:
    silent = RobotFacts(model="UR5", series="cb3", version="3.15.8", serial="1")
    clauses = contract(silent, STATE)
    assert not broken(clauses)
    assert [clause.name for clause in clauses if clause.passed is None] == [
        "arm geometry",
        "tool centre point",
        "payload",
        "remote control",
    ]
    # But a TCP that is not told and not ours shows in what is reported.
    assert broken(contract(silent, replace(STATE, X_BT=flange_pose(START) @ BARE))) == ["base and kinematics"]


def test_the_simulated_arm_keeps_it_and_a_broken_line_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = SimulatedRobot(bare_model(), START)
    with SafetyGate(robot) as gate:
        assert all(clause.passed for clause in check_contract(gate))
        facts = robot.facts()
        monkeypatch.setattr(robot, "facts", lambda: replace(facts, payload_kg=3.0, safety="protective stop"))
        with pytest.raises(ExecutionError, match=r"payload: 3\.00 kg, expected 1\.2 \+- 0\.1 kg; .*\(and 1 more\)") as caught:
            check_contract(gate)
        assert caught.value.data["rule"] == "contract"
        assert caught.value.exit_code == 1
        assert gate.state().t == 0.0
