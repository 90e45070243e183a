"""Forward and inverse kinematics of the UR5, in the controller's base frame.

Modified Denavit-Hartenberg (thesis eq 3.3, table 3.1); all inverse branches from `ur-analytic-ik`.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.mounts import X_FT

JOINT_NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
A2, A3, D1, D4, D5, D6 = -0.425, -0.39225, 0.089159, 0.10915, 0.09465, 0.0823
ALPHA = np.array([0.0, np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2])  # alpha_{i-1} [rad]
A = np.array([0.0, 0.0, A2, A3, 0.0, 0.0])  # a_{i-1} [m]
D = np.array([D1, 0.0, 0.0, D4, D5, D6])  # d_i [m]
_CA, _SA = np.cos(ALPHA), np.sin(ALPHA)
DH = np.array(
    [
        [0.0, 0.0, D1, np.pi / 2],
        [0.0, A2, 0.0, 0.0],
        [0.0, A3, 0.0, 0.0],
        [0.0, 0.0, D4, np.pi / 2],
        [0.0, 0.0, D5, -np.pi / 2],
        [0.0, 0.0, D6, 0.0],
    ]
)
"""The same arm as its controller tells it: theta offset [rad], a [m], d [m], alpha [rad] of each joint, in standard DH."""
TURNS = np.array([0.3456, 0.0, 0.0, 0.0, 0.0, 0.2345])  # [rad] arbitrary, but no round angles: see `inverse_of_many`
TURN_FIRST, TURN_LAST = (
    np.array([[np.cos(a), -np.sin(a), 0, 0], [np.sin(a), np.cos(a), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    for a in (TURNS[0], TURNS[5])
)
JOINT_LIMIT = 2 * np.pi  # [rad] each joint, both ways
SPEED_LIMIT = np.pi  # [rad/s] each joint
REACH = 0.85  # [m] published; beyond it a flange pose has no solution
ROUNDS = 12  # of Newton's method; each squares the error, and the first is some millimetres
EXACT = 1e-10  # [m], [rad]
STRAY = 0.5  # [rad] a joint that Newton's method moves further has left its posture: it is at a singularity
DAMPING = 1e-12  # [m2/rad2] keeps a singular Jacobian soluble, and bends no step anywhere else


def link_frames(q: Float[ndarray, "*batch 6"]) -> Float[ndarray, "*batch 6 4 4"]:
    """Pose in B of each of the six DH frames, for joint angles q [rad] (thesis eq 3.2-3.3)."""
    q = np.asarray(q, float)
    c, s = np.cos(q), np.sin(q)
    ca, sa = _CA, _SA
    T = np.zeros((*q.shape, 4, 4))
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 3] = c, -s, A
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 2], T[..., 1, 3] = s * ca, c * ca, -sa, -sa * D
    T[..., 2, 0], T[..., 2, 1], T[..., 2, 2], T[..., 2, 3] = s * sa, c * sa, ca, ca * D
    T[..., 3, 3] = 1.0
    out = np.empty_like(T)
    out[..., 0, :, :] = T[..., 0, :, :]
    for i in range(1, 6):
        out[..., i, :, :] = out[..., i - 1, :, :] @ T[..., i, :, :]
    return out


def dh_frames(dh: Float[ndarray, "6 4"], q: Float[ndarray, "*batch 6"]) -> Float[ndarray, "*batch 7 4 4"]:
    """Pose in B of B itself and of the six frames of any arm by standard DH; joint k turns about z of frame k, the last is F.

    Args:
        dh: theta offset [rad], a [m], d [m], alpha [rad] of each joint, as `DH` has them.  q: joint angles [rad].
    """
    theta = np.asarray(q, float) + dh[:, 0]
    (_, a, d, alpha), c, s = dh.T, np.cos(theta), np.sin(theta)
    ca, sa = np.cos(alpha), np.sin(alpha)
    T = np.zeros((*theta.shape, 4, 4))
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 2], T[..., 0, 3] = c, -s * ca, s * sa, a * c
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 2], T[..., 1, 3] = s, c * ca, -c * sa, a * s
    T[..., 2, 1], T[..., 2, 2], T[..., 2, 3] = sa, ca, d
    T[..., 3, 3] = 1.0
    out = np.empty((*theta.shape[:-1], 7, 4, 4))
    out[..., 0, :, :] = np.eye(4)
    for k in range(6):
        out[..., k + 1, :, :] = out[..., k, :, :] @ T[..., k, :, :]
    return out


def frames_jacobian(frames: Float[ndarray, "*batch 7 4 4"], point_B: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 6 6"]:
    """Geometric Jacobian in B of a point [m] of the last link: rows vx vy vz [m] and wx wy wz [rad], one column a joint.

    Args:
        frames: as `dh_frames` gives them.
    """
    axes, origins = frames[..., :6, :3, 2], frames[..., :6, :3, 3]
    return np.concatenate([np.cross(axes, point_B[..., None, :] - origins), axes], axis=-1).swapaxes(-1, -2)


def joints_at(dh: Float[ndarray, "6 4"], X_BF: Float[ndarray, "n 4 4"], q_near: Float[ndarray, "n 6"]) -> Float[ndarray, "n 6"]:
    """Joint angles [rad] with which an arm has its flange at each pose, by Newton's method from angles that nearly do.

    Row by row a smooth function of pose and angles. NaN where it does not converge, or not within STRAY: at a singularity.

    Args:
        dh: of the arm, as `DH` has them; lengths of hundreds of metres that cancel, as in a linearised calibration, do no harm.
        q_near: angles that put it within some centimetres of the pose, those of the nominal arm say.
    """
    out, q, left = np.full(q_near.shape, np.nan), np.array(q_near, float), np.arange(len(q_near))
    for _ in range(ROUNDS):
        frames = dh_frames(dh, q[left])
        here, wanted = frames[:, 6], X_BF[left]
        turn = wanted[:, :3, :3] @ here[:, :3, :3].swapaxes(-1, -2)
        # The sine of the angle, which is near zero at half a turn too: its cosine tells them apart.
        sine = np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1) / 2
        off = np.concatenate([wanted[:, :3, 3] - here[:, :3, 3], sine], axis=1)
        done = (np.abs(off).max(axis=1) <= EXACT) & (np.trace(turn, axis1=1, axis2=2) > 1)
        out[left[done]] = q[left[done]]
        if done.all():
            break
        J = frames_jacobian(frames[~done], here[~done, :3, 3])
        square = J.swapaxes(-1, -2) @ J + DAMPING * np.eye(6)
        left = left[~done]
        q[left] += np.linalg.solve(square, J.swapaxes(-1, -2) @ off[~done, :, None])[..., 0]
        left = left[np.abs(q[left] - q_near[left]).max(axis=1) <= STRAY]
    return out


def flange_pose(q: Float[ndarray, "*batch 6"]) -> Transform:
    """X_BF for joint angles q [rad]; any batch shape."""
    return Transform.from_matrix("BF", link_frames(q)[..., 5, :, :])


def torch_pose(q: Float[ndarray, "*batch 6"], X_FT: Transform = X_FT) -> Transform:
    """X_BT for joint angles q [rad]; any batch shape."""
    return flange_pose(q) @ X_FT


def torch_tip(q: Float[ndarray, "*batch 6"], X_FT: Transform = X_FT) -> Float[ndarray, "*batch 3"]:
    """The torch tip of `torch_pose` alone, in B [m]: at a third of its cost, for what is asked every period."""
    X_BF = link_frames(q)[..., 5, :, :]
    return X_BF[..., :3, :3] @ X_FT.p + X_BF[..., :3, 3]


def inverse(X_BF: Transform) -> Float[ndarray, "k 6"]:
    """All joint solutions [rad] in (-pi, pi] of one flange pose; k is 0 (none) to 8."""
    return inverse_of_many(X_BF.matrix[None])[0]


def inverse_of_many(X_BF: Float[ndarray, "n 4 4"]) -> tuple[Float[ndarray, "n_k 6"], Int[ndarray, "n_k"]]:
    """All joint solutions [rad] in (-pi, pi] of many flange poses, and the pose that each is of.

    ur-analytic-ik loses solutions where the angles of a pose are round: all with the tool square to the arm and the last joint at
    zero, which is how a tool points straight down. So it is asked for poses turned about the first and the last joint's axis.
    """
    import ur_analytic_ik

    solve = ur_analytic_ik.ur5.inverse_kinematics  # pyright: ignore[reportAttributeAccessIssue] - compiled, untyped
    turned = TURN_FIRST @ X_BF @ TURN_LAST
    found = [(solution, i) for i, matrix in enumerate(turned) for solution in solve(matrix)]
    q = np.array([q for q, _ in found], float).reshape(-1, 6) - TURNS
    q -= 2 * np.pi * np.ceil(q / (2 * np.pi) - 0.5)
    return q, np.array([i for _, i in found], np.int64)


def inverse_near(X_BF: Transform, q_near: Float[ndarray, "6"]) -> Float[ndarray, "6"]:
    """The solution nearest to q_near [rad], each joint unwrapped by whole turns within its limits.

    Raises:
        UnreachableError: no solution; `data` has the flange's position and its distance from the base axis.
    """
    solutions = inverse(X_BF)
    if len(solutions) == 0:
        distance = float(np.linalg.norm(X_BF.p - [0.0, 0.0, D1]))
        raise UnreachableError(
            f"flange at ({X_BF.p[0]:.3f}, {X_BF.p[1]:.3f}, {X_BF.p[2]:.3f}) m in base: no joint solution,"
            f" {distance:.3f} m from the shoulder (reach {REACH} m); move the part or turn the torch",
            position=tuple(X_BF.p),
            distance=distance,
            reach=REACH,
        )
    turns = solutions + 2 * np.pi * np.round((q_near - solutions) / (2 * np.pi))
    turns = np.where(np.abs(turns) > JOINT_LIMIT, solutions, turns)
    return turns[np.abs(turns - q_near).max(axis=1).argmin()]
