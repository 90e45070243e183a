"""What was asked of a weld, in closed form: the wire's tip at its stick-out, a known seam's axes leaned as the path travels."""

import numpy as np
import pytest

from weldsim.frames import Transform, unit
from weldsim.path.asked import leaned, wire_tip
from weldsim.path.config import PathConfig
from weldsim.records import KnownSeam, Segment, TorchPath

N = 11
LINE = np.stack([np.linspace(0.0, 0.1, N), np.zeros(N), np.zeros(N)], axis=1)


def known(bisector: tuple[float, float, float]) -> KnownSeam:
    """A line along x with one inward bisector."""
    return KnownSeam(
        opening_B=LINE,
        root_B=LINE,
        left_B=LINE,
        right_B=LINE,
        tangents_B=np.tile([1.0, 0.0, 0.0], (N, 1)),
        bisectors_B=np.tile(unit(np.array(bisector)), (N, 1)),
        s=LINE[:, 0],
    )


def path(back: bool = False) -> TorchPath:
    """Along the line or back, after an approach that goes the other way; the wire straight down."""
    way = -1.0 if back else 1.0
    weld = LINE[::-1] if back else LINE
    p = np.concatenate([weld[:1] + np.linspace(0.5, 0.1, 5)[:, None] * [way, 0.0, 0.0], weld])
    ahead = np.array([way, 0.0, 0.0])
    R = np.stack([ahead, np.cross([0.0, 0.0, -1.0], ahead), [0.0, 0.0, -1.0]], axis=1)
    turned = R @ np.diag([-1.0, -1.0, 1.0])
    n = len(p)
    return TorchPath(
        X_BT=Transform("BT", np.concatenate([np.tile(turned, (5, 1, 1)), np.tile(R, (N, 1, 1))]), p),
        s=np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]),
        speed=np.full(n, 6e-3),
        arc_on=np.arange(n) >= 5,
        segments=(Segment.APPROACH,) * 5 + (Segment.WELD,) * N,
    )


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("angle", [-0.3, 0.2])
@pytest.mark.parametrize("lean", [0.0, 0.25])
def test_a_pushing_wire_points_ahead_of_the_bisector(lean: float, angle: float, back: bool) -> None:
    """A bisector that leans by `lean` towards x and a wire that leans ahead by `angle` add up, along x, or part, back."""
    found = leaned(known((np.sin(lean), 0.0, -np.cos(lean))), path(back), PathConfig(travel_angle=angle))
    total = lean + (-angle if back else angle)
    np.testing.assert_allclose(found.bisectors_B, np.tile([np.sin(total), 0.0, -np.cos(total)], (N, 1)), atol=1e-12)
    assert found.opening_B is not None
    np.testing.assert_array_equal(found.opening_B, LINE)


@pytest.mark.parametrize("back", [False, True])
def test_a_work_angle_turns_the_axis_about_travel(back: bool) -> None:
    """The body leans to the right of travel, so the wire points to the left: minus y is right along x, left on the way back."""
    found = leaned(known((0.0, 0.0, -1.0)), path(back), PathConfig(work_angle=0.3))
    side = -1.0 if back else 1.0
    np.testing.assert_allclose(found.bisectors_B, np.tile([0.0, side * np.sin(0.3), -np.cos(0.3)], (N, 1)), atol=1e-12)


def test_without_angles_nothing_is_leaned() -> None:
    seam = known((0.0, 0.1, -1.0))
    assert leaned(seam, path(), PathConfig()) is seam
    assert leaned(seam, path(), PathConfig(work_angle=0.1)) is not seam
    assert leaned(seam, path(), PathConfig(travel_angle=0.1)) is not seam


@pytest.mark.parametrize("more", [0.004, -0.003])
def test_the_wires_tip_is_out_by_what_the_stick_out_is_more(more: float) -> None:
    poses = path().X_BT
    config = PathConfig()
    found = wire_tip(poses, PathConfig(ctwd=config.nominal_ctwd + more))
    np.testing.assert_allclose(found.p - poses.p, np.tile([0.0, 0.0, -more], (len(poses), 1)), atol=1e-15)
    np.testing.assert_array_equal(found.R, poses.R)
    one = wire_tip(poses[3], PathConfig(ctwd=config.nominal_ctwd + more))
    np.testing.assert_allclose(one.p - poses.p[3], [0.0, 0.0, -more], atol=1e-15)
