"""The whole published method: where it works, how it fails, and on the author's own scan."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData

from tests.clouds import GROOVE, groove_cloud
from weldsim.curves import project
from weldsim.errors import CloudError, ConfigError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import PointCloud, Seam
from weldsim.seam.thesis.config import ThesisConfig
from weldsim.seam.thesis.find import find_seams_thesis

CONFIG = ThesisConfig()


def errors_mm(seam: Seam, truth: np.ndarray) -> np.ndarray:
    """Distance of each seam point from the true opening [mm]."""
    return project(seam.points_B, truth)[0] * 1e3


@pytest.mark.parametrize("curve", ["straight", "arc"])
@pytest.mark.parametrize("noise", ["none", "iid"])
def test_it_works_on_clean_and_low_noise_grooves(curve, noise) -> None:
    made = groove_cloud(np.random.default_rng(2), curve=curve, noise=noise, sigma=3e-4, table=False)
    found = find_seams_thesis(made.cloud, CONFIG)
    assert made.seam is not None
    assert len(found.seams) == 1
    seam = found.seams[0]
    error = errors_mm(seam, made.seam.opening_B)
    assert error.mean() < 0.75, "the published method's own figure for flat V grooves is 0.1 to 0.75 mm"
    covered = project(made.seam.opening_B, seam.points_B)[0] < 3e-3
    assert covered.mean() > 0.8
    # The wire axis stands on the groove band; the band is symmetric, so on a flat plate it is the plate's normal.
    assert np.degrees(np.arccos(np.clip(seam.normals_B[:, 2], -1, 1))).max() < 8
    truth = made.labels == GROOVE
    assert (found.region[truth] == 1).mean() > 0.95  # the band holds the groove, and about as much beside it
    assert (found.region == 1).sum() < 4 * truth.sum()


def test_the_printed_descriptor_works_too() -> None:
    made = groove_cloud(np.random.default_rng(2), noise="iid", table=False)
    found = find_seams_thesis(made.cloud, ThesisConfig(descriptor="thesis", threshold=4e-4))
    assert made.seam is not None
    assert found.threshold is not None
    assert (found.threshold.value, found.threshold.unit) == (4e-4, "rad^4")
    assert errors_mm(found.seams[0], made.seam.opening_B).mean() < 0.75


def test_it_turns_with_the_cloud() -> None:
    made = groove_cloud(np.random.default_rng(0), curve="arc", table=False)
    X = Transform("BB", matrix_from_rotation_vector(np.array([0.4, -0.3, 1.0])), np.array([0.1, 0.2, 0.3]))
    turned = PointCloud(points=X.points(made.cloud.points), viewpoints=X.points(made.cloud.viewpoints))
    assert made.seam is not None
    seam = find_seams_thesis(turned, CONFIG).seams[0]
    assert errors_mm(seam, X.points(made.seam.opening_B)).mean() < 0.75
    assert (seam.normals_B @ X.R[:, 2] > 0.98).all()


def test_same_cloud_same_seam() -> None:
    made = groove_cloud(np.random.default_rng(5), noise="iid", table=False)
    a, b = (find_seams_thesis(made.cloud, CONFIG) for _ in range(2))
    assert np.array_equal(a.seams[0].points_B, b.seams[0].points_B)
    assert np.array_equal(a.seams[0].normals_B, b.seams[0].normals_B)
    assert np.array_equal(a.region, b.region)


@pytest.mark.parametrize("noise", ["none", "iid", "d415"])
def test_a_plain_plate_has_no_seam(noise) -> None:
    made = groove_cloud(np.random.default_rng(1), width=0.0, noise=noise, table=False)
    found = find_seams_thesis(made.cloud, CONFIG)
    assert found.seams == ()
    # Waves of a measured D415 may leave a few boundary points, too few for a line.
    assert any(
        word in found.rejected[0].reason for word in (["descriptor", "ordered path points"] if noise == "d415" else ["descriptor"])
    )


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((1, 3)),
        np.random.default_rng(0).uniform(0, 0.1, (12, 3)),
        np.zeros((5000, 3)),
        np.stack([np.linspace(0, 1, 5000), np.zeros(5000), np.zeros(5000)], 1),
        np.random.default_rng(0).uniform(0, 0.1, (500, 3)),
        np.random.default_rng(0).uniform(0, 4.9, (3000, 3)),
    ],
    ids=["empty", "one", "twelve", "one point 5000 times", "line", "sparse ball", "as wide as may be"],
)
@pytest.mark.parametrize("kind", ["code", "thesis"])
def test_hopeless_clouds_give_a_reason(points, kind) -> None:
    found = find_seams_thesis(PointCloud(points=points), ThesisConfig(descriptor=kind))
    assert found.seams == ()
    assert found.region.shape == (len(points),)
    assert found.rejected
    assert all(refused.reason for refused in found.rejected)


@pytest.mark.parametrize("threshold", [0.9, 1e-30])
def test_a_threshold_that_cannot_work_gives_a_reason(threshold: float) -> None:
    made = groove_cloud(np.random.default_rng(1), table=False)
    found = find_seams_thesis(made.cloud, ThesisConfig(threshold=threshold, mls_radius=0.0))
    if threshold > 0.5:
        assert found.seams == ()
        assert "above 0.9" in found.rejected[0].reason
    else:  # everything is groove: whatever comes out, it ends and says so
        assert found.seams or found.rejected


def test_random_blobs_never_crash() -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed)
        blob = rng.normal(0, rng.uniform(0.002, 0.05, 3), (2500, 3))
        found = find_seams_thesis(PointCloud(points=blob), CONFIG)
        assert found.seams or found.rejected


def test_the_cloud_must_be_in_the_base() -> None:
    with pytest.raises(CloudError, match="frame C"):
        find_seams_thesis(PointCloud(points=np.zeros((20, 3)), frame="C"), CONFIG)


@pytest.mark.parametrize("field", ["voxel", "normal_radius", "descriptor_radius", "thin_voxel", "axis_radius", "cluster_size"])
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_config_refuses_nonsense(field: str, value: float) -> None:
    if field == "cluster_size" and value != value:
        value = -2
    with pytest.raises(ConfigError, match=field):
        ThesisConfig(**{field: value if field == "cluster_size" else float(value)})


def test_numba_loads_only_when_a_cloud_is_searched() -> None:
    code = "import sys, weldsim.seam.thesis.find; sys.exit('numba' in sys.modules or 'open3d' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_authors_own_scan(real_data: Path) -> None:
    vertex = PlyData.read(str(real_data / "curved_groove_scan.ply"))["vertex"]
    points = np.stack([vertex["x"], vertex["y"], vertex["z"]], axis=1).astype(float)
    found = find_seams_thesis(PointCloud(points=points), CONFIG)
    assert len(found.seams) == 1
    seam = found.seams[0]
    assert seam.length > 0.18
    error = project(seam.points_B * [1, 1, 0], valley(points))[0] * 1e3
    assert error.mean() < 1.0
    assert np.percentile(error, 95) < 2.5


def valley(points: np.ndarray) -> np.ndarray:
    """The groove's valley, z = 0: depth-weighted centroid below the plate in slices along y, 3 mm apart."""
    A = np.column_stack([points[:, :2], np.ones(len(points))])
    keep = np.ones(len(points), bool)
    for _ in range(8):  # the plate's plane, points off it left out
        plane = np.linalg.lstsq(A[keep], points[keep, 2], rcond=None)[0]
        depth = A @ plane - points[:, 2]
        keep = np.abs(depth) < 1.5e-3
    line = []
    for y in np.arange(points[:, 1].min() + 2e-3, points[:, 1].max() - 2e-3, 3e-3):
        inside = (np.abs(points[:, 1] - y) < 3e-3) & (depth > 3e-3) & (depth < 12e-3)  # deeper is the table
        w = np.where(inside, depth - 3e-3, 0.0)
        line.append((w @ (points * [1, 1, 0])) / w.sum())
    return np.array(line)
