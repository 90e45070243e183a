"""A seam that joins itself: the torch goes once around, ends as it began, and is judged without ends."""

import numpy as np
import pytest
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.errors import RecordError
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.path.asked import leaned
from weldsim.path.config import PathConfig
from weldsim.path.directions import turn
from weldsim.path.plan import plan_path
from weldsim.records import KnownSeam, Seam
from weldsim.report.metrics import line_error

RADIUS = 0.06


def ring(seed: int, *, cone: float = 0.0, start: float = 0.0) -> tuple[Seam, KnownSeam]:
    """A ring about a random axis, its normals tilted outwards by `cone` [rad]; as found from angle `start`, and as known."""
    rng = np.random.default_rng(seed)
    X = Transform("BP", matrix_from_rotation_vector(rng.normal(size=3) * 0.3), np.array([0.0, -0.45, 0.05]))

    def lines(angle: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        travel = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
        normal = np.sin(cone) * out + np.cos(cone) * np.array([0.0, 0.0, 1.0])
        return X.points(RADIUS * out), X.vectors(travel), X.vectors(normal)

    angle = start + np.linspace(0, 2 * np.pi, 181)
    points, travel, normal = lines(angle)
    points[-1] = points[0]
    noisy = unit(normal + 0.02 * rng.normal(size=normal.shape))
    seam = Seam(points_B=points, s=arc_length(points), tangents_B=travel, normals_B=noisy, closed=True)
    p, t, n = lines(np.linspace(0, 2 * np.pi, 1501))
    side = 0.007 * np.cross(n, t)
    known = KnownSeam(
        opening_B=p, root_B=p - 0.008 * n, left_B=p + side, right_B=p - side, tangents_B=t, bisectors_B=-n, s=arc_length(p)
    )
    return seam, known


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("cone", [0.0, 0.6])
def test_the_torch_ends_as_it_began_and_turns_evenly(seed: int, cone: float) -> None:
    seam, known = ring(seed, cone=cone, start=0.7 * seed)
    path = plan_path(seam)
    X = path.X_BT
    assert np.abs(X.matrix[0] - X.matrix[-1]).max() < 1e-9
    assert path.s[-1] == pytest.approx(seam.length, abs=1e-6)
    axes = X.R[:, :, 2]
    assert turn(axes).max() <= PathConfig().turn_limit * 1e-4 * 1.01
    # One full turn about the ring's own axis, with neither a flip nor a jump where the ends meet.
    around = np.concatenate([X.R[:, :, 0], X.R[1:2, :, 0]])
    assert turn(around).max() < 1.05 * 1e-4 / RADIUS + 1e-3
    error = line_error(X.p, axes, known)
    assert error.coverage > 0.999
    assert error.start == 0.0
    assert abs(error.end) < 1e-4
    assert error.max < 0.1e-3
    assert error.axis_p95 < np.radians(1.0)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("start", [0.0, 2.0, 5.5])
def test_a_part_of_a_ring_is_judged_as_that_part(start: float, reverse: bool) -> None:
    seam, known = ring(3, start=start)
    config = PathConfig(start_trim=0.05, end_trim=0.1, reverse=reverse)
    X = plan_path(seam, config).X_BT
    whole = line_error(X.p, X.R[:, :, 2], known)
    assert whole.coverage == pytest.approx(1 - 0.15 / known.length, abs=0.005)
    assert whole.end == pytest.approx(-0.15, abs=1e-3)
    asked = line_error(X.p, X.R[:, :, 2], known, trims=(0.05, 0.1))
    assert asked.coverage > 0.999
    assert asked.end == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_leaned_torch_around_a_ring_is_compared_with_the_lean_asked_for(reverse: bool) -> None:
    seam, known = ring(1, start=3.0)
    config = PathConfig(work_angle=0.2, travel_angle=-0.15, reverse=reverse)
    path = plan_path(seam, config)
    error = line_error(path.X_BT.p, path.X_BT.R[:, :, 2], leaned(known, path, config))
    assert error.axis_p95 < np.radians(1.0)


def test_ends_apart_are_no_ring() -> None:
    seam, _ = ring(0)
    with pytest.raises(RecordError, match="repeats its first"):
        Seam(
            points_B=seam.points_B[:-1],
            s=seam.s[:-1],
            tangents_B=seam.tangents_B[:-1],
            normals_B=seam.normals_B[:-1],
            closed=True,
        )
