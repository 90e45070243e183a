"""How the simulated arm's controller behaves, and how a trajectory is run."""

from dataclasses import dataclass, field

from weldsim.errors import ConfigError
from weldsim.execution.ur_config import UrConfig
from weldsim.quantity import Radian, Second, require_within

RANGES = {
    "start_tolerance": (1e-6, 1.0),
    "settle": (0.0, 60.0),
}
SIMULATION_RANGES = {
    "period": (5e-4, 0.1),
    "timestep": (1e-5, 0.1),
    "velocity_lag": (0.0, 0.1),
    "payload_known": (0.0, 2.0),
    "stop_deceleration": (0.01, 1e4),
    "frame_period": (1e-3, 60.0),
}


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
        require_within(self, SIMULATION_RANGES, "simulation")
        if self.timestep > min(self.period, 0.002):
            raise ConfigError(
                f"simulation.timestep = {self.timestep} s: at most {min(self.period, 0.002)} s, or the servos turn unstable",
                key="simulation.timestep",
            )


@dataclass(frozen=True)
class ExecutionConfig:
    """Settings of `execute`."""

    start_tolerance: Radian = 0.0087
    """Greatest distance of any joint from the trajectory's first point (0.5 deg): otherwise nothing moves."""
    settle: Second = 0.2
    """Time the last point is held, so that the log ends with the arm at rest."""
    simulation: SimulationConfig = field(default_factory=SimulationConfig)
    """How the simulated arm behaves."""
    ur: UrConfig = field(default_factory=UrConfig)
    """How a UR arm is reached and driven."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "execution")
