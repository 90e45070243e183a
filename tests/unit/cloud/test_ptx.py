"""PTX scans: points come out in the frame their pose is in, with the scanner as viewpoint."""

from pathlib import Path

import numpy as np
import pytest

from weldsim.cloud.files import read_cloud
from weldsim.errors import CloudFileError
from weldsim.frames import Transform, matrix_from_rotation_vector

RNG = np.random.default_rng(4)
POINTS = RNG.uniform([-0.1, 0.4, 0.0], [0.2, 0.7, 0.05], (120, 3))
POSE = Transform("BS", matrix_from_rotation_vector(np.array([2.0, 0.5, -0.3])), np.array([0.1, 0.2, 0.9]))


def scan(points_B: np.ndarray, X_BS: Transform, *, columns_from_left: bool = False, tail: str = " 0.5 10 20 30") -> str:
    """A scan of two columns, one pixel of which is no return, as scanners export it."""
    local = np.vstack([X_BS.inverse().points(points_B), np.zeros((2, 3))])
    matrix = X_BS.matrix if columns_from_left else X_BS.matrix.T
    lines = ["2", str(len(local) // 2), _row(X_BS.p), *map(_row, X_BS.R.T), *map(_row, matrix)]
    return "\n".join([*lines, *(_row(point) + tail for point in local), ""])


def _row(values: np.ndarray) -> str:
    return " ".join(f"{value:.9f}" for value in values)


@pytest.mark.parametrize("columns_from_left", [False, True])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_the_pose_is_applied_and_is_the_viewpoint(tmp_path: Path, columns_from_left: bool, newline: str) -> None:
    (tmp_path / "a.ptx").write_bytes(scan(POINTS, POSE, columns_from_left=columns_from_left).replace("\n", newline).encode())
    cloud = read_cloud(tmp_path / "a.ptx")
    np.testing.assert_allclose(cloud.points, POINTS, atol=1e-7)
    np.testing.assert_allclose(cloud.viewpoints, [POSE.p], atol=1e-8)


def test_several_scans_are_several_views(tmp_path: Path) -> None:
    other = Transform("BS", np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.5, 0.6]))
    (tmp_path / "a.ptx").write_text(scan(POINTS, POSE) + scan(POINTS[:50], other, tail=" 1"))
    cloud = read_cloud(tmp_path / "a.ptx")
    np.testing.assert_allclose(cloud.points, np.vstack([POINTS, POINTS[:50]]), atol=1e-7)
    np.testing.assert_allclose(cloud.viewpoints, [POSE.p, other.p], atol=1e-8)
    assert cloud.view is not None
    np.testing.assert_array_equal(cloud.view, [0] * 120 + [1] * 50)


def test_millimetres_are_scaled_with_their_pose(tmp_path: Path) -> None:
    far = Transform("BS", POSE.R, POSE.p * 1e3)
    (tmp_path / "a.ptx").write_text(scan(POINTS * 1e3, far))
    cloud = read_cloud(tmp_path / "a.ptx", unit="mm")
    np.testing.assert_allclose(cloud.points, POINTS, atol=1e-7)
    np.testing.assert_allclose(cloud.viewpoints, [POSE.p], atol=1e-8)


def test_a_ptx_without_its_pose_is_refused_and_the_advice_works(tmp_path: Path) -> None:
    bare = "\n".join(["2", "60", *(_row(point) + " 0.5" for point in POINTS), ""])
    (tmp_path / "a.ptx").write_text(bare)
    with pytest.raises(CloudFileError, match=r"begins as a PTX .* delete the lines above its points"):
        read_cloud(tmp_path / "a.ptx")
    (tmp_path / "a.ptx").write_text(bare.removeprefix("2\n60\n"))
    np.testing.assert_allclose(read_cloud(tmp_path / "a.ptx").points, POINTS, atol=1e-8)


def test_a_matrix_that_is_no_pose_and_a_cut_are_refused(tmp_path: Path) -> None:
    text = scan(POINTS, POSE)
    lines = text.splitlines()
    (tmp_path / "a.ptx").write_text("\n".join([*lines[:6], "2 0 0 0", *lines[7:]]))
    with pytest.raises(CloudFileError, match="no rigid transform"):
        read_cloud(tmp_path / "a.ptx")
    (tmp_path / "a.ptx").write_text("\n".join(lines[:-5]))
    with pytest.raises(CloudFileError, match="promises 122 points"):
        read_cloud(tmp_path / "a.ptx")
