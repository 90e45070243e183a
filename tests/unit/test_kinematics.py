"""The standard DH table that a controller tells is the same arm as our modified one, and no inverse branch is lost."""

import numpy as np
import pytest

from weldsim.kinematics import DH, flange_pose, inverse


def test_standard_and_modified_dh_give_the_same_flange() -> None:
    rng = np.random.default_rng(0)
    for q in rng.uniform(-2 * np.pi, 2 * np.pi, (50, 6)):
        X = np.eye(4)
        for (offset, a, d, alpha), angle in zip(DH, q, strict=True):
            c, s = np.cos(angle + offset), np.sin(angle + offset)
            ca, sa = np.cos(alpha), np.sin(alpha)
            X = X @ np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
        assert np.abs(X - flange_pose(q).matrix).max() < 1e-12


@pytest.mark.parametrize(
    "wrist", [(-np.pi / 2, 0.0), (np.pi / 2, 0.0), (-np.pi / 2, np.pi), (np.pi / 2, np.pi / 2), (-np.pi / 4, 0.0)]
)
@pytest.mark.parametrize("down", [False, True])
def test_no_branch_is_lost_where_angles_are_round(wrist: tuple[float, float], down: bool) -> None:
    rng = np.random.default_rng(1)
    for _ in range(30):
        q = np.array([rng.uniform(-np.pi, np.pi), rng.uniform(-2.2, -0.8), rng.uniform(0.4, 2.2), rng.uniform(-2, 2), *wrist])
        if down:  # the tool points straight at the table
            q[3] = -np.pi / 2 - q[1] - q[2]
        if rng.random() < 0.5:
            q[0] = np.round(q[0] / (np.pi / 2)) * np.pi / 2
        found = inverse(flange_pose(q))
        off = np.remainder(found - q + np.pi, 2 * np.pi) - np.pi
        assert np.abs(off).max(axis=1).min() < 1e-6
        assert np.abs(flange_pose(found).matrix - flange_pose(q).matrix).max() < 1e-9
        assert np.abs(found).max() <= np.pi + 1e-12
