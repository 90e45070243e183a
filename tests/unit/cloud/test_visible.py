"""A part shown from all sides is reduced to what can be seen; a camera's own cloud is left as it is."""

import numpy as np
import pytest

from weldsim.cloud.visible import sides
from weldsim.records import PointCloud

CAMERA = (0.05, -0.40, 0.42)


def plate(thickness: float, *, count: int = 60_000, noise: float = 0.0002, seed: int = 0) -> tuple[PointCloud, np.ndarray]:
    """A closed plate of 240 x 160 mm with a V-groove of 14 x 8 mm, its top at z = 0, sampled evenly; and which points are of the
    upper side: its top and the groove's walls."""
    rng = np.random.default_rng(seed)
    top, wall, side = 0.24 * 0.146, 0.24 * 2 * np.hypot(0.007, 0.008), 0.24 * thickness
    areas = np.array([top, wall, 0.24 * 0.16, side, side, 0.16 * thickness, 0.16 * thickness])
    face = rng.choice(7, count, p=areas / areas.sum())
    a, b = rng.uniform(-1, 1, count), rng.uniform(-1, 1, count)
    x, y, z = 0.12 * a, np.empty(count), np.empty(count)
    y[face == 0], z[face == 0] = (np.sign(b) * (0.007 + 0.073 * np.abs(b)))[face == 0], 0
    y[face == 1], z[face == 1] = (0.007 * b)[face == 1], (-0.008 * (1 - np.abs(b)))[face == 1]
    y[face == 2], z[face == 2] = (0.08 * b)[face == 2], -thickness
    for k, way in ((3, -1), (4, 1)):
        y[face == k], z[face == k] = way * 0.08, (-thickness * (b + 1) / 2)[face == k]
    for k, way in ((5, -1), (6, 1)):
        x[face == k], y[face == k], z[face == k] = way * 0.12, (0.08 * a)[face == k], (-thickness * (b + 1) / 2)[face == k]
    points = np.column_stack([x, y - 0.45, z]) + rng.normal(0, noise, (count, 3))
    return PointCloud(points=points), face < 2


@pytest.mark.parametrize("thickness", [0.012, 0.030, 0.060])
def test_what_lies_behind_is_left_out_and_told(thickness: float) -> None:
    whole, upper = plate(thickness)
    cloud = PointCloud(points=whole.points, viewpoints=np.array([CAMERA]))
    (side,) = sides(cloud)
    kept = np.isin(cloud.points[:, 0], side.cloud.points[:, 0])
    lower = cloud.points[:, 2] < -thickness + 0.001
    assert kept[upper].mean() > 0.98
    assert kept[lower].mean() < 0.03
    assert (
        side.note == f"{len(cloud) - len(side.cloud)} of {len(cloud)} points lie behind others as seen from the viewpoint: left out"
    )
    np.testing.assert_array_equal(side.cloud.viewpoints, cloud.viewpoints)


def test_without_a_viewpoint_both_sides_are_offered_the_upper_one_first() -> None:
    whole, upper = plate(0.02)
    top, bottom = sides(whole)
    assert np.isin(whole.points[upper, 0], top.cloud.points[:, 0]).mean() > 0.98
    assert np.median(top.cloud.points[:, 2]) > -0.001
    assert np.median(bottom.cloud.points[:, 2]) < -0.019
    assert "its upper side" in top.note
    assert "its lower side" in bottom.note
    assert top.cloud.normals is not None
    assert bottom.cloud.normals is not None
    assert (top.cloud.normals[:, 2] > 0.9).all()
    assert (bottom.cloud.normals[:, 2] < -0.9).all()


@pytest.mark.parametrize("viewpoint", [CAMERA, (0.1, -0.2, 0.3), None])
@pytest.mark.parametrize("noise", [0.0, 0.0003, 0.001])
def test_one_surface_is_left_as_it_is(viewpoint: tuple[float, float, float] | None, noise: float) -> None:
    whole, upper = plate(0.02, noise=noise)
    known = np.zeros((0, 3)) if viewpoint is None else np.array([viewpoint])
    cloud = PointCloud(points=whole.points[upper], viewpoints=known)
    (side,) = sides(cloud)
    assert side.cloud is cloud
    assert side.note == ""


def test_a_step_between_two_levels_is_no_second_surface() -> None:
    whole, upper = plate(0.02)
    table = np.column_stack([np.random.default_rng(1).uniform([-0.3, -0.7], [0.3, -0.2], (60_000, 2)), np.full(60_000, -0.02)])
    beside = (np.abs(table[:, 0]) > 0.12) | (np.abs(table[:, 1] + 0.45) > 0.08)
    cloud = PointCloud(points=np.vstack([whole.points[upper], table[beside]]), viewpoints=np.array([CAMERA]))
    assert sides(cloud)[0].cloud is cloud


def test_few_points_are_left_as_they_are() -> None:
    cloud = PointCloud(points=np.array([[0.0, 0, 0], [0, 0, 1]]))
    assert sides(cloud)[0].cloud is cloud
