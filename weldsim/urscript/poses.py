"""UR poses, [x, y, z, rx, ry, rz], to homogeneous matrices and back, one at a time and fast.

`weldsim.frames` does the same for batches and checks every matrix; inside a control period of 2 ms there is no time for that.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, sin, sqrt

import numpy as np
from jaxtyping import Float
from numpy import ndarray

Matrix = Float[ndarray, "4 4"]


def matrix_of(pose: Sequence[float]) -> Matrix:
    """Homogeneous matrix of a pose [m, rad] (Rodrigues' formula)."""
    x, y, z, rx, ry, rz = pose
    angle = sqrt(rx * rx + ry * ry + rz * rz)
    # sin(a)/a and (1 - cos(a))/a^2, with their series where the quotients lose digits.
    if angle > 1e-4:
        a, b = sin(angle) / angle, (1.0 - cos(angle)) / (angle * angle)
    else:
        a, b = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    return np.array(
        [
            [1.0 - b * (ry * ry + rz * rz), b * rx * ry - a * rz, b * rx * rz + a * ry, x],
            [b * rx * ry + a * rz, 1.0 - b * (rx * rx + rz * rz), b * ry * rz - a * rx, y],
            [b * rx * rz - a * ry, b * ry * rz + a * rx, 1.0 - b * (rx * rx + ry * ry), z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def pose_of(matrix: Matrix) -> list[float]:
    """The pose of a homogeneous matrix; the angle of its rotation vector in [0, pi]."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z) = matrix[:3].tolist()
    vector = (h - f, c - g, d - b)  # twice the sine times the axis
    sine, cosine = hypot(*vector), a + e + i - 1.0
    angle = atan2(sine, cosine)
    if sine > 1e-6 or cosine > 0:
        scale = angle / sine if sine > 1e-12 else 0.5
        return [x, y, z, vector[0] * scale, vector[1] * scale, vector[2] * scale]
    # Near half a turn the sine says nothing: the axis is in the greatest column of (R + R^T) / 2 - cos(angle) I.
    k = cosine / 2.0
    columns = ((a - k, (d + b) / 2, (g + c) / 2), ((b + d) / 2, e - k, (h + f) / 2), ((c + g) / 2, (f + h) / 2, i - k))
    axis = max(((column[n], column) for n, column in enumerate(columns)), key=lambda pair: pair[0])[1]
    scale = angle / hypot(*axis)
    if axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2] < 0:
        scale = -scale
    return [x, y, z, axis[0] * scale, axis[1] * scale, axis[2] * scale]


def inverse_matrix(matrix: Matrix) -> Matrix:
    """The inverse of a rigid transform."""
    out = np.eye(4)
    out[:3, :3] = matrix[:3, :3].T
    out[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return out


def pose_between(a: Sequence[float], b: Sequence[float], share: float) -> list[float]:
    """The pose a share of the way from `a` to `b`: position on the straight line, rotation about one axis, the short way."""
    start, end = matrix_of(a), matrix_of(b)
    turn = np.eye(4)
    turn[:3, :3] = start[:3, :3].T @ end[:3, :3]
    part = matrix_of([0.0, 0.0, 0.0, *(share * r for r in pose_of(turn)[3:])])
    out = start @ part
    out[:3, 3] = start[:3, 3] + share * (end[:3, 3] - start[:3, 3])
    return pose_of(out)


def turn_between(a: Sequence[float], b: Sequence[float]) -> float:
    """Angle [rad] between the orientations of two poses."""
    turn = inverse_matrix(matrix_of(a)) @ matrix_of(b)
    return hypot(*pose_of(turn)[3:])
