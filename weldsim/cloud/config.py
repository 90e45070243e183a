"""CloudConfig: how views become one cloud (`weldsim.cloud.views`) and how it is cleaned (`weldsim.cloud.filters.prepare`)."""

from dataclasses import dataclass, field

from weldsim.errors import ConfigError
from weldsim.quantity import Metre, Radian, require_within

RANGES = {
    "voxel": (0.0, 0.1),
    "outlier_radius": (0.0, 0.1),
    "outlier_neighbours": (1, 10_000),
}
REGISTER_RANGES = {
    "offset_sigma": (1e-6, 0.1),
    "view_sigma": (1e-6, 0.1),
    "view_turn": (1e-6, 0.5),
    "hand_eye_sigma": (1e-6, 0.1),
    "hand_eye_turn": (1e-6, 0.5),
    "farthest": (0.05, 10.0),
}


@dataclass(frozen=True, kw_only=True)
class RegisterConfig:
    """How large the mistakes of a cell are from which views are lined up (read by `weldsim.cloud.register`)."""

    enabled: bool = True
    """Whether several views are lined up at all."""

    offset_sigma: Metre = 0.0035
    """Standard deviation of a view's offset along its optical axis; the thesis's ten distances (table 6.2) scatter so."""

    view_sigma: Metre = 0.0005
    """Standard deviation of a view's other offsets, across the axis: the arm's own errors."""

    view_turn: Radian = 0.0017
    """Standard deviation of a view's turn about each axis (0.1 deg)."""

    hand_eye_sigma: Metre = 0.001
    """Standard deviation of the hand-eye calibration along each axis; it moves every view alike in its camera's frame."""

    hand_eye_turn: Radian = 0.0035
    """Standard deviation of the hand-eye calibration about each axis (0.2 deg)."""

    farthest: Metre = 1.2
    """Where views are merged, points deeper than this are dropped: they are of the room, and a stereo camera's noise is ten
    times that of its working distance."""

    double_walls: bool = True
    """Whether, where two views still show one surface in two places, the worse-seen one is dropped."""

    def __post_init__(self) -> None:
        require_within(self, REGISTER_RANGES, "cloud.register")


@dataclass(frozen=True, kw_only=True)
class CloudConfig:
    """What is kept of a cloud. The defaults keep every point: the stages behind are made for clutter and noise."""

    crop_min: tuple[Metre, Metre, Metre] | None = None
    """Lower corner of the box that is kept, in the robot base; none keeps everything."""

    crop_max: tuple[Metre, Metre, Metre] | None = None
    """Upper corner of that box."""

    voxel: Metre = 0.0
    """Edge of the cubes whose points are averaged; 0 keeps the points as they are."""

    outlier_radius: Metre = 0.0
    """Points with fewer than `outlier_neighbours` others within this radius are dropped; 0 drops none."""

    outlier_neighbours: int = 4
    """How many neighbours a point needs within `outlier_radius`."""

    register: RegisterConfig = field(default_factory=RegisterConfig)
    """How several views are lined up."""

    def __post_init__(self) -> None:
        if (self.crop_min is None) != (self.crop_max is None):
            raise ConfigError("crop box: give both crop_min and crop_max, or neither", key="crop_min")
        if self.crop_min is not None and self.crop_max is not None:
            for axis, low, high in zip("xyz", self.crop_min, self.crop_max, strict=True):
                if low >= high:
                    raise ConfigError(f"crop box: {axis} from {low:g} m to {high:g} m holds nothing", key="crop_max", axis=axis)
        require_within(self, RANGES, "cloud")
