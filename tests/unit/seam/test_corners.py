"""Seams that go on round the edges of a box come out as one; branches end where they meet; a stopped groove does not."""

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length, project, resample
from weldsim.records import PointCloud, Seam, Threshold
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import Atlas
from weldsim.seam.profile.find import find_seams_profile
from weldsim.seam.profile.valley import CoarseLine

CONFIG = ProfileConfig()
HALF, WIDTH, DEPTH, SPACING = 0.10, 0.014, 0.008, 0.0014
EDGE = 0.0005  # [m] by which points keep away from an edge


def face(rng: np.random.Generator, long: float, wide: float, stop: float = 0.0, noise: float = 1e-4) -> Float[ndarray, "n 3"]:
    """A face in z = 0, x from -long to 0, with a V-groove along y = 0 that stops at x = -stop."""
    x, y = np.meshgrid(np.arange(-long, -EDGE, SPACING), np.arange(-wide, wide, SPACING), indexing="ij")
    x, y = x.ravel() + rng.uniform(-3e-4, 3e-4, x.size), y.ravel() + rng.uniform(-3e-4, 3e-4, x.size)
    groove = np.maximum(0.0, 1 - np.abs(y) / (WIDTH / 2)) * DEPTH * (x < -stop)
    return np.stack([np.minimum(x, 0.0), y, -groove + rng.normal(0, noise, x.size)], axis=1)


def edge_cloud(angle: float, rng: np.random.Generator, stop: float = 0.0, viewpoints: bool = True) -> PointCloud:
    """Two faces that meet at x = z = 0, the second turned down by `angle` [rad], each seen from its own side."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[-c, 0, s], [0, -1, 0], [s, 0, c]])  # half a turn about the vertical, then down
    first, second = face(rng, 0.12, 0.06, stop), face(rng, 0.10, 0.06, stop) @ R.T
    points = np.concatenate([first, second])
    if not viewpoints:
        return PointCloud(points=points)
    eyes = np.array([[-0.06, 0.02, 0.4], R @ np.array([-0.05, 0.02, 0.4])])
    return PointCloud(points=points, viewpoints=eyes, view=np.repeat([0, 1], [len(first), len(second)]))


def truth(angle: float) -> Float[ndarray, "3 3"]:
    return np.array([[-0.12, 0, 0], [0, 0, 0], [0.10 * np.cos(angle), 0, -0.10 * np.sin(angle)]])


def turns(seam: Seam) -> Float[ndarray, "n-1"]:
    """Angle from each direction to the next [rad]."""
    return np.arccos(np.clip((seam.tangents_B[1:] * seam.tangents_B[:-1]).sum(1), -1, 1))


@pytest.mark.parametrize(("seed", "angle", "viewpoints"), [(0, np.pi / 2, True), (1, 1.2, True), (2, np.pi / 2, False)])
def test_a_seam_goes_on_round_an_edge(seed: int, angle: float, viewpoints: bool) -> None:
    found = find_seams_profile(edge_cloud(angle, np.random.default_rng(seed), viewpoints=viewpoints), CONFIG)
    assert len(found.seams) == 1
    seam = found.seams[0]
    distance, _, _ = project(seam.points_B, truth(angle))
    radius = CONFIG.corner_radius
    assert np.quantile(distance, 0.9) < 3e-4
    assert distance.max() < radius * (1 - np.cos(angle / 2)) + 5e-4
    near, _, _ = project(truth(angle)[1:2], seam.points_B)
    assert near[0] < radius * (1 / np.cos(angle / 2) - 1) + 5e-4
    s = seam.s
    assert np.diff(s).max() < 2.1e-3, "no hole at the edge"
    assert (turns(seam) / np.diff(s)).max() < 2.0 / radius, "no sharper than the radius told"
    assert np.abs((seam.tangents_B * seam.normals_B).sum(1)).max() < 1e-6
    assert seam.left_B is not None
    assert np.ptp((seam.left_B - seam.points_B)[:, 1]) < 1e-3, "the lips stay on their sides"
    assert set(np.unique(found.region)) == {0, 1}


def test_the_radius_is_the_one_asked_for() -> None:
    cloud = edge_cloud(np.pi / 2, np.random.default_rng(3))
    for radius in (0.003, 0.009):
        (seam,) = find_seams_profile(cloud, ProfileConfig(corner_radius=radius)).seams
        near, _, _ = project(np.zeros((1, 3)), seam.points_B)
        assert near[0] == pytest.approx(radius * (np.sqrt(2) - 1), abs=5e-4)


def test_grooves_that_stop_well_before_the_edge_stay_two() -> None:
    found = find_seams_profile(edge_cloud(np.pi / 2, np.random.default_rng(4), stop=0.035), CONFIG)
    assert len(found.seams) == 2


def branches(seed: int) -> tuple[PointCloud, Float[ndarray, "3"]]:
    """Three grooves of 85 mm from one junction in a plate, and their azimuths [rad]."""
    rng = np.random.default_rng(seed)
    x, y = (v.ravel() for v in np.meshgrid(np.arange(-HALF, HALF, SPACING), np.arange(-HALF, HALF, SPACING)))
    x, y = x + rng.uniform(-3e-4, 3e-4, x.size), y + rng.uniform(-3e-4, 3e-4, y.size)
    angles = rng.uniform(0, 2 * np.pi) + np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.2, 0.2, 3)
    groove = np.zeros(len(x))
    for angle in angles:
        along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        arm = np.maximum(0.0, 1 - np.abs(across) / (WIDTH / 2)) * DEPTH * (along > 0)
        groove = np.maximum(groove, np.where(along < 0.085, arm, 0.0))
    points = np.stack([x, y, -groove + rng.normal(0, 1e-4, len(x))], axis=1)
    return PointCloud(points=points, viewpoints=np.array([[0.02, 0.01, 0.4]])), angles


def check_branches(seams: tuple[Seam, ...], angles: Float[ndarray, "3"]) -> None:
    assert len(seams) == 3
    for seam in seams:
        ends = np.linalg.norm(seam.points_B[[0, -1]], axis=1)
        azimuth = np.arctan2(*seam.points_B[-int(ends.argmax())][1::-1])
        assert np.cos(angles - azimuth).max() > np.cos(0.01), "along one of the arms"
        assert ends.min() < 0.001, "at the junction"
        assert 0.080 < ends.max() < 0.088
        assert arc_length(seam.points_B)[-1] < 0.09


@pytest.mark.parametrize("seed", range(5))
def test_branches_end_where_they_meet(seed: int) -> None:
    cloud, angles = branches(seed)
    check_branches(find_seams_profile(cloud, CONFIG).seams, angles)


@pytest.mark.parametrize("seed", range(3))
def test_a_coarse_line_may_run_on_into_a_groove_already_found(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    cloud, angles = branches(seed)
    tips = 0.08 * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)

    def coarse(start: Float[ndarray, "3"], stop: Float[ndarray, "3"]) -> CoarseLine:
        points = resample(np.stack([start, np.zeros(3), stop]), 0.001)
        return CoarseLine(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), 1.0, 1.0)

    lines = [coarse(tips[0], tips[1]), coarse(tips[2], 0.6 * tips[1])]
    monkeypatch.setattr(Atlas, "coarse_lines", lambda *_: (lines, Threshold(name="", value=1e-3, unit="m", noise=1e-4)))
    check_branches(find_seams_profile(cloud, CONFIG).seams, angles)
