"""The arm as geometry alone: a MuJoCo model for differential kinematics, the Jacobian, and rough centre lines.

Everything is expressed in the controller's base B. The model has the arm's own figures, so that a solved pose and a checked pose
agree to rounding; the Jacobian, dexterity and centre lines have the nominal arm's: they weigh postures, and a calibration changes
them by millimetres where centimetres count.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.frames import Transform
from weldsim.kinematics import ALPHA, JOINT_LIMIT, JOINT_NAMES, A, D, link_frames
from weldsim.mounts import X_FC, X_FT

TORCH_SITE = "torch"
UPPER_ARM_OFFSET = 0.136  # [m] of the upper arm's centre line from the shoulder's, along the elbow axis
FOREARM_OFFSET = 0.016  # [m] of the forearm's centre line, likewise


def kinematic_model(arm: Arm = UR5) -> mujoco.MjModel:
    """Six hinges and a site at the torch tip, rooted in B; masses are dummies."""
    spec = mujoco.MjSpec()
    body = spec.worldbody
    for name, hinge in zip(JOINT_NAMES, _nominal_hinges() if arm.nominal else _own_hinges(arm), strict=True):
        body = body.add_body(
            name=name, pos=hinge.p, quat=hinge.quaternion, mass=1.0, inertia=[0.01, 0.01, 0.01], explicitinertial=True
        )
        body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            pos=hinge.anchor,
            axis=hinge.axis,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[-JOINT_LIMIT, JOINT_LIMIT],
        )
    X_LT = arm.X_FT if arm.nominal else arm.torch_pose(np.zeros(6))
    body.add_site(name=TORCH_SITE, pos=X_LT.p, quat=X_LT.quaternion)
    spec.compiler.degree = False
    return spec.compile()


class _Hinge(NamedTuple):
    """A link and its joint. Attributes: p [m], quaternion wxyz, of the link in the one before, all joints at zero; anchor [m],
    axis, of the joint in the link."""

    p: list[float]
    quaternion: list[float]
    anchor: list[float]
    axis: list[float]


def _nominal_hinges() -> list[_Hinge]:
    """Modified DH: Rx(alpha) Tx(a) before the joint, Tz(d) after it; turning about z and moving along z commute."""
    out = []
    for alpha, a, d in zip(ALPHA, A, D, strict=True):
        turn = [np.cos(alpha / 2), np.sin(alpha / 2), 0.0, 0.0]
        out.append(_Hinge([a, -np.sin(alpha) * d, np.cos(alpha) * d], turn, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    return out


def _own_hinges(arm: Arm) -> list[_Hinge]:
    """All links have their frame in B when the joints are at zero: the frames of DH figures may lie hundreds of metres away."""
    return [
        _Hinge([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], point.tolist(), axis.tolist())
        for point, axis in zip(*arm.axes(), strict=True)
    ]


def jacobian(q: Float[ndarray, "n 6"], X_FT: Transform = X_FT) -> Float[ndarray, "n 6 6"]:
    """Geometric Jacobian of the torch tip in B: rows 0-2 linear [m/rad], 3-5 angular."""
    frames = link_frames(q)
    axes, origins = frames[..., :3, 2], frames[..., :3, 3]
    tip = frames[:, 5, :3, :3] @ X_FT.p + frames[:, 5, :3, 3]
    return np.concatenate([np.cross(axes, tip[:, None, :] - origins), axes], axis=-1).swapaxes(-1, -2)


def dexterity(q: Float[ndarray, "n 6"], X_FT: Transform = X_FT) -> Float[ndarray, "n"]:
    """Smallest singular value of the Jacobian, with angles weighed as arcs of half a metre; 0 = singular."""
    J = jacobian(q, X_FT).copy()
    J[:, 3:] *= 0.5
    return np.linalg.svd(J, compute_uv=False)[:, -1]


def _between(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, "n m 3"]:
    u = np.linspace(0.0, 1.0, 9)[None, :, None]
    return a[:, None] * (1 - u) + b[:, None] * u


def clearances(q: Float[ndarray, "n 6"], floor: float, X_FT: Transform = X_FT) -> Float[ndarray, "n"]:
    """Least distance [m] from the arm's centre lines and camera to the table, and from the tool to the arm.

    A coarse guard against elbows in the table and a torch in the forearm; bodies of the cell are not known here.
    """
    frames = link_frames(q)
    elbow_axis = frames[:, 1, :3, 2]
    shoulder, elbow, wrist = frames[:, 1, :3, 3], frames[:, 2, :3, 3], frames[:, 3, :3, 3]
    wrist_root = wrist - D[3] * elbow_axis
    upper = _between(shoulder, elbow) + UPPER_ARM_OFFSET * elbow_axis[:, None]
    fore = _between(elbow, wrist_root) + FOREARM_OFFSET * elbow_axis[:, None]
    flange = frames[:, 5, :3, 3]
    tip = frames[:, 5, :3, :3] @ X_FT.p + flange
    camera = frames[:, 5, :3, :3] @ X_FC.p + flange
    wrists = np.stack([wrist, frames[:, 4, :3, 3], flange, camera], axis=1)
    height = np.concatenate([upper[:, 2:], fore, wrists], axis=1)[..., 2].min(axis=1) - floor
    tool = np.concatenate([_between(flange, tip), camera[:, None]], axis=1)
    arm = np.concatenate([upper, fore[:, :-1]], axis=1)
    gap = np.linalg.norm(tool[:, :, None] - arm[:, None], axis=-1).min(axis=(1, 2))
    return np.minimum(height, gap)
