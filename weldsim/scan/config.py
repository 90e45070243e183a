"""ScanConfig: how the arm goes to the scan views, and how views are chosen where the scene leaves it open."""

from dataclasses import dataclass
from typing import Literal

from weldsim.errors import ConfigError
from weldsim.quantity import Metre, Radian, require_within

RANGES = {
    "nearest": (0.05, 5.0),
    "farthest": (0.05, 5.0),
    "incidence": (0.01, 1.5),
    "margin": (0.0, 0.4),
    "coverage": (0.01, 1.0),
    "surroundings": (1e-3, 0.5),
    "most": (1, 64),
}


@dataclass(frozen=True, kw_only=True)
class ScanConfig:
    """Settings of the scan (`weldsim.scan.tour`, `weldsim.scan.plan`)."""

    views: Literal["scene", "auto"] = "scene"
    """Which views are taken: the scene's own, or ones chosen from the part's nominal geometry (`weldsim.scan.plan`)."""

    move: bool = True
    """Whether `weldsim run` drives the simulated arm from view to view; without, it stands at each as if it had been put there."""

    nearest: Metre = 0.33
    """Least depth at which a chosen view sees a place of the part."""

    farthest: Metre = 0.47
    """Greatest depth at which it sees it; a stereo camera's noise grows with the square."""

    incidence: Radian = 0.7854
    """Greatest angle between the sight line and the surface's normal (45 deg)."""

    margin: float = 0.08
    """Share of the image at each border that is not counted on."""

    surroundings: Metre = 0.025
    """How far from the groove the part's surface has to be seen."""

    coverage: float = 0.97
    """Share of the groove's surroundings that has to be seen; less is refused."""

    most: int = 8
    """Greatest number of views."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "scan")
        if not self.nearest < self.farthest:
            raise ConfigError(f"scan.nearest = {self.nearest:g} m: must be under farthest, {self.farthest:g} m", key="nearest")
