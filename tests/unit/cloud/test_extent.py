"""Clouds and cameras in another unit, another frame or too large: refused with a remedy, and the remedy works."""

import re
from pathlib import Path

import numpy as np
import pytest

import weldsim
from weldsim.cloud.extent import REACH, check_reach
from weldsim.cloud.files import check_plannable, read_cloud
from weldsim.errors import CloudError
from weldsim.records import PointCloud

RNG = np.random.default_rng(2)


def plate(spacing: float = 0.002) -> np.ndarray:
    x, y = np.meshgrid(np.arange(-0.12, 0.12, spacing), np.arange(-0.53, -0.37, spacing))
    return np.column_stack([x.ravel(), y.ravel(), RNG.normal(0, 0.0003, x.size)])


def room(spacing: float, size: float = 8.0) -> np.ndarray:
    """A floor, a wall, and the plate on its table."""
    a, b = (axis.ravel() for axis in np.meshgrid(np.arange(-size / 2, size / 2, spacing), np.arange(-size / 2, size / 2, spacing)))
    noise = RNG.normal(0, 0.002, a.size)
    return np.vstack([np.column_stack([a, b, noise - 0.75]), np.column_stack([a, noise + size / 2, b]), plate()])


@pytest.mark.parametrize("spacing", [0.015, 0.03])
def test_a_room_in_metres_is_told_to_crop_and_the_options_named_do(tmp_path: Path, spacing: float) -> None:
    np.save(tmp_path / "room.npy", room(spacing))
    with pytest.raises(CloudError) as caught:
        read_cloud(tmp_path / "room.npy")
    assert "; crop it to the workpiece (--set cloud.crop_min=[-1.5,-1.5,-0.5] --set cloud.crop_max=[1.5,1.5,1.5]" in str(
        caught.value
    )
    assert "mm" not in str(caught.value)
    cropped = read_cloud(tmp_path / "room.npy", crop=REACH)
    assert len(cropped) == len(plate())
    check_plannable(cropped)


@pytest.mark.parametrize("spacing", [0.0008, 0.002])
@pytest.mark.parametrize(("unit", "scale"), [("mm", 1e3), ("cm", 100.0), ("in", 1 / 0.0254)])
def test_a_part_in_another_unit_is_told_that_unit_and_it_works(tmp_path: Path, unit: str, scale: float, spacing: float) -> None:
    """Centimetres and inches are too much alike: both are told, with the size that they make of it."""
    np.save(tmp_path / "part.npy", plate(spacing) * scale)
    with pytest.raises(CloudError) as caught:
        read_cloud(tmp_path / "part.npy")
    told = dict(re.findall(r"--units (\w+)(?:, which makes it ([0-9.]+) m)?", str(caught.value)))
    assert unit in told
    assert told.keys() <= {unit} or told.keys() == {"cm", "in"}
    read = read_cloud(tmp_path / "part.npy", unit=unit)  # type: ignore[arg-type]
    check_plannable(read)
    assert not told[unit] or float(told[unit]) == pytest.approx(float(np.ptp(read.points, axis=0).max()), rel=0.01)
    with pytest.raises(CloudError) as caught:
        weldsim.plan(plate(spacing) * scale)
    factors = [float(factor) for factor in re.findall(r"times ([0-9.e-]+)", str(caught.value))]
    assert any(factor * scale == pytest.approx(1.0) for factor in factors)


def test_a_part_in_whole_millimetres_is_told_its_unit_and_it_works(tmp_path: Path) -> None:
    """Many of its points lie in one place: how far the next one is says nothing of how dense it is."""
    np.save(tmp_path / "part.npy", np.round(plate(0.0004) * 1e3).astype(int))
    with pytest.raises(CloudError, match="it looks like millimetres: pass --units mm"):
        read_cloud(tmp_path / "part.npy")
    check_plannable(read_cloud(tmp_path / "part.npy", unit="mm"))


def test_stray_points_are_told_and_cropping_them_works(tmp_path: Path) -> None:
    np.save(tmp_path / "part.npy", np.vstack([plate(), [[40.0, 0, 0], [0, 900.0, 0]]]))
    with pytest.raises(CloudError, match=r"remove the stray ones \(--set cloud.crop_min"):
        read_cloud(tmp_path / "part.npy")
    assert len(read_cloud(tmp_path / "part.npy", crop=REACH)) == len(plate())
    with pytest.raises(CloudError, match="crop box: none of the"):
        read_cloud(tmp_path / "part.npy", crop=([5, 5, 5], [6, 6, 6]))


@pytest.mark.parametrize("away", [12.0, 1000.0])
def test_a_cloud_beyond_every_arm_is_refused(away: float) -> None:
    cloud = PointCloud(points=plate() + np.array([away, 0, 0]))
    with pytest.raises(CloudError, match=r"nearest point is [0-9.]+ m from the robot's base \(limit 3 m\)"):
        check_plannable(cloud)
    check_reach(PointCloud(points=plate() + np.array([2.5, 0, 0])))


@pytest.mark.parametrize(("scale", "meant"), [(1e3, "millimetres"), (100.0, "centimetres")])
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_a_viewpoint_in_another_unit_is_refused_and_the_one_named_works(
    tmp_path: Path, scale: float, meant: str, unit: str
) -> None:
    np.save(tmp_path / "part.npy", plate() * (1e3 if unit == "mm" else 1))
    given = np.array([0.0, -0.45, 0.42]) * scale
    with pytest.raises(CloudError, match=f"--viewpoint 0 -45.* looks like {meant}; .*: --viewpoint 0 -0.45 0.42$"):
        read_cloud(tmp_path / "part.npy", unit=unit, viewpoint=given)  # type: ignore[arg-type]
    read = read_cloud(tmp_path / "part.npy", unit=unit, viewpoint=[0, -0.45, 0.42])  # type: ignore[arg-type]
    np.testing.assert_allclose(read.viewpoints, [[0, -0.45, 0.42]])


def test_a_viewpoint_in_the_file_that_is_elsewhere_is_refused_and_the_option_works(tmp_path: Path) -> None:
    np.savez(tmp_path / "part.npz", points=plate(), viewpoints=np.array([[0.0, -450.0, 420.0]]))
    with pytest.raises(CloudError, match=r"part.npz: the viewpoint in it, \(0, -450, 420\) m,.*--viewpoint 0 -0.45 0.42$"):
        read_cloud(tmp_path / "part.npz")
    assert len(read_cloud(tmp_path / "part.npz", viewpoint=[0, -0.45, 0.42]).viewpoints) == 1


def test_a_cloud_far_away_is_not_blamed_on_its_viewpoint(tmp_path: Path) -> None:
    np.save(tmp_path / "far.npy", plate() + np.array([12.0, 0, 0]))
    with pytest.raises(CloudError, match="nothing an arm reaches"):
        check_plannable(read_cloud(tmp_path / "far.npy", viewpoint=[0, -0.45, 0.42]))
