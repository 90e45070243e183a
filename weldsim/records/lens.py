"""The lens model of OpenCV (Brown-Conrady, with the rational and thin-prism terms): distorted image coordinates and back.

Coordinates are x / z and y / z in the camera's frame. Coefficients are in OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4,
as many as there are; the rest is zero.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

COUNTS = (0, 4, 5, 8, 12)  # of coefficients that the model is written with
ROUNDS = 30  # of Newton's method; strong lenses take six
CLOSE = 1e-10  # residual at which it has arrived, far under a thousandth of a pixel


def distorted(xy: Float[ndarray, "n 2"], coefficients: tuple[float, ...]) -> Float[ndarray, "n 2"]:
    """Where the lens puts rays that a pinhole would put at xy."""
    return _model(xy, coefficients)[0]


def undistorted(xy: Float[ndarray, "n 2"], coefficients: tuple[float, ...]) -> Float[ndarray, "n 2"]:
    """Where a pinhole would put what the lens puts at xy; NaN where no ray is found, or where the lens folds its image over."""
    out = xy.copy()
    with np.errstate(all="ignore"):
        for _ in range(ROUNDS):
            at, (a, b, c, d) = _model(out, coefficients)
            off, determinant = xy - at, a * d - b * c
            step = np.stack([d * off[:, 0] - b * off[:, 1], a * off[:, 1] - c * off[:, 0]], axis=1) / determinant[:, None]
            out = out + step
            if not np.abs(step).max(initial=0.0, where=np.isfinite(step)) > CLOSE:
                break
        at, (a, b, c, d) = _model(out, coefficients)
        lost = ~(np.abs(at - xy).max(axis=1) < 10 * CLOSE) | ~(a * d - b * c > 0)
    out[lost] = np.nan
    return out


def _model(
    xy: Float[ndarray, "n 2"], coefficients: tuple[float, ...]
) -> tuple[Float[ndarray, "n 2"], tuple[ndarray, ndarray, ndarray, ndarray]]:
    """Distorted coordinates and their derivatives: (dX/dx, dX/dy, dY/dx, dY/dy), each (n,)."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = (*coefficients, *[0.0] * (12 - len(coefficients)))
    x, y = xy.T
    r2 = x * x + y * y
    above, below = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = above / below
    slope = ((k1 + r2 * (2 * k2 + r2 * 3 * k3)) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / below  # by r2
    out = np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4),
        ],
        axis=1,
    )
    prism_x, prism_y = s1 + 2 * r2 * s2, s3 + 2 * r2 * s4
    return out, (
        radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + 2 * x * prism_x,
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * y * prism_x,
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * x * prism_y,
        radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + 2 * y * prism_y,
    )
