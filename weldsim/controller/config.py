"""How a virtual controller behaves beyond what its profile says."""

from dataclasses import dataclass, field

from weldsim.controller.calibration import Calibration
from weldsim.errors import ConfigError
from weldsim.quantity import Second, require_within


@dataclass(frozen=True)
class ControllerConfig:
    """Settings of the virtual controller: its clock, and what a technician would have set on the pendant."""

    speed: float = 1.0
    """Simulated seconds in a second."""
    unlock_delay: Second = 5.0
    """Time after a protective stop before the dashboard can unlock it; real controllers refuse for 5 s."""
    low_when_stopped: tuple[int, ...] = (0,)
    """Digital outputs that the installation drops when no program runs any longer; the arc belongs among them."""
    standstill: float = 1e-3
    """Joint speed below which the arm counts as steady [rad/s]."""
    calibration: Calibration = field(default_factory=Calibration)
    """Factory calibration of the arm: what it tells of itself, and what its poses and joint angles mean to it, and where
    its links are."""

    def __post_init__(self) -> None:
        require_within(self, {"speed": (0.01, 100.0), "unlock_delay": (0.0, 60.0), "standstill": (1e-6, 1.0)}, "controller")
        if any(not 0 <= bit <= 17 for bit in self.low_when_stopped):
            raise ConfigError(
                f"controller.low_when_stopped = {self.low_when_stopped}: outputs are 0 to 17", key="controller.low_when_stopped"
            )
