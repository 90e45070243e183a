"""Settings of the seam finders."""

from dataclasses import dataclass, field
from typing import Literal

from weldsim.errors import ConfigError
from weldsim.quantity import Metre, Radian, require_within
from weldsim.seam.thesis.config import ThesisConfig

RANGES = {
    "min_width": (5e-4, 0.1),
    "max_width": (1e-3, 0.2),
    "min_length": (1e-3, 10.0),
    "min_depth": (0.0, 0.1),
    "search_width": (2e-3, 0.4),
    "side_band": (2e-3, 0.2),
    "station_step": (1e-4, 0.02),
    "max_side_angle": (0.01, 1.5),
    "max_side_step": (0.0, 0.1),
    "max_gap": (0.0, 0.5),
    "max_filled": (0.0, 0.5),
    "corner_radius": (1e-4, 0.1),
    "detection_factor": (0.1, 1000.0),
    "points_per_metre": (1e3, 1e6),
}


@dataclass(frozen=True, kw_only=True)
class ProfileConfig:
    """Limits of what counts as a groove for the default method. Nothing here is a noise threshold: those come from the
    cloud itself.

    Attributes:
        min_width, max_width: opening widths accepted [m].
        min_length: shortest seam accepted [m].
        min_depth: shallowest groove accepted, as the sensor shows it [m]; a D415 counts in steps of 1 mm.
        search_width: width of the window that closes valleys in the coarse search [m]; wider than max_width.
        side_band: how far beyond each lip the parent surface is read [m].
        station_step: spacing of the cross-sections along the seam [m].
        max_side_angle: largest angle between the parent surfaces left and right of a groove [rad].
        max_side_step: largest height difference between them at the groove [m].
        max_gap: pieces of one groove with no more than this between them are joined, past a clamp or missing data [m].
        max_filled: no more than this of it may show the plate's own surface, as a tack weld filed flush does [m].
        corner_radius: with which a seam that goes on round an edge of the part is rounded there [m]; at a right angle the line
            then passes 0.29 of it inside of the faces.
        detection_factor: detection threshold in robust standard deviations of the valley image above its median.
        points_per_metre: at most this many points for each metre of coarse line are used for its fit [1/m], evenly thinned.
    """

    min_width: Metre = 0.0045
    max_width: Metre = 0.028
    min_length: Metre = 0.030
    min_depth: Metre = 0.0010
    search_width: Metre = 0.036
    side_band: Metre = 0.022
    station_step: Metre = 0.001
    max_side_angle: Radian = 0.30
    max_side_step: Metre = 0.003
    max_gap: Metre = 0.045
    max_filled: Metre = 0.025
    corner_radius: Metre = 0.003
    detection_factor: float = 4.0
    points_per_metre: float = 100_000.0

    def __post_init__(self) -> None:
        require_within(self, RANGES, "seam.profile")
        for low, high in (("min_width", "max_width"), ("max_width", "search_width")):
            if not getattr(self, low) < getattr(self, high):
                raise ConfigError(
                    f"seam.profile.{high} = {getattr(self, high):g} m: must be over {low}, {getattr(self, low):g} m",
                    key=high,
                    limit=getattr(self, low),
                )


@dataclass(frozen=True, kw_only=True)
class SeamConfig:
    """Which seam finder runs, and its settings.

    Attributes:
        method: "profile" fits cross-sections along a smooth curve (default); "thesis" is chapter 5 as published.
        profile: settings of the default method.  thesis: settings of the published one.
    """

    method: Literal["profile", "thesis"] = "profile"
    profile: ProfileConfig = field(default_factory=ProfileConfig)
    thesis: ThesisConfig = field(default_factory=ThesisConfig)
