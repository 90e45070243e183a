"""The contract: what a robot must be for a plan to hold on it, line by line, before anything moves.

An arm that tells DH figures of its own is planned for with them (`own_arm`), so they need not be the nominal ones. They must
explain the pose that the controller reports, though: a weld planned with other figures than it moves by is off by the difference.
"""

from dataclasses import dataclass

import numpy as np

from weldsim.arm import Arm
from weldsim.errors import ExecutionError
from weldsim.execution.config import ContractConfig
from weldsim.execution.robot import Robot
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES, REACH
from weldsim.mounts import PAYLOAD, PAYLOAD_COG
from weldsim.mounts import X_FT as NOMINAL_X_FT
from weldsim.records import RobotFacts, RobotState

MODEL = "UR5"
VERSIONS = {"cb3": ((3, 12), (4, 0)), "e": ((5, 6), (5, 26))}  # from the first to before the second
ANOTHER = 0.02  # [m] no factory calibration puts a flange that far from the nominal arm's: it is another arm
HALF_TURN = np.diag([-1.0, -1.0, 1.0])
FURTHEST = REACH + 1.0  # [m] from the base: no torch tip is there


@dataclass(frozen=True, kw_only=True)
class Clause:
    """One line of the contract.

    Attributes:
        name: of the line.  value: as the robot has it.  expected: what it must be.
        passed: whether it is kept, None where the robot cannot say.  advice: what to do where it is not.
    """

    name: str
    value: str
    expected: str
    passed: bool | None
    advice: str = ""


def check_contract(robot: Robot, config: ContractConfig | None = None, X_FT: Transform = NOMINAL_X_FT) -> tuple[Clause, ...]:
    """Every line of the contract with a connected robot, all of them kept; nothing moves.

    What is then planned for it takes `own_arm` of its facts, and so does its gate (`SafetyGate.arm`).

    Args:
        robot: connected.  config: tolerances.  X_FT: the mount that plans are made with.
    Raises:
        ExecutionError: a line that is not kept, or facts that cannot be had; `data`: rule "contract", clauses.
    """
    clauses = contract(robot.facts(), robot.state(), config, X_FT)
    require_kept(clauses, robot.name)
    return clauses


def own_arm(facts: RobotFacts, X_FT: Transform = NOMINAL_X_FT) -> Arm:
    """The arm that a robot says it is, with its own DH figures where it tells them, else the nominal one. Args: X_FT, the mount."""
    return Arm(X_FT=X_FT) if facts.dh is None else Arm(dh=facts.dh, X_FT=X_FT)


def require_kept(clauses: tuple[Clause, ...], name: str) -> None:
    """Nothing, when every line is kept; else ExecutionError about the first that is not, of the robot of that name."""
    broken = [clause for clause in clauses if clause.passed is False]
    if broken:
        first = broken[0]
        more = f" (and {len(broken) - 1} more)" if len(broken) > 1 else ""
        raise ExecutionError(
            f"{name}: contract: {first.name}: {first.value}, expected {first.expected}; {first.advice}{more}; nothing has moved",
            rule="contract",
            value=first.value,
            limit=first.expected,
            clauses=clauses,
        )


def contract(
    facts: RobotFacts, state: RobotState, config: ContractConfig | None = None, X_FT: Transform = NOMINAL_X_FT
) -> tuple[Clause, ...]:
    """Every line of the contract, kept or not."""
    config = config or ContractConfig()
    return (
        _model(facts),
        _version(facts),
        _arm(facts, config),
        _tcp(facts, X_FT, config),
        *_payload(facts, config),
        *_units(state),
        _frames(facts, state, X_FT, config),
        _flag(
            "remote control",
            facts.remote_control,
            wanted=True,
            words=("local", "remote"),
            advice="switch the teach pendant to remote control",
        ),
        _word("safety", facts.safety, "normal", "find out why, clear the cell, and unlock it on the pendant"),
        _word("arm", facts.mode, "running", "power it on and release its brakes on the pendant"),
        _flag(
            "another program",
            facts.program_running,
            wanted=False,
            words=("none", "running"),
            advice="stop it: two masters of one arm are one too many",
        ),
        _rest(state, config),
    )


def _model(facts: RobotFacts) -> Clause:
    return Clause(
        name="arm model",
        value=facts.model + (f", serial number {facts.serial}" if facts.serial else ""),
        expected=MODEL,
        passed=facts.model.upper() == MODEL,
        advice="plans are made for a UR5; another arm has other links",
    )


def _version(facts: RobotFacts) -> Clause:
    """The controller's software; a simulated one has any."""
    if facts.series not in VERSIONS:
        return Clause(
            name="controller",
            value=f"{facts.series} {facts.version}",
            expected="cb3, e or simulated",
            passed=facts.series == "simulated",
            advice="this controller is not known",
        )
    low, high = VERSIONS[facts.series]
    parts = facts.version.split(".")
    known = len(parts) >= 2 and all(part.isdigit() for part in parts[:2])
    return Clause(
        name="controller",
        value=f"{facts.series} {facts.version}",
        expected=f"{'.'.join(map(str, low))} to before {'.'.join(map(str, high))}",
        passed=known and low <= (int(parts[0]), int(parts[1])) < high,
        advice="the client library is not known to work with it; update the controller or the library",
    )


