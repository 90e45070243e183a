"""Charts of several views: a part whose faces no single direction sees, and the points that a fit along a line takes."""

import numpy as np
import pytest

from weldsim.cloud.merge import merge
from weldsim.curves import project
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import PointCloud
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import GRAZING, make_atlas
from weldsim.seam.profile.facing import facing_directions
from weldsim.seam.profile.find import find_seams_profile

CONFIG = ProfileConfig()
LENGTH, HEIGHT, BREADTH = 0.24, 0.18, 0.16  # [m] of a box; a groove runs up its left side, over it and down the right
WIDTH, DEPTH, SPACING = 0.014, 0.008, 0.0012  # [m]
# Of each face: middle, outward, along the groove, across it, length.
FACES = [
    (np.array([-LENGTH / 2, 0, HEIGHT / 2]), np.array([-1.0, 0, 0]), np.array([0, 0, 1.0]), HEIGHT),
    (np.array([0, 0, HEIGHT]), np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), LENGTH),
    (np.array([LENGTH / 2, 0, HEIGHT / 2]), np.array([1.0, 0, 0]), np.array([0, 0, -1.0]), HEIGHT),
]
EYES = np.array([[-0.5, 0.02, 0.25], [-0.30, 0.05, 0.52], [0.0, 0.03, 0.60], [0.30, -0.05, 0.52], [0.5, -0.02, 0.25]])


def box(rng: np.random.Generator, noise: float) -> tuple[PointCloud, Transform]:
    """A cloud of the box's grooved faces merged from the views of EYES, and the pose of the box."""
    X = Transform("BB", matrix_from_rotation_vector(np.array([0.0, 0.0, rng.uniform(-3, 3)])), rng.uniform(-0.3, 0.3, 3))
    clouds = []
    for eye in EYES:
        parts = []
        for middle, outward, along, length in FACES:
            number = int(length * BREADTH / SPACING**2)
            s, y = rng.uniform(-length / 2, length / 2, number), rng.uniform(-BREADTH / 2, BREADTH / 2, number)
            below = DEPTH * np.maximum(1 - np.abs(y) / (WIDTH / 2), 0.0)
            below = np.where(np.abs(s) < length / 2 - DEPTH, below, np.nan)  # the neighbour's groove cuts the corner off
            below = np.where(np.abs(y) < WIDTH / 2, below, 0.0)
            points = middle + s[:, None] * along + y[:, None] * np.array([0, 1.0, 0]) - below[:, None] * outward
            sight = eye - points
            seen = sight @ outward > GRAZING * np.linalg.norm(sight, axis=1)
            parts.append(points[seen & np.isfinite(below)])
        points = np.concatenate(parts)
        sight = points - eye
        points = points + rng.normal(0, noise, len(points))[:, None] * sight / np.linalg.norm(sight, axis=1, keepdims=True)
        clouds.append(PointCloud(points=X.points(points), viewpoints=X.points(eye[None])))
    return merge(clouds), X


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("seed", range(2))
def test_a_groove_over_three_faces_is_one_seam(seed: int, known: bool) -> None:
    cloud, X = box(np.random.default_rng(seed), 3e-4)
    if not known:
        cloud = PointCloud(points=cloud.points)
    (seam,) = find_seams_profile(cloud, CONFIG).seams
    corners = np.array([[-LENGTH / 2, 0, 0], [-LENGTH / 2, 0, HEIGHT], [LENGTH / 2, 0, HEIGHT], [LENGTH / 2, 0, 0]])
    distance, _, s = project(X.inverse().points(seam.points_B), corners)
    assert distance.mean() < 0.3e-3
    assert distance.max() < 0.3 * CONFIG.corner_radius + 0.5e-3
    whole = LENGTH + 2 * HEIGHT
    assert s.min() < 0.012
    assert s.max() > whole - 0.012
    assert (np.diff(s) > 0).all() or (np.diff(s) < 0).all()


@pytest.mark.parametrize("slope", [-0.5, 0.5])
@pytest.mark.parametrize("seed", range(2))
def test_a_view_that_ends_aslant_across_the_groove_leaves_no_gap(seed: int, slope: float) -> None:
    """The next view takes over where both plates and the groove between them are in it; that looks aslant along the groove."""
    rng = np.random.default_rng(seed)
    cloud, X = box(rng, 3e-4)
    assert cloud.view is not None
    local = X.inverse().points(cloud.points)
    lost = (cloud.view == 0) & (local[:, 2] > HEIGHT - rng.uniform(0.05, 0.08) + slope * local[:, 1])
    (seam,) = find_seams_profile(cloud.select(~lost), CONFIG).seams
    assert seam.gaps == ()
    assert seam.length > LENGTH + 2 * HEIGHT - 0.03


def test_each_view_has_a_chart_of_its_own_points() -> None:
    cloud, _ = box(np.random.default_rng(0), 0.0)
    atlas = make_atlas(cloud)
    assert len(atlas.charts) == len(EYES)
    for view, (chart, members) in enumerate(zip(atlas.charts, atlas.members, strict=True)):
        assert members is not None
        assert cloud.view is not None
        assert (cloud.view[members] == view).all()
        assert len(chart.cell) == len(members)
        assert np.allclose(chart.origin, cloud.viewpoints[view])


def test_a_fit_takes_points_near_the_line_seen_from_above_its_surface() -> None:
    cloud, X = box(np.random.default_rng(1), 0.0)
    line = X.points(np.stack([np.linspace(-0.1, 0.1, 50), np.zeros(50), np.full(50, HEIGHT)], axis=1))
    normals = np.repeat(X.vectors(np.array([[0.0, 0, 1.0]])), 50, axis=0)
    picked = make_atlas(cloud).around(line, normals, len(cloud))
    assert len(picked) > 5000
    distance = np.linalg.norm(cloud.points[picked][:, None] - line[None], axis=2).min(axis=1)
    assert distance.max() < 0.06
    origins = cloud.sight_origins()
    assert origins is not None
    sight = origins[picked] - cloud.points[picked]
    assert (sight @ normals[0] > 0).all()
    few = make_atlas(cloud).around(line, normals, 1000)
    assert len(few) == 1000
    assert np.isin(few, picked).all()


def test_a_sheet_faces_one_way_and_a_box_five() -> None:
    rng = np.random.default_rng(2)
    sheet = PointCloud(points=np.c_[rng.uniform(-0.1, 0.1, (20_000, 2)), rng.normal(0, 1e-4, 20_000)])
    assert facing_directions(sheet, np.array([0.0, 0.0, 1.0])) == []
    cube = rng.uniform(-0.1, 0.1, (60_000, 3))
    cube[np.arange(60_000), rng.integers(0, 3, 60_000)] = 0.1 * rng.choice([-1.0, 1.0], 60_000)
    found = np.array(facing_directions(PointCloud(points=cube), np.array([0.0, 0.0, 1.0])))
    assert len(found) == 4
    assert np.abs(found[:, 2]).max() < 0.05
    assert np.abs(found.sum(axis=0)).max() < 0.1
