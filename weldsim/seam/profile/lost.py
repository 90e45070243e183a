"""Why no groove can be followed along a coarse line: one clause for each cause, with its figure and limit."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.parent import LEAST_SUPPORT, TOLERANCE, Parent
from weldsim.seam.profile.track import Track


@dataclass(frozen=True)
class Lost:
    """No groove.

    Attributes:
        reason: one clause.  sides: whether the surface beside the line is what is wrong, as on a part that is narrow there.
    """

    reason: str
    sides: bool = False


def too_few(stations: int, fewest: int, config: ProfileConfig) -> Lost:
    """A line that holds too few cross-sections."""
    step = config.station_step * 1e3
    return Lost(f"{stations} cross-sections along it at the {step:g} mm of seam.profile.station_step, under {fewest}")


def no_sides(parent: Parent, config: ProfileConfig, band: tuple[float, float], share: str, most: float | None = None) -> Lost:
    """A line without parent surface on both sides, at one level and of one slope, and what most of it lacks.

    Args:
        band: from and to how far off the line the surface was read [m].  share: over how much of the line there is, and the
            limit.  most: angle between the sides [rad] that is allowed, if not the config's.
    """
    thin = parent.support <= LEAST_SUPPORT
    absent = thin.any(axis=1) | ~np.isfinite(parent.step)
    steep = ~absent & (parent.angle >= (most or config.max_side_angle))
    high = ~absent & (parent.step >= config.max_side_step)
    causes = {
        np.count_nonzero(high): lambda: _high(parent.step[high], config),
        np.count_nonzero(steep): lambda: _steep(parent.angle[steep], config, most),
        np.count_nonzero(absent): lambda: f"there is hardly any of it on {_which(thin[absent])}",
    }
    return Lost(f"surface at one level on both sides over {share}: {_off(band)} {causes[max(causes)]()}", sides=True)


def short(length: float, least: float) -> str:
    """A length of a line that is under the least one [m], a share of the shortest seam."""
    return f"{length * 1e3:.1f} mm of it, under {least * 1e3:g} mm (0.7 of seam.profile.min_length)"


def off_surface(parent: Parent, band: tuple[float, float]) -> Lost | None:
    """A line that does not lie on the surface that leads across it from beside; None where it does.

    Args:
        band: as for `no_sides`.
    """
    height = float(np.median(parent.a))
    if abs(height) <= TOLERANCE:
        return None
    where, limit = "below" if height < 0 else "above", TOLERANCE * 1e3
    off = f"passes {abs(height) * 1e3:.1f} mm {where} it, over {limit:g} mm"
    return Lost(f"a smooth surface through what lies {_off(band)} {off}", sides=True)


def not_followed(track: Track, flanked: Bool[ndarray, "m"], depth: float, fewest: int) -> Lost:
    """A line with parent surface on both sides, along which the cross-section shows in too few places.

    Args:
        flanked: (m,) stations with parent surface on both sides.  depth: of the cross-section [m].
    """
    known = np.count_nonzero(flanked & np.isfinite(track.amplitude))
    if known < fewest:
        return Lost(f"enough points at a groove's depth at {known} of its cross-sections, under {fewest}")
    shown = np.count_nonzero(track.weight)
    return Lost(f"a groove of its mean depth, {depth * 1e3:.1f} mm, shows at {shown} of its cross-sections, under {fewest}")


def _off(band: tuple[float, float]) -> str:
    return f"from {band[0] * 1e3:.0f} to {band[1] * 1e3:.0f} mm off its middle"


def _which(thin: Bool[ndarray, "k 2"]) -> str:
    """On how many sides of most stations there is hardly any surface."""
    return "either side" if thin.all(axis=1).mean() > 0.5 else "one side"


def _steep(angle: Float[ndarray, "k"], config: ProfileConfig, most: float | None) -> str:
    limit = np.degrees(most or config.max_side_angle)
    setting = "" if most else " of seam.profile.max_side_angle"
    article = "" if most else "the "
    return f"the two sides are {np.degrees(np.median(angle)):.1f} deg apart, over {article}{limit:.1f} deg{setting}"


def _high(step: Float[ndarray, "k"], config: ProfileConfig) -> str:
    limit = f"the {config.max_side_step * 1e3:g} mm of seam.profile.max_side_step"
    return f"one side is {np.median(step) * 1e3:.1f} mm higher than the other, over {limit}"
