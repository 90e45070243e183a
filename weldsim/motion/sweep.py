"""What the arm would touch on its way: joint motions looked at in steps so small that nothing moves far between two looks."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

STEP_LENGTH = 0.002  # [m] that no point of arm or torch moves by between two looks
STEP_TURN = np.deg2rad(0.5)  # [rad] that no joint turns by
# Greatest distance of any point of arm, torch or camera from each joint's axis [m]: the arm stretched, the torch across.
LEVERS = np.array([1.20, 1.20, 0.80, 0.45, 0.40, 0.26])
COARSE = 8  # looks skipped at first: most ways that touch something touch it for longer than one step

Blocked = Callable[[Float[ndarray, "6"]], str | None]
"""What a configuration touches, in words, or None: the cell's own collision check, where there is one."""


def steps(a: Float[ndarray, "n 6"], b: Float[ndarray, "n 6"]) -> Float[ndarray, "n"]:
    """How many steps the straight joint moves from a to b [rad] take, by STEP_LENGTH and STEP_TURN; whole, at least one."""
    turn = np.abs(b - a)
    return np.maximum(1.0, np.ceil(np.maximum(turn.max(axis=-1) / STEP_TURN, turn @ LEVERS / STEP_LENGTH) - 1e-9))


def touched(a: Float[ndarray, "6"], b: Float[ndarray, "6"], blocked: Blocked) -> str | None:
    """What the straight joint move from a to b touches, or None; both ends belong to it."""
    n = int(steps(a[None], b[None])[0])
    order = np.arange(n + 1)
    # Ends first, then coarsely, then the rest: the same looks, and a blocked way is refused sooner.
    rank = np.where((order == 0) | (order == n), 0, np.where(order % COARSE == 0, 1, 2))
    return next(
        (touch for k in order[np.argsort(rank, kind="stable")] if (touch := blocked(a + k / n * (b - a))) is not None), None
    )


def first_touch(q: Float[ndarray, "n 6"], blocked: Blocked) -> tuple[float, str] | None:
    """Where along the samples q, joined by straight joint moves, something is touched first: index with its fraction, what.

    None where nothing is touched.
    """
    if (touch := blocked(q[0])) is not None:
        return 0.0, touch
    for i, n in enumerate(steps(q[:-1], q[1:]).astype(int)):
        for k in range(1, n + 1):
            if (touch := blocked(q[i] + k / n * (q[i + 1] - q[i]))) is not None:
                return i + k / n, touch
    return None


def posture_at(q: Float[ndarray, "n 6"], index: float) -> Float[ndarray, "6"]:
    """The posture [rad] at an index with its fraction, as `first_touch` gives it."""
    i = min(int(index), len(q) - 2)
    return q[i] + (index - i) * (q[i + 1] - q[i])
