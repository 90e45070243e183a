"""A UR5 and the torch it carries: kinematics by the arm's own DH figures, factory calibration included.

No two arms are alike: the flanges of two whose figures are published lie 3.0 and 3.3 mm off the nominal one's at the same joint
angles. A plan is made with the figures of the arm that welds. Its joint angles for a pose are the nominal arm's, which have a
closed form, moved by Newton's method (`weldsim.kinematics.joints_at`); a calibration changes them by some milliradians.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim import kinematics
from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import DH, dh_frames, joints_at, link_frames
from weldsim.mounts import X_FT
from weldsim.records.checks import store

POSTURES = 200  # in which two arms are compared


@dataclass(frozen=True, eq=False, kw_only=True)
class Arm:
    """One arm with its torch; `UR5` is the nominal one.

    Attributes:
        dh: (6, 4) theta offset [rad], a [m], d [m], alpha [rad] of each joint, as `weldsim.kinematics.DH` has them.
        X_FT: flange to torch tip.
        nominal: whether it is the nominal arm, whose closed forms are used then.
    """

    dh: Float[ndarray, "6 4"] = field(default_factory=DH.copy)
    X_FT: Transform = X_FT
    nominal: bool = field(init=False)

    def __post_init__(self) -> None:
        store(self, "dh", self.dh, shape=(6, 4))
        object.__setattr__(self, "nominal", bool((self.dh == DH).all()))

    def flange_pose(self, q: Float[ndarray, "*batch 6"]) -> Transform:
        """X_BF for joint angles q [rad]; any batch shape."""
        return kinematics.flange_pose(q) if self.nominal else Transform.from_matrix("BF", self._flange(q))

    def torch_pose(self, q: Float[ndarray, "*batch 6"]) -> Transform:
        """X_BT for joint angles q [rad]; any batch shape."""
        return self.flange_pose(q) @ self.X_FT

    def torch_tip(self, q: Float[ndarray, "*batch 6"]) -> Float[ndarray, "*batch 3"]:
        """The torch tip of `torch_pose` alone, in B [m]: for what is asked every period."""
        if self.nominal:
            return kinematics.torch_tip(q, self.X_FT)
        X_BF = self._flange(q)
        return X_BF[..., :3, :3] @ self.X_FT.p + X_BF[..., :3, 3]

    def inverse(self, X_BF: Transform) -> Float[ndarray, "k 6"]:
        """All joint solutions [rad] in (-pi, pi] of one flange pose; k is 0 (none) to 8."""
        q, _ = self.inverse_of_many(X_BF.matrix[None])
        return q[np.isfinite(q).all(axis=1)]

    def inverse_of_many(self, X_BF: Float[ndarray, "n 4 4"]) -> tuple[Float[ndarray, "n_k 6"], Int[ndarray, "n_k"]]:
        """All joint solutions [rad] in (-pi, pi] of many flange poses, and the pose that each is of.

        A pose that the nominal arm does not reach has none, though this arm may reach a millimetre further. NaN where the nominal
        arm has one and Newton's method does not converge: at a singularity.
        """
        q, pose = kinematics.inverse_of_many(X_BF)
        if self.nominal:
            return q, pose
        q = joints_at(self.dh, X_BF[pose], q)
        return q - 2 * np.pi * np.ceil(q / (2 * np.pi) - 0.5), pose

    def inverse_near(self, X_BF: Transform, q_near: Float[ndarray, "6"]) -> Float[ndarray, "6"]:
        """The solution nearest to q_near [rad], each joint unwrapped by whole turns within its limits.

        Raises:
            UnreachableError: no solution; `data` has the flange's position.
        """
        q = kinematics.inverse_near(X_BF, q_near)
        if self.nominal:
            return q
        own = joints_at(self.dh, X_BF.matrix[None], q[None])[0]
        if not np.isfinite(own).all():
            x, y, z = X_BF.p
            where = f"flange at ({x:.3f}, {y:.3f}, {z:.3f}) m in base"
            raise UnreachableError(f"{where}: a singularity; move the part or turn the torch", position=tuple(X_BF.p))
        return own

    def axes(self) -> tuple[Float[ndarray, "6 3"], Float[ndarray, "6 3"]]:
        """A point [m] on the axis of each joint, the nearest to where the nominal arm's link frame lies, and its direction, in B,
        all joints at zero: with these lines and the flange there an arm is known, however strange its figures."""
        frames = dh_frames(self.dh, np.zeros(6))[:6]
        points, directions = frames[:, :3, 3], frames[:, :3, 2]
        off = link_frames(np.zeros(6))[:, :3, 3] - points
        return points + np.sum(off * directions, axis=1, keepdims=True) * directions, directions

    def deviation(self) -> float:
        """Greatest distance [m] in any of many postures between its flange and the nominal arm's at the same joint angles.

        DH figures themselves say nothing: they trade off against one another, those of a calibrated arm with its three parallel
        axes by hundreds of metres.
        """
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSTURES, 6))
        return float(np.linalg.norm(self._flange(q)[:, :3, 3] - kinematics.flange_pose(q).p, axis=1).max())

    def _flange(self, q: Float[ndarray, "*batch 6"]) -> Float[ndarray, "*batch 4 4"]:
        return dh_frames(self.dh, q)[..., 6, :, :]


UR5 = Arm()
"""The nominal arm with the cell's torch: what is planned for unless a robot tells its own figures."""
