"""Records check themselves: each field that is wrong is refused by its name, what is at the limit is kept, arrays are frozen."""

from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any

import numpy as np
import pytest

from weldsim.errors import RecordError
from weldsim.frames import Transform
from weldsim.records import (
    CameraIntrinsics,
    DepthFrame,
    ExecutionLog,
    JointTrajectory,
    KnownSeam,
    PointCloud,
    RobotFacts,
    RobotState,
    Seam,
    SeamFindings,
    Segment,
    TorchPath,
)
from weldsim.records.checks import check_increasing, check_metres, check_unit, require, store

N = 4
LINE = np.stack([0.01 * np.arange(N), np.zeros(N), np.zeros(N)], axis=1)
S = 0.01 * np.arange(N)
X, Z = np.tile([1.0, 0.0, 0.0], (N, 1)), np.tile([0.0, 0.0, 1.0], (N, 1))
SIX, MANY = np.zeros(6), np.zeros((N, 6))
POSES = Transform("BT", np.tile(np.eye(3), (N, 1, 1)), LINE)
CAMERA = CameraIntrinsics(width=5, height=3, fx=4.0, fy=4.0, cx=2.5, cy=1.5)
X_BC = Transform.identity("BC")
ON = np.ones(N, bool)
WELD = (Segment.WELD,) * N

GOOD: dict[type, dict[str, Any]] = {
    Seam: {
        "points_B": LINE,
        "s": S,
        "tangents_B": X,
        "normals_B": Z,
        "left_B": LINE,
        "right_B": LINE,
        "sigma": np.zeros(N),
        "confidence": 1.0,
        "gaps": ((0.0, 0.005), (0.02, 0.03)),
    },
    SeamFindings: {"seams": (), "region": np.zeros(3, int)},
    KnownSeam: {
        "opening_B": LINE,
        "root_B": LINE,
        "left_B": LINE,
        "right_B": LINE,
        "tangents_B": X,
        "bisectors_B": -Z,
        "s": S,
    },
    TorchPath: {"X_BT": POSES, "s": np.zeros(N), "speed": np.full(N, 1e-3), "arc_on": ON, "segments": WELD, "sigma": np.zeros(N)},
    JointTrajectory: {
        "t": S,
        "q": MANY,
        "qd": MANY,
        "qdd": MANY,
        "s": S,
        "arc_on": ON,
        "segments": WELD,
        "joint_names": tuple("abcdef"),
    },
    RobotState: {"t": 0.0, "q": SIX, "qd": SIX, "X_BT": Transform.identity("BT")},
    RobotFacts: {
        "model": "UR5",
        "series": "cb3",
        "version": "3.15",
        "serial": "1",
        "dh": np.zeros((6, 4)),
        "payload_cog": np.zeros(3),
        "X_FT": Transform.identity("FT"),
    },
    ExecutionLog: {
        "t": S,
        "q_cmd": MANY,
        "q_act": MANY,
        "qd_act": MANY,
        "X_BT_act": POSES,
        "s_cmd": S,
        "arc_on": ON,
        "segments": WELD,
        "period": 0.01,
        "robot": "none",
        "torque": MANY,
    },
    CameraIntrinsics: {"width": 1, "height": 1, "fx": 0.5, "fy": 0.5, "cx": 0.0, "cy": 0.0},
    DepthFrame: {
        "depth": np.full((3, 5), 0.5, np.float32),
        "intrinsics": CAMERA,
        "X_BC": X_BC,
        "colour": np.zeros((3, 5, 3), np.uint8),
    },
    PointCloud: {
        "points": LINE,
        "normals": Z,
        "colours": np.full((N, 3), 0.5),
        "viewpoints": np.zeros((2, 3)),
        "view": np.array([0, 1, 1, 0]),
        "pixel": np.arange(N),
        "intrinsics": CAMERA,
        "X_BC": X_BC,
    },
}
NAN = np.array([[np.nan, 0.0, 0.0], *LINE[1:]])
SHORT, LONG = LINE[:-1], 10.0 * LINE / LINE[-1, 0]

