"""Rigid transforms named by the frames they join: X_AB is the pose of frame B in frame A.

Letters (see CONVENTIONS.md): W world, B robot base as the controller reports it, F flange (UR `tool0`), T torch tip,
C camera (optical: x right, y down, z forward), P part, S seam. Composition checks that the inner letters cancel:
`X_BF @ X_FT` is `X_BT`; `X_BF @ X_CT` is an error.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import FrameError, RecordError

LETTERS = {
    "W": "world",
    "B": "base",
    "F": "flange",
    "T": "torch",
    "C": "camera",
    "P": "part",
    "S": "seam",
}


def read_only(array: ndarray) -> ndarray:
    """A C-contiguous copy of `array` that cannot be written."""
    copy = np.array(array, order="C", copy=True)
    copy.setflags(write=False)
    return copy


def unit(vectors: Float[ndarray, "... 3"]) -> Float[ndarray, "... 3"]:
    """Each vector divided by its length; a zero vector stays zero."""
    norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(norm > 0, norm, 1.0)


@dataclass(frozen=True, eq=False)
class Transform:
    """X_AB: rotation R_AB and translation p_AB [m], for one pose or a batch of any shape.

    Attributes:
        names: the two letters, outer then inner ("BT" for X_BT).
        R: rotation matrices, shape (..., 3, 3), orthonormal, right-handed.
        p: positions of B's origin in A [m], shape (..., 3).
    Raises:
        RecordError: shapes that disagree, values that are not finite, a matrix that is no rotation (1e-6).
    """

    names: str
    R: Float[ndarray, "*batch 3 3"]
    p: Float[ndarray, "*batch 3"]

    def __post_init__(self) -> None:
        if len(self.names) != 2 or any(letter not in LETTERS for letter in self.names):
            raise FrameError(f"frames {self.names!r}: expected two of {', '.join(LETTERS)}", names=self.names)
        R, p = read_only(np.asarray(self.R, float)), read_only(np.asarray(self.p, float))
        if R.shape[-2:] != (3, 3) or p.shape != R.shape[:-1]:
            raise RecordError(f"X_{self.names}: rotation shape {R.shape} does not fit position shape {p.shape}")
        if not (np.isfinite(R).all() and np.isfinite(p).all()):
            raise RecordError(f"X_{self.names}: holds a value that is not finite")
        if R.size:
            defect = float(np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max())
            if defect > 1e-6 or float(np.linalg.det(R).min()) < 0:
                raise RecordError(f"X_{self.names}: not a rotation matrix (off by {defect:.2g})", defect=defect)
        object.__setattr__(self, "R", R)
        object.__setattr__(self, "p", p)

    @classmethod
    def identity(cls, names: str) -> "Transform":
        return cls(names, np.eye(3), np.zeros(3))

    @classmethod
    def from_matrix(cls, names: str, matrix: Float[ndarray, "*batch 4 4"]) -> "Transform":
        """From homogeneous matrices, shape (..., 4, 4)."""
        matrix = np.asarray(matrix, float)
        return cls(names, matrix[..., :3, :3], matrix[..., :3, 3])

    @classmethod
    def from_quaternion(cls, names: str, wxyz: Float[ndarray, "*batch 4"], p: Float[ndarray, "*batch 3"]) -> "Transform":
        return cls(names, matrix_from_quaternion(wxyz), p)

    @classmethod
    def from_rotation_vector(cls, names: str, rotvec: Float[ndarray, "*batch 3"], p: Float[ndarray, "*batch 3"]) -> "Transform":
        return cls(names, matrix_from_rotation_vector(rotvec), p)

    @property
    def batch(self) -> tuple[int, ...]:
        return self.p.shape[:-1]

    @property
    def matrix(self) -> Float[ndarray, "*batch 4 4"]:
        out = np.zeros((*self.batch, 4, 4))
        out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = self.R, self.p, 1.0
        return out

    @property
    def quaternion(self) -> Float[ndarray, "*batch 4"]:
        """Unit quaternions wxyz, w >= 0."""
        return quaternion_from_matrix(self.R)

    @property
    def rotation_vector(self) -> Float[ndarray, "*batch 3"]:
        """Axis times angle [rad], angle in [0, pi]: the rotation part of a UR pose."""
        return rotation_vector_from_matrix(self.R)

    def inverse(self) -> "Transform":
        Rt = np.swapaxes(self.R, -1, -2)
        return Transform(self.names[::-1], Rt, -np.einsum("...ij,...j->...i", Rt, self.p))

    def __matmul__(self, other: "Transform") -> "Transform":
        if self.names[1] != other.names[0]:
            raise FrameError(
                f"X_{self.names} @ X_{other.names}: inner frames {self.names[1]} and {other.names[0]} differ",
                left=self.names,
                right=other.names,
            )
        return Transform(
            self.names[0] + other.names[1],
            self.R @ other.R,
            np.einsum("...ij,...j->...i", self.R, other.p) + self.p,
        )

    def points(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """points_A from points_B (a single transform only)."""
        return points @ self.R.T + self.p

    def vectors(self, vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Directions expressed in A from directions expressed in B (a single transform only)."""
        return vectors @ self.R.T

    def __getitem__(self, index: object) -> "Transform":
        return Transform(self.names, self.R[index], self.p[index])  # type: ignore[index]

    def __len__(self) -> int:
        if not self.batch:
            raise TypeError("a single Transform has no length")
        return self.batch[0]


