"""Points whose file gives their sensor's pose: moved to the base where they are in the sensor's frame, else left as they are."""

from pathlib import Path

import numpy as np
import pytest

from tests.cloud_files import pcd_bytes, ply_bytes, xyz_columns
from weldsim.cloud.files import read_cloud
from weldsim.errors import CloudFileError
from weldsim.frames import matrix_from_quaternion, quaternion_from_matrix, unit

POINTS = np.random.default_rng(0).uniform(-0.1, 0.1, (400, 3)) * [1, 1, 0.1] + [0.0, -0.45, 0.02]
STOOD = [(0.0, -0.45, 0.42), (0.1, -0.75, 0.55), (-0.2, -0.3, 0.5)]
BODY = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # of a camera whose x axis looks ahead: its axes in the optical ones


def looking(stood: np.ndarray) -> np.ndarray:
    """R_BC of a camera that looks at the points."""
    z = unit(POINTS.mean(axis=0) - stood)
    x = unit(np.cross(z, [0.1, 0.02, 1.0]))
    return np.stack([x, np.cross(z, x), z], axis=1)


def header(stood: np.ndarray, R: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in (*stood, *quaternion_from_matrix(R)))


@pytest.mark.parametrize("stood", STOOD)
@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_in_the_sensors_frame_is_moved_and_one_in_the_base_is_not(tmp_path: Path, stood: tuple, data: str) -> None:
    place, R = np.array(stood), looking(np.array(stood))
    normals = [(f"normal_{axis}", "f8", np.full(400, value)) for axis, value in zip("xyz", R[2], strict=True)]
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_bytes([*xyz_columns((POINTS - place) @ R), *normals], data, viewpoint=header(place, R)))
    cloud = read_cloud(path)
    np.testing.assert_allclose(cloud.points, POINTS, atol=1e-9)
    np.testing.assert_allclose(cloud.normals, np.tile([0.0, 0, 1], (400, 1)), atol=1e-9)
    np.testing.assert_allclose(cloud.viewpoints, [place])
    assert "from the sensor's frame to the one of the pose" in cloud.notes[0]
    assert cloud.select(np.arange(5)).notes == cloud.notes
    np.testing.assert_allclose(read_cloud(path, viewpoint=place).points, POINTS, atol=1e-9)
    path.write_bytes(pcd_bytes(xyz_columns(POINTS), data, viewpoint=header(place, R)))
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.points, POINTS)
    np.testing.assert_allclose(cloud.viewpoints, [place])
    assert cloud.notes == ()


def test_the_origin_as_viewpoint_asks_for_the_sensors_frame_and_a_crop_box_is_of_the_base(tmp_path: Path) -> None:
    place, R = np.array(STOOD[1]), looking(np.array(STOOD[1]))
    local = (POINTS - place) @ R
    (tmp_path / "a.pcd").write_bytes(pcd_bytes(xyz_columns(local), viewpoint=header(place, R)))
    np.testing.assert_allclose(read_cloud(tmp_path / "a.pcd", viewpoint=[0, 0, 0]).points, local)
    cropped = read_cloud(tmp_path / "a.pcd", crop=([0.0, -1.0, -1.0], [1.0, 1.0, 1.0])).points
    np.testing.assert_allclose(cropped, POINTS[POINTS[:, 0] >= 0], atol=1e-9)


def test_pixels_without_a_return_are_not_moved_to_where_the_sensor_stood(tmp_path: Path) -> None:
    place, R = np.array(STOOD[0]), looking(np.array(STOOD[0]))
    local = np.vstack([(POINTS - place) @ R, np.zeros((50, 3)), np.full((50, 3), np.nan)])
    (tmp_path / "a.pcd").write_bytes(pcd_bytes(xyz_columns(local), viewpoint=header(place, R)))
    np.testing.assert_allclose(read_cloud(tmp_path / "a.pcd").points, POINTS, atol=1e-9)


def test_a_sensor_whose_x_axis_looks_ahead_is_understood_where_its_points_lie_ahead_in_one_frame_alone(tmp_path: Path) -> None:
    place = np.array([0.0, -0.45, 0.42])
    R = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]) @ BODY.T
    for points in ((POINTS - place) @ R, POINTS):
        (tmp_path / "a.pcd").write_bytes(pcd_bytes(xyz_columns(points), viewpoint=header(place, R)))
        np.testing.assert_allclose(read_cloud(tmp_path / "a.pcd").points, POINTS, atol=1e-9)


def test_points_that_may_be_in_either_frame_are_refused_and_the_viewpoint_takes_them_as_they_are(tmp_path: Path) -> None:
    place = np.array([0.0, -0.45, 0.42])
    for shift in (np.array([0.0, 0.45, 1.0]), np.array([0.0, 2.0, -0.4])):  # ahead in both frames, and in neither
        points, R = POINTS + shift, matrix_from_quaternion(np.array([np.cos(0.4), -np.sin(0.4), 0.0, 0.0]))
        (tmp_path / "a.pcd").write_bytes(pcd_bytes(xyz_columns(points), viewpoint=header(place, R)))
        with pytest.raises(CloudFileError, match=r"pose of the sensor, at \(0, -0.45, 0.42\).*--viewpoint X Y Z, where the sensor"):
            read_cloud(tmp_path / "a.pcd")
        np.testing.assert_allclose(read_cloud(tmp_path / "a.pcd", viewpoint=place).points, points)


def test_a_header_that_says_nothing_is_taken_for_that(tmp_path: Path) -> None:
    for words in ("0 0 0 0 0 0 1", "0 0 0 0 0 0 0", "0 0 0 2 0 0 0"):
        (tmp_path / "a.pcd").write_bytes(pcd_bytes(xyz_columns(POINTS), viewpoint=words))
        cloud = read_cloud(tmp_path / "a.pcd")
        np.testing.assert_array_equal(cloud.points, POINTS)
        assert len(cloud.viewpoints) == 0


def test_the_camera_that_pcl_writes_after_the_points_of_a_ply_is_read_like_it(tmp_path: Path) -> None:
    place, R = np.array(STOOD[1]), looking(np.array(STOOD[1]))
    names = ["view_px", "view_py", "view_pz", *(f"{row}_axis{axis}" for row in "xyz" for axis in "xyz"), "focal"]
    camera = "element camera 1\n" + "".join(f"property double {name}\n" for name in names)
    row = np.array([*place, *R.ravel(), 0.0]).tobytes()  # PCL's x_axis is the first row of its matrix
    for points in ((POINTS - place) @ R, POINTS):
        data = ply_bytes(xyz_columns(points)).replace(b"end_header", camera.encode() + b"end_header") + row
        (tmp_path / "a.ply").write_bytes(data)
        cloud = read_cloud(tmp_path / "a.ply")
        np.testing.assert_allclose(cloud.points, POINTS, atol=1e-9)
        np.testing.assert_allclose(cloud.viewpoints, [place])
