"""How much the detection threshold matters: the finder run again with it moved."""

from dataclasses import replace

from weldsim.curves import project
from weldsim.records import PointCloud, Seam, SeamFindings
from weldsim.seam.config import SeamConfig
from weldsim.seam.profile.find import find_seams_profile

FACTORS = (0.5, 0.7, 1.4, 2.0)


def with_stability(cloud: PointCloud, findings: SeamFindings, config: SeamConfig) -> SeamFindings:
    """The findings, with the greatest movement of their best centre line [m] when the threshold is multiplied by each of
    FACTORS, infinity where the seam is lost. Unchanged where there is no seam or the method has no such threshold."""
    if not findings.seams or findings.threshold is None or findings.method != "profile":
        return findings
    best = findings.seams[0]
    moved = {
        f"{factor:g}": _movement(best, find_seams_profile(cloud, config.profile, threshold_factor=factor).seams)
        for factor in FACTORS
    }
    return replace(findings, threshold=replace(findings.threshold, stability=moved))


def _movement(seam: Seam, others: tuple[Seam, ...]) -> float:
    """Greatest distance [m] of the seam's points from the other line that runs closest to it, no further than its lips."""
    distances = [float(project(seam.points_B, other.points_B)[0].max()) for other in others]
    nearest = min(distances, default=float("inf"))
    return nearest if nearest < max(seam.width, 0.005) else float("inf")
