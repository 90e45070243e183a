"""Rails: coordinates along a curve and back, and sight lines in them."""

import numpy as np
import pytest

from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.seam.profile.rail import lay_out, make_rail, shift_rail


def arc(radius: float = 0.3, length: float = 0.24, n: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """A flat arc and its plane's normal."""
    angle = np.linspace(-0.5, 0.5, n) * length / radius
    return radius * np.stack([np.sin(angle), np.cos(angle) - 1, 0 * angle], axis=1), np.tile([0.0, 0.0, 1.0], (n, 1))


def bent(radius: float = 0.25, length: float = 0.2, n: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """A line over a cylinder about y, and the cylinder's normals."""
    angle = np.linspace(-0.5, 0.5, n) * length / radius
    normals = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    return radius * normals, normals


@pytest.mark.parametrize("curve", [arc, bent])
def test_coordinates_of_made_points_are_read_back(curve) -> None:
    rng = np.random.default_rng(0)
    X = Transform("BB", matrix_from_rotation_vector(rng.normal(size=3)), rng.normal(size=3))
    line, normals = curve()
    rail = make_rail(X.points(line), X.vectors(normals), 0.001)
    np.testing.assert_allclose(np.linalg.norm(np.diff(rail.points, axis=0), axis=1), 0.001, rtol=1e-3)
    station = rng.integers(5, len(rail) - 5, 4000)
    x, h = rng.uniform(-0.03, 0.03, 4000), rng.uniform(-0.008, 0.008, 4000)
    points = rail.points[station] + x[:, None] * rail.e[station] + h[:, None] * rail.n[station]
    strip = lay_out(rail, points, None)
    np.testing.assert_allclose(strip.x, x, atol=3e-5)
    np.testing.assert_allclose(strip.h, h, atol=3e-5)
    np.testing.assert_allclose(strip.s, station * rail.step, atol=3e-5)
    assert np.isinf(strip.above).all()


def test_coordinates_are_continuous_between_stations() -> None:
    """On an arc, a point carried round at a fixed distance keeps its lateral coordinate to a hundredth of a millimetre."""
    line, normals = arc()
    rail = make_rail(line, normals, 0.001)
    angle = np.linspace(-0.35, 0.35, 5000)
    for offset in (-0.025, 0.01, 0.025):
        radius = 0.3 + offset
        points = np.stack([radius * np.sin(angle), radius * np.cos(angle) - 0.3, 0 * angle], axis=1)
        strip = lay_out(rail, points, None)
        np.testing.assert_allclose(strip.x, offset, atol=2e-5)
        assert np.abs(np.diff(strip.s, n=2)).max() < 1.2e-4


def test_the_axes_are_right_handed_and_unit() -> None:
    line, normals = arc()
    tilted = unit(normals + np.random.default_rng(1).normal(0, 0.05, (1, 3)))
    rail = make_rail(line, tilted, 0.001, extend=0.015)
    for axes in (rail.t, rail.e, rail.n):
        np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(rail.t, rail.e), rail.n, atol=1e-9)
    assert (len(rail) - 1) * rail.step == pytest.approx(0.24 + 0.030, abs=0.003)


def test_sight_lines_are_those_of_the_camera() -> None:
    """Following a point's sight line inward by 1 mm moves it by `slope` millimetres along and across."""
    rng = np.random.default_rng(2)
    line, normals = bent()
    rail = make_rail(line, normals, 0.001)
    origin = np.array([0.05, 0.08, 0.6])
    station = rng.integers(20, len(rail) - 20, 500)
    points = rail.points[station] + rng.uniform(-0.01, 0.01, 500)[:, None] * rail.e[station]
    sight = unit(points - origin)
    strip = lay_out(rail, points, np.tile(origin, (500, 1)))
    inward = -np.einsum("ij,ij->i", sight, rail.n[strip.station])
    further = lay_out(rail, points + sight * (0.001 / inward)[:, None], np.tile(origin, (500, 1)))
    np.testing.assert_allclose(further.x - strip.x, 0.001 * strip.slope[:, 1], atol=1e-5)
    np.testing.assert_allclose(further.s - strip.s, 0.001 * strip.slope[:, 0], atol=2e-5)
    np.testing.assert_allclose(strip.above, np.linalg.norm(origin - points, axis=1) * inward, atol=2e-3)


def test_shifting_there_and_back_is_no_shift() -> None:
    line, normals = arc()
    rail = make_rail(line, normals, 0.001)
    x = 0.002 * np.sin(np.linspace(0, 3, len(rail)))
    none = np.zeros(len(rail))
    moved = shift_rail(rail, x, none + 0.001, none, respace=False)
    back = shift_rail(moved, none, none - 0.001, none, respace=False)
    distance = np.abs(lay_out(rail, back.points, None).x - x)
    assert distance[5:-5].max() < 2e-5


@pytest.mark.parametrize("turns", [0.3, 1.5])
def test_the_nearest_station_is_the_nearest(turns: float) -> None:
    """Also on a rail that turns back on itself."""
    rng = np.random.default_rng(3)
    angle = np.linspace(0, turns * np.pi, 400)
    line = 0.08 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    rail = make_rail(line, np.tile([0.0, 0.0, 1.0], (400, 1)), 0.001)
    points = line[rng.integers(0, 400, 2000)] + rng.uniform(-0.02, 0.02, (2000, 3))
    strip = lay_out(rail, points, None)
    distance = np.linalg.norm(points[:, None] - rail.points[None], axis=2)
    found = np.linalg.norm(points - rail.points[strip.station], axis=1)
    assert (found - distance.min(axis=1)).max() < 2e-4
