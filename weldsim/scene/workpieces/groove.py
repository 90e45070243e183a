"""The cross-section of a groove: V, flat-bottomed V, or square slot, its sides level or not."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import REACH, SIZE, TURN, Metre, Radian, require_within

SIZES = (0.2e-3, 0.5)  # [m] of what can be called a groove in a part


@dataclass(frozen=True)
class GrooveConfig:
    """A groove's cross-section and how far it runs.

    Attributes:
        width: distance between the lips, across the seam [m].
        depth: of the bottom below the surface on the right of travel [m].
        angle: included angle between the walls [rad]; None takes the V that width and depth give, 0 a square slot.
            A smaller angle than the V's leaves a flat bottom, the root gap.
        root_gap: width of the flat bottom [m]; None takes what `angle` leaves. Give one of the two at most.
        misalignment: how much lower the surface on the left of travel lies (hi-lo) [m].
        margin: from each edge of the part to the groove's end [m]; 0 runs out through both edges.
    """

    width: Metre = 0.014
    depth: Metre = 0.008
    angle: Radian | None = None
    root_gap: Metre | None = None
    misalignment: Metre = 0.0
    margin: Metre = 0.0

    def __post_init__(self) -> None:
        ranges = {"width": SIZE, "depth": SIZE, "root_gap": SIZE, "angle": TURN, "misalignment": REACH, "margin": REACH}
        require_within(self, {name: limits for name, limits in ranges.items() if getattr(self, name) is not None}, "groove")


@dataclass(frozen=True)
class GrooveSection:
    """A groove's cross-section, checked. Its lips are width / 2 to either side of its middle, its bottom root_gap / 2.

    Attributes:
        width, depth, root_gap, misalignment: as in `GrooveConfig` [m].
    """

    width: float
    depth: float
    root_gap: float
    misalignment: float = 0.0

    @property
    def run(self) -> float:
        """How far each wall goes sideways [m]."""
        return (self.width - self.root_gap) / 2

    @property
    def left_depth(self) -> float:
        """Of the bottom below the surface on the left of travel [m]."""
        return self.depth - self.misalignment

    @property
    def angle(self) -> float:
        """Included angle between the walls [rad]."""
        return float(np.arctan2(self.run, self.depth) + np.arctan2(self.run, self.left_depth))

    @property
    def opening_depth(self) -> float:
        """Of the opening, the midpoint of the lips, below the surface on the right of travel [m]."""
        return self.misalignment / 2

    def outline(self, above: float) -> Float[ndarray, "k 2"]:
        """Corners (across, up) [m], counter-clockwise, of the material that is missing, walls extended `above` the right
        surface; convex. Across is positive to the right of travel."""
        right = self.root_gap / 2 + self.run * (1 + above / self.depth)
        left = self.root_gap / 2 + self.run * (1 + (above + self.misalignment) / self.left_depth)
        bottom = [(0.0, -self.depth)]
        if self.root_gap > 0:
            bottom = [(-self.root_gap / 2, -self.depth), (self.root_gap / 2, -self.depth)]
        return np.array([*bottom, (right, above), (-left, above)])


def make_section(config: GrooveConfig) -> GrooveSection:
    """The cross-section that `config` describes.

    Raises:
        SceneError: a width or depth outside SIZES, an angle too wide for the width at this depth, a root gap wider than the
            groove or given beside an angle, a misalignment that leaves no groove on the lower side.
    """
    for key in ("width", "depth"):
        value = getattr(config, key)
        if not SIZES[0] <= value <= SIZES[1]:
            low, high = (limit * 1e3 for limit in SIZES)
            raise SceneError(f"groove: {key} {value * 1e3:g} mm must be {low:g} to {high:g} mm", key=key, limit=SIZES)
    if config.margin < 0:
        raise SceneError(f"groove: margin {config.margin * 1e3:g} mm must not be negative", key="margin", limit=0.0)
    step = config.misalignment
    if not 0 <= step < 0.8 * config.depth:
        raise SceneError(
            f"groove: misalignment {step * 1e3:g} mm must be at least 0 and under {config.depth * 800:g} mm, 0.8 of the depth"
            f" {config.depth * 1e3:g} mm; a part whose right side is lower is turned end for end",
            key="misalignment",
            limit=0.8 * config.depth,
        )
    return GrooveSection(config.width, config.depth, _root_gap(config), step)


def _root_gap(config: GrooveConfig) -> float:
    """Width of the flat bottom [m]."""
    if config.root_gap is not None:
        if config.angle is not None:
            raise SceneError("groove: angle and root_gap are both given; one follows from the other, give one", key="root_gap")
        if not 0 <= config.root_gap <= config.width:
            raise SceneError(
                f"groove: root_gap {config.root_gap * 1e3:g} mm must be 0 to the width {config.width * 1e3:g} mm",
                key="root_gap",
                limit=config.width,
            )
        return config.root_gap
    if config.angle is None:
        return 0.0
    if not 0 <= config.angle < np.pi:
        raise SceneError(
            f"groove: angle {np.degrees(config.angle):g} deg must be at least 0 and under 180", key="angle", limit=np.pi
        )
    walls = 2 * _run(config.angle, config.depth, config.depth - config.misalignment)
    if walls > config.width * (1 + 1e-9):
        widest = GrooveSection(config.width, config.depth, 0.0, config.misalignment).angle
        raise SceneError(
            f"groove: walls at {np.degrees(config.angle):g} deg need a width of {walls * 1e3:.3f} mm"
            f" at depth {config.depth * 1e3:g} mm, but width is {config.width * 1e3:g} mm;"
            f" widen it, make it shallower, or use an angle up to {np.degrees(widest):.2f} deg",
            key="angle",
            limit=widest,
        )
    return max(0.0, config.width - walls)


def _run(angle: float, right: float, left: float) -> float:
    """How far each wall goes sideways so that walls of depths `right` and `left` [m] enclose `angle`: the root of
    atan(run / right) + atan(run / left) = angle."""
    if right == left:
        return right * np.tan(angle / 2)
    product, total = right * left, right + left
    c, s = np.cos(angle), np.sin(angle)
    # run^2 sin + run (right + left) cos - right left sin = 0, its positive root, without cancellation where cos > 0
    root = np.sqrt((total * c) ** 2 + 4 * product * s**2)
    return float(2 * product * s / (total * c + root)) if c > 0 else float((root - total * c) / (2 * s))
