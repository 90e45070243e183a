"""The native loop over points beside a rail: the same as its definition, written out for one point at a time."""

import numpy as np
import pytest

from weldsim.curves import arc_length
from weldsim.frames import unit
from weldsim.seam.profile.rail import Rail, lay_out, make_rail


def bent_rail(turns: float) -> Rail:
    """An arc of 0.2 m that turns by so many radians, on a surface that leans."""
    angle = np.linspace(0, turns, 60)
    radius = 0.2 / turns
    line = np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), 0.1 + 0.05 * angle], axis=1)
    return make_rail(line, np.tile(unit(np.array([0.1, -0.2, 1.0])), (len(line), 1)), 0.001)


@pytest.mark.parametrize("turns", [0.3, 1.0, 4.0])  # the last one turns back on its chord
@pytest.mark.parametrize("seen", [False, True])
def test_points_are_laid_out_as_defined(turns, seen):
    rail = bent_rail(turns)
    rng = np.random.default_rng(3)
    at = rng.integers(0, len(rail), 400)
    points = rail.points[at] + rng.normal(0, [0.004, 0.004, 0.002], (400, 3))
    origin = np.array([0.05, -0.1, 0.5])
    strip = lay_out(rail, points, np.broadcast_to(origin, points.shape) if seen else None)
    distance = np.linalg.norm(points[:, None] - rail.points, axis=2)
    # A walk along the tangents ends at a station than which no neighbour is nearer along the rail.
    assert (distance[np.arange(400), strip.station] <= distance.min(axis=1) + 2e-5).all()
    for k in range(400):
        j = int(strip.station[k])
        along = float((points[k] - rail.points[j]) @ rail.t[j])
        other = int(np.clip(j + (1 if along > 0 else -1), 0, len(rail) - 1))
        u = min(abs(along) / rail.step, 1.0)
        base, e, n = (axis[j] * (1 - u) + axis[other] * u for axis in (rail.points, rail.e, rail.n))
        assert (strip.s[k], strip.x[k], strip.h[k]) == pytest.approx(
            (j * rail.step + along, (points[k] - base) @ e, (points[k] - base) @ n), abs=1e-12
        )
        if seen:
            sight = unit(points[k] - origin)
            inward = max(-float(sight @ n), 0.2)
            assert strip.slope[k] == pytest.approx([sight @ rail.t[j] / inward, sight @ e / inward], abs=1e-12)
            assert strip.above[k] == pytest.approx((origin - base) @ n, abs=1e-12)
    if not seen:
        assert not strip.slope.any()
        assert np.isinf(strip.above).all()


def test_points_far_off_the_ends_belong_to_the_ends():
    rail = bent_rail(0.3)
    ends = np.stack([rail.points[0] - 0.3 * rail.t[0], rail.points[-1] + 0.3 * rail.t[-1]])
    strip = lay_out(rail, ends, None)
    assert strip.station.tolist() == [0, len(rail) - 1]
    assert strip.s == pytest.approx([-0.3, arc_length(rail.points)[-1] + 0.3], abs=1e-4)
