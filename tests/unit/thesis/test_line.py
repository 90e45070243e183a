"""From boundary points to an ordered line: partners, thinning, ordering, axes."""

import numpy as np
import pytest
from numpy import ndarray

from weldsim.curves import project
from weldsim.frames import matrix_from_rotation_vector, unit
from weldsim.seam.thesis.axes import plane_normals, travel
from weldsim.seam.thesis.midpoints import midpoints
from weldsim.seam.thesis.order import walk_both_ways
from weldsim.seam.thesis.thin import thin


def curve(kind: int, n: int = 80) -> ndarray:
    """A line in space about 0.2 m long: straight, arc, s."""
    t = np.linspace(-1, 1, n)
    return np.stack([0.1 * t, [0 * t, 0.04 * t**2, 0.02 * np.sin(3 * t)][kind], 0.01 * t], axis=1)


@pytest.mark.parametrize("seed", range(6))
def test_midpoints_of_two_edges_lie_on_their_middle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gap, R, p = rng.uniform(0.008, 0.04), matrix_from_rotation_vector(rng.normal(0, 1, 3)), rng.uniform(-1, 1, 3)
    x = np.arange(0, 0.15, 0.001) + rng.uniform(-2e-4, 2e-4, 150)
    edges = np.concatenate([np.stack([x, np.full_like(x, side * gap / 2), 0 * x], 1) for side in (1, -1)])
    middle = (midpoints(edges @ R.T + p, 0.001, 0.05, 5 * np.pi / 180) - p) @ R
    assert len(middle) > 0.9 * len(edges)
    np.testing.assert_allclose(middle[:, 1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("gap", [0.051, 0.08])
def test_no_partner_beyond_the_limit(gap: float) -> None:
    x = np.arange(0, 0.15, 0.001)
    edges = np.concatenate([np.stack([x, np.full_like(x, y), 0 * x], 1) for y in (0.0, gap)])
    assert len(midpoints(edges, 0.001, 0.05, 5 * np.pi / 180)) == 0


def test_a_single_edge_has_no_midpoints() -> None:
    x = np.arange(0, 0.15, 0.001)
    assert len(midpoints(np.stack([x, 0 * x, 0 * x], 1), 0.001, 0.05, 5 * np.pi / 180)) == 0
    assert len(midpoints(np.zeros((0, 3)), 0.001, 0.05, 0.1)) == 0
    assert len(midpoints(np.zeros((4, 3)), 0.001, 0.05, 0.1)) == 0  # one point four times


@pytest.mark.parametrize("kind", range(3))
@pytest.mark.parametrize("seed", range(3))
def test_thinning_draws_a_cloud_onto_its_line(kind: int, seed: int) -> None:
    line = curve(kind, 1000)
    raw = line + np.random.default_rng(seed).normal(0, 4e-4, line.shape)
    knots = thin(raw, 0.003, 50, 0.003)
    assert len(knots) < len(raw) / 8
    assert project(knots, line)[0].max() < 6e-4
    assert thin(raw, 0.003, 0, 0.003).shape[1] == 3  # no pass: the voxel grid alone


@pytest.mark.parametrize("kind", range(3))
@pytest.mark.parametrize("seed", range(5))
def test_ordering_recovers_a_shuffled_curve(kind: int, seed: int) -> None:
    line = curve(kind)
    shuffle = np.random.default_rng(seed).permutation(len(line))
    walk = shuffle[walk_both_ways(line[shuffle], 0.03)]
    assert np.array_equal(walk, np.arange(80)) or np.array_equal(walk, np.arange(80)[::-1])


@pytest.mark.parametrize("seed", range(20))
def test_ordering_ends_and_visits_no_point_twice(seed: int) -> None:
    rng = np.random.default_rng(seed)
    if seed % 2:  # a closed ring, on which the published walk goes round for ever
        angle = np.sort(rng.uniform(0, 2 * np.pi, 150))
        points = 0.05 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    else:
        points = rng.uniform(0, 0.1, (200, 3))
    walk = walk_both_ways(points, 0.03)
    assert len(set(walk)) == len(walk) <= len(points)
    assert np.linalg.norm(np.diff(points[walk], axis=0), axis=1).max(initial=0.0) <= 0.03


def test_ordering_stops_at_a_gap() -> None:
    line = curve(0)
    broken = np.concatenate([line[:50], line[70:]])
    walk = walk_both_ways(broken, 0.03)
    assert set(walk) == set(range(50))


@pytest.mark.parametrize("n", [0, 1, 2])
def test_ordering_of_next_to_nothing(n: int) -> None:
    assert len(walk_both_ways(np.zeros((n, 3)) + 0.001 * np.arange(n)[:, None], 0.03)) == n


@pytest.mark.parametrize("seed", range(5))
def test_axes_of_a_plane(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R = matrix_from_rotation_vector(rng.normal(0, 1, 3))
    plane = np.column_stack([rng.uniform(-0.1, 0.1, (4000, 2)), np.zeros(4000)]) @ R.T
    line = curve(0, 30) * [1, 1, 0] @ R.T
    normal = plane_normals(line, plane, 0.012)
    np.testing.assert_allclose(np.abs(normal @ R[:, 2]), 1.0, atol=1e-9)
    np.testing.assert_allclose(travel(line), np.broadcast_to(unit(line[-1] - line[0]), line.shape), atol=1e-9)
    far = plane_normals(line + 0.05 * R[:, 2], plane, 0.012)  # nothing within reach: the three nearest
    np.testing.assert_allclose(np.abs(far @ R[:, 2]), 1.0, atol=1e-6)
