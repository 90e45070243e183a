"""A posture whose rotation about the wire changes on the way: for welds that no constant rotation can sweep, over edges say."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, inverse
from weldsim.motion.arm import clearances, dexterity
from weldsim.motion.config import MotionConfig
from weldsim.motion.posture import SHY, Blocked, roll_frames
from weldsim.motion.rail import Rail

TURN, LENGTH = 0.12, 0.012  # [rad], [m] between looks, at most
STEP = 0.6  # [rad] a joint that turns further between two looks has changed branch
SMOOTH = 3.0  # looks over which the posture is smoothed: its tip strays, but it only draws the free rotation

Node = tuple[int, Float[ndarray, "6"], float]
"""One way to stand at a look: which rotation about the wire, joint angles [rad], cost."""


def winding_posture(
    rail: Rail, q_start: Float[ndarray, "6"], X_FT: Transform, config: MotionConfig, blocked: Blocked | None
) -> tuple[Float[ndarray, "6"], PchipInterpolator] | None:
    """Joint angles at the rail's first pose and, as a function of s, what the arm is drawn to; None where there is no way.

    The cheapest chain of IK solutions over looks along the rail (dynamic programming), the rotation about the wire free to change
    by one step of `config.rolls` from look to look, every solution clear of everything and away from stops and singularities.
    """
    s = _looks(rail)
    X_BT, X_TF = rail.at(s), X_FT.inverse()
    frames = roll_frames(X_BT)
    layers = []
    for i in range(len(s)):
        layers.append(_nodes(frames[i], X_BT.p[i], X_TF, X_FT, config, blocked))
        if not layers[-1]:
            return None
    cost = np.array([c + 0.05 * float(np.abs(_wrap(q - q_start)).max()) for _, q, c in layers[0]])
    back = []
    for before, after in pairwise(layers):
        q_before, q_after = (np.array([q for _, q, _ in layer]) for layer in (before, after))
        turn = np.array([r for r, _, _ in after])[:, None] - np.array([r for r, _, _ in before])
        turn = np.abs((turn + config.rolls // 2) % config.rolls - config.rolls // 2)
        step = np.abs(_wrap(q_after[:, None] - q_before)).max(axis=2)
        total = np.where((step < STEP) & (turn <= 1), cost + step + 0.1 * turn, np.inf)
        back.append(total.argmin(axis=1))
        cost = total.min(axis=1) + np.array([c for _, _, c in after])
        if not np.isfinite(cost).any():
            return None
    chain = [int(cost.argmin())]
    for best in reversed(back):
        chain.append(int(best[chain[-1]]))
    q = np.unwrap(np.array([layer[i][1] for layer, i in zip(layers, reversed(chain), strict=True)]), axis=0)
    q = q + 2 * np.pi * np.round((q_start - q[0]) / (2 * np.pi))
    limit = JOINT_LIMIT - config.limit_margin
    q = q - 2 * np.pi * (q.max(axis=0) > limit) + 2 * np.pi * (q.min(axis=0) < -limit)
    if np.abs(q).max() > limit:
        return None
    return q[0], PchipInterpolator(s, gaussian_filter1d(q, SMOOTH, axis=0, mode="nearest"))


def _looks(rail: Rail) -> Float[ndarray, "m"]:
    """Arc lengths, near enough to each other in length and in turn of the wire."""
    s = np.linspace(rail.s[0], rail.s[-1], max(2, int((rail.s[-1] - rail.s[0]) / 0.0005)))
    wire = rail.at(s).R[:, :, 2]
    stride = np.maximum(np.diff(s) / LENGTH, np.linalg.norm(np.diff(wire, axis=0), axis=1) / TURN)
    gone = np.concatenate([[0.0], np.cumsum(stride)])
    return np.unique(np.interp(np.linspace(0.0, gone[-1], int(np.ceil(gone[-1])) + 1), gone, s))


def _nodes(
    R: Float[ndarray, "3 3"],
    p: Float[ndarray, "3"],
    X_TF: Transform,
    X_FT: Transform,
    config: MotionConfig,
    blocked: Blocked | None,
) -> list[Node]:
    nodes = []
    for k in range(config.rolls):
        c, s = np.cos(2 * np.pi * k / config.rolls), np.sin(2 * np.pi * k / config.rolls)
        turned = R @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        for q in inverse(Transform("BT", turned, p) @ X_TF):
            if blocked is None or blocked(q) is None:
                shy = max(0.0, 1.0 - float(dexterity(q[None], X_FT).min()) / SHY)
                near = max(0.0, 1.0 - float(clearances(q[None], config.floor, X_FT).min()) / max(config.clearance, 1e-9))
                nodes.append((k, q, shy**2 + near))
    return nodes


def _wrap(angle: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    return (angle + np.pi) % (2 * np.pi) - np.pi
