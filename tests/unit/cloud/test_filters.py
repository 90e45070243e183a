"""What filters keep, and that everything that belongs to a point stays with it."""

import numpy as np
import pytest

from weldsim.cloud.config import CloudConfig
from weldsim.cloud.filters import crop, drop_outliers, drop_sparse, estimate_normals, prepare, voxel_grid
from weldsim.errors import CloudError, ConfigError
from weldsim.records import PointCloud

SEEDS = range(4)


def random_cloud(seed: int, n: int = 2000) -> PointCloud:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    return PointCloud(
        points=rng.uniform([-0.2, 0.3, 0.0], [0.2, 0.7, 0.05], (n, 3)),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        colours=rng.random((n, 3)),
        viewpoints=np.array([[0, 0, 0.6], [0, 0.5, 0.7]]),
        view=rng.integers(0, 2, n),
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_crop_keeps_exactly_the_box(seed: int) -> None:
    cloud, low, high = random_cloud(seed), np.array([-0.1, 0.4, 0.01]), np.array([0.1, 0.6, 0.04])
    inside = np.array([all(low[i] <= p[i] <= high[i] for i in range(3)) for p in cloud.points])
    kept = crop(cloud, low, high)
    np.testing.assert_array_equal(kept.points, cloud.points[inside])
    assert kept.view is not None
    assert cloud.view is not None
    np.testing.assert_array_equal(kept.view, cloud.view[inside])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size", [0.003, 0.02, 0.3, 10.0])
def test_a_voxel_holds_the_mean_of_its_points(seed: int, size: float) -> None:
    cloud = random_cloud(seed)
    assert cloud.colours is not None
    cells: dict[tuple[int, ...], list[int]] = {}
    for i, point in enumerate(cloud.points):
        cells.setdefault(tuple(np.floor((point - cloud.points.min(axis=0)) / size).astype(int)), []).append(i)
    thin = voxel_grid(cloud, size)
    expected = np.array([[*cloud.points[i].mean(axis=0), *cloud.colours[i].mean(axis=0)] for _, i in sorted(cells.items())])
    assert thin.colours is not None
    assert thin.normals is not None
    np.testing.assert_allclose(np.hstack([thin.points, thin.colours]), expected, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(thin.normals, axis=1), 1.0, atol=1e-9)
    # The grid's phase follows the cloud, so thinning again may merge neighbours but never adds or moves the centroid.
    again = voxel_grid(thin, size)
    assert len(again) <= len(thin)


def test_opposite_normals_in_a_voxel_leave_one() -> None:
    sheet = PointCloud(points=np.zeros((2, 3)), normals=np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    np.testing.assert_array_equal(voxel_grid(sheet, 0.01).normals, [[0, 0, 1]])


def test_a_voxel_too_small_to_count_is_refused() -> None:
    with pytest.raises(CloudError, match="too small"):
        voxel_grid(random_cloud(0), 1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_sparse_points_are_those_with_few_neighbours(seed: int) -> None:
    cloud, radius, wanted = random_cloud(seed, 400), 0.03, 4
    distance = np.linalg.norm(cloud.points[:, None] - cloud.points[None], axis=2)
    expected = (distance <= radius).sum(axis=1) - 1 >= wanted
    assert 0 < expected.sum() < 400
    np.testing.assert_array_equal(drop_sparse(cloud, radius, wanted).points, cloud.points[expected])


@pytest.mark.parametrize("seed", SEEDS)
def test_stray_points_go_and_the_plate_stays(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(60), np.arange(60))
    plate = np.stack([x.ravel(), y.ravel(), np.zeros(3600)], axis=1) * 1e-3 + rng.normal(0, 1e-4, (3600, 3))
    stray = rng.uniform([-0.1, -0.1, 0.02], [0.2, 0.2, 0.2], (40, 3))
    cloud = PointCloud(points=np.vstack([stray, plate]))
    for kept in (drop_outliers(cloud), drop_sparse(cloud, 0.003, 4)):
        assert (kept.points[:, 2] > 0.015).sum() <= 1
        assert len(kept) > 0.985 * 3600


@pytest.mark.parametrize("seed", SEEDS)
def test_normals_of_a_tilted_plane_face_the_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = rng.uniform(-0.1, 0.1, (500, 2)) @ frame[:2]
    for camera in (frame[2], -frame[2]):
        found = estimate_normals(PointCloud(points=points, viewpoints=camera[None] * 0.6)).normals
        np.testing.assert_allclose(found, np.broadcast_to(camera, (500, 3)), atol=1e-6)


def test_normals_of_a_sphere_are_radial_and_up_without_a_viewpoint() -> None:
    rng = np.random.default_rng(0)
    radial = rng.normal(size=(4000, 3))
    radial[:, 2] = np.abs(radial[:, 2])
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    found = estimate_normals(PointCloud(points=radial * 0.1), 16).normals
    assert found is not None
    assert (found[:, 2] >= 0).all()
    angle = np.degrees(np.arccos(np.clip(np.abs((found * radial).sum(axis=1)), 0, 1)))
    assert np.percentile(angle, 95) < 5
    with pytest.raises(CloudError, match="three"):
        estimate_normals(PointCloud(points=radial[:2]))


def test_prepare_does_what_the_config_says_and_nothing_by_default() -> None:
    cloud = random_cloud(1)
    assert prepare(cloud, CloudConfig()) is cloud
    config = CloudConfig(crop_min=(-0.1, 0.4, 0.0), crop_max=(0.1, 0.6, 1.0), outlier_radius=0.03, voxel=0.01)
    low, high = np.array([-0.1, 0.4, 0.0]), np.array([0.1, 0.6, 1.0])
    expected = voxel_grid(drop_sparse(crop(cloud, low, high), 0.03, 4), 0.01)
    np.testing.assert_array_equal(prepare(cloud, config).points, expected.points)
    with pytest.raises(CloudError, match=r"outlier_radius: none of 2000 points is left"):
        prepare(cloud, CloudConfig(outlier_radius=1e-6))
    with pytest.raises(CloudError, match="crop box: none of 2000"):
        prepare(cloud, CloudConfig(crop_min=(3, 3, 3), crop_max=(4, 4, 4)))


@pytest.mark.parametrize("change", [{"voxel": -1.0}, {"outlier_radius": -1.0}, {"outlier_neighbours": 0}, {"crop_min": (0, 0, 0)}])
def test_a_config_without_sense_is_refused(change: dict) -> None:
    with pytest.raises(ConfigError):
        CloudConfig(**change)
