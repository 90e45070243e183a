"""Double walls dropped, views merged, pixels and labels kept."""

from dataclasses import replace

import numpy as np
import pytest

from tests.views import FAN, NARROW, Block, fan, scan
from weldsim.cloud.config import RegisterConfig
from weldsim.cloud.merge import merge
from weldsim.cloud.views import dropped, merge_views
from weldsim.cloud.walls import double_walls

PLATE = Block(size=(0.24, 0.22, 0.02), sides=False)


@pytest.mark.parametrize("noise", ["none", "iid", "d415"])
def test_views_that_agree_are_kept(noise):
    seen = scan(np.random.default_rng(0), Block(), noise=noise, intrinsics=NARROW)
    for double in double_walls(seen.clouds):
        assert double.mean() < 0.05


@pytest.mark.parametrize("step", [0.002, 0.004, -0.002])
@pytest.mark.parametrize("seed", range(2))
def test_the_worse_seen_of_two_walls_is_dropped(step, seed):
    """A part of the plate that the oblique view shows elsewhere: it goes, in that view alone."""
    seen = scan(np.random.default_rng(seed), PLATE, fan(PLATE, (0.0, 50.0)), noise="iid", sigma=0.0003, intrinsics=NARROW)
    straight, oblique = seen.clouds
    wrong = (
        (np.abs(oblique.points[:, 0] - 0.05) < 0.03) & (np.abs(oblique.points[:, 1] + 0.49) < 0.03) & (oblique.points[:, 2] > 0.01)
    )
    sight = oblique.viewpoints[0] - oblique.points
    oblique = replace(oblique, points=oblique.points + step * (wrong / sight[:, 2])[:, None] * sight)
    kept, gone = double_walls([straight, oblique])
    assert gone[wrong].mean() > 0.6
    assert gone[~wrong].mean() < 0.03
    assert kept.mean() < 0.02
    again, first = double_walls([oblique, straight])
    np.testing.assert_array_equal(again, gone)
    np.testing.assert_array_equal(first, kept)


def test_merged_points_know_view_and_pixel():
    seen = scan(np.random.default_rng(1), PLATE, fan(PLATE, (-30.0, 0.0, 30.0)), noise="d415", offset=0.0035, intrinsics=NARROW)
    merged, found = merge_views(seen.clouds, RegisterConfig(farthest=9.0))
    assert found is not None
    assert len(merged) + sum(dropped(seen.clouds, merged)) == sum(map(len, seen.clouds))
    labels = np.zeros((3, NARROW.width * NARROW.height), bool)
    for mask, cloud, groove in zip(labels, seen.clouds, seen.groove, strict=True):
        mask[cloud.pixel[groove]] = True
    inside = labels[merged.view, merged.pixel]
    assert 0.5 * sum(g.sum() for g in seen.groove) < inside.sum() <= sum(g.sum() for g in seen.groove)
    np.testing.assert_array_equal(merged.sight_origins(), merged.X_BC.p[merged.view])
    half = merged.select(np.arange(0, len(merged), 2))
    np.testing.assert_array_equal(labels[half.view, half.pixel], inside[::2])
    # Each point lies on its pixel's sight line from its camera.
    for view in range(3):
        of = merged.view == view
        local = merged.X_BC[view].inverse().points(merged.points[of])
        u = NARROW.fx * local[:, 0] / local[:, 2] + NARROW.cx - 0.5
        np.testing.assert_allclose(u, merged.pixel[of] % NARROW.width, atol=1e-6)


def test_one_view_is_left_untouched():
    cloud = scan(np.random.default_rng(2), PLATE, fan(PLATE, (10.0,)), intrinsics=NARROW).clouds[0]
    merged, found = merge_views([cloud])
    assert merged is cloud
    assert found is None
    assert dropped([cloud], merged) == (0,)


def test_what_is_switched_off_is_not_done():
    seen = scan(np.random.default_rng(3), Block(), fan(Block(), FAN[:3]), noise="d415", offset=0.0035, intrinsics=NARROW)
    merged, found = merge_views(seen.clouds, RegisterConfig(enabled=False, double_walls=False, farthest=9.0))
    assert found is None
    np.testing.assert_array_equal(merged.points, merge(seen.clouds).points)


def test_what_is_far_away_is_dropped_from_several_views():
    seen = scan(np.random.default_rng(4), PLATE, fan(PLATE, (-60.0, 60.0)), intrinsics=NARROW)
    merged, _ = merge_views(seen.clouds, RegisterConfig(farthest=0.6))
    depth = np.einsum("ij,ij->i", merged.points - merged.sight_origins(), merged.X_BC.R[merged.view][:, :, 2])
    assert 0.59 < depth.max() < 0.61
