"""Trapezoidal speed along a distance: how long it takes, and how far it has come."""

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True)
class Trapezoid:
    """Rest to rest over `distance`, at most `speed`, changing at `acceleration`; any consistent units."""

    distance: float
    speed: float
    acceleration: float

    @classmethod
    def lasting(cls, distance: float, duration: float, acceleration: float) -> "Trapezoid":
        """The one that takes `duration`; the acceleration is raised where it must be."""
        acceleration = max(acceleration, 4.0 * distance / duration**2)
        root = (acceleration * duration) ** 2 - 4.0 * acceleration * distance
        speed = (acceleration * duration - sqrt(max(0.0, root))) / 2.0
        return cls(distance, max(speed, 1e-12), acceleration)

    @property
    def peak(self) -> float:
        """The greatest speed that is reached."""
        return min(self.speed, sqrt(self.distance * self.acceleration))

    @property
    def duration(self) -> float:
        peak = self.peak
        return self.distance / peak + peak / self.acceleration if self.distance > 0 else 0.0

    def at(self, t: float) -> tuple[float, float]:
        """Distance covered and speed at time t from the start."""
        total, peak, a = self.duration, self.peak, self.acceleration
        if t >= total:
            return self.distance, 0.0
        rise = peak / a
        if t < rise:
            return a * t * t / 2, a * t
        if t > total - rise:
            left = total - t
            return self.distance - a * left * left / 2, a * left
        return peak * (t - rise / 2), peak
