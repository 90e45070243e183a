"""How much the detection threshold matters: the finder run again with it moved."""

from dataclasses import replace

import numpy as np

from weldsim.curves import project
from weldsim.records import PointCloud, Seam, SeamFindings
from weldsim.seam.config import SeamConfig
from weldsim.seam.profile.find import find_seams_profile

FACTORS = (0.7, 1.4)


def with_stability(cloud: PointCloud, findings: SeamFindings, config: SeamConfig) -> SeamFindings:
    """The findings, with the greatest movement of their best centre line [m] when the threshold is multiplied by each of
    FACTORS, infinity where the seam is lost. Unchanged where there is no seam or no threshold.

    Args:
        cloud, config: what the findings were made from.
    """
    threshold = findings.threshold
    if not findings.seams or threshold is None:
        return findings
    moved = {}
    for factor in FACTORS:
        again = _seams_with(cloud, config, findings.method, threshold.value, factor)
        moved[f"{factor:g}"] = _movement(findings.seams[0], again)
    return replace(findings, threshold=replace(threshold, stability=moved))


def _seams_with(cloud: PointCloud, config: SeamConfig, method: str, threshold: float, factor: float) -> tuple[Seam, ...]:
    """The seams found with the threshold times `factor`."""
    if method == "thesis":
        # Loaded here: the published method compiles native loops, which the default one does not need.
        from weldsim.seam.thesis.find import find_seams_thesis

        return find_seams_thesis(cloud, replace(config.thesis, threshold=threshold * factor)).seams
    return find_seams_profile(cloud, config.profile, threshold_factor=factor).seams


def _movement(seam: Seam, others: tuple[Seam, ...]) -> float:
    """Greatest distance [m] of the seam's points from the same seam found again: the line that runs closest to it over
    half of it. Infinity where that is further off than the groove is wide (5 mm where its width is unknown)."""
    distances = [project(seam.points_B, other.points_B)[0] for other in others]
    nearest = min(distances, key=lambda distance: float(np.median(distance)), default=None)
    if nearest is None or float(np.median(nearest)) > max(seam.width, 0.005):
        return float("inf")
    return float(nearest.max())
