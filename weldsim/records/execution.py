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


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotFacts:
    """What a controller says about itself and the tool it believes in; None where it cannot say.

    Attributes:
        model: of the arm, "UR5" say.  series: of the controller, "cb3", "e" or "simulated".
        version: of its software, "3.15.8" say.  serial: of the arm, "" where it has none.
        dh: (6, 4) DH parameters (theta offset [rad], a [m], d [m], alpha [rad]) a joint, factory calibration included, in UR's
            own convention (standard DH: a and alpha lie behind the joint's d).
        dh_note: how good they are in the controller's word, "calibrated" say; where dh is None, why, in one word.
        X_FT: flange to torch tip.  payload_kg: mass on the flange [kg].  payload_cog: (3,) its centre in F [m].
        remote_control: whether it may be commanded from outside; None where there is no such switch.
        safety: state of the safety system, "normal" where nothing is wrong.  mode: of the arm, "running" when it can move.
        program_running: whether a program that is not ours runs.
    """

    model: str
    series: str
    version: str
    serial: str
    dh: Float[ndarray, "6 4"] | None = None
    dh_note: str = ""
    X_FT: Transform | None = None
    payload_kg: float | None = None
    payload_cog: Float[ndarray, "3"] | None = None
    remote_control: bool | None = None
    safety: str = "normal"
    mode: str = "running"
    program_running: bool = False

    def __post_init__(self) -> None:
        if self.dh is not None:
            store(self, "dh", self.dh, shape=(6, 4))
        if self.payload_cog is not None:
            store(self, "payload_cog", self.payload_cog, shape=(3,))
        if self.X_FT is not None:
            require(self.X_FT.names == "FT" and self.X_FT.batch == (), self, "X_FT", "must be one X_FT")


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
