"""Interpolation between path poses: straight lines for the tip, slerp for the torch (thesis 5.2.5)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.errors import InputError
from weldsim.frames import Transform, slerp
from weldsim.quantity import Metre

STEP: Metre = 1e-4
"""Distance between interpolated points [m] (thesis 5.2.5)."""


def interpolate_poses(X_BT: Transform, step: Metre = STEP) -> tuple[Transform, Float[ndarray, "m"]]:
    """The poses with others filled in between, and their arc length [m] from the first.

    Every given pose is kept. Between two of them the tip moves along the chord in equal steps of at most `step`
    (eq 5.54-5.55) and the torch turns the short way round at a constant rate (eq 5.61; 5.57-5.58 have their dot products
    swapped). Two poses with the same tip but different torch directions get nothing in between.

    Args:
        X_BT: n >= 1 poses of the torch tip.  step: [m].
    Raises:
        InputError: no pose, a single Transform instead of a batch, or a step that is not positive.
    """
    if len(X_BT.batch) != 1 or len(X_BT) == 0:
        raise InputError(f"interpolation: {X_BT.batch} poses; a batch of at least one is needed", batch=X_BT.batch)
    if not step > 0:
        raise InputError(f"interpolation: step {step:g} m must be positive", step=step)
    s, quaternion = arc_length(X_BT.p), X_BT.quaternion
    # The small allowance keeps a chord of exactly k steps at k pieces in spite of rounding.
    pieces = np.maximum(np.ceil(np.diff(s) / step * (1 - 1e-9)).astype(np.int64), 1)
    segment = np.repeat(np.arange(len(pieces)), pieces)
    offset = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    u = offset / pieces[segment]
    p = X_BT.p[segment] + u[:, None] * (X_BT.p[segment + 1] - X_BT.p[segment])
    q = slerp(quaternion[segment], quaternion[segment + 1], u)
    at = s[segment] + u * (s[segment + 1] - s[segment])
    X = Transform.from_quaternion(X_BT.names, np.concatenate([q, quaternion[-1:]]), np.concatenate([p, X_BT.p[-1:]]))
    return X, np.append(at, s[-1])
