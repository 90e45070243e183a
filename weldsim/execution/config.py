"""How the simulated arm's controller behaves, and how a trajectory is run."""

from dataclasses import dataclass, field

from weldsim.errors import ConfigError
from weldsim.quantity import Radian, Second, require_within


@dataclass(frozen=True)
class SimulationConfig:
    """Settings of `SimulatedRobot`. Stiffness, damping and friction of the joints are in the arm's MJCF."""

    period: Second = 0.008
    """Command period: 8 ms on a CB3 controller, 2 ms on an e-Series."""
    timestep: Second = 0.001
    """Physics step; commands are interpolated to it, as a joint servo does."""
    velocity_lag: Second = 0.00045
    """What the servo's velocity feed-forward lacks; logs of a real UR5 show 0.4 ms (arm) to 0.6 ms (wrist)."""
    payload_known: float = 0.9
    """Share of the torch's and camera's weight that the controller's gravity feed-forward knows; the arm's own it knows."""
    stop_deceleration: float = 10.0
    """Joint deceleration of a stop [rad/s2]."""
    frame_period: Second = 0.04
    """Simulated time between two calls of the frame callback."""

    def __post_init__(self) -> None:
        for name in ("period", "timestep", "stop_deceleration", "frame_period"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"simulation.{name} = {getattr(self, name)}: must be positive", key=f"simulation.{name}")
        require_within(self, {"period": (5e-4, 0.1), "timestep": (1e-5, 0.1), "stop_deceleration": (0.01, 1e4)}, "simulation")
        if self.timestep > min(self.period, 0.002):
            raise ConfigError(
                f"simulation.timestep = {self.timestep} s: at most {min(self.period, 0.002)} s, or the servos turn unstable",
                key="simulation.timestep",
            )
        if not 0.0 <= self.payload_known <= 2.0:
            raise ConfigError(f"simulation.payload_known = {self.payload_known}: expected 0 to 2", key="simulation.payload_known")


@dataclass(frozen=True)
class ExecutionConfig:
    """Settings of `execute`."""

    start_tolerance: Radian = 0.0087
    """Greatest distance of any joint from the trajectory's first point (0.5 deg): otherwise nothing moves."""
    settle: Second = 0.2
    """Time the last point is held, so that the log ends with the arm at rest."""
    simulation: SimulationConfig = field(default_factory=SimulationConfig)
    """How the simulated arm behaves."""

    def __post_init__(self) -> None:
        if not self.start_tolerance > 0 or self.settle < 0:
            raise ConfigError(
                "execution: start_tolerance must be positive and settle not negative", key="execution.start_tolerance"
            )
        require_within(self, {"settle": (0.0, 60.0)}, "execution")