def _arm(facts: RobotFacts, config: ContractConfig) -> Clause:
    """The controller's arm against the nominal one by where both put the flange."""
    if facts.dh is None:
        value = f"not told: {facts.dh_note}" if facts.dh_note else "not told"
        advice = "planned for a nominal UR5, from which published arms are 3 mm off: touch a measured point with the wire tip first"
        return Clause(name="arm geometry", value=value, expected="DH of a UR5", passed=None, advice=advice)
    off = Arm(dh=facts.dh).deviation()
    note = f" ({facts.dh_note})" if facts.dh_note else ""
    calibrated = (
        "this arm's factory calibration: raise execution.contract.calibration to have the plan made for it, or take another arm"
    )
    return Clause(
        name="arm geometry",
        value=f"{1e3 * off:.2f} mm from a nominal UR5 at the worst{note}",
        expected=f"<= {1e3 * config.calibration:g} mm, planned for as it is",
        passed=off <= config.calibration,
        advice=calibrated if off <= ANOTHER else "another arm: no calibration moves a flange that far; connect a UR5",
    )


def _tcp(facts: RobotFacts, X_FT: Transform, config: ContractConfig) -> Clause:
    limit = f"<= {1e3 * config.tcp_position:g} mm, {np.rad2deg(config.tcp_rotation):.2g} deg from our mount"
    if facts.X_FT is None:
        return Clause(name="tool centre point", value="not told", expected=limit, passed=None)
    far, turn = _apart(facts.X_FT, X_FT)
    x, y, z = 1e3 * facts.X_FT.p
    return Clause(
        name="tool centre point",
        value=f"({x:.2f}, {y:.2f}, {z:.2f}) mm: {1e3 * far:.2f} mm, {np.rad2deg(turn):.2f} deg off",
        expected=limit,
        passed=far <= config.tcp_position and turn <= config.tcp_rotation,
        advice="set the controller's TCP to the torch mount, in metres and radians",
    )


def _payload(facts: RobotFacts, config: ContractConfig) -> list[Clause]:
    mass, limit = facts.payload_kg, f"{PAYLOAD:g} +- {config.payload:g} kg"
    out = [
        Clause(
            name="payload",
            value="not told" if mass is None else f"{mass:.2f} kg",
            expected=limit,
            passed=None if mass is None else bool(abs(mass - PAYLOAD) <= config.payload),
            advice="set the controller's payload: a wrong one makes the arm sag and its stops late",
        )
    ]
    if facts.payload_cog is not None:
        off = float(np.linalg.norm(facts.payload_cog - PAYLOAD_COG))
        out.append(
            Clause(
                name="payload's centre",
                value=f"{1e3 * off:.1f} mm from the torch's",
                expected=f"<= {1e3 * config.payload_cog:g} mm",
                passed=off <= config.payload_cog,
                advice="set the controller's centre of gravity",
            )
        )
    return out


def _units(state: RobotState) -> list[Clause]:
    joint = int(np.abs(state.q).argmax())
    far = float(np.linalg.norm(state.X_BT.p))
    return [
        Clause(
            name="unit of angles",
            value=f"{JOINT_NAMES[joint]} {state.q[joint]:.4g}",
            expected=f"within +-{JOINT_LIMIT:.4g} rad",
            passed=bool(abs(state.q[joint]) <= JOINT_LIMIT + 0.01),
            advice="looks like degrees",
        ),
        Clause(
            name="unit of lengths",
            value=f"torch tip {far:.4g} from the base",
            expected=f"within {FURTHEST:g} m",
            passed=far <= FURTHEST,
            advice="looks like millimetres",
        ),
    ]


def _frames(facts: RobotFacts, state: RobotState, X_FT: Transform, config: ContractConfig) -> Clause:
    """The reported torch against forward kinematics of the reported joints, with the controller's own figures and TCP."""
    arm = own_arm(facts, X_FT if facts.X_FT is None else facts.X_FT)
    ours, limit = arm.torch_pose(state.q), config.frame_position if arm.nominal else config.own_position
    far, turn = _apart(state.X_BT, ours)
    advice = "another arm, TCP or base frame than ours"
    if not arm.nominal:
        advice = (
            "the DH figures that the controller tells are not those it moves by, or TCP or base frame are not ours: find out which"
        )
    turned = Transform("BT", HALF_TURN @ ours.R, HALF_TURN @ ours.p)
    if _apart(state.X_BT, turned)[0] <= limit < far:
        advice = "the poses are in base_link, half a turn about z from the controller's base"
    return Clause(
        name="base and kinematics",
        value=f"{1e3 * far:.2f} mm, {np.rad2deg(turn):.2f} deg from ours",
        expected=f"<= {1e3 * limit:g} mm, {np.rad2deg(config.frame_rotation):.2g} deg",
        passed=far <= limit and turn <= config.frame_rotation,
        advice=advice,
    )


def _apart(one: Transform, other: Transform) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses."""
    cosine = (np.trace(one.R.T @ other.R) - 1) / 2
    return float(np.linalg.norm(one.p - other.p)), float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _flag(name: str, value: bool | None, *, wanted: bool, words: tuple[str, str], advice: str) -> Clause:
    said = "no such switch" if value is None else words[value]
    return Clause(name=name, value=said, expected=words[wanted], passed=None if value is None else value == wanted, advice=advice)


def _word(name: str, value: str, wanted: str, advice: str) -> Clause:
    return Clause(name=name, value=value or "not told", expected=wanted, passed=value.lower() == wanted, advice=advice)


def _rest(state: RobotState, config: ContractConfig) -> Clause:
    joint = int(np.abs(state.qd).argmax())
    value = float(np.abs(state.qd).max())
    return Clause(
        name="at rest",
        value=f"{JOINT_NAMES[joint]} {value:.4f} rad/s",
        expected=f"<= {config.rest:g} rad/s",
        passed=value <= config.rest,
        advice="wait until the arm stands still",
    )
