"""PathConfig: how the torch is laid along a seam (read by `weldsim.path.plan`)."""

from dataclasses import dataclass

from weldsim.errors import ConfigError
from weldsim.quantity import Metre, MetrePerSecond, Radian, RadianPerMetre, require_within

DEGREE_PER_MM: RadianPerMetre = 17.453292519943295
STEEPEST: Radian = 1.0471975511965976  # 60 deg
RANGES = {
    "step": (1e-5, 0.01),
    "speed": (1e-4, 1.0),
    "smoothing": (0.0, 1.0),
    "turn_limit": (1e-3, 1e6),
    "ctwd": (1e-3, 0.1),
    "nominal_ctwd": (1e-3, 0.1),
    "start_trim": (0.0, 10.0),
    "end_trim": (0.0, 10.0),
}


@dataclass(frozen=True, kw_only=True)
class PathConfig:
    """Settings of `plan_path`. The defaults weld the whole seam along its surface normal."""

    step: Metre = 0.0001
    """Distance between poses, straight lines and slerp between them (thesis 5.2.5)."""

    speed: MetrePerSecond = 0.008
    """Torch speed along the weld."""

    smoothing: Metre = 0.005
    """Wire axis and travel direction are smoothed over this length (standard deviation of a Gaussian in arc length, fitted
    with local lines so that a steady turn is kept); 0 takes them as the seam has them."""

    turn_limit: RadianPerMetre = 2 * DEGREE_PER_MM
    """Greatest turn of the wire axis per length of seam, before work and travel angle; the default is 2 deg/mm, a right angle
    within 45 mm. Where the seam turns faster, round an edge, the axis begins to turn before it and ends after it, both gradually,
    over the length of `smoothing`."""

    work_angle: Radian = 0.0
    """Lean of the torch across travel, away from the seam's bisector: right-handed about travel, so positive leans it to
    the right."""

    travel_angle: Radian = 0.0
    """Lean of the torch along travel: positive pushes (the wire points ahead), negative drags."""

    ctwd: Metre = 0.015
    """Contact tip to work distance. Where it differs from `nominal_ctwd` the torch is moved along its wire."""

    nominal_ctwd: Metre = 0.015
    """The CTWD for which the torch's tip was measured: there the tip of the wire touches the seam."""

    start_trim: Metre = 0.0
    """Length of seam left out at its start, as travelled."""

    end_trim: Metre = 0.0
    """Length of seam left out at its end, as travelled."""

    reverse: bool = False
    """Whether the seam is travelled from its end to its start."""

    roll_free: bool = True
    """Whether the arm may turn the torch about its wire."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "path")
        for name in ("work_angle", "travel_angle"):
            if not abs(getattr(self, name)) <= STEEPEST:
                raise ConfigError(
                    f"{name} = {getattr(self, name):.3g} rad leans over 60 deg", key=name, value=getattr(self, name), limit=STEEPEST
                )
