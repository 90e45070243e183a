"""Frame letters and how transforms compose."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from weldsim.errors import FrameError
from weldsim.frames import LETTERS, Transform


def random_transform(names: str, rng: np.random.Generator) -> Transform:
    return Transform(names, Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3))


def test_letters_are_the_ones_on_the_page():
    assert LETTERS == {"W": "world", "B": "base", "F": "flange", "T": "torch", "C": "camera", "P": "part", "S": "seam"}


@pytest.mark.parametrize("seed", range(5))
def test_x_ab_maps_coordinates_in_b_to_coordinates_in_a(seed):
    rng = np.random.default_rng(seed)
    X_BC = random_transform("BC", rng)
    origin_and_axes_C = np.vstack([np.zeros(3), np.eye(3)])
    in_base = X_BC.points(origin_and_axes_C)
    np.testing.assert_allclose(in_base[0], X_BC.p, atol=1e-12)  # p is C's origin in B
    np.testing.assert_allclose((in_base[1:] - in_base[0]).T, X_BC.R, atol=1e-12)  # columns of R are C's axes in B
    np.testing.assert_allclose(X_BC.matrix @ [0.1, 0.2, 0.3, 1.0], [*X_BC.points(np.array([[0.1, 0.2, 0.3]]))[0], 1.0])


@pytest.mark.parametrize("seed", range(5))
def test_inner_letters_cancel(seed):
    rng = np.random.default_rng(seed)
    X_BF, X_FT = random_transform("BF", rng), random_transform("FT", rng)
    X_BT = X_BF @ X_FT
    points_T = rng.normal(size=(4, 3))
    assert X_BT.names == "BT"
    np.testing.assert_allclose(X_BT.points(points_T), X_BF.points(X_FT.points(points_T)), atol=1e-12)
    np.testing.assert_allclose(X_BT.inverse().points(X_BT.points(points_T)), points_T, atol=1e-12)
    assert X_BT.inverse().names == "TB"


def test_letters_that_do_not_cancel_are_refused():
    for left, right in product(LETTERS, repeat=2):
        a, b = Transform.identity(f"B{left}"), Transform.identity(f"{right}T")
        if left == right:
            assert (a @ b).names == "BT"
        else:
            with pytest.raises(FrameError):
                a @ b
