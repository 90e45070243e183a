"""The default finder's symmetries: moving the cell, shuffling the points or running again changes nothing that matters."""

import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from tests.clouds import GrooveCloud, groove_cloud
from weldsim.curves import project
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import PointCloud, Seam, SeamFindings
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.find import find_seams_profile

CONFIG = ProfileConfig()
CURVES = ("straight", "arc", "s")
END = 0.012  # [m] near the ends a line may move along itself too


@cache
def scanned(curve, noise) -> tuple[GrooveCloud, Seam]:
    made = groove_cloud(np.random.default_rng(3), curve=curve, noise=noise, clamps=2)
    return made, find_seams_profile(made.cloud, CONFIG).seams[0]


def movement(seam: Seam, points_B: np.ndarray) -> float:
    """Greatest distance [m] of a seam's points, END from its ends on, from a line."""
    inner = (seam.s > END) & (seam.s < seam.s[-1] - END)
    return float(project(seam.points_B[inner], points_B)[0].max())


def ends_apart(a: np.ndarray, b: np.ndarray) -> float:
    """Greater distance [m] between the ends of two lines, whichever way they run."""
    return float(min(max(np.linalg.norm(a[0] - c[0]), np.linalg.norm(a[-1] - c[-1])) for c in (b, b[::-1])))


def moved(cloud: PointCloud, X: Transform) -> PointCloud:
    return PointCloud(points=X.points(cloud.points), viewpoints=X.points(cloud.viewpoints))


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("seed", range(2))
def test_the_seam_moves_with_the_cell(curve, seed: int) -> None:
    made, seam = scanned(curve, "none")
    rng = np.random.default_rng(seed)
    X = Transform("BB", matrix_from_rotation_vector(rng.normal(size=3)), rng.uniform(-0.3, 0.3, 3))
    found = find_seams_profile(moved(made.cloud, X), CONFIG).seams
    assert len(found) == 1
    back = X.inverse().points(found[0].points_B)
    assert movement(seam, back) < 0.1e-3
    assert ends_apart(seam.points_B, back) < 1e-3
    assert found[0].width == pytest.approx(seam.width, abs=1e-4)
    nearest = np.argmin(np.linalg.norm(back[:, None] - seam.points_B[None], axis=2), axis=1)
    normals = X.inverse().vectors(found[0].normals_B)
    turned = np.arccos(np.clip(np.einsum("ij,ij->i", normals, seam.normals_B[nearest]), -1, 1))
    assert np.degrees(np.quantile(turned, 0.95)) < 0.5


@pytest.mark.parametrize("curve", CURVES)
def test_the_seam_moves_with_the_cell_under_noise(curve) -> None:
    made, seam = scanned(curve, "d415")
    X = Transform("BB", matrix_from_rotation_vector(np.array([0.3, -0.5, 1.4])), np.array([0.1, 0.2, -0.05]))
    found = find_seams_profile(moved(made.cloud, X), CONFIG).seams
    assert len(found) == 1
    assert movement(seam, X.inverse().points(found[0].points_B)) < 0.6e-3


def test_a_shifted_cell_gives_the_shifted_seam() -> None:
    made, seam = scanned("s", "d415")
    X = Transform("BB", np.eye(3), np.array([0.25, -0.125, 0.0625]))  # exact in binary
    found = find_seams_profile(moved(made.cloud, X), CONFIG).seams
    assert movement(seam, found[0].points_B - X.p) < 0.05e-3


@pytest.mark.parametrize(("noise", "most"), [("none", 0.1e-3), ("d415", 0.3e-3)])
@pytest.mark.parametrize("curve", CURVES)
def test_the_order_of_the_points_matters_little(curve, noise, most: float) -> None:
    made, seam = scanned(curve, noise)
    order = np.random.default_rng(0).permutation(len(made.cloud))
    found = find_seams_profile(PointCloud(points=made.cloud.points[order], viewpoints=made.cloud.viewpoints), CONFIG)
    assert len(found.seams) == 1
    assert movement(seam, found.seams[0].points_B) < most
    marked = np.empty(len(order), bool)
    marked[order] = found.region > 0
    again = find_seams_profile(made.cloud, CONFIG).region > 0
    assert (marked & again).sum() / (marked | again).sum() > 0.95


def same(a: SeamFindings, b: SeamFindings) -> bool:
    pairs = zip(a.seams, b.seams, strict=True)
    lines = all(
        np.array_equal(x.points_B, y.points_B) and np.array_equal(x.normals_B, y.normals_B) and x.confidence == y.confidence
        for x, y in pairs
    )
    return lines and np.array_equal(a.region, b.region) and a.rejected == b.rejected and a.threshold == b.threshold


def test_the_same_cloud_gives_the_same_bits() -> None:
    made, _ = scanned("arc", "d415")
    assert same(find_seams_profile(made.cloud, CONFIG), find_seams_profile(made.cloud, CONFIG))


PROGRAM = """
import hashlib, sys
import numpy as np
from weldsim.records import PointCloud
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.find import find_seams_profile
data = np.load(sys.argv[1])
found = find_seams_profile(PointCloud(points=data["points"], viewpoints=data["viewpoints"]), ProfileConfig())
print(hashlib.sha256(found.seams[0].points_B.tobytes() + found.region.tobytes()).hexdigest())
"""


def test_another_process_gives_the_same_bits(tmp_path) -> None:
    made, _ = scanned("s", "d415")
    file = tmp_path / "cloud.npz"
    np.savez(file, points=made.cloud.points, viewpoints=made.cloud.viewpoints)
    answers = {
        subprocess.run([sys.executable, "-c", PROGRAM, str(file)], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    }
    assert len(answers) == 1


def test_the_cloud_is_left_as_it_was() -> None:
    made, _ = scanned("straight", "none")
    before = made.cloud.points.copy()
    find_seams_profile(made.cloud, CONFIG)
    assert np.array_equal(before, made.cloud.points)
