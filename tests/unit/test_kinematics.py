"""The standard DH table that a controller tells is the same arm as our modified one."""

import numpy as np

from weldsim.kinematics import DH, flange_pose


def test_standard_and_modified_dh_give_the_same_flange() -> None:
    rng = np.random.default_rng(0)
    for q in rng.uniform(-2 * np.pi, 2 * np.pi, (50, 6)):
        X = np.eye(4)
        for (offset, a, d, alpha), angle in zip(DH, q, strict=True):
            c, s = np.cos(angle + offset), np.sin(angle + offset)
            ca, sa = np.cos(alpha), np.sin(alpha)
            X = X @ np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
        assert np.abs(X - flange_pose(q).matrix).max() < 1e-12
