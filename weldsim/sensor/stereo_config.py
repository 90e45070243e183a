"""Settings of the reference D415, apart from the class that renders: every command reads them."""

from dataclasses import dataclass, field

from weldsim.quantity import Metre, Pixel, require_within
from weldsim.sensor.infrared import InfraredConfig
from weldsim.sensor.matching import MatchingConfig

RANGES = {
    "baseline": (1e-3, 1.0),
    "disparity_step": (0.0, 16.0),
    "depth_unit": (0.0, 0.1),
    "max_disparity": (4.0, 1000.0),
    "offset_sigma": (0.0, 0.5),
    "offset_limit": (0.0, 0.5),
}


@dataclass(frozen=True, kw_only=True)
class D415StereoConfig:
    """The reference D415. Defaults: 640 x 480, factory settings."""

    baseline: Metre = 0.055
    """Distance between the two imagers (nominal)."""
    infrared: InfraredConfig = field(default_factory=InfraredConfig)
    """Projector and imagers."""
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """How the two images are matched."""
    disparity_step: Pixel = 1 / 32
    """Disparity is stored in these steps (the maker's white paper on sub-pixel linearity); 0 = exact."""
    depth_unit: Metre = 0.001
    """Depth is stored in these steps; 0 = exact."""
    max_disparity: Pixel = 126.0
    """Search limit of the silicon: nothing nearer than f * baseline / max_disparity is seen."""
    offset_sigma: Metre = 0.0
    """Standard deviation of an error of the whole view; see `D415Config.offset_sigma`."""
    offset_limit: float = 0.02
    """That error is cut off at this share of the distance (the maker's accuracy figure)."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "stereo")
