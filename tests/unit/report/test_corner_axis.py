"""The wire-axis figure about a corner of the known seam, which every line must round."""

import numpy as np
import pytest

from weldsim.report.metrics import axis_angle


def wire(turned: np.ndarray) -> np.ndarray:
    """Unit axes pointing down, turned about y by these angles [rad]."""
    return np.stack([np.sin(turned), np.zeros_like(turned), -np.cos(turned)], axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_about_a_corner_the_wire_may_point_between_both_sides(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bend, lean = rng.uniform(0.6, 1.6), rng.uniform(0.05, 0.3)
    s, at = np.linspace(0.0, 0.2, 201), np.linspace(0.0, 0.2, 400)
    bisectors = wire(np.where(s < 0.1, 0.0, bend))
    rounded = wire(bend * np.clip((at - 0.092) / 0.016, 0.0, 1.0))
    assert axis_angle(rounded, at, s, bisectors).max() < 0.02
    leaned = np.cos(lean) * rounded + np.sin(lean) * np.array([0.0, 1.0, 0.0])
    assert np.abs(axis_angle(leaned, at, s, bisectors) - lean).max() < 0.02, "out of the corner's plane counts in full"
    straight_on = axis_angle(wire(np.zeros(400)), at, s, bisectors)
    assert np.abs(straight_on[at > 0.13] - bend).max() < 0.02, "beyond the corner its own bisector counts"