def matrix_from_quaternion(wxyz: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch 3 3"]:
    """Rotation matrices from quaternions wxyz of any length but zero."""
    q = np.asarray(wxyz, float)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.isfinite(q).all() or (norm < 1e-12).any():
        raise RecordError("quaternion: zero length or not finite")
    w, x, y, z = np.moveaxis(q / norm, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_matrix(R: Float[ndarray, "*batch 3 3"]) -> Float[ndarray, "*batch 4"]:
    """Unit quaternions wxyz with w >= 0, stable for every rotation (thesis eq 5.53 breaks down near w = 0)."""
    R = np.asarray(R, float)
    d = np.einsum("...ii->...i", R)
    trace = d.sum(-1)
    # Four candidates, each exact; the one with the largest leading component is well conditioned (Shepperd 1978).
    squares = np.stack([trace, *(2 * d[..., i] - trace for i in range(3))], axis=-1)
    a, b, c = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    e, f, g = R[..., 1, 0] + R[..., 0, 1], R[..., 0, 2] + R[..., 2, 0], R[..., 2, 1] + R[..., 1, 2]
    lead = 1 + squares
    table = np.stack(
        [
            np.stack([lead[..., 0], a, b, c], -1),
            np.stack([a, lead[..., 1], e, f], -1),
            np.stack([b, e, lead[..., 2], g], -1),
            np.stack([c, f, g, lead[..., 3]], -1),
        ],
        axis=-2,
    )
    best = squares.argmax(-1)
    q = np.take_along_axis(table, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def matrix_from_rotation_vector(rotvec: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3 3"]:
    """Rotation matrices from axis times angle [rad]."""
    v = np.asarray(rotvec, float)
    half = np.linalg.norm(v, axis=-1, keepdims=True) / 2
    return matrix_from_quaternion(np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * v], axis=-1))


def rotation_vector_from_matrix(R: Float[ndarray, "*batch 3 3"]) -> Float[ndarray, "*batch 3"]:
    """Axis times angle [rad], angle in [0, pi]."""
    q = quaternion_from_matrix(R)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)


def slerp(
    q0: Float[ndarray, "*batch 4"], q1: Float[ndarray, "*batch 4"], u: Float[ndarray, "*batch"]
) -> Float[ndarray, "*batch 4"]:
    """Spherical interpolation between unit quaternions wxyz, the short way round (thesis eq 5.61)."""
    dot = np.sum(q0 * q1, axis=-1)
    q1 = np.where(dot[..., None] < 0, -q1, q1)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.where(angle > 1e-9, np.sin(angle), 1.0)
    a = np.where(angle > 1e-9, np.sin((1 - u) * angle) / sine, 1 - u)
    b = np.where(angle > 1e-9, np.sin(u * angle) / sine, u)
    return unit_quaternion(a[..., None] * q0 + b[..., None] * q1)


def unit_quaternion(q: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch 4"]:
    """Each quaternion divided by its length."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)
