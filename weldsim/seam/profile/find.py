"""The default seam finder: grooves by fitting cross-sections along a smooth curve.

Coarse: valleys of the cloud's chart (`chart`, `valley`). Fine: each candidate is measured along its own rail
(`refine`), ended (`ends`) and judged (`judge`). No threshold is typed: the coarse one comes from the valley image's own
background, the smoothing from cross-validation, the blur of the camera's support window from the groove's own shape.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.curves import arc_length, interpolate, project, tangents
from weldsim.frames import unit
from weldsim.records import PointCloud, Rejection, Seam, SeamFindings
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import SURROUNDINGS, Atlas, make_atlas
from weldsim.seam.profile.ends import seam_span, station_mask
from weldsim.seam.profile.grid import ray_coordinates
from weldsim.seam.profile.judge import confidence, refusal
from weldsim.seam.profile.rail import lay_out
from weldsim.seam.profile.refine import Fit, pieces, refine
from weldsim.seam.profile.valley import CoarseLine

LONG = 0.05  # [m] a seam of this length is half as good as the same one without end
MIN_LEVEL = 0.5  # of a coarse line must have surface at one level on both sides


def find_seams_profile(cloud: PointCloud, config: ProfileConfig, threshold_factor: float = 1.0) -> SeamFindings:
    """Every groove of a cloud, best first, with what was refused and why.

    Args:
        cloud: in B, at least a few hundred points.
        threshold_factor: multiplies the coarse threshold, to see how much it matters.
    """
    atlas = make_atlas(cloud)
    lines, threshold = atlas.coarse_lines(config, threshold_factor)
    accepted: list[tuple[Fit, tuple[float, float], float]] = []
    rejected: list[Rejection] = []
    for coarse in lines:
        line = coarse.points
        if coarse.level < MIN_LEVEL:
            rejected.append(_rejection(line, f"surface at one level on both sides over only {coarse.level:.0%} of it"))
            continue
        if any(_covers(fit, line) for fit, _, _ in accepted):
            continue
        fit = _refine_whole(atlas, coarse, config)
        if fit is None:
            rejected.append(_rejection(line, "no parent surface on both sides at one level"))
            continue
        span = seam_span(fit, config)
        reason = refusal(fit, span, config)
        if reason is not None:
            rejected.append(_rejection(line, reason))
        elif not any(_covers(other, fit.rail.points[station_mask(fit, span)]) for other, _, _ in accepted):
            accepted.append((fit, span, confidence(fit, span, config)))
    accepted.sort(key=_merit, reverse=True)
    region = np.zeros(len(cloud), np.int32)
    for number, (fit, span, _) in enumerate(accepted, start=1):
        _mark_region(region, number, atlas, fit, span)
    seams = tuple(_seam(fit, span, sure) for fit, span, sure in accepted)
    return SeamFindings(seams=seams, region=region, rejected=tuple(rejected), threshold=threshold, method="profile")


def _refine_whole(atlas: Atlas, coarse: CoarseLine, config: ProfileConfig) -> Fit | None:
    """The fit of a coarse line; begun again, with the points around, where the groove goes on far beyond the line."""
    cloud, line, normals = atlas.cloud, coarse.points, coarse.normals
    fit = None
    for _ in range(3):
        most = int(config.points_per_metre * (arc_length(line)[-1] + 2 * SURROUNDINGS))
        picked = atlas.around(line, normals, most)
        fit = refine(line, unit(normals.mean(axis=0)), cloud.points[picked], atlas.sight_origins(picked), config)
        if fit is None:
            return None
        core = pieces(fit.track.weight > 0, fit.rail.step)[0]
        found = fit.rail.points[core]
        beyond = max(np.linalg.norm(line - end, axis=1).min() for end in (found[0], found[-1]))
        if beyond < 0.5 * SURROUNDINGS:
            break
        line, normals = found, fit.rail.n[core]
    return fit


def _merit(found: tuple[Fit, tuple[float, float], float]) -> float:
    """What puts a seam first: its confidence, and its length as far as more of it is better evidence."""
    _, (start, end), sure = found
    return sure * (end - start) / (end - start + LONG)


def _rejection(line: Float[ndarray, "k 3"], reason: str) -> Rejection:
    middle = line[len(line) // 2]
    return Rejection(
        position_B=(float(middle[0]), float(middle[1]), float(middle[2])), length=float(arc_length(line)[-1]), reason=reason
    )


def _covers(fit: Fit, line: Float[ndarray, "k 3"]) -> bool:
    """Whether most of a line lies within an accepted groove."""
    distance, _, _ = project(line, fit.rail.points)
    return bool(np.mean(distance < 0.6 * fit.section.width) > 0.5)


def _mark_region(region: Int[ndarray, "n"], number: int, atlas: Atlas, fit: Fit, span: tuple[float, float]) -> None:
    """Write `number` at the points whose sight line enters between the lips of a groove."""
    part, cloud = station_mask(fit, span), atlas.cloud
    near = atlas.around(fit.rail.points[part], fit.rail.n[part], len(cloud))
    strip = lay_out(fit.rail, cloud.points[near], atlas.sight_origins(near))
    s, x, depth = ray_coordinates(strip, fit.parent)
    inside: Bool[ndarray, "k"] = (np.abs(x) <= fit.section.width / 2) & (s >= span[0]) & (s <= span[1]) & (depth > -0.004)
    region[near[inside]] = number


def _seam(fit: Fit, span: tuple[float, float], sure: float) -> Seam:
    """The seam record: the rail between its ends, lips on the parent surface."""
    rail, step = fit.rail, fit.rail.step
    at = np.arange(len(rail)) * step
    stations = np.concatenate([[span[0]], at[(at > span[0] + 0.3 * step) & (at < span[1] - 0.3 * step)], [span[1]]])

    points = interpolate(at, rail.points, stations)
    for end in (0, -1):  # beyond the rail's own last station: straight on
        points[end] += (stations[end] - np.clip(stations[end], at[0], at[-1])) * rail.t[end]
    t = tangents(points)
    n = unit(interpolate(at, rail.n, stations))
    n = unit(n - np.einsum("ij,ij->i", n, t)[:, None] * t)
    left = np.cross(n, t)
    half = fit.section.width / 2
    sigma = np.interp(stations, at, fit.sigma)
    return Seam(
        points_B=points,
        s=arc_length(points),
        tangents_B=t,
        normals_B=n,
        left_B=points + half * left,
        right_B=points - half * left,
        sigma=sigma,
        width=fit.section.width,
        depth=fit.section.depth,
        residual=fit.parent.noise,
        confidence=sure,
    )
