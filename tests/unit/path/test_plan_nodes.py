"""The torch path of a seam with few points, in closed form: where poses get an orientation of their own, trims, sigma, refusals."""

from typing import Any

import numpy as np
import pytest

from weldsim.errors import ConfigError, PathError
from weldsim.frames import unit
from weldsim.path.config import STEEPEST, PathConfig
from weldsim.path.plan import plan_path, plan_paths
from weldsim.records import Seam

AS_FOUND = {"smoothing": 0.0, "turn_limit": 1e5}


def line(*x: float, angle: float | tuple[float, ...] = 0.0, **more: Any) -> Seam:
    """Points along x [m], the wire leaning ahead by an angle [rad], one for all or one each."""
    n = len(x)
    a = np.broadcast_to(angle, n)
    return Seam(
        points_B=np.stack([np.array(x), np.full(n, -0.5), np.zeros(n)], axis=1),
        s=np.array(x) - x[0],
        tangents_B=np.tile([1.0, 0.0, 0.0], (n, 1)),
        normals_B=np.stack([0 * a, -np.sin(a), np.cos(a)], axis=1),
        **more,
    )


def test_a_long_chord_has_a_direction_of_its_own_every_millimetre() -> None:
    """Between two ends that point 1 rad apart the wire points to a place that goes evenly along the chord, not about it."""
    path = plan_path(line(0.0, 0.1, angle=(0.0, 1.0)), PathConfig(step=1e-3, **AS_FOUND))
    u = np.linspace(0.0, 1.0, 101)
    wire = unit((1 - u)[:, None] * np.array([0.0, 0.0, -1.0]) + u[:, None] * np.array([0.0, np.sin(1.0), -np.cos(1.0)]))
    assert len(path.s) == 101
    np.testing.assert_allclose(path.s, 0.1 * u, atol=1e-12)
    np.testing.assert_allclose(path.X_BT.R[:, :, 2], wire, atol=1e-9)
    np.testing.assert_allclose(path.X_BT.R[:, :, 0], np.tile([1.0, 0.0, 0.0], (101, 1)), atol=1e-9)


def test_a_chord_of_whole_millimetres_is_cut_in_as_many() -> None:
    for x in ((0.0, 0.003), (0.0, 0.001, 0.002, 0.003)):
        assert len(plan_path(line(*x), PathConfig(step=0.01)).s) == 4
    assert len(plan_path(line(0.0, 0.0031), PathConfig(step=0.01)).s) == 5


@pytest.mark.parametrize("reverse", [False, True])
def test_sigma_goes_with_the_place_trims_or_not(reverse: bool) -> None:
    """1e-4 at 20 mm, 5e-4 at 60 mm."""
    seam = line(0.02, 0.03, 0.06, sigma=np.array([1e-4, 2e-4, 5e-4]))
    config = PathConfig(start_trim=0.004, end_trim=0.01, reverse=reverse, step=5e-4)
    path = plan_path(seam, config)
    x = path.X_BT.p[:, 0]
    np.testing.assert_allclose(x[[0, -1]], (0.056, 0.03) if reverse else (0.024, 0.05), atol=1e-12)
    np.testing.assert_allclose(path.sigma, x / 100 - 1e-4, atol=1e-12)
    assert plan_path(line(0.0, 0.01)).sigma is None


def test_a_trim_may_fall_on_a_point_or_next_to_it() -> None:
    """No pose is left beside it that has no direction."""
    seam = line(*np.linspace(0.0, 0.02, 21))
    for start, end in ((0.005, 0.004), (0.005 - 5e-7, 0.004 + 5e-7), (0.005 + 5e-7, 0.004 - 5e-7)):
        path = plan_path(seam, PathConfig(start_trim=start, end_trim=end, step=0.01))
        np.testing.assert_allclose(path.X_BT.p[[0, -1], 0], [start, 0.02 - end], atol=1e-12)
        assert np.diff(path.s).min() > 0.4e-3


def test_two_millimetres_are_worth_a_path() -> None:
    seam = line(0.0, 0.02)
    assert plan_path(seam, PathConfig(start_trim=0.01, end_trim=0.00799)).s[-1] == pytest.approx(0.00201)
    with pytest.raises(
        PathError, match=r"^trims of 10 and 8\.01 mm leave 2\.0 mm of a seam 20\.0 mm long \(least 2 mm\)$"
    ) as caught:
        plan_path(seam, PathConfig(start_trim=0.01, end_trim=0.00801))
    assert caught.value.data == {"length": pytest.approx(0.02), "limit": 0.002}
    with pytest.raises(PathError, match=r"^trims of 0 and 19 mm leave"):
        plan_path(seam, PathConfig(end_trim=0.019))
    with pytest.raises(PathError, match=r"^trims of 0 and 0 mm leave 1\.9 mm of a seam 1\.9 mm long"):
        plan_path(line(0.0, 0.0019495), PathConfig())
    with pytest.raises(PathError, match=r"leave 0\.0 mm"):
        plan_path(seam, PathConfig(start_trim=0.01, end_trim=0.012))


