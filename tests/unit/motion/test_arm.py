"""Rough clearances of the stretched arm in closed form: where the centre lines lie, what counts and what does not."""

import numpy as np
import pytest

from weldsim.frames import Transform
from weldsim.kinematics import A2, A3, D1, D4, D5, D6, flange_pose
from weldsim.motion.arm import clearances

STRETCHED = np.zeros(6)
"""Upper arm and forearm lie along minus x of B at height D1, the elbow's axis and the flange's z along minus y."""
DEEP = -10.0  # [m] a table far below
UPPER, FORE = -0.136, -0.016  # [m] y of the two centre lines
ASIDE = 0.04  # [m]


def clearance(tip: np.ndarray, q: np.ndarray = STRETCHED, floor: float = DEEP) -> float:
    """With a torch whose tip is at a place in B [m]."""
    X_BF = flange_pose(q)
    return float(clearances(q[None], floor, Transform("FT", np.eye(3), X_BF.inverse().points(tip[None])[0]))[0])


def test_the_flange_of_the_stretched_arm() -> None:
    X_BF = flange_pose(STRETCHED)
    np.testing.assert_allclose(X_BF.p, [A2 + A3, -D4 - D6, D1 - D5], atol=1e-12)
    np.testing.assert_allclose(X_BF.R[:, 1], [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("eighths", range(8))
def test_a_tip_beside_the_forearm_is_as_far_from_its_centre_line(eighths: int) -> None:
    place = np.array([A2 + A3 * eighths / 8, FORE - ASIDE, D1])
    assert clearance(place) == pytest.approx(ASIDE, abs=1e-12)


@pytest.mark.parametrize("eighths", range(9))
def test_a_tip_beside_the_upper_arm_is_as_far_from_its_centre_line(eighths: int) -> None:
    place = np.array([A2 * eighths / 8, UPPER - ASIDE, D1])
    assert clearance(place) == pytest.approx(ASIDE, abs=1e-12)


def test_the_end_of_the_forearm_counts_as_wrist() -> None:
    place = np.array([A2 + A3, FORE - ASIDE, D1])
    assert clearance(place) == pytest.approx(np.hypot(A3 / 8, ASIDE), abs=1e-12)


def test_what_is_lowest_is_above_the_table() -> None:
    """Of the stretched arm the camera, 116.1 mm below the flange; with the elbow down and the forearm up, the elbow."""
    away = np.array([A2 + A3, -1.0, D1])
    assert clearance(away, floor=-0.2) == pytest.approx(D1 - D5 - 0.1161 + 0.2, abs=1e-12)
    down = np.array([0.0, 0.5, -1.5, 0.0, 0.0, 0.0])
    assert clearance(away, down, floor=-0.2) == pytest.approx(D1 + A2 * np.sin(0.5) + 0.2, abs=1e-12)