WRONG: list[tuple[type, str, Any, str]] = [
    *((Seam, name, SHORT, r"shape \(3, 3\), expected \(4, 3\)") for name in ("tangents_B", "normals_B", "left_B", "right_B")),
    *((Seam, name, NAN, "1 value is not finite") for name in ("points_B", "tangents_B", "normals_B", "left_B", "right_B")),
    *((Seam, name, 1.01 * X, "not unit") for name in ("tangents_B", "normals_B")),
    (Seam, "points_B", LINE[:1], "1 point; a seam needs two"),
    (Seam, "points_B", LINE[:, :2], r"shape \(4, 2\), expected \(n, 3\)"),
    (Seam, "points_B", LONG, r"spans 10 m \(limit 5 m\): looks like millimetres"),
    (Seam, "s", S[:-1], "shape"),
    (Seam, "s", S[[0, 1, 1, 3]], "not strictly increasing"),
    (Seam, "sigma", S[:-1], "shape"),
    (Seam, "sigma", -S, "negative"),
    (Seam, "closed", True, "30 mm apart"),
    (Seam, "confidence", -0.01, "outside 0 to 1"),
    (Seam, "confidence", 1.01, "outside 0 to 1"),
    (Seam, "gaps", ((0.01, 0.005),), "ordered"),
    (Seam, "gaps", ((0.01, 0.02), (0.0, 0.005)), "ordered"),
    (Seam, "gaps", ((-0.001, 0.005),), "within 0 to 0.03 m"),
    (Seam, "gaps", ((0.001, 0.031),), "within 0 to 0.03 m"),
    (SeamFindings, "region", np.zeros((3, 1), int), "shape"),
    *((KnownSeam, name, SHORT, "shape") for name in ("root_B", "left_B", "right_B", "tangents_B", "bisectors_B")),
    *((KnownSeam, name, 1.01 * X, "not unit") for name in ("tangents_B", "bisectors_B")),
    (KnownSeam, "opening_B", LINE[:, :2], "shape"),
    (KnownSeam, "s", S[:-1], "shape"),
    (KnownSeam, "s", S[[0, 1, 1, 3]], "not strictly increasing"),
    (TorchPath, "X_BT", Transform("BF", POSES.R, POSES.p), "X_BT"),
    (TorchPath, "X_BT", POSES[0], "batch"),
    (TorchPath, "X_BT", POSES[:1], "1 pose; a path needs two"),
    (TorchPath, "X_BT", Transform("BT", POSES.R, LONG), "millimetres"),
    (TorchPath, "s", -S, "decreases"),
    (TorchPath, "s", S[:-1], "shape"),
    (TorchPath, "speed", np.array([1.0, 0.0, 1.0, 1.0]), "positive"),
    (TorchPath, "speed", S[:-1], "shape"),
    (TorchPath, "arc_on", ON[:-1], "shape"),
    (TorchPath, "segments", WELD[1:], "3 names for 4 poses"),
    (TorchPath, "sigma", S[:-1], "shape"),
    (JointTrajectory, "t", np.zeros(N), "not strictly increasing"),
    (JointTrajectory, "t", MANY, "shape"),
    *((JointTrajectory, name, MANY[:-1], r"expected \(4, 6\)") for name in ("q", "qd", "qdd")),
    *((JointTrajectory, name, ON[:-1], "shape") for name in ("s", "arc_on")),
    (JointTrajectory, "segments", WELD[1:], "3 names for 4 instants"),
    (JointTrajectory, "joint_names", tuple("abcde"), "six"),
    *((RobotState, name, SIX[:-1], "shape") for name in ("q", "qd")),
    (RobotFacts, "dh", np.zeros((4, 6)), r"expected \(6, 4\)"),
    (RobotFacts, "payload_cog", SIX, r"expected \(3\)"),
    (RobotFacts, "X_FT", Transform.identity("BT"), "X_FT"),
    (RobotFacts, "X_FT", Transform("FT", POSES.R, POSES.p), "X_FT"),
    (ExecutionLog, "t", MANY, "shape"),
    *((ExecutionLog, name, MANY[:-1], r"expected \(4, 6\)") for name in ("q_cmd", "q_act", "qd_act", "torque")),
    (ExecutionLog, "X_BT_act", Transform("BF", POSES.R, POSES.p), "measured pose"),
    (ExecutionLog, "X_BT_act", POSES[:-1], "measured pose"),
    *((ExecutionLog, name, ON[:-1], "shape") for name in ("s_cmd", "arc_on")),
    *((CameraIntrinsics, name, 0, "width") for name in ("width", "height")),
    *((CameraIntrinsics, name, 0.0, "fx") for name in ("fx", "fy")),
    *((CameraIntrinsics, name, np.inf, "not finite") for name in ("fx", "fy", "cx", "cy")),
    (DepthFrame, "depth", np.full((5, 3), 0.5, np.float32), r"expected \(3, 5\)"),
    (DepthFrame, "depth", np.full((3, 5), np.inf, np.float32), "infinite"),
    (DepthFrame, "depth", np.zeros((3, 5), np.float32), "<= 0"),
    (DepthFrame, "colour", np.zeros((3, 5), np.uint8), r"expected \(3, 5, 3\)"),
    (DepthFrame, "X_BC", Transform.identity("BT"), "X_BT"),
    (PointCloud, "points", LINE[:, :2], "shape"),
    (PointCloud, "points", LONG, "millimetres"),
    *((PointCloud, name, SHORT, "shape") for name in ("normals", "colours")),
    (PointCloud, "normals", 1.01 * X, "not unit"),
    (PointCloud, "viewpoints", np.zeros((2, 2)), "shape"),
    *((PointCloud, name, np.zeros(3, int), "shape") for name in ("view", "pixel")),
    (PointCloud, "view", np.array([0, 0, 0, 2]), "names no viewpoint"),
    (PointCloud, "view", np.array([-1, 0, 0, 0]), "names no viewpoint"),
]


