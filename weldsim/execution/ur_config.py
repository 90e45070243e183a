"""How a UR arm is reached and driven."""

from dataclasses import dataclass
from typing import Literal

from numpy import ndarray

from weldsim.errors import ConfigError
from weldsim.mounts import PAYLOAD, PAYLOAD_COG, X_FT
from weldsim.quantity import Second, require_within

Series = Literal["cb3", "e"]
PERIODS: dict[Series, float] = {"cb3": 1 / 125, "e": 1 / 500}
"""Control period of a controller generation [s]."""

RANGES = {
    "arc_output": (0, 7),
    "buffer": (0.0, 0.1),
    "lookahead": (0.03, 0.2),
    "gain": (100.0, 2000.0),
    "watchdog_rate": (2.0, 50.0),
    "stall": (0.02, 0.4),
    "silence": (0.02, 1.0),
    "stop_deceleration": (1.0, 40.0),
    "follow_limit": (1e-3, 1.0),
    "answer_timeout": (0.02, 5.0),
    "connect_timeout": (1.0, 60.0),
    "stop_timeout": (0.3, 30.0),
    "payload": (0.0, 5.0),
}
TCP_LIMIT, COG_LIMIT = 1.0, 0.5  # [m] farther from the flange is a mistake of units

Point = tuple[float, float, float]
Pose = tuple[float, float, float, float, float, float]


def _three(values: ndarray) -> Point:
    return float(values[0]), float(values[1]), float(values[2])


_TCP, _COG = (*_three(X_FT.p), *_three(X_FT.rotation_vector)), _three(PAYLOAD_COG)


@dataclass(frozen=True)
class UrConfig:
    """Settings of `UrRobot`."""

    host: str = "127.0.0.1"
    """Address of the controller."""
    series: Literal["auto", "cb3", "e"] = "auto"
    """Controller generation: CB3 is streamed to at 125 Hz, e-Series at 500 Hz; auto takes what the controller says it is."""
    arc_output: int = 0
    """Standard digital output that strikes the arc. On a real controller its action at program end, in the installation's I/O
    set-up, must be `Low when not running`: that alone drops it when this computer or the cable dies."""
    buffer: Second = 0.024
    """How long a target waits before it is sent on, so that a hitch of this computer does not reach the arm."""
    lookahead: Second = 0.03
    """Smoothing time of servoJ; the arm follows about this much late. 0.03 to 0.2 s."""
    gain: float = 300.0
    """Position gain of servoJ, 100 to 2000; 300 is the controller's own default."""
    watchdog_rate: float = 6.0
    """Rate [Hz] at which the controller must be commanded, or it ends its program: the arm rests, the arc drops."""
    stall: Second = 0.12
    """Longest time between two commands of a stream; then the client process stops arm and arc by itself."""
    silence: Second = 0.12
    """Longest time without a state from the controller while streaming."""
    stop_deceleration: float = 15.0
    """Joint deceleration of a stop [rad/s2]."""
    follow_limit: float = 0.05
    """Greatest distance [rad] of the controller's own target from every command of the last moments: beyond it the controller
    obeys somebody else."""
    answer_timeout: Second = 0.12
    """Longest time that the client process may take to pass on a command; then it is killed."""
    connect_timeout: Second = 10.0
    """Longest time of one step of connecting."""
    stop_timeout: Second = 2.0
    """Longest time that a stop waits to see arm and arc at rest."""
    payload: float = PAYLOAD
    """Mass on the flange that the controller is told [kg]."""
    payload_cog: Point = _COG
    """Its centre in F [m]."""
    tcp: Pose = _TCP
    """X_FT that the controller is told: position [m] and rotation vector [rad] of the torch tip in the flange."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "ur")
        if not self.host or any(sign in self.host for sign in " /:"):
            raise ConfigError(f"ur.host = {self.host!r}: a name or an address, without port", key="ur.host", value=self.host)
        for name, values, limit in (("tcp", self.tcp[:3], TCP_LIMIT), ("payload_cog", self.payload_cog, COG_LIMIT)):
            if not all(abs(x) <= limit for x in values):
                raise ConfigError(
                    f"ur.{name} = {values}: farther than {limit} m from the flange; metres are meant", key=f"ur.{name}", limit=limit
                )
        if not all(abs(r) <= 6.3 for r in self.tcp[3:]):
            raise ConfigError(f"ur.tcp = {self.tcp}: a rotation vector beyond a whole turn; radians are meant", key="ur.tcp")
        limit = 1 / self.watchdog_rate
        for name in ("stall", "answer_timeout"):  # or the watchdog comes first, and knows no reason
            if (value := getattr(self, name)) >= limit:
                raise ConfigError(
                    f"ur.{name} = {value} s: must be shorter than a period of the watchdog, {limit:g} s",
                    key=f"ur.{name}",
                    value=value,
                    limit=limit,
                )
