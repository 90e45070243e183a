"""The lens model's derivatives are its differences, and what records of lenses and polylines refuse names its field."""

import numpy as np
import pytest

from weldsim.errors import RecordError
from weldsim.records import CameraIntrinsics, Seam
from weldsim.records.lens import _model, distorted

ALL_TWELVE = (0.1, -0.05, 0.003, -0.002, 0.02, 0.08, -0.03, 0.01, 0.004, -0.003, 0.002, 0.005)


def test_derivatives_of_a_lens_are_the_differences_of_where_it_puts_rays() -> None:
    xy = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    step = 1e-6
    by_x, by_y = (
        (distorted(xy + off, ALL_TWELVE) - distorted(xy - off, ALL_TWELVE)) / (2 * step) for off in step * np.eye(2)[:, None]
    )
    _, found = _model(xy, ALL_TWELVE)
    np.testing.assert_allclose(np.stack(found), np.stack([by_x[:, 0], by_y[:, 0], by_x[:, 1], by_y[:, 1]]), atol=1e-8)


def test_coefficients_that_are_none_and_places_too_few_name_their_field() -> None:
    with pytest.raises(RecordError) as caught:
        CameraIntrinsics(width=64, height=48, fx=60.0, fy=60.0, cx=32.0, cy=24.0, distortion=(0.1, 0.2))
    assert caught.value.data["field"] == "distortion"
    with pytest.raises(RecordError) as caught:
        Seam.along([[0, 0, 0]])
    assert caught.value.data == {"field": "points_B"}


def test_a_seam_along_a_polyline_keeps_which_line_of_which_joint_it_is() -> None:
    seam = Seam.along([[0, 0, 0], [0.1, 0, 0]], reference="root", joint="lap")
    assert (seam.reference, seam.joint) == ("root", "lap")
