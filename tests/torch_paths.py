"""Torch paths for tests: lines, arcs and waves on tilted planes in front of the arm, from a seed."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length, tangents
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.records import Segment, TorchPath

START = np.array([-1.5708, -1.9199, -1.6, -1.1, 1.5708, 0.0])  # [rad] arm up over the table, wire well above it
OVER = np.array([-1.6, -1.36, -2.33, -0.19, 2.02, -0.4])  # [rad] wire straight down, some centimetres over (0, -0.48, 0.06) m in B


def torch_path(
    points_B: Float[ndarray, "n 3"],
    wire_B: Float[ndarray, "3"] | Float[ndarray, "n 3"],
    speed: float = 0.008,
    roll_free: bool = True,
) -> TorchPath:
    """A WELD along points with the wire along `wire_B` and x along travel."""
    z = unit(np.broadcast_to(wire_B, points_B.shape))
    t = tangents(points_B)
    x = unit(t - np.einsum("ij,ij->i", t, z)[:, None] * z)
    n = len(points_B)
    return TorchPath(
        X_BT=Transform("BT", np.stack([x, np.cross(z, x), z], axis=-1), points_B),
        s=arc_length(points_B),
        speed=np.full(n, speed),
        arc_on=np.ones(n, bool),
        segments=(Segment.WELD,) * n,
        roll_free=roll_free,
    )


def flat_curve(kind: str, length: float, step: float = 0.0007) -> Float[ndarray, "n 3"]:
    """A seam in its own plane, middle at the origin: "line", "arc" (radius 0.1 to 0.2 m) or "wave"."""
    u = np.linspace(-length / 2, length / 2, round(length / step) + 1)
    if kind == "line":
        return np.stack([u, 0 * u, 0 * u], axis=1)
    if kind == "arc":
        radius = 0.5 * length + 0.05
        return np.stack([radius * np.sin(u / radius), radius * (1 - np.cos(u / radius)), 0 * u], axis=1)
    return np.stack([u, 0.02 * np.sin(2 * np.pi * u / length), 0 * u], axis=1)


def random_path(seed: int, kind: str) -> TorchPath:
    """A seam of 0.1 to 0.25 m on a plane tilted by up to 25 deg, turned at will, 0.42 to 0.55 m before the base."""
    rng = np.random.default_rng(seed)
    tilt, heading, yaw = rng.uniform(0, np.deg2rad(25)), rng.uniform(0, 2 * np.pi), rng.uniform(-np.pi, np.pi)
    lean = matrix_from_rotation_vector(tilt * np.array([-np.sin(heading), np.cos(heading), 0.0]))
    R = lean @ matrix_from_rotation_vector(np.array([0.0, 0.0, yaw]))
    middle = np.array([rng.uniform(-0.12, 0.12), -rng.uniform(0.42, 0.55), rng.uniform(0.05, 0.12)])
    points = flat_curve(kind, rng.uniform(0.1, 0.25)) @ R.T + middle
    return torch_path(points, -R[:, 2], speed=rng.uniform(0.004, 0.010))
