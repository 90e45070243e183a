"""A groove in pieces is one seam, and what lay between them is told; two grooves far apart stay two."""

from typing import Literal

import numpy as np
import pytest

from tests.clouds import groove_cloud
from weldsim.curves import project
from weldsim.records import KnownSeam, PointCloud, SeamFindings
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.find import find_seams_profile

CURVES = ("straight", "arc", "s")
Cause = Literal["clamp", "missing", "tack"]


def across(seed: int, cause: Cause, length: float, where: float = 0.45) -> tuple[PointCloud, KnownSeam]:
    """A groove as a D415 sees it, of which `length` [m] about the share `where` of it lies under a clamp, is missing, or is
    filled by a tack weld 0.5 mm proud of the plate."""
    made = groove_cloud(np.random.default_rng(seed), curve=CURVES[seed % 3], noise="d415", yaw=0.3 * seed, tilt=0.05 * seed)
    truth, points, eye = made.seam, made.cloud.points, made.cloud.viewpoints[0]
    assert truth is not None
    i = round(where * (len(truth.s) - 1))
    middle, along, up = truth.opening_B[i], truth.tangents_B[i], -truth.bisectors_B[i]
    side = np.cross(up, along)

    def lifted(height: float) -> np.ndarray:
        """Where the sight lines meet a plane above the plate."""
        rays = points - eye
        return eye + rays * (((middle + height * up - eye) @ up) / (rays @ up))[:, None]

    top = lifted({"clamp": 0.012, "tack": 0.0005, "missing": 0.0}[cause])
    hit = np.abs((top - middle) @ along) < length / 2
    if cause == "missing":
        points = points[~hit]
    else:
        reach = 0.2 if cause == "clamp" else 0.007
        hit &= np.abs((top - middle) @ side) < reach
        points = np.where(hit[:, None], top, points)
    return PointCloud(points=points, viewpoints=made.cloud.viewpoints), truth


def found_in(cloud: PointCloud, **settings) -> SeamFindings:
    return find_seams_profile(cloud, ProfileConfig(**settings))


@pytest.mark.parametrize(
    ("seed", "cause", "length"),
    [(0, "clamp", 0.034), (1, "clamp", 0.025), (2, "missing", 0.020), (3, "missing", 0.036), (4, "tack", 0.014)],
)
def test_pieces_of_one_groove_are_one_seam_and_the_gap_is_told(seed: int, cause: Cause, length: float) -> None:
    cloud, truth = across(seed, cause, length)
    found = found_in(cloud)
    assert len(found.seams) == 1, [refused.reason for refused in found.rejected]
    seam = found.seams[0]
    distance = project(seam.points_B, truth.opening_B)[0]
    assert project(truth.opening_B, seam.points_B)[0].max() < 0.004, "all of it is covered"
    assert len(seam.gaps) == 1
    s0, s1 = seam.gaps[0]
    middle = project(truth.opening_B[None, round(0.45 * (len(truth.s) - 1))], seam.points_B)[2][0]
    assert s0 < middle < s1
    assert length - 0.006 < s1 - s0 < length + 0.016
    gap = (seam.s > s0) & (seam.s < s1)
    assert distance.mean() < 0.45e-3  # one view under the measured noise
    assert distance[gap].max() < 1.2e-3
    assert seam.sigma is not None
    assert seam.sigma[gap].max() > seam.sigma[[gap.argmax() - 1, len(gap) - gap[::-1].argmax()]].max(), "less is known there"
    assert np.mean(distance[gap] < 3 * seam.sigma[gap]) > 0.9
    turns = np.arccos(np.clip((seam.tangents_B[1:] * seam.tangents_B[:-1]).sum(1), -1, 1))
    assert turns.max() < 0.03, "one smooth curve"
    in_region = project(cloud.points[found.region == 1], seam.points_B)[2]
    assert np.mean((in_region > s0 + 0.002) & (in_region < s1 - 0.002)) < 0.01, "nothing in the gap is groove"


def test_a_gap_over_the_limit_keeps_two_seams() -> None:
    cloud, _ = across(0, "missing", 0.058)
    assert len(found_in(cloud).seams) == 2
    cloud, _ = across(0, "missing", 0.030)
    assert len(found_in(cloud).seams) == 1
    assert len(found_in(cloud, max_gap=0.015).seams) == 2


def test_where_the_plate_itself_is_seen_there_are_two_grooves() -> None:
    cloud, _ = across(0, "tack", 0.036)
    found = found_in(cloud)
    assert len(found.seams) == 2
    assert all(seam.gaps == () for seam in found.seams)


@pytest.mark.parametrize("seed", range(3))
def test_a_groove_without_a_break_has_no_gap(seed: int) -> None:
    made = groove_cloud(np.random.default_rng(seed), curve=CURVES[seed], noise="d415", clamps=2)
    found = found_in(made.cloud)
    assert [seam.gaps for seam in found.seams] == [()]
