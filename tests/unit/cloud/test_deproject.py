"""Depth images to points, against the projection they come from."""

import numpy as np
import pytest

from weldsim.cloud.deproject import deproject
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics, DepthFrame


def random_frame(seed: int, *, colour: bool = False) -> DepthFrame:
    rng = np.random.default_rng(seed)
    h, w = 37, 53
    camera = CameraIntrinsics(width=w, height=h, fx=61.0, fy=58.0, cx=rng.uniform(20, 30), cy=rng.uniform(15, 20))
    depth = rng.uniform(0.2, 1.5, (h, w)).astype(np.float32)
    depth[rng.random((h, w)) < 0.2] = np.nan
    X_BC = Transform("BC", matrix_from_rotation_vector(rng.normal(size=3) * 2), rng.normal(size=3))
    image = rng.integers(0, 256, (h, w, 3)).astype(np.uint8) if colour else None
    return DepthFrame(depth=depth, intrinsics=camera, X_BC=X_BC, colour=image)


@pytest.mark.parametrize("seed", range(8))
def test_points_project_back_onto_their_pixels_at_their_depth(seed: int) -> None:
    frame = random_frame(seed)
    cloud, camera = deproject(frame), frame.intrinsics
    assert cloud.pixel is not None
    p_C = frame.X_BC.inverse().points(cloud.points)
    u = camera.fx * p_C[:, 0] / p_C[:, 2] + camera.cx
    v = camera.fy * p_C[:, 1] / p_C[:, 2] + camera.cy
    row, column = np.divmod(cloud.pixel, camera.width)
    np.testing.assert_allclose(u, column + 0.5, atol=1e-9)
    np.testing.assert_allclose(v, row + 0.5, atol=1e-9)
    np.testing.assert_allclose(p_C[:, 2], frame.depth[row, column], atol=1e-12)
    assert len(cloud) == np.isfinite(frame.depth).sum()


@pytest.mark.parametrize("seed", range(3))
def test_points_are_depth_times_the_camera_rays(seed: int) -> None:
    frame = random_frame(seed)
    rays = (frame.depth[..., None] * frame.intrinsics.rays()).reshape(-1, 3)
    expected = frame.X_BC.points(rays[np.isfinite(rays).all(axis=1)])
    np.testing.assert_allclose(deproject(frame).points, expected, atol=1e-12)


def test_colours_viewpoint_and_camera_go_along() -> None:
    frame = random_frame(3, colour=True)
    cloud = deproject(frame)
    assert frame.colour is not None
    assert cloud.colours is not None
    np.testing.assert_allclose(cloud.colours, frame.colour[np.isfinite(frame.depth)] / 255)
    np.testing.assert_array_equal(cloud.viewpoints, frame.X_BC.p[None])
    assert cloud.intrinsics is frame.intrinsics
    assert cloud.X_BC is frame.X_BC
    assert cloud.frame == "B"


def test_a_frame_without_returns_is_an_empty_cloud() -> None:
    depth = np.full((480, 640), np.nan, np.float32)
    assert len(deproject(DepthFrame(depth=depth, intrinsics=D415_640X480, X_BC=Transform.identity("BC")))) == 0