def steep(angle: float, apart: float = 0.01) -> Seam:
    """The wire stands square to travel but for the last of four points, where it is `angle` [rad] from it."""
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    normals[-1] = [-np.cos(angle), 0.0, np.sin(angle)]
    x = apart * np.arange(4)
    return Seam(
        points_B=np.stack([x, np.full(4, -0.5), np.zeros(4)], axis=1),
        s=x,
        tangents_B=np.tile([1.0, 0.0, 0.0], (4, 1)),
        normals_B=normals,
    )


def test_a_wire_nearer_than_20_degrees_to_travel_has_no_side() -> None:
    path = plan_path(steep(np.radians(20.5)), PathConfig(**AS_FOUND))
    np.testing.assert_allclose(path.X_BT.R[-1, :, 1], [0.0, -1.0, 0.0], atol=1e-9)
    with pytest.raises(PathError, match=r"normal lies 19 deg from its travel at s = 30\.0 mm \(least 20 deg\)") as caught:
        plan_path(steep(np.radians(19.4)), PathConfig(**AS_FOUND))
    assert caught.value.data == {"s": pytest.approx(0.03)}
    with pytest.raises(PathError, match=r"at s = 450\.0 mm \("):
        plan_path(steep(np.radians(19.4), apart=0.15), PathConfig(**AS_FOUND))


def test_paths_of_several_seams_and_why_some_have_none() -> None:
    good, bad = line(0.0, 0.05), steep(np.radians(10))
    paths, refused = plan_paths((good, bad, good), PathConfig(**AS_FOUND))
    assert [path is None for path in paths] == [False, True, False]
    assert list(refused) == [1]
    assert "10 deg" in str(refused[1])
    assert plan_paths(()) == ((), {})
    with pytest.raises(PathError, match=r"^the seam's normal lies 10 deg"):
        plan_paths((bad,), PathConfig(**AS_FOUND))
    worse = steep(np.radians(5))
    with pytest.raises(PathError, match=r"^no path along any of 2 seams: seam 1: .* 10 deg .*; seam 2: .* 5 deg ") as caught:
        plan_paths((bad, worse), PathConfig(**AS_FOUND))
    assert caught.value.data == {"s": pytest.approx(0.03)}
    with pytest.raises(PathError, match=r"^no path along any of 2 seams: seam 1: trims .*; seam 2: .* 5 deg ") as caught:
        plan_paths((line(0.0, 0.0005, 0.0015), worse), PathConfig(**AS_FOUND))
    assert caught.value.data["length"] == pytest.approx(0.0015), "what is told is the first's"


def test_the_turn_limit_holds_with_its_margin_and_no_more() -> None:
    """A wire that would turn by 1 rad at once turns at 0.99 of the limit, about the middle."""
    seam = line(*np.linspace(0.0, 0.1, 401), angle=tuple(np.where(np.linspace(0.0, 0.1, 401) < 0.05, 0.0, 1.0)))
    path = plan_path(seam, PathConfig(smoothing=0.0, turn_limit=20.0))
    angle = np.arctan2(path.X_BT.R[:, 1, 2], -path.X_BT.R[:, 2, 2])
    turning = (angle > 0.05) & (angle < 0.95)
    np.testing.assert_allclose(np.diff(angle[turning]) / np.diff(path.s[turning]), 0.99 * 20.0, rtol=1e-3)
    assert np.interp(0.5, angle, path.s) == pytest.approx(0.05, abs=3e-4)


@pytest.mark.parametrize("name", ["work_angle", "travel_angle"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_torch_leans_60_degrees_at_most(name: str, sign: float) -> None:
    PathConfig(**{name: sign * STEEPEST})
    with pytest.raises(ConfigError, match=rf"^{name} = {sign * 1.05:.3g} rad leans over 60 deg$") as caught:
        PathConfig(**{name: sign * 1.05})
    assert caught.value.data == {"key": name, "value": sign * 1.05, "limit": STEEPEST}


def test_a_setting_out_of_range_is_told_by_its_whole_name() -> None:
    with pytest.raises(ConfigError, match=r"^path\.step = 1 m is outside 1e-05 to 0\.01 m$"):
        PathConfig(step=1.0)
