"""Seams: arc length, left and right, normals, bisectors and references."""

from typing import get_args

import numpy as np
import pytest

from weldsim.curves import arc_length, tangents
from weldsim.errors import RecordError
from weldsim.path.asked import wire_tip
from weldsim.path.config import PathConfig
from weldsim.path.plan import plan_path
from weldsim.records import KnownSeam, LineError, Reference, Seam, Segment, TorchPath
from weldsim.scene.config import SceneConfig, make_workpiece, part_pose
from weldsim.scene.files import scene_path
from weldsim.schema import structure


def known_seams(name: str) -> list[KnownSeam]:
    import tomllib

    config = structure(tomllib.loads(scene_path(name).read_text()), SceneConfig, where=name)
    part = make_workpiece(config)
    return [curve.in_base(part_pose(config.pose, part)) for curve in part.seam_curves()]


def a_seam(**changes: object) -> Seam:
    points = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.02, 0.0, 0.0]])
    fields = {
        "points_B": points,
        "s": arc_length(points),
        "tangents_B": tangents(points),
        "normals_B": np.tile([0.0, 0.0, 1.0], (3, 1)),
    }
    return Seam(**{**fields, **changes})


def test_arc_length_is_the_sum_of_chords_from_the_first_point():
    angle = np.linspace(0, np.pi, 2001)
    half_circle = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    s = arc_length(half_circle)
    assert s[0] == 0
    assert s[-1] == pytest.approx(0.1 * np.pi, rel=1e-6)
    np.testing.assert_allclose(np.diff(s), np.linalg.norm(np.diff(half_circle, axis=0), axis=1), atol=1e-15)


def test_arc_length_of_a_seam_increases():
    assert a_seam().length == pytest.approx(0.02)
    with pytest.raises(RecordError):
        a_seam(s=np.array([0.0, 0.01, 0.01]))


@pytest.mark.parametrize("scene", ["straight", "curve"])
def test_tangents_point_along_travel(scene):
    for seam in known_seams(scene):
        travel = np.diff(seam.opening_B, axis=0)
        assert (np.einsum("ij,ij->i", travel, seam.tangents_B[:-1]) > 0).all()


@pytest.mark.parametrize("scene", ["straight", "curve"])
def test_left_is_left_along_travel_with_the_normal_up(scene):
    for seam in known_seams(scene):
        leftwards = np.cross(-seam.bisectors_B, seam.tangents_B)
        assert (np.einsum("ij,ij->i", seam.left_B - seam.opening_B, leftwards) > 0).all()
        assert (np.einsum("ij,ij->i", seam.right_B - seam.opening_B, leftwards) < 0).all()


@pytest.mark.parametrize("scene", ["straight", "curve"])
def test_bisectors_point_into_the_groove(scene):
    for seam in known_seams(scene):
        assert (np.einsum("ij,ij->i", seam.root_B - seam.opening_B, seam.bisectors_B) > 0).all()


@pytest.mark.parametrize("scene", ["straight", "curve"])
def test_opening_is_the_midpoint_of_the_lips_at_most_half_a_millimetre_apart(scene):
    for seam in known_seams(scene):
        np.testing.assert_allclose(seam.opening_B, (seam.left_B + seam.right_B) / 2, atol=1e-9)
        assert np.diff(seam.s).max() <= 0.5e-3 + 1e-9
        np.testing.assert_allclose(seam.s, arc_length(seam.opening_B), atol=2e-6)


def test_every_figure_says_its_reference():
    assert get_args(Reference) == ("opening", "root", "gap_mid")
    assert a_seam().reference == "opening"
    figures = {name: 0.0 for name in LineError.__annotations__ if name not in ("reference", "closed")}
    assert LineError(**figures).reference == "opening"


def test_positive_work_angle_leans_the_torch_to_the_right():
    path = plan_path(a_seam(), PathConfig(work_angle=0.3))  # along x on a level plate
    torch_body = -path.X_BT.R[:, :, 2]
    assert torch_body[:, 1] == pytest.approx(-np.sin(0.3))


def test_positive_travel_angle_pushes():
    path = plan_path(a_seam(), PathConfig(travel_angle=0.3))
    assert path.X_BT.R[:, 0, 2] == pytest.approx(np.sin(0.3))


def test_longer_ctwd_leaves_the_tip_of_the_wire_on_the_seam():
    config = PathConfig(travel_angle=0.3, ctwd=0.019, nominal_ctwd=0.015)
    path = plan_path(a_seam(), config)
    back = path.X_BT.p + 0.004 * path.X_BT.R[:, :, 2]
    np.testing.assert_allclose(back[[0, -1]], a_seam().points_B[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(wire_tip(path.X_BT, config).p, back, atol=1e-12)


def test_the_arc_burns_in_weld_alone():
    from weldsim.frames import Transform

    path = {"X_BT": Transform("BT", np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))), "s": np.zeros(2), "speed": np.ones(2)}
    welding = TorchPath(**path, arc_on=np.ones(2, bool), segments=(Segment.WELD, Segment.WELD))
    assert welding.weld == slice(0, 2)
    with pytest.raises(RecordError):
        TorchPath(**path, arc_on=np.ones(2, bool), segments=(Segment.WELD, Segment.AIR))
