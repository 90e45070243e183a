"""The optical frame, pixel centres and depth."""

import cv2
import numpy as np
import pytest

from weldsim.errors import RecordError
from weldsim.frames import Transform
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics, DepthFrame

OPENCV = {"fx": 619.97, "fy": 619.86, "cx": 311.23, "cy": 226.93}


def test_camera_looks_along_z_with_x_right_and_y_down():
    rays = D415_640X480.rays()
    assert rays.shape == (480, 640, 3)  # row, then column
    assert (rays[..., 2] == 1).all()
    assert (np.diff(rays[..., 0], axis=1) > 0).all()
    assert (np.diff(rays[..., 1], axis=0) > 0).all()


def test_pixel_centres_are_at_half_pixels():
    camera = CameraIntrinsics(width=640, height=480, fx=600.0, fy=600.0, cx=320.0, cy=240.0)
    left, right = camera.rays()[0, 0], camera.rays()[-1, -1]
    np.testing.assert_allclose(left[:2], [-319.5 / 600, -239.5 / 600])
    np.testing.assert_allclose(left[:2], -right[:2], atol=1e-15)  # a centred principal point leaves no side favoured


def test_opencv_principal_points_move_by_half_a_pixel():
    camera = CameraIntrinsics.from_opencv(width=640, height=480, **OPENCV)
    matrix = np.array([[OPENCV["fx"], 0, OPENCV["cx"]], [0, OPENCV["fy"], OPENCV["cy"]], [0, 0, 1.0]])
    points_C = camera.rays()[::60, ::80].reshape(-1, 1, 3) * 0.4
    pixels, _ = cv2.projectPoints(points_C, np.zeros(3), np.zeros(3), matrix, None)
    v, u = np.meshgrid(np.arange(0, 480, 60), np.arange(0, 640, 80), indexing="ij")
    np.testing.assert_allclose(pixels[:, 0], np.stack([u, v], axis=-1).reshape(-1, 2), atol=1e-9)


def test_depth_is_along_the_optical_axis_not_along_the_ray():
    """A wall square to the axis has one depth all over the image, and depth times ray is the point."""
    wall_C = 0.7 * D415_640X480.rays()
    np.testing.assert_array_equal(wall_C[..., 2], 0.7)
    assert np.linalg.norm(wall_C, axis=-1).max() > 0.75


@pytest.mark.parametrize("no_return", [0.0, -1.0, np.inf])
def test_no_return_is_nan_and_nothing_else(no_return):
    camera = CameraIntrinsics(width=4, height=3, fx=5.0, fy=5.0, cx=2.0, cy=1.5)
    depth = np.full((3, 4), 0.5, np.float32)
    depth[1, 2] = np.nan
    frame = DepthFrame(depth=depth, intrinsics=camera, X_BC=Transform.identity("BC"))
    assert frame.depth.dtype == np.float32
    assert np.isnan(frame.depth[1, 2])
    depth[1, 2] = no_return
    with pytest.raises(RecordError):
        DepthFrame(depth=depth, intrinsics=camera, X_BC=Transform.identity("BC"))