def built(record: type, **given: Any) -> Any:
    """A record with some fields, checked by itself alone: the tests' own check of shapes would refuse it first."""
    made = object.__new__(record)
    for field in fields(record):
        default = field.default if field.default_factory is MISSING else field.default_factory()
        object.__setattr__(made, field.name, given.get(field.name, default))
    made.__post_init__()
    return made


@pytest.mark.parametrize(
    ("record", "name", "value", "told"), WRONG, ids=[f"{w[0].__name__}.{w[1]}-{i}" for i, w in enumerate(WRONG)]
)
def test_a_wrong_field_is_refused_by_its_name(record: type, name: str, value: Any, told: str) -> None:
    with pytest.raises(RecordError, match=told) as caught:
        built(record, **{**GOOD[record], name: value})
    field = {"cx": "fx", "cy": "fx", "fy": "fx", "height": "width"}.get(name, name)
    assert caught.value.data["field"] == field
    assert str(caught.value).startswith(f"{record.__name__}.{field}: ")


@pytest.mark.parametrize("record", GOOD, ids=lambda record: record.__name__)
def test_a_good_record_keeps_what_it_was_given_and_freezes_its_arrays(record: type) -> None:
    made = record(**GOOD[record])
    for field in fields(record):
        value = getattr(made, field.name)
        given = GOOD[record].get(field.name)
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, np.zeros((0, 3)) if given is None else given)
            assert not value.flags.writeable
            assert value is not given
        elif given is not None:
            assert value is given


def test_what_may_be_missing_may_be_missing() -> None:
    for record, names in (
        (Seam, ("left_B", "right_B", "sigma", "gaps")),
        (TorchPath, ("sigma",)),
        (RobotFacts, ("dh", "payload_cog", "X_FT")),
        (ExecutionLog, ("torque",)),
        (DepthFrame, ("colour",)),
        (PointCloud, ("normals", "colours", "viewpoints", "view", "pixel", "intrinsics", "X_BC")),
    ):
        made = record(**{name: value for name, value in GOOD[record].items() if name not in names})
        assert all(getattr(made, name) is None or len(getattr(made, name)) == 0 for name in names)


@pytest.mark.parametrize("missing", ["intrinsics", "X_BC"])
def test_pixels_need_their_camera(missing: str) -> None:
    with pytest.raises(RecordError, match="pixel: needs intrinsics and X_BC"):
        PointCloud(**{**GOOD[PointCloud], missing: None})


def test_integers_become_the_numbers_the_record_holds() -> None:
    assert SeamFindings(seams=(), region=np.array([0, 2])).region.dtype == np.int32
    cloud = PointCloud(**{**GOOD[PointCloud], "view": np.array([0, 1, 1, 0], np.int32), "pixel": np.arange(N, dtype=np.int32)})
    assert cloud.view is not None
    assert cloud.pixel is not None
    assert cloud.view.dtype == cloud.pixel.dtype == np.int64


def test_each_array_has_the_type_of_its_record_whatever_it_was_given() -> None:
    for record in (TorchPath, JointTrajectory, ExecutionLog):
        assert built(record, **{**GOOD[record], "arc_on": np.ones(N, int)}).arc_on.dtype == bool
    frame = built(DepthFrame, **{**GOOD[DepthFrame], "depth": np.ones((3, 5)), "colour": np.zeros((3, 5, 3), int)})
    assert (frame.depth.dtype, frame.colour.dtype) == (np.float32, np.uint8)
    for record, name in ((Seam, "s"), (KnownSeam, "s"), (TorchPath, "s"), (JointTrajectory, "t"), (ExecutionLog, "s_cmd")):
        assert getattr(built(record, **{**GOOD[record], name: np.arange(N), "gaps": ()}), name).dtype == np.float64


def test_an_arc_burns_in_weld_alone_and_weld_is_one_stretch() -> None:
    parts = (Segment.APPROACH, Segment.WELD, Segment.WELD, Segment.RETRACT)
    good = {**GOOD[TorchPath], "segments": parts}
    assert TorchPath(**{**good, "arc_on": np.array([False, True, True, False])}).weld == slice(1, 3)
    assert TorchPath(**{**good, "arc_on": np.zeros(N, bool)}).weld == slice(1, 3)
    for outside in (0, 3):
        with pytest.raises(RecordError, match=r"TorchPath\.arc_on: the arc burns outside WELD"):
            TorchPath(**{**good, "arc_on": np.arange(N) == outside})
    air = TorchPath(**{**good, "segments": (Segment.AIR,) * N, "arc_on": np.zeros(N, bool)})
    with pytest.raises(RecordError, match=r"TorchPath\.segments: no WELD segment"):
        _ = air.weld


