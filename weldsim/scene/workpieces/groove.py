"""The cross-section of a groove: V, flat-bottomed V, or square slot."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import Metre, Radian


@dataclass(frozen=True)
class GrooveConfig:
    """A groove's cross-section and how far it runs.

    Attributes:
        width: distance between the lips at the plate's surface [m].
        depth: of the bottom below the surface [m].
        angle: included angle between the walls [rad]; None takes the V that width and depth give, 0 a square slot.
            A smaller angle than the V's leaves a flat bottom (the root gap) of width - 2 depth tan(angle / 2).
        margin: from each plate edge to the groove's end, along x [m]; 0 runs out through both edges.
    """

    width: Metre = 0.014
    depth: Metre = 0.008
    angle: Radian | None = None
    margin: Metre = 0.0


@dataclass(frozen=True)
class GrooveSection:
    """A groove's cross-section, checked.

    Attributes:
        width, depth, root_gap: [m].
    """

    width: float
    depth: float
    root_gap: float

    @property
    def angle(self) -> float:
        """Included angle between the walls [rad]."""
        return 2 * float(np.arctan2((self.width - self.root_gap) / 2, self.depth))

    def outline(self, above: float) -> Float[ndarray, "k 2"]:
        """Corners (across, up) [m], counter-clockwise, of the material that is missing, walls extended `above` the surface."""
        top = self.root_gap / 2 + (self.width - self.root_gap) / 2 * (1 + above / self.depth)
        bottom = [(0.0, -self.depth)]
        if self.root_gap > 0:
            bottom = [(-self.root_gap / 2, -self.depth), (self.root_gap / 2, -self.depth)]
        return np.array([*bottom, (top, above), (-top, above)])


def make_section(config: GrooveConfig) -> GrooveSection:
    """The cross-section that `config` describes.

    Raises:
        SceneError: a size that is not positive, or an angle too wide for the width at this depth.
    """
    for key in ("width", "depth"):
        value = getattr(config, key)
        if value <= 0:
            raise SceneError(f"groove: {key} {value * 1e3:g} mm must be positive", key=key, limit=0.0)
    if config.margin < 0:
        raise SceneError(f"groove: margin {config.margin * 1e3:g} mm must not be negative", key="margin", limit=0.0)
    if config.angle is None:
        return GrooveSection(config.width, config.depth, 0.0)
    if not 0 <= config.angle < np.pi:
        raise SceneError(
            f"groove: angle {np.degrees(config.angle):g} deg must be at least 0 and under 180", key="angle", limit=np.pi
        )
    walls = 2 * config.depth * np.tan(config.angle / 2)
    if walls > config.width * (1 + 1e-9):
        widest = GrooveSection(config.width, config.depth, 0.0).angle
        raise SceneError(
            f"groove: walls at {np.degrees(config.angle):g} deg need a width of {walls * 1e3:.3f} mm"
            f" at depth {config.depth * 1e3:g} mm, but width is {config.width * 1e3:g} mm;"
            f" widen it, make it shallower, or use an angle up to {np.degrees(widest):.2f} deg",
            key="angle",
            limit=widest,
        )
    return GrooveSection(config.width, config.depth, max(0.0, config.width - walls))
