"""The chart and its valleys: planes are affine in it, and only what dips between two higher sides is a valley."""

from collections.abc import Callable

import numpy as np
import pytest

from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import PointCloud
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.chart import make_chart
from weldsim.seam.profile.valley import trace_valleys, valley_images

CONFIG = ProfileConfig()
Height = Callable[[np.ndarray, np.ndarray], np.ndarray]


def sheet(
    height: Height, rng: np.random.Generator, *, tilt: float = 0.0, noise: float = 5e-5, viewpoint: bool = True
) -> PointCloud:
    """A 200 x 160 mm sheet of points with heights `height(x, y)`, tilted, half a metre under a camera."""
    x, y = np.meshgrid(np.arange(-0.1, 0.1, 7e-4), np.arange(-0.08, 0.08, 7e-4))
    x, y = x.ravel() + rng.uniform(-2e-4, 2e-4, x.size), y.ravel() + rng.uniform(-2e-4, 2e-4, x.size)
    points = np.stack([x, y, height(x, y) + rng.normal(0.0, noise, x.size)], axis=1)
    X = Transform("BB", matrix_from_rotation_vector(tilt * np.array([0.6, 0.8, 0.0])), np.array([0.1, -0.4, 0.02]))
    views = np.array([[0.1, -0.4, 0.52]]) if viewpoint else np.empty((0, 3))
    return PointCloud(points=X.points(points), viewpoints=views)


def lines(cloud: PointCloud, config: ProfileConfig = CONFIG) -> list:
    chart = make_chart(cloud)
    return [line for line in trace_valleys(valley_images(chart, config), config) if line.level >= 0.5]


def v_groove(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return -0.006 * np.maximum(1 - np.abs(y) / 0.007, 0)


NO_VALLEYS: dict[str, Height] = {
    "plane": lambda x, y: 0 * x,
    "step": lambda x, y: np.where(y > 0, 0.004, 0.0),
    "slanted step": lambda x, y: np.where(y > 0.4 * x, 0.012, 0.0),
    "ridge": lambda x, y: 0.006 * np.maximum(1 - np.abs(y) / 0.007, 0),
    "block": lambda x, y: np.where((np.abs(x) < 0.03) & (np.abs(y) < 0.02), 0.015, 0.0),
    "plate on a table": lambda x, y: np.where((np.abs(x) < 0.06) & (np.abs(y) < 0.05), 0.02, 0.0),
    "hump": lambda x, y: -(y**2) / 0.4,
    "roof": lambda x, y: -0.3 * np.abs(y),
}


@pytest.mark.parametrize("viewpoint", [True, False])
@pytest.mark.parametrize("tilt", [0.0, 0.25, 0.5])
def test_a_plane_of_any_tilt_is_affine_in_the_chart(tilt: float, viewpoint: bool) -> None:
    chart = make_chart(sheet(NO_VALLEYS["plane"], np.random.default_rng(0), tilt=tilt, noise=0.0, viewpoint=viewpoint))
    row, column = np.nonzero(chart.valid)
    design = np.stack([row, column, np.ones(len(row))], axis=1)
    height = chart.height[row, column]
    rest = height - design @ np.linalg.lstsq(design, height, rcond=None)[0]
    # Points lie anywhere in their cells: half a cell's slope is the most a cell's mean can be off.
    assert np.abs(rest).max() < 0.75 * chart.pitch * np.tan(tilt) + 1e-6
    assert rest.std() < 0.25 * chart.pitch * np.tan(tilt) + 1e-6


@pytest.mark.parametrize("viewpoint", [True, False])
def test_chart_cells_lead_back_to_their_points(viewpoint: bool) -> None:
    cloud = sheet(v_groove, np.random.default_rng(1), tilt=0.2, viewpoint=viewpoint)
    chart = make_chart(cloud)
    inside = chart.cell >= 0
    assert inside.mean() > 0.99
    h, w = chart.height.shape
    row, column = np.divmod(chart.cell[inside], w)
    assert row.max() < h
    back = chart.to_space(column.astype(float), row.astype(float), chart.height[row, column])
    assert np.linalg.norm(back - cloud.points[inside], axis=1).max() < 1.6 * chart.pitch


@pytest.mark.parametrize("shape", NO_VALLEYS)
@pytest.mark.parametrize("tilt", [0.0, 0.35])
def test_planes_steps_and_edges_are_no_valleys(shape: str, tilt: float) -> None:
    for seed in range(2):
        assert not lines(sheet(NO_VALLEYS[shape], np.random.default_rng(seed), tilt=tilt))


@pytest.mark.parametrize("tilt", [0.0, 0.3])
@pytest.mark.parametrize("viewpoint", [True, False])
def test_a_groove_is_a_valley_along_its_middle(tilt: float, viewpoint: bool) -> None:
    cloud = sheet(v_groove, np.random.default_rng(2), tilt=tilt, viewpoint=viewpoint)
    found = lines(cloud)
    assert len(found) == 1
    X = Transform("BB", matrix_from_rotation_vector(tilt * np.array([0.6, 0.8, 0.0])), np.array([0.1, -0.4, 0.02]))
    local = X.inverse().points(found[0].points)
    assert np.abs(local[:, 1]).max() < 0.004
    assert np.ptp(local[:, 0]) > 0.17
    assert np.abs(local[10:-10, 2]).max() < 0.002, "on the lid, which is the parent surface"


def test_two_parallel_grooves_are_two_lines() -> None:
    cloud = sheet(lambda x, y: v_groove(x, y - 0.03) + v_groove(x, y + 0.03), np.random.default_rng(3))
    middles = sorted(float(np.median(line.points[:, 1])) + 0.4 for line in lines(cloud))
    np.testing.assert_allclose(middles, [-0.03, 0.03], atol=0.002)


def test_the_threshold_follows_the_noise_and_the_factor() -> None:
    values, config = [], ProfileConfig(min_depth=1e-6)
    for noise in (1e-4, 8e-4):
        chart = make_chart(sheet(NO_VALLEYS["plane"], np.random.default_rng(4), noise=noise))
        image = valley_images(chart, config)[0]
        values.append(image.threshold)
        assert valley_images(chart, config, 1.4)[0].threshold == pytest.approx(1.4 * image.threshold)
        assert (image.depth >= 0).all()
        assert (image.lined[~chart.valid] == 0).all()
    assert values[1] > 3 * values[0]
