"""The compiled neighbourhood loops against plain numpy over the same balls, for random clouds and radii."""

import numpy as np
import pytest
from numpy import ndarray

from weldsim.frames import matrix_from_rotation_vector, unit
from weldsim.seam.thesis.boundary import boundary
from weldsim.seam.thesis.clusters import euclidean_clusters
from weldsim.seam.thesis.descriptor import gradient
from weldsim.seam.thesis.grid import FEW, THREADS, threads
from weldsim.seam.thesis.mls import smooth
from weldsim.seam.thesis.normals import normals_towards, principal_axes
from weldsim.seam.thesis.voxel import voxel_centroids


def random_cloud(seed: int, n: int = 400) -> ndarray:
    """Points on a bumpy, tilted sheet 40 x 30 mm, far from the origin."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 0.04, n), rng.uniform(0, 0.03, n)
    flat = np.stack([x, y, 0.002 * np.sin(200 * x) + rng.normal(0, 2e-4, n)], axis=1)
    return flat @ matrix_from_rotation_vector(rng.normal(0, 0.5, 3)).T + rng.uniform(-1, 1, 3)


def balls(points: ndarray, radius: float) -> ndarray:
    """(n, n) who is within `radius` of whom, itself included."""
    return np.linalg.norm(points[:, None] - points[None], axis=2) <= radius


@pytest.mark.parametrize("seed", range(6))
def test_principal_axes_are_those_of_the_ball(seed: int) -> None:
    points, radius = random_cloud(seed), (0.003, 0.01, 0.1)[seed % 3]
    count, mean, axes = principal_axes(points, radius)
    near = balls(points, radius)
    assert np.array_equal(count, near.sum(axis=1))
    for i in range(0, len(points), 23):
        local = points[near[i]]
        np.testing.assert_allclose(mean[i], local.mean(axis=0), atol=1e-12)
        scatter = np.cov(local.T, bias=True) if len(local) > 1 else np.zeros((3, 3))
        rotated = axes[i].T @ scatter @ axes[i]
        np.testing.assert_allclose(rotated, np.diag(np.diag(rotated)), atol=1e-15)
        assert np.diff(np.diag(rotated)).max() <= 1e-15  # widest first, the normal last


def test_results_do_not_depend_on_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    points = random_cloud(1, 3 * FEW)
    results = []
    for allowed in ("1", "2", "64", "", "nonsense"):
        monkeypatch.setenv("OMP_NUM_THREADS", allowed)
        assert threads() == (1 if allowed == "1" else THREADS)
        results.append(principal_axes(points, 0.002))
    for other in results[1:]:
        for mine, yours in zip(results[0], other, strict=True):
            np.testing.assert_array_equal(mine, yours)


@pytest.mark.parametrize("seed", range(4))
def test_descriptors_match_the_equations(seed: int) -> None:
    points, radius = random_cloud(seed), 0.008
    normals = normals_towards(points, None, 0.006)
    near = balls(points, radius)
    mean_normal = unit(normals.sum(axis=0))  # eq 5.18
    beta = np.arccos(np.clip(normals @ mean_normal, -1, 1))  # eq 5.19
    angles, dots = np.zeros(len(points)), np.zeros(len(points))
    for i, ball in enumerate(near):
        dot = np.clip(normals[ball] @ normals[i], -1, 1)
        angles[i] = np.hypot(np.var(np.arccos(dot)), np.var(beta[ball]))  # eq 5.17, 5.20-5.22
        dots[i] = np.var(dot)
    for kind, v in (("thesis", angles), ("code", dots)):
        expected = np.array([np.var(v[ball]) for ball in near])  # eq 5.23
        np.testing.assert_allclose(gradient(points, normals, radius, kind), expected, rtol=1e-5, atol=1e-16)


def test_a_plane_has_no_gradient_and_a_fold_has() -> None:
    x, y = np.meshgrid(np.arange(-0.04, 0.04, 0.001), np.arange(-0.03, 0.03, 0.001))
    for slope in (0.0, 0.5):
        points = np.stack([x, y, slope * np.abs(x)], axis=-1).reshape(-1, 3)
        g = gradient(points, normals_towards(points, None, 0.01), 0.01, "code")
        assert g[np.abs(points[:, 0]) > 0.032].max() < 1e-25  # beyond three radii nothing is felt
        assert g.max() < 1e-25 if slope == 0 else g.max() > 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_normals_face_the_camera(seed: int) -> None:
    points = random_cloud(seed)
    rng = np.random.default_rng(seed)
    sight = points.mean(axis=0) + 0.4 * unit(rng.normal(size=3)) + np.zeros_like(points)
    normals = normals_towards(points, sight, 0.008)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-12)
    assert (np.einsum("ij,ij->i", normals, sight - points) >= 0).all()
    np.testing.assert_allclose(normals_towards(points, 2 * points - sight, 0.008), -normals, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_mls_keeps_planes_and_moves_noise_down(seed: int) -> None:
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.uniform(0, 0.04, (3000, 2)), np.zeros(3000)])
    np.testing.assert_allclose(smooth(flat, 0.005), flat, atol=1e-12)
    rough = flat + [0, 0, 1] * rng.normal(0, 3e-4, (3000, 1))
    middle = (np.abs(flat[:, :2] - 0.02) < 0.012).all(axis=1)
    assert smooth(rough, 0.005)[middle, 2].std() < 0.4 * 3e-4
    R = matrix_from_rotation_vector(rng.normal(0, 1, 3))
    np.testing.assert_allclose(smooth(rough @ R.T, 0.005), smooth(rough, 0.005) @ R.T, atol=1e-9)


def test_mls_leaves_lone_points_alone() -> None:
    points = np.array([[0.0, 0, 0], [0.001, 0, 0], [1.0, 1, 1]])
    assert np.array_equal(smooth(points, 0.005), points)


@pytest.mark.parametrize("seed", range(4))
def test_voxels_partition_the_cloud(seed: int) -> None:
    points = random_cloud(seed, 2000)
    centroids, cube = voxel_centroids(points, 0.002)
    assert set(cube) == set(range(len(centroids)))
    assert len(np.unique(np.floor(points / 0.002), axis=0)) == len(centroids)
    for k in range(0, len(centroids), 17):
        np.testing.assert_allclose(centroids[k], points[cube == k].mean(axis=0), atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_clusters_are_the_components_largest_first(seed: int) -> None:
    points = random_cloud(seed)
    rank = euclidean_clusters(points, 0.0015)
    same = rank[:, None] == rank[None]
    assert same[balls(points, 0.0015)].all()
    assert (np.diff(np.bincount(rank)) <= 0).all()
    for k in range(rank.max() + 1):  # every cluster hangs together: no part is farther than the radius from the rest
        member = points[rank == k]
        if len(member) > 1:
            reached = np.zeros(len(member), bool)
            reached[0] = True
            near = balls(member, 0.0015)
            for _ in range(len(member)):
                reached = near[reached].any(axis=0)
            assert reached.all()


@pytest.mark.parametrize("seed", range(4))
def test_boundary_of_a_disc_is_its_rim(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(-0.03, 0.03, 0.001), np.arange(-0.03, 0.03, 0.001))
    flat = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3) + rng.normal(0, 1e-4, (3600, 3)) * [1, 1, 0]
    disc = flat[np.hypot(flat[:, 0], flat[:, 1]) < 0.025] @ matrix_from_rotation_vector(rng.normal(0, 1, 3)).T
    r = np.linalg.norm(disc, axis=1)
    rim = boundary(disc, 0.005, 0.010, np.pi / 2)
    assert not rim[r < 0.0225].any()
    assert rim.sum() > 2 * np.pi * 25 * 0.6  # about one point a millimetre
