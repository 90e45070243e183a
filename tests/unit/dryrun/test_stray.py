"""A single waypoint aside of a smooth line is told; corners, weaves and noise are not."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.torch_paths import torch_path
from weldsim.cli import main
from weldsim.curves import arc_length
from weldsim.dryrun.stray import strays
from weldsim.records import TorchPath

DOWN = np.array([0.0, 0.0, -1.0])
CENTRE = np.array([0.0, -0.45, 0.1])


def path_of(points: np.ndarray) -> TorchPath:
    path = torch_path(CENTRE + np.linspace([0, 0, 0], [0.1, 0, 0], len(points)), DOWN)
    p = CENTRE + points
    return replace(path, X_BT=type(path.X_BT)("BT", path.X_BT.R, p), s=arc_length(p), roll_free=False)


def line(n: int, length: float = 0.2) -> np.ndarray:
    return np.linspace([-length / 2, 0, 0], [length / 2, 0, 0], n)


def arc(n: int, radius: float = 0.1, angle: float = 2.5) -> np.ndarray:
    turn = np.linspace(0, angle, n)
    return radius * np.stack([np.sin(turn), 1 - np.cos(turn), 0.1 * turn], axis=1)


def polygon(corners: np.ndarray, step: float) -> np.ndarray:
    """Waypoints at the corners, and between them about a step apart."""
    rows = [corners[:1]]
    for a, b in pairwise(corners):
        rows.append(np.linspace(a, b, max(1, round(np.linalg.norm(b - a) / step)) + 1)[1:])
    return np.vstack(rows)


def corners_of(*xy: tuple[float, float]) -> np.ndarray:
    return np.array([(x, y, 0.0) for x, y in xy])


RECTANGLE = corners_of((0, 0), (0.12, 0), (0.12, 0.08), (0, 0.08), (0, 0))
TRIANGLE = corners_of((0, 0), (0.12, 0), (0.06, 0.1), (0, 0))
L_SHAPE = corners_of((0, 0.1), (0, 0), (0.1, 0))
HEXAGON = 0.08 * np.array([(np.cos(a), np.sin(a), 0.0) for a in np.linspace(0, 2 * np.pi, 7)])
BLUNT = corners_of((0, 0), (0.1, 0), (0.19, 0.03))
HAIRPIN = corners_of((0, 0), (0.1, 0), (0, 0.012))
STEPS = corners_of((0, 0), (0.05, 0), (0.05, 0.03), (0.1, 0.03), (0.1, 0))


@pytest.mark.parametrize("size", [0.003, 0.01, 0.03, 0.1])
@pytest.mark.parametrize("n", [7, 20, 60, 200])
@pytest.mark.parametrize("shape", [line, arc])
def test_one_waypoint_aside_is_told_wherever_it_is(shape, n, size) -> None:
    exact = shape(n)
    step = float(np.linalg.norm(exact[1] - exact[0]))
    for place in (0, 1, 2, n // 2, n - 3, n - 2, n - 1):
        for direction in (np.array([0, 0, 1.0]), np.array([0, 0.6, -0.8])):
            points = exact.copy()
            points[place] += size * direction
            found = strays(path_of(points))
            if not found and shape is arc and (n == 7 or size < step or place in (0, n - 1)):
                continue  # the arc's own bend between two waypoints is as much
            assert [one.index for one in found] == [place], (place, direction)
            assert found[0].aside == pytest.approx(size, rel=0.3, abs=0.15 * step)


@pytest.mark.parametrize("sigma", [5e-5, 2e-4, 5e-4])
@pytest.mark.parametrize("n", [20, 60, 300, 1500])
def test_one_among_waypoints_that_scatter_is_told_and_scatter_is_not(n, sigma) -> None:
    rng = np.random.default_rng(n)
    for shape in (line, arc):
        for _ in range(10):
            points = shape(n) + sigma * rng.normal(size=(n, 3))
            assert strays(path_of(points)) == []
            place = int(rng.integers(3, n - 3))
            points[place] += [0, 0, 0.03]
            assert [one.index for one in strays(path_of(points))] == [place]


@pytest.mark.parametrize("step", [1.0, 0.03, 0.01, 0.0037, 0.001])
@pytest.mark.parametrize("corners", [RECTANGLE, TRIANGLE, L_SHAPE, HEXAGON, BLUNT, HAIRPIN, STEPS])
def test_corners_are_not_told(corners, step) -> None:
    points = polygon(corners, step)
    rng = np.random.default_rng(1)
    assert strays(path_of(points)) == []
    assert strays(path_of(points[::-1])) == []
    for sigma in (1e-4, 4e-4):
        assert strays(path_of(points + sigma * rng.normal(size=points.shape))) == []


@pytest.mark.parametrize("count", [9, 20, 41, 120])
@pytest.mark.parametrize("wide", [0.002, 0.005, 0.02])
@pytest.mark.parametrize("legs", [1, 2, 3, 5])
def test_weaves_and_zigzags_are_not_told(count, wide, legs) -> None:
    u = np.arange(count) / legs
    for across in (
        wide * (2 * np.abs((u + 0.5) % 2 - 1) - 1),  # triangles
        wide * np.sin(np.pi * u),
        wide * np.sign(np.sin(np.pi * (np.arange(count) // legs + 0.5))),  # steps
    ):
        points = np.stack([0.004 * u, across, 0 * u], axis=1)
        assert strays(path_of(points)) == []


def test_the_same_again_and_again_is_a_pattern() -> None:
    points = line(21)
    points[3::3, 2] += 0.02
    assert strays(path_of(points)) == []


def test_waypoints_in_the_wrong_order_and_uneven_ones_are_not_aside() -> None:
    order = [0, 1, 2, 4, 3, 5, 6, 9, 8, 7, *range(10, 20)]
    assert strays(path_of(line(20)[order])) == []
    rng = np.random.default_rng(3)
    for _ in range(20):
        x = np.sort(rng.uniform(-0.1, 0.1, 15))
        assert strays(path_of(np.stack([x, 0.5 * x**2, 0 * x], axis=1))) == []


def test_the_note_names_the_row_and_the_distance(tmp_path, capsys) -> None:
    points = CENTRE + line(12, 0.11)
    points[7, 1] += 0.03
    rows = np.column_stack([points, np.tile([0.0, 3.14159, 0.0], (12, 1))])
    file = tmp_path / "poses.csv"
    np.savetxt(file, rows, delimiter=",", header="x,y,z,rx,ry,rz", comments="", fmt="%.6f")
    assert main(["dry-run", str(file), "--tool", "torch", "--no-fix"]) == 0
    told = "  poses: pose 7 (line 9) lies 30.0 mm aside of the line through its neighbours; is it where it is meant to be?"
    assert told in capsys.readouterr().out.splitlines()
    rows[7, 1] -= 0.03
    np.savetxt(file, rows, delimiter=",", header="x,y,z,rx,ry,rz", comments="", fmt="%.6f")
    assert main(["dry-run", str(file), "--tool", "torch", "--no-fix"]) == 0
    assert "aside" not in capsys.readouterr().out
