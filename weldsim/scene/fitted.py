"""The compiled cell with an arm of its own geometry in it: every joint where that arm has it, every link fitted between its joints.

Published meshes and collision bodies are the nominal arm's. A link of a calibrated arm is the same casting, a fraction of a
millimetre longer or skewed: its bodies are laid, undeformed, where the axes at both its ends fit best, and the flange with all that
is bolted to it exactly where the arm has it.
"""

import copy
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.frames import quaternion_from_matrix
from weldsim.kinematics import JOINT_NAMES, link_frames

SPAN = 0.1  # [m] along each axis, to either side of the link's own frame, in which its fit counts


def fitted_model(model: Any, arm: Arm) -> Any:
    """A copy of a compiled model, an MjModel, in which the UR5 is that arm: the same joint angles put the flange where it has it.

    Args:
        model: with the nominal UR5 of `assets/ur5`, whose body frames are `weldsim.kinematics.link_frames`.
    """
    out = copy.copy(model)
    points, axes = arm.axes()
    X_BP = np.eye(4)  # of the link before
    for name, X_BL, point, axis in zip(JOINT_NAMES, _links(arm), points, axes, strict=True):
        joint = out.joint(name).id
        body = out.jnt_bodyid[joint]
        X_PL = np.linalg.inv(X_BP) @ X_BL
        out.body_pos[body], out.body_quat[body] = X_PL[:3, 3], quaternion_from_matrix(X_PL[:3, :3])
        R_LB = X_BL[:3, :3].T
        out.jnt_pos[joint], out.jnt_axis[joint] = R_LB @ (point - X_BL[:3, 3]), R_LB @ axis
        X_BP = X_BL
    return out


def _links(arm: Arm) -> Float[ndarray, "6 4 4"]:
    """Pose in B of each link's body frame, all joints at zero."""
    nominal, own = (np.stack([points - SPAN * axes, points + SPAN * axes], axis=1) for points, axes in (UR5.axes(), arm.axes()))
    zero = np.zeros(6)
    moves = [_rigid(nominal[k : k + 2].reshape(4, 3), own[k : k + 2].reshape(4, 3)) for k in range(5)]
    moves.append(arm.flange_pose(zero).matrix @ UR5.flange_pose(zero).inverse().matrix)
    return np.stack(moves) @ link_frames(zero)


def _rigid(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, "4 4"]:
    """The rigid motion that takes points a to b with the least sum of squares (Kabsch 1976)."""
    middle_a, middle_b = a.mean(axis=0), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((b - middle_b).T @ (a - middle_a))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = R, middle_b - R @ middle_a
    return out