def test_lengths_are_from_first_to_last_and_a_ring_is_closed() -> None:
    for record in (Seam, KnownSeam):
        assert record(**{**GOOD[record], "s": 1.0 + S, "gaps": ()} if record is Seam else GOOD[record]).length == pytest.approx(
            0.03
        )
    ring = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.9e-6, 0.0]])
    assert KnownSeam(**{**GOOD[KnownSeam], "opening_B": ring}).closed
    assert not KnownSeam(**{**GOOD[KnownSeam], "opening_B": ring * [1.0, 1.2, 1.0]}).closed
    assert Seam(**{**GOOD[Seam], "points_B": ring, "closed": True}).closed
    assert not KnownSeam(**GOOD[KnownSeam]).closed


def test_points_picked_bring_all_that_is_theirs() -> None:
    cloud = PointCloud(**GOOD[PointCloud], frame="W")
    assert len(cloud) == N
    for keep in (np.array([False, True, False, True]), np.array([1, 3])):
        some = cloud.select(keep)
        assert some.frame == "W"
        for name in ("points", "normals", "colours", "view", "pixel"):
            np.testing.assert_array_equal(getattr(some, name), getattr(cloud, name)[[1, 3]])
        np.testing.assert_array_equal(some.viewpoints, cloud.viewpoints)
        assert some.intrinsics is CAMERA
        assert some.X_BC is X_BC
    bare = PointCloud(points=LINE).select(np.array([0]))
    assert bare.normals is bare.colours is bare.view is bare.pixel is bare.intrinsics is bare.X_BC is None


def test_sights_begin_where_each_points_camera_stood() -> None:
    two = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])
    assert PointCloud(points=LINE).sight_origins() is None
    np.testing.assert_array_equal(PointCloud(points=LINE, viewpoints=two[:1]).sight_origins(), np.tile(two[0], (N, 1)))
    view = np.array([0, 1, 1, 0])
    np.testing.assert_array_equal(PointCloud(points=LINE, viewpoints=two, view=view).sight_origins(), two[view])


def test_rays_go_through_pixel_centres_and_opencv_counts_from_there() -> None:
    camera = CameraIntrinsics(width=3, height=2, fx=2.0, fy=4.0, cx=1.0, cy=0.75)
    rays = camera.rays()
    assert rays.shape == (2, 3, 3)
    np.testing.assert_allclose(rays[1, 2], [(2.5 - 1.0) / 2.0, (1.5 - 0.75) / 4.0, 1.0])
    np.testing.assert_allclose(rays[0, 0], [-0.25, -0.0625, 1.0])
    other = CameraIntrinsics.from_opencv(width=3, height=2, fx=2.0, fy=4.0, cx=0.5, cy=0.25)
    assert asdict(other) == asdict(camera)


@dataclass(frozen=True)
class Bare:
    """A record to check on."""

    a: Any = None


def test_the_checks_at_their_limits() -> None:
    bare = Bare()
    check_metres(bare, "a", np.array([[0.0, -2.5, 0.0], [0.0, 2.5, 0.0]]))
    check_metres(bare, "a", np.zeros((0, 3)))
    with pytest.raises(RecordError, match=r"Bare\.a: spans 5\.1 m"):
        check_metres(bare, "a", np.array([[0.0, 0.0, -2.5], [0.0, 0.0, 2.6]]))
    with pytest.raises(RecordError, match="spans inf m"):
        check_metres(bare, "a", np.array([[0.0, 0.0, -1.5e308], [0.0, 0.0, 1.5e308]]))
    check_unit(bare, "a", np.array([[1.0 + 0.9e-6, 0.0, 0.0]]))
    with pytest.raises(RecordError, match=r"Bare\.a: not unit"):
        check_unit(bare, "a", np.array([[1.0, 0.0, 0.0], [1.0 + 2e-5, 0.0, 0.0]]))
    check_increasing(bare, "a", np.array([0.0, 1e-12]))
    check_increasing(bare, "a", np.array([1.0]))
    require(True, bare, "a", "is wrong")
    store(bare, "a", [[1, 2]], shape=("n", 2))
    np.testing.assert_array_equal(bare.a, [[1.0, 2.0]])
    store(bare, "a", [np.nan], shape=(1,), nan=True)
    store(bare, "a", [1, 2], shape=(2,), dtype=int)
    assert bare.a.dtype == int
    for shape in ((1,), ("n", "m"), (2, "m")):
        with pytest.raises(RecordError, match=r"Bare\.a: shape \(2,\), expected"):
            store(bare, "a", [1.0, 2.0], shape=shape)
