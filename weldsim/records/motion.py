"""What the torch and the arm shall do: torch path and joint trajectory."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.counted import counted
from weldsim.frames import Transform
from weldsim.records.checks import check_increasing, check_metres, require, store


class Segment(StrEnum):
    """What the torch is doing at a path point. The arc may burn in WELD alone."""

    AIR = "air"
    APPROACH = "approach"
    WELD = "weld"
    RETRACT = "retract"


@dataclass(frozen=True, eq=False, kw_only=True)
class TorchPath:
    """Where the torch tip shall be, ordered.

    Attributes:
        X_BT: n poses of the torch tip: z along the wire towards the work, x along travel.
        s: (n,) arc length of the tip from the path's first point [m], non-decreasing.
        speed: (n,) tip speed [m/s], positive.
        arc_on: (n,) whether the arc burns; true inside WELD only.
        segments: n segment names.
        roll_free: whether rotation about the wire may differ from X_BT.
        sigma: (n,) standard deviation of the tip position across the seam [m], or None.
    """

    X_BT: Transform
    s: Float[ndarray, "n"]
    speed: Float[ndarray, "n"]
    arc_on: Bool[ndarray, "n"]
    segments: tuple[Segment, ...]
    roll_free: bool = True
    sigma: Float[ndarray, "n"] | None = None

    def __post_init__(self) -> None:
        require(self.X_BT.names == "BT" and len(self.X_BT.batch) == 1, self, "X_BT", "must be a batch of X_BT")
        n = len(self.X_BT)
        require(n >= 2, self, "X_BT", f"{counted(n, 'pose')}; a path needs two")
        check_metres(self, "X_BT", self.X_BT.p)
        store(self, "s", self.s, shape=(n,))
        require(bool((np.diff(self.s) >= 0).all()), self, "s", "decreases")
        store(self, "speed", self.speed, shape=(n,))
        require(bool((self.speed > 0).all()), self, "speed", "must be positive")
        store(self, "arc_on", self.arc_on, shape=(n,), dtype=bool)
        require(len(self.segments) == n, self, "segments", f"{counted(len(self.segments), 'name')} for {counted(n, 'pose')}")
        weld = np.array([segment == Segment.WELD for segment in self.segments])
        require(not bool((self.arc_on & ~weld).any()), self, "arc_on", "the arc burns outside WELD")
        if self.sigma is not None:
            store(self, "sigma", self.sigma, shape=(n,))

    @property
    def weld(self) -> slice:
        """The poses of the WELD segment, which is contiguous."""
        index = [i for i, segment in enumerate(self.segments) if segment == Segment.WELD]
        require(bool(index), self, "segments", "no WELD segment")
        return slice(index[0], index[-1] + 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class JointTrajectory:
    """Joint motion over time.

    Attributes:
        t: (k,) [s], from 0, strictly increasing.
        q, qd, qdd: (k, 6) joint angles [rad], speeds [rad/s], accelerations [rad/s2].
        s: (k,) arc length of the torch path at each instant [m].
        arc_on: (k,).  segments: k names.  joint_names: six.
    """

    t: Float[ndarray, "k"]
    q: Float[ndarray, "k 6"]
    qd: Float[ndarray, "k 6"]
    qdd: Float[ndarray, "k 6"]
    s: Float[ndarray, "k"]
    arc_on: Bool[ndarray, "k"]
    segments: tuple[Segment, ...]
    joint_names: tuple[str, ...]

    def __post_init__(self) -> None:
        store(self, "t", self.t, shape=("k",))
        k = len(self.t)
        check_increasing(self, "t", self.t)
        for name in ("q", "qd", "qdd"):
            store(self, name, getattr(self, name), shape=(k, 6))
        store(self, "s", self.s, shape=(k,))
        store(self, "arc_on", self.arc_on, shape=(k,), dtype=bool)
        require(len(self.segments) == k, self, "segments", f"{counted(len(self.segments), 'name')} for {counted(k, 'instant')}")
        require(len(self.joint_names) == 6, self, "joint_names", "six are needed")
