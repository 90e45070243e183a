"""How far a motion that would pass is from failing: clearance, joint range and speed, singularities, pace."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.margin import Margin
from weldsim.dryrun.verdict import Trial
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES
from weldsim.motion.arm import dexterity
from weldsim.motion.collision import NEAR, in_words
from weldsim.motion.config import MotionConfig
from weldsim.motion.rungs import SINGULAR
from weldsim.records import Segment

SAMPLES = 400  # of a motion at which clearances are looked at


def margins(trial: Trial, cell: Cell, config: MotionConfig) -> tuple[Margin, ...]:
    """The figures of a trial that passed, none of one that failed or has no motion."""
    if not trial.passed or len(trial.q) < 2:
        return ()
    found = [_clearance(trial, cell), _range(trial), _speed(trial, config), _singular(trial)]
    if trial.slowest > 0:
        pace = min(100.0 * trial.slowest, 100.0)
        found.append(Margin(figure="pace of the weld", value=pace, limit=100 * config.least_speed, unit="%", least=True))
    return tuple(found)


def _clearance(trial: Trial, cell: Cell) -> Margin:
    """The least gap between the arm with its torch and anything else; the wire, which is to touch, apart."""
    rows = np.unique(np.linspace(0, len(trial.q) - 1, min(SAMPLES, len(trial.q))).astype(int))
    gaps = [cell.collision.nearest(trial.q[row]) for row in rows]
    worst = min(range(len(rows)), key=lambda i: gaps[i][0])
    gap, first, second = gaps[worst]
    bodies = f"{in_words(first)} from {in_words(second)}" if first else ""
    return Margin(
        figure="clearance of arm and torch",
        value=1e3 * gap,
        limit=0.0,
        unit="mm",
        least=True,
        t=float(trial.t[rows[worst]]) if first else None,
        of=bodies,
        beyond=gap >= NEAR,
    )


def _range(trial: Trial) -> Margin:
    left = JOINT_LIMIT - np.abs(trial.q)
    row, joint = np.unravel_index(left.argmin(), left.shape)
    return Margin(
        figure="joint angle to its end stop",
        value=float(np.rad2deg(left[row, joint])),
        limit=0.0,
        unit="deg",
        least=True,
        t=float(trial.t[row]),
        of=JOINT_NAMES[joint].replace("_", " "),
    )


def _speed(trial: Trial, config: MotionConfig) -> Margin:
    speed = joint_speeds(trial)
    row, joint = np.unravel_index(np.abs(speed).argmax(), speed.shape)
    return Margin(
        figure="joint speed",
        value=float(np.rad2deg(abs(speed[row, joint]))),
        limit=float(np.rad2deg(config.joint_speed_limit)),
        unit="deg/s",
        least=False,
        t=float(trial.t[row + 1]),
        of=JOINT_NAMES[joint].replace("_", " "),
    )


def _singular(trial: Trial) -> Margin:
    """The nearest to a singularity of all that leads the torch along a line; a move of the joints passes one unharmed."""
    led = trial.arc_on.copy() if trial.trajectory is None else np.array([one != Segment.AIR for one in trial.trajectory.segments])
    rows = np.flatnonzero(led) if len(led) == len(trial.q) and led.any() else np.arange(len(trial.q))
    value = dexterity(trial.q[rows])
    row = int(rows[value.argmin()])
    return Margin(
        figure="least tip travel for a turn of the joints",
        value=1e3 * float(value.min()),
        limit=1e3 * SINGULAR,
        unit="mm/rad",
        least=True,
        t=float(trial.t[row]),
    )


def joint_speeds(trial: Trial) -> Float[ndarray, "k 6"]:
    """Speeds between the samples of the motion [rad/s]; 0 where two have the same time."""
    dt = np.diff(trial.t)[:, None]
    return np.divide(np.diff(trial.q, axis=0), dt, out=np.zeros((len(dt), 6)), where=dt > 1e-9)
