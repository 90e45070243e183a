"""The test clouds are what they claim: points on the closed-form surface, a seam where the groove is, camera-like noise."""

import numpy as np
import pytest

from tests.clouds import ARC_RADIUS, GROOVE, PLATE, d415_depth, groove_cloud
from weldsim.curves import project
from weldsim.frames import matrix_from_rotation_vector


@pytest.mark.parametrize("curve", ["straight", "arc", "s"])
def test_points_lie_on_the_plate_and_its_flanks(curve) -> None:
    made = groove_cloud(np.random.default_rng(0), curve=curve, width=0.016, depth=0.007, yaw=0.3)
    assert made.seam is not None
    across, foot, _ = project(made.cloud.points[made.labels == GROOVE], made.seam.opening_B)
    points = made.cloud.points[made.labels == GROOVE]
    below = made.seam.opening_B[0, 2] - points[:, 2]
    level = np.hypot(*(points - foot)[:, :2].T)  # in the plate's plane
    inner = (np.linalg.norm(foot - made.seam.opening_B[0], axis=1) > 0.02) & (across > 0)
    inner &= np.linalg.norm(foot - made.seam.opening_B[-1], axis=1) > 0.02
    np.testing.assert_allclose(below[inner], 0.007 * (1 - level[inner] / 0.008), atol=2e-5)
    top = made.cloud.points[made.labels == PLATE]
    assert (np.abs(top[:, 2] - 0.02) < 1e-7).mean() > 0.98  # the rest are the plate's sides


def test_the_known_seam_is_the_curve_it_names() -> None:
    made = groove_cloud(np.random.default_rng(0), curve="arc", margin=0.02, root_gap=0.002)
    assert made.seam is not None
    p, R = made.seam.opening_B, matrix_from_rotation_vector(np.array([0.0, 0, np.pi / 2]))
    centre = p.mean(axis=0)
    fit = np.linalg.lstsq(
        np.column_stack([2 * (p - centre)[:, :2], np.ones(len(p))]), ((p - centre)[:, :2] ** 2).sum(1), rcond=None
    )[0]
    assert np.sqrt(fit[2] + fit[:2] @ fit[:2]) == pytest.approx(ARC_RADIUS, rel=1e-6)
    np.testing.assert_allclose(np.linalg.norm(made.seam.left_B - made.seam.right_B, axis=1), 0.014, atol=1e-12)
    np.testing.assert_allclose(made.seam.bisectors_B, np.broadcast_to([0.0, 0, -1], p.shape), atol=1e-9)
    assert (np.einsum("ij,ij->i", made.seam.left_B - p, made.seam.tangents_B @ R.T) > 0).all()  # left is left


@pytest.mark.parametrize("seed", range(3))
def test_d415_noise_has_the_figures_of_the_real_camera(seed: int) -> None:
    z = d415_depth(np.full((240, 320), 0.4), 620.0, np.random.default_rng(seed))
    assert 0.25e-3 < z.std() < 0.55e-3
    made = groove_cloud(np.random.default_rng(seed), width=0.006, depth=0.005, table=False, noise="d415")
    assert made.seam is not None
    near = project(made.cloud.points, made.seam.root_B)[0] < 6e-3
    plate = np.median(made.cloud.points[made.labels == PLATE, 2])
    level = np.abs(project(made.cloud.points[near], made.seam.opening_B)[0])
    shown = plate - made.cloud.points[near, 2][level < 4e-3].mean()
    assert 0.0005 < shown < 0.0030  # 5 mm deep in truth: the support window fills it
