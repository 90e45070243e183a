"""Is it a groove? Each reason to refuse a candidate, with its figure and limit; and how sure an accepted one is."""

from collections.abc import Sequence

import numpy as np

from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.background import SIDE, SIDE_HELD, Standing
from weldsim.seam.profile.ends import station_mask, supported, trusted
from weldsim.seam.profile.refine import BRIDGE, Fit

MISFIT_LIMIT = 0.75
MIN_SUPPORT = 0.5
MOST_LAPSES = 0.18
FORGIVEN = 4.0  # looks more than one, from which on so many are allowed
LOOKS = 2.0  # looks at the depth, that a groove is longer than: a hole is drawn out to one, and by its own length
FOUND = 6.0  # score of a `Standing`, from which on it is a groove; waves of bare tables, real and simulated, reach 4.6
CLEAR = 6.0  # score at which 37 % of the doubt is left
DOUBTFUL = 4.0  # from which on it is named as one that there may be


def _limit(name: str, value: float) -> str:
    """A limit and the setting that holds it."""
    return f"the {value * 1e3:g} mm of seam.profile.{name}"


def refusal(fit: Fit, span: tuple[float, float], config: ProfileConfig, piece: bool = False) -> str | None:
    """Why the candidate is no groove, one clause, or None if it is one.

    Args:
        piece: let it be as short as it is: it may be a part of a longer one.
    """
    section, length = fit.section, span[1] - span[0]
    support, look = supported(fit, span, config), _look(fit)
    checks = [
        (length < config.min_length, f"a groove over {length * 1e3:.1f} mm, under {_limit('min_length', config.min_length)}"),
        (section.width < config.min_width, f"opening {section.width * 1e3:.1f} mm, under {_limit('min_width', config.min_width)}"),
        (section.width > config.max_width, f"opening {section.width * 1e3:.1f} mm, over {_limit('max_width', config.max_width)}"),
        (length < 2.0 * section.width, f"{length * 1e3:.1f} mm long, under twice its width of {section.width * 1e3:.1f} mm"),
        (
            length < LOOKS * look,
            f"{length * 1e3:.1f} mm long, under {LOOKS:g} times the {look * 1e3:.0f} mm that a noisy cloud is averaged over",
        ),
        (
            _shown_depth(fit) < config.min_depth,
            f"{_shown_depth(fit) * 1e3:.2f} mm deep, under {_limit('min_depth', config.min_depth)}",
        ),
        (fit.track.misfit > MISFIT_LIMIT, f"cross-sections fit a groove poorly ({fit.track.misfit:.2f}, limit {MISFIT_LIMIT})"),
        (
            _lapses(fit, span) > most_lapses(length, look),
            f"depth comes and goes, absent over {_lapses(fit, span):.0%} of it: a row of holes, or noise",
        ),
        (support < MIN_SUPPORT, f"parent surface on both sides over {support:.0%} of it, under {MIN_SUPPORT:.0%}"),
        (_floor_goes_on(fit, span), "its floor goes on as the surface around it: a gap between two objects on a plate"),
    ]
    by_length = {0, 3, 4} if piece else set()
    return next((reason for k, (failed, reason) in enumerate(checks) if failed and k not in by_length), None)


def sideless(fit: Fit, span: tuple[float, float], config: ProfileConfig) -> bool:
    """Whether the candidate has too little parent surface beside it, whatever else it is refused for."""
    return supported(fit, span, config) < MIN_SUPPORT


def doubt(standings: Sequence[Standing | None]) -> tuple[str, bool] | None:
    """Why the pieces of a seam may be waves of the surface, one clause, and whether it may be a groove all the same; or None.

    Args:
        standings: of its pieces; None where no chart shows one.
    """
    if all(each is None for each in standings):
        beside = f"{SIDE * SIDE_HELD * 1e3:.0f} mm of surface beyond its blurred lips on each side"
        return f"too little of it shows together with {beside}, which tell a groove from waves of that surface", False
    over = score(standings)
    if over >= FOUND:
        if any(each.elsewhere > 0 or each.sighted for each in standings if each is not None):
            return None
        return "doubtful: its surface has no other place to compare it with, and no viewpoint is known", True
    clause = f"stands {max(over, 0.0):.1f} times over what the surface does elsewhere, under {FOUND:g}"
    return (f"doubtful: {clause}", True) if over >= DOUBTFUL else (clause, False)


def score(standings: Sequence[Standing | None]) -> float:
    """That of several pieces of one seam, whose backgrounds are independent."""
    return float(np.sqrt(sum(max(each.score, 0.0) ** 2 for each in standings if each is not None)))


def confidence(fit: Fit, span: tuple[float, float], config: ProfileConfig, stands: Standing | None) -> float:
    """0 to 1: support on both sides, agreement with the section, and how far it stands out, multiplied."""
    explained = max(0.0, 1.0 - fit.track.misfit**2)
    clear = 1.0 - float(np.exp(-((score([stands]) / CLEAR) ** 2)))
    return float(np.clip(supported(fit, span, config) * explained * clear, 0.0, 1.0))


def most_lapses(length: float, look: float) -> float:
    """Fraction of its stations at which the depth of a groove may be absent: none of two looks, where two holes may seem one
    groove; of many, as much as noise hides.

    Args:
        length: of the groove, look: of the stretch over which its depth is averaged [m].
    """
    return MOST_LAPSES * min(1.0, max(length / look - 1.0, 0.0) / FORGIVEN)


def _shown_depth(fit: Fit) -> float:
    """Greatest depth of the blurred section [m]."""
    return float(np.max(fit.section.image(fit.grid.x, np.median(fit.grid.shear, keepdims=True))[0]))


def _look(fit: Fit) -> float:
    """Length [m] of the stretch over which the depth is averaged."""
    return (2 * fit.track.depth_reach + 1) * fit.rail.step


def _lapses(fit: Fit, span: tuple[float, float]) -> float:
    """Fraction of the stations, from the first to the last seen, at which a short look shows hardly any depth."""
    seen = np.flatnonzero(fit.track.weight > 0)
    local = fit.track.local[seen[0] : seen[-1] + 1]
    known = np.isfinite(local)
    if fit.bridge > BRIDGE:  # what lies across the groove between joined pieces says nothing about them
        known &= trusted(fit, span)[seen[0] : seen[-1] + 1]
    return float(np.mean(local[known] < 0.4)) if known.any() else 1.0


def _floor_goes_on(fit: Fit, span: tuple[float, float]) -> bool:
    """Whether, beyond both ends, a surface goes on at the level of the floor: the gap between two clamps on a plate."""
    step, grid = fit.rail.step, fit.grid
    floor = np.abs(grid.x) < max(0.3 * fit.section.width, 0.002)
    level = float(np.nanmedian(grid.depth[station_mask(fit, span)][:, floor]))
    found = []
    for start, stop in ((span[0] - 0.012, span[0] - 0.004), (span[1] + 0.004, span[1] + 0.012)):
        a, b = max(round(start / step), 0), min(round(stop / step), len(grid.depth))
        patch = grid.depth[a:b]
        if b - a < 3 or np.isfinite(patch).mean() < 0.5:
            return False
        found.append(bool(np.nanmean(np.abs(patch - level) < 0.25 * abs(level) + 0.001) > 0.7))
    return all(found)
