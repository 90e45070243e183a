"""The rules of motion that every command is held to: joint position, speed, acceleration, jerk; torch speed; workspace box.

Acceleration and jerk are differences of what is sent, over the period it is sent at: each is a mean of the motion's own over
the samples it spans, and so exceeds no limit that the motion keeps to.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.execution.config import GateConfig
from weldsim.kinematics import JOINT_NAMES
from weldsim.quantity import Second

Rule = Literal[
    "start",
    "command",
    "joint position",
    "joint speed",
    "joint acceleration",
    "joint jerk",
    "workspace",
    "torch speed",
    "tracking",
    "stale state",
    "arc",
]
HISTORY = 3  # commands before the one that is judged
SLACK = 1e-6  # of a limit: rounding of a motion that keeps to it exactly


@dataclass(frozen=True, kw_only=True)
class Breach:
    """A rule that was broken. Attributes: rule; what broke it, "elbow" say; value, limit [SI]; text, both with their units."""

    rule: Rule
    what: str
    value: float
    limit: float
    text: str


def motion_breach(
    q: Float[ndarray, "k 6"], qd: Float[ndarray, "k 6"], tip_B: Float[ndarray, "k 3"], period: Second, config: GateConfig
) -> tuple[int, Breach] | None:
    """The first row that breaks a rule, from row HISTORY on, and which; None where none does.

    Args:
        q, qd: joint angles [rad] and speeds [rad/s] that are sent, a row a period; both count: what an arm makes of which is
            its own affair.
        tip_B: torch tip of each row [m].  period: [s].  config: the limits.
    """
    speed = np.diff(q, axis=0) / period
    acceleration = np.diff(speed, axis=0) / period
    jerk = np.diff(acceleration, axis=0) / period
    told = np.diff(qd, axis=0) / period
    told_jerk = np.diff(told, axis=0) / period
    fast = np.linalg.norm(np.diff(tip_B, axis=0), axis=1) / period
    n = len(q) - HISTORY
    found: list[tuple[int, Breach]] = []

    def joints(rule: Rule, values: Float[ndarray, "m 6"], limit: float, unit: str, scale: float = 1.0) -> None:
        over = np.abs(values[-n:])
        rows = np.flatnonzero((over > limit * (1 + SLACK)).any(axis=1))
        if len(rows):
            row, joint = int(rows[0]), int(over[rows[0]].argmax())
            value = float(over[row, joint])
            text = f"{JOINT_NAMES[joint]} {scale * value:.4g} {unit} (limit {scale * limit:.4g} {unit})"
            found.append((row + HISTORY, Breach(rule=rule, what=JOINT_NAMES[joint], value=value, limit=limit, text=text)))

    joints("joint position", q, config.joint_position, "deg", 180 / np.pi)
    joints("joint speed", np.maximum(np.abs(speed), np.abs(qd[1:])), config.joint_speed, "rad/s")
    joints("joint acceleration", np.maximum(np.abs(acceleration), np.abs(told[1:])), config.joint_acceleration, "rad/s2")
    joints("joint jerk", np.maximum(np.abs(jerk), np.abs(told_jerk[1:])), config.joint_jerk, "rad/s3")
    rows = np.flatnonzero(fast[-n:] > config.tip_speed * (1 + SLACK))
    if len(rows):
        value = float(fast[-n:][rows[0]])
        text = f"{1e3 * value:.1f} mm/s (limit {1e3 * config.tip_speed:g} mm/s)"
        breach = Breach(rule="torch speed", what="torch tip", value=value, limit=config.tip_speed, text=text)
        found.append((int(rows[0]) + HISTORY, breach))
    found += _outside(tip_B[-n:], config)
    return min(found, key=lambda each: each[0]) if found else None


def _outside(tip_B: Float[ndarray, "n 3"], config: GateConfig) -> list[tuple[int, Breach]]:
    """The first row outside the box, and on which side."""
    out = []
    for bounds, sign, word in ((config.box_low, -1.0, "least"), (config.box_high, 1.0, "greatest")):
        beyond = sign * (tip_B - np.array(bounds))
        rows = np.flatnonzero((beyond > 1e-9).any(axis=1))
        if len(rows):
            row, axis = int(rows[0]), int(beyond[rows[0]].argmax())
            value, limit = float(tip_B[row, axis]), bounds[axis]
            text = f"torch tip at {'xyz'[axis]} = {1e3 * value:.1f} mm in base ({word} {1e3 * limit:.1f} mm)"
            breach = Breach(rule="workspace", what=f"torch tip {'xyz'[axis]}", value=value, limit=limit, text=text)
            out.append((row + HISTORY, breach))
    return out


def off_the_way(point: Float[ndarray, "d"], way: Float[ndarray, "n d"]) -> Float[ndarray, "d"]:
    """From the nearest point of a polyline to `point`; the polyline has one vertex at least."""
    a, b = (way[:-1], way[1:]) if len(way) > 1 else (way, way)
    d = b - a
    u = np.clip(np.einsum("ij,ij->i", point - a, d) / np.maximum(np.einsum("ij,ij->i", d, d), 1e-30), 0.0, 1.0)
    off = point - (a + u[:, None] * d)
    return off[np.einsum("ij,ij->i", off, off).argmin()]
