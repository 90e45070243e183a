"""Clouds of several views as one, and depth frames written and read back."""

import json
from dataclasses import replace

import numpy as np
import pytest

from weldsim.cloud.deproject import deproject
from weldsim.cloud.depth_files import read_depth_frame
from weldsim.cloud.depth_output import write_depth_frame
from weldsim.cloud.merge import merge
from weldsim.errors import CloudError, OutputError, RecordError
from weldsim.frames import Transform, matrix_from_quaternion
from weldsim.records import CameraIntrinsics, DepthFrame, PointCloud


def frame(seed: int) -> DepthFrame:
    """A depth image of noise with holes, from a random pose."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.3, 0.6, (24, 32)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.2] = np.nan
    camera = CameraIntrinsics(width=32, height=24, fx=30.5, fy=31.25, cx=15.75, cy=12.5)
    pose = Transform("BC", matrix_from_quaternion(rng.normal(size=4)), rng.uniform(-0.5, 0.5, 3))
    return DepthFrame(depth=depth, intrinsics=camera, X_BC=pose)


@pytest.mark.parametrize("seed", range(4))
def test_merged_points_know_the_camera_that_saw_them(seed):
    clouds = [deproject(frame(seed + 10 * k)) for k in range(3)]
    merged = merge(clouds)
    assert len(merged) == sum(map(len, clouds))
    start = 0
    for k, cloud in enumerate(clouds):
        part = slice(start, start + len(cloud))
        np.testing.assert_array_equal(merged.points[part], cloud.points)
        np.testing.assert_array_equal(merged.sight_origins()[part], cloud.sight_origins())
        assert set(merged.view[part]) == {k}
        np.testing.assert_array_equal(merged.pixel[part], cloud.pixel)
        np.testing.assert_array_equal(merged.X_BC.p[k], cloud.X_BC.p)
        start += len(cloud)
    assert merge([clouds[0], replace(clouds[1], pixel=None)]).pixel is None


def test_one_cloud_is_left_as_it_is():
    cloud = deproject(frame(0))
    assert merge([cloud]) is cloud


def test_clouds_that_do_not_go_together_are_refused():
    cloud = deproject(frame(0))
    with pytest.raises(CloudError, match="no cloud"):
        merge([])
    with pytest.raises(CloudError, match="cloud 1 is in frame C"):
        merge([cloud, PointCloud(points=cloud.points, frame="C", viewpoints=cloud.viewpoints)])
    with pytest.raises(CloudError, match="cloud 1 has 0 viewpoints"):
        merge([cloud, PointCloud(points=cloud.points)])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("name", "step", "error"), [("d.npy", 1e-3, 0.0), ("d.png", 1e-3, 0.5e-3), ("d.png", 1e-4, 0.5e-4)])
def test_depth_frames_come_back(tmp_path, seed, name, step, error):
    before = frame(seed)
    image, intrinsics, pose = write_depth_frame(tmp_path / name, before, depth_unit=step)
    after = read_depth_frame(image, intrinsics, pose=pose)
    assert after.intrinsics == before.intrinsics or after.intrinsics.cx == pytest.approx(before.intrinsics.cx, abs=1e-12)
    np.testing.assert_array_equal(np.isnan(after.depth), np.isnan(before.depth))
    assert np.nanmax(np.abs(after.depth.astype(float) - before.depth)) <= error * 1.001
    np.testing.assert_allclose(after.X_BC.R, before.X_BC.R, atol=1e-12)
    np.testing.assert_array_equal(after.X_BC.p, before.X_BC.p)


def test_intrinsics_are_written_as_drivers_print_them(tmp_path):
    _, intrinsics, _ = write_depth_frame(tmp_path / "d.npy", frame(0))
    assert json.loads(intrinsics.read_text())["cx"] == 15.25


def test_depth_that_does_not_fit_and_other_suffixes_are_refused(tmp_path):
    with pytest.raises(RecordError, match="16 bits"):
        write_depth_frame(tmp_path / "d.png", replace(frame(0), depth=np.full((24, 32), 70.0, np.float32)))
    with pytest.raises(OutputError, match=r"\.png, \.npy"):
        write_depth_frame(tmp_path / "d.tif", frame(0))
    assert list(tmp_path.iterdir()) == []
