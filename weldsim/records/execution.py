"""What the robot reports, and the log of what it did."""

from dataclasses import dataclass

from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records.checks import require, store
from weldsim.records.motion import Segment


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotState:
    """What the robot reports at one instant, never what was asked of it.

    Attributes:
        t: [s].  q, qd: (6,) [rad], [rad/s].  X_BT: torch tip.  mode: the robot's own word for its state.
    """

    t: float
    q: Float[ndarray, "6"]
    qd: Float[ndarray, "6"]
    X_BT: Transform
    mode: str = "idle"

    def __post_init__(self) -> None:
        for name in ("q", "qd"):
            store(self, name, getattr(self, name), shape=(6,))


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened while executing. Attributes: t [s], kind, text."""

    t: float
    kind: str
    text: str


@dataclass(frozen=True, eq=False, kw_only=True)
class ExecutionLog:
    """What the arm did, sampled every `period`.

    Attributes:
        t: (k,) [s].  q_cmd: (k, 6) what was sent [rad].  q_act, qd_act: (k, 6) what the robot reported.
        X_BT_act: k poses of the torch tip, measured.
        s_cmd: (k,) arc length of the commanded path [m].  arc_on: (k,).  segments: k names.
        torque: (k, 6) joint torques [Nm], or None.
        events: in order.  robot: which robot.  period: [s].
    """

    t: Float[ndarray, "k"]
    q_cmd: Float[ndarray, "k 6"]
    q_act: Float[ndarray, "k 6"]
    qd_act: Float[ndarray, "k 6"]
    X_BT_act: Transform
    s_cmd: Float[ndarray, "k"]
    arc_on: Bool[ndarray, "k"]
    segments: tuple[Segment, ...]
    period: float
    robot: str
    torque: Float[ndarray, "k 6"] | None = None
    events: tuple[Event, ...] = ()

    def __post_init__(self) -> None:
        store(self, "t", self.t, shape=("k",))
        k = len(self.t)
        for name in ("q_cmd", "q_act", "qd_act"):
            store(self, name, getattr(self, name), shape=(k, 6))
        require(self.X_BT_act.names == "BT" and self.X_BT_act.batch == (k,), self, "X_BT_act", "one measured pose an instant")
        store(self, "s_cmd", self.s_cmd, shape=(k,))
        store(self, "arc_on", self.arc_on, shape=(k,), dtype=bool)
        if self.torque is not None:
            store(self, "torque", self.torque, shape=(k, 6))
