"""A coarse line followed for as far as its groove goes."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.curves import arc_length, project
from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import SURROUNDINGS, Atlas
from weldsim.seam.profile.ends import seam_span
from weldsim.seam.profile.judge import refusal
from weldsim.seam.profile.lost import Lost
from weldsim.seam.profile.refine import Fit, refine, resume
from weldsim.seam.profile.section import Section

MOST_GROWTHS = 12  # times a fit is carried on with the points around it: a metre either way of where it began


def grow(atlas: Atlas, line: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], config: ProfileConfig) -> Fit | Lost:
    """The fit of a coarse line; carried on, with the points around, until the groove goes on no farther. Or why there is none.

    Args:
        line: (k, 3) coarse centre line [m].  normals: (k, 3) unit, outward, of the surface around it.
    """
    picked = _gather(atlas, line, normals, config)
    fit = refine(line, unit(normals.mean(axis=0)), atlas.cloud.points[picked], atlas.sight_origins(picked), config)
    for _ in range(MOST_GROWTHS):
        if isinstance(fit, Lost) or refusal(fit, seam_span(fit, config), config, piece=True) is not None:
            return fit
        found = fit.rail.points[fit.core]
        beyond = max(np.linalg.norm(line - end, axis=1).min() for end in (found[0], found[-1]))
        if beyond < 0.5 * SURROUNDINGS:
            return fit
        line = found
        longer = fit_line(atlas, line, fit.rail.n[fit.core], fit.section, config, fit.bridge)
        fit = fit if longer is None else longer
    return fit


def fit_line(
    atlas: Atlas,
    line: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
    section: Section,
    config: ProfileConfig,
    bridge: float,
) -> Fit | None:
    """The groove along a line already fitted, from all the points around it; arguments as those of `resume`."""
    picked = _gather(atlas, line, normals, config)
    return resume(line, normals, section, atlas.cloud.points[picked], atlas.sight_origins(picked), config, bridge)


def uncovered(line: Float[ndarray, "k 3"], fit: Fit, span: tuple[float, float], shortest: float) -> list[Int[ndarray, "_"]]:
    """Indices of the stretches of a coarse line at least `shortest` [m] long that do not lie along a groove, in its span."""
    _, _, s = project(line, fit.rail.points)
    left = np.flatnonzero((s < span[0] + fit.rail.step) | (s > span[1] - fit.rail.step))
    runs = np.split(left, np.flatnonzero(np.diff(left) > 1) + 1)
    return [run for run in runs if len(run) > 1 and arc_length(line[run])[-1] >= shortest]


def _gather(atlas: Atlas, line: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], config: ProfileConfig) -> Int[ndarray, "m"]:
    """Indices of the points about a line, at most `config.points_per_metre`."""
    return atlas.around(line, normals, int(config.points_per_metre * (arc_length(line)[-1] + 2 * SURROUNDINGS)))
