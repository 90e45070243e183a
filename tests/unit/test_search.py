"""Where seams are searched for, what is said of odd places, and remedies that are followed and work."""

from dataclasses import replace

import numpy as np
import pytest

from tests.clouds import groove_cloud
from tests.unit.cloud.test_visible import CAMERA, plate
from weldsim.cloud.filters import voxel_grid
from weldsim.config import CellConfig
from weldsim.curves import project
from weldsim.hints import hint
from weldsim.pipeline import plan
from weldsim.records import CameraIntrinsics, PointCloud

SMALL = CameraIntrinsics.from_opencv(width=320, height=240, fx=310.0, fy=310.0, cx=155.0, cy=113.0)
NONE = np.zeros((0, 3))


@pytest.fixture(scope="module")
def scan():
    made = groove_cloud(np.random.default_rng(3), noise="iid", sigma=0.0002, intrinsics=SMALL, table=False)
    return replace(made.cloud, pixel=None, intrinsics=None, X_BC=None), made


@pytest.fixture(scope="module")
def plain() -> PointCloud:
    made = groove_cloud(np.random.default_rng(3), width=0.0, noise="iid", sigma=0.0002, intrinsics=SMALL, table=False)
    return replace(made.cloud, pixel=None, intrinsics=None, X_BC=None)


def seen_from(cloud: PointCloud, *viewpoint: float) -> PointCloud:
    return replace(cloud, viewpoints=np.array([viewpoint]) if viewpoint else NONE)


def named_viewpoint(told: str) -> list[float]:
    words = told.split("--viewpoint ")[1].split()[:3]
    return [float(word) for word in words]


@pytest.mark.parametrize(("thickness", "known", "turned"), [(0.012, True, False), (0.060, True, True), (0.012, False, True)])
def test_a_whole_part_is_searched_from_where_it_can_be_seen(thickness: float, known: bool, turned: bool) -> None:
    whole, _ = plate(thickness)
    points, camera = whole.points, np.array(CAMERA)
    if turned:  # upside down: its groove below, and the camera too
        points = points * np.array([1, -1, -1]) - np.array([0, 0.9, 0])
        camera = camera * np.array([1, 1, -1])
    cloud = PointCloud(points=points, viewpoints=camera[None] if known else NONE)
    result = plan(cloud)
    (seam,) = result.findings.seams
    assert 0.235 < seam.length < 0.245
    assert np.abs(seam.points_B[:, 1] + 0.45).max() < 0.0005
    assert np.abs(seam.points_B[:, 2]).max() < 0.0005
    assert len(result.findings.region) == len(result.cloud)
    assert any(note.startswith("seam 1 faces down: the torch would come from below") for note in result.notes) == turned
    assert result.notes[0].endswith("left out" if known else f"of its {'lower' if turned else 'upper'} side, were searched")


def test_a_cloud_in_the_cameras_frame_is_told_and_the_remedy_works_and_says_so(scan) -> None:
    _, made = scan
    optical = PointCloud(points=made.cloud.X_BC.inverse().points(made.cloud.points))
    assert not plan(optical).findings.seams
    told = hint(optical, CellConfig())
    assert "with --viewpoint 0 0 0 one is: the cloud looks like one in its camera's own frame" in told
    result = plan(seen_from(optical, *named_viewpoint(told.replace("one", "", 1))))
    assert len(result.findings.seams) == 1
    assert result.notes == ("the camera stood at the origin: the path is in the camera's own frame, not in the robot's base",)


def test_a_cloud_in_the_cameras_frame_with_a_viewpoint_in_the_base_is_told_too(scan) -> None:
    _, made = scan
    X_BC = made.cloud.X_BC
    optical = seen_from(PointCloud(points=X_BC.inverse().points(made.cloud.points)), *X_BC.p)
    assert not plan(optical).findings.seams
    told = hint(optical, CellConfig())
    assert "with --viewpoint 0 0 0 one is: the cloud looks like one in its camera's own frame" in told
    assert told.endswith("; --viewpoint is where the camera stood in the frame of the cloud")
    assert len(plan(seen_from(optical, *named_viewpoint(told))).findings.seams) == 1


def test_a_path_below_the_base_is_said(scan) -> None:
    _, made = scan
    opengl = made.cloud.X_BC.inverse().points(made.cloud.points) * [1, -1, -1]
    result = plan(PointCloud(points=opengl))
    assert len(result.findings.seams) == 1
    assert any("0.40 m below the robot's base: is the cloud in the base's frame" in note for note in result.notes)
    assert plan(scan[0]).notes == ()


@pytest.mark.parametrize("where", ["under", "on", "beside"])
def test_a_viewpoint_that_cannot_be_is_named_and_the_one_that_is_proposed_works(scan, where: str) -> None:
    cloud, made = scan
    middle, (camera,) = cloud.points.mean(axis=0), cloud.viewpoints
    away = {"under": middle - camera, "on": np.zeros(3), "beside": np.array([4.0, 0.0, 0.0])}[where]
    wrong = seen_from(cloud, *(middle + away))
    assert not plan(wrong).findings.seams
    told = hint(wrong, CellConfig())
    assert {"under": "lies below the surface", "on": "mm from the cloud", "beside": "sees the surface at"}[where] in told
    (seam,) = plan(seen_from(cloud, *named_viewpoint(told))).findings.seams
    assert project(seam.points_B, made.seam.opening_B)[0].max() < 0.001


@pytest.mark.parametrize("viewpoint", [(0.0, -0.45, 0.45), (0.2, -0.3, 0.4), (0.0, -0.75, 0.75), ()])
def test_a_viewpoint_that_may_be_right_is_never_doubted(plain: PointCloud, viewpoint: tuple[float, ...]) -> None:
    cloud = seen_from(plain, *viewpoint)
    assert not plan(cloud).findings.seams
    assert hint(cloud, CellConfig()) == ""


def test_a_thinned_cloud_is_told_the_spacing_and_it_works(scan) -> None:
    cloud, _ = scan
    thinned = voxel_grid(cloud, 0.0065)
    assert not plan(thinned).findings.seams
    told = hint(thinned, CellConfig())
    assert 5.5 < float(told.split("its points lie ")[1].split(" mm")[0]) < 7
    assert "one of 14 mm needs them 2.8 mm apart" in told
    assert len(plan(voxel_grid(cloud, 0.0028)).findings.seams) == 1


def test_points_near_enough_for_wide_grooves_are_told_which_do_not_show(plain: PointCloud) -> None:
    """What is asked of the points is never what they have already."""
    thinned = voxel_grid(plain, 0.0024)
    told = hint(replace(thinned, viewpoints=np.zeros((0, 3)), view=None), CellConfig())
    apart, width = (float(told.split(said)[1].split(" mm")[0]) for said in ("its points lie ", "one under "))
    assert 2.0 <= apart <= 2.8
    assert width == pytest.approx(5 * apart, abs=0.6)
    assert "needs them" not in told


def test_a_voxel_that_hides_the_groove_is_named_and_leaving_it_out_works(scan) -> None:
    cloud, config = scan[0], CellConfig()
    coarse = replace(config, cloud=replace(config.cloud, voxel=0.0065))
    assert not plan(cloud, coarse).findings.seams
    assert hint(cloud, coarse) == "; without cloud.voxel = 6.5 mm a seam is found: make it smaller, or leave it out"
    assert len(plan(cloud, config).findings.seams) == 1
