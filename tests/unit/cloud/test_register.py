"""Views with known mistakes lined up: on blocks and plates with a groove, over offsets, seeds, noise and numbers of views."""

from dataclasses import replace

import numpy as np
import pytest

from tests.views import CENTRE, FAN, NARROW, Block, Scan, fan, fit_motion, look, scan
from weldsim.cloud.config import RegisterConfig
from weldsim.cloud.patches import planar_patches
from weldsim.cloud.register import register
from weldsim.errors import CloudError, ConfigError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.mounts import D415_640X480
from weldsim.records import PointCloud

BLOCK = Block()
PLATE = Block(size=(0.24, 0.22, 0.02), groove=(0.014, 0.008), sides=False)
WIDE = Block(size=(0.24, 0.22, 0.02), groove=(0.025, 0.012), sides=False)
MISTAKES = {"offset": 0.0035, "hand_eye": 0.001, "hand_eye_turn": 0.0035}


def made(block: Block, angles=FAN, seed: int = 0, intrinsics=NARROW, **errors) -> Scan:
    return scan(np.random.default_rng(seed), block, fan(block, angles), intrinsics=intrinsics, **errors)


@pytest.mark.parametrize("noise", ["none", "iid", "d415"])
@pytest.mark.parametrize(
    ("block", "angles", "noisy"),  # the last: mean and greatest misalignment [m] under a D415's noise
    [
        (BLOCK, FAN, (0.4e-3, 0.6e-3)),
        (BLOCK, (-60.0, 0.0, 60.0), (0.7e-3, 1.0e-3)),
        (PLATE, (-25.0, 25.0), (0.7e-3, 1.0e-3)),
        (WIDE, (-30.0, 0.0, 30.0), (0.3e-3, 0.4e-3)),
    ],
)
def test_grooves_of_all_views_come_together(block, angles, noisy, noise):
    """Where all that can go wrong does: what is left is what a plate does not show, a hand-eye mistake along it.

    A measured D415's noise has waves as long as a plate's side, of 0.2 mm at 0.4 m and 0.5 mm at 0.7 m: three views 60 degrees
    apart, which share little, are turned by them.
    """
    after = []
    for seed in range(2):
        # A D415's noise belongs to its own resolution; without it half of that will do.
        seen = made(block, angles, seed, D415_640X480 if noise == "d415" else NARROW, noise=noise, **MISTAKES)
        clouds, found = register(seen.clouds)
        assert found is not None
        assert found.after < found.before
        assert found.alone == ()
        assert seen.misalignment(clouds) < seen.misalignment(seen.clouds)
        after.append(seen.misalignment(clouds))
    mean, most = noisy if noise == "d415" else (0.5e-3, 0.8e-3)
    assert np.mean(after) < mean
    assert max(after) < most


@pytest.mark.parametrize("noise", ["none", "iid", "d415"])
@pytest.mark.parametrize(("block", "angles"), [(BLOCK, FAN), (PLATE, (-25.0, 25.0)), (WIDE, (-30.0, 0.0, 30.0))])
def test_offsets_of_depth_are_taken_out(block, angles, noise):
    before, after = [], []
    for seed in range(2):
        seen = made(block, angles, seed, D415_640X480 if noise == "d415" else NARROW, noise=noise, offset=0.0035)
        before.append(seen.misalignment(seen.clouds))
        after.append(seen.misalignment(register(seen.clouds)[0]))
    assert np.mean(after) < (0.25 if noise == "d415" else 0.15) * np.mean(before)  # two views of a plate share long waves' error
    assert max(after) < 0.4e-3


@pytest.mark.parametrize("seed", range(4))
def test_offsets_alone_are_found_to_rounding_where_nothing_else_is_wrong(seed):
    """The absolute one too: sides of a block turn when depths are wrong, whatever the block."""
    seen = made(BLOCK, seed=seed, offset=0.0035)
    clouds, found = register(seen.clouds)
    assert found is not None
    assert seen.misalignment(clouds) < 0.06e-3
    assert seen.error(clouds) < 0.15e-3
    np.testing.assert_allclose([view.depth for view in found.views], -seen.offsets, atol=0.2e-3)


@pytest.mark.parametrize("offset", [0.001, 0.0035, 0.006])
def test_the_groove_keeps_its_shape(offset):
    """Within 30 mm of any place of the groove, a corrected view differs from the true groove by a motion and next to nothing."""
    seen = made(PLATE, (-25.0, 0.0, 25.0), 3, offset=offset)
    clouds, _ = register(seen.clouds)
    for i, (before, after) in enumerate(zip(seen.clouds, clouds, strict=True)):
        right, rows = seen.places(i, every=1)
        near = np.abs(right[:, 0] - 0.04) < 0.015
        assert near.sum() > 100
        assert fit_motion(right[near], after.points[rows[near]])[1].max() < 0.02e-3
        np.testing.assert_array_equal(after.pixel, before.pixel)


@pytest.mark.parametrize(("block", "noise", "most"), [(BLOCK, "none", 1e-5), (PLATE, "none", 1e-5), (BLOCK, "d415", 0.6e-3)])
def test_views_without_mistakes_stay_where_they_are(block, noise, most):
    for seed in range(2):
        seen = made(block, (-35.0, 0.0, 35.0), seed, D415_640X480, noise=noise)
        clouds, _ = register(seen.clouds)
        assert seen.error(clouds) - seen.error(seen.clouds) < most


def test_sliding_along_a_plane_is_left_as_it_was():
    """A plain plate seen from straight above twice, the second time 2 mm aside: nothing shows that, nothing is done about it."""
    plate = Block(size=(0.5, 0.5, 0.02), groove=(0.0, 0.0), sides=False)
    pose = look(np.array([0.0, -0.55, 0.02]), np.array([0.0, 0.0, 1.0]), 0.4)
    aside = Transform("BC", pose.R, pose.p + np.array([0.002, 0.0, 0.003]))
    for noise in ("none", "iid", "d415"):
        seen = scan(np.random.default_rng(0), plate, [pose, pose], noise=noise, table=False, intrinsics=NARROW)
        wrong = Transform("BB", np.eye(3), aside.p - pose.p)
        second = replace(seen.clouds[1], points=wrong.points(seen.clouds[1].points), viewpoints=aside.p[None], X_BC=aside)
        clouds, _ = register([seen.clouds[0], second])
        apart = clouds[1].X_BC.p - clouds[0].X_BC.p
        assert abs(apart[0] - 0.002) < 0.25e-3, noise
        assert abs(np.mean(clouds[1].points[:, 2]) - np.mean(clouds[0].points[:, 2])) < 0.1e-3


def test_the_order_of_views_does_not_matter():
    seen = made(BLOCK, seed=2, noise="d415", **MISTAKES)
    order = [3, 0, 4, 2, 1]
    clouds, _ = register(seen.clouds)
    shuffled, found = register([seen.clouds[i] for i in order])
    assert found is not None
    for place, i in enumerate(order):
        assert np.abs(shuffled[place].points - clouds[i].points).max() < 0.05e-3


@pytest.mark.parametrize("seed", range(3))
def test_moving_everything_moves_the_result_with_it(seed):
    seen = made(BLOCK, seed=seed, noise="d415", **MISTAKES)
    rng = np.random.default_rng(seed)
    X = Transform("BB", matrix_from_rotation_vector(rng.normal(size=3)), rng.normal(size=3))
    moved = [moved_cloud(cloud, X) for cloud in seen.clouds]
    for here, there in zip(register(seen.clouds)[0], register(moved)[0], strict=True):
        assert np.abs(X.points(here.points) - there.points).max() < 0.05e-3


def moved_cloud(cloud: PointCloud, X: Transform) -> PointCloud:
    pose = X @ cloud.X_BC
    return replace(cloud, points=X.points(cloud.points), viewpoints=pose.p[None], X_BC=pose)


def test_one_view_is_left_untouched():
    seen = made(PLATE, (0.0,), noise="iid")
    (cloud,), found = register(seen.clouds)
    assert cloud is seen.clouds[0]
    assert found is None
    clouds, found = register(made(PLATE, (0.0, 20.0)).clouds, RegisterConfig(enabled=False))
    assert found is None
    assert len(clouds) == 2


def test_a_view_that_shares_nothing_is_named_and_moves_by_no_more_than_the_hand_eye():
    seen = made(BLOCK, (-35.0, 0.0, 35.0), 4, noise="d415", offset=0.0035)
    far = Transform("BB", np.eye(3), np.array([0.0, 1.5, 0.0]))
    clouds, found = register([*seen.clouds, moved_cloud(seen.clouds[0], far)])
    assert found is not None
    assert found.alone == (3,)
    assert found.views[3].before is found.views[3].after is None or found.views[3].pairs < 30
    assert abs(found.views[3].depth) < 1e-6
    assert np.linalg.norm(found.views[3].shift_C) < 3 * 1e-3
    assert found.views[3].turn < 3 * 0.0035
    assert len(clouds[3]) == len(seen.clouds[0])


@pytest.mark.parametrize("noise", ["none", "d415"])
def test_what_no_view_sees_is_said(noise):
    """The scatter of the absolute error over seeds is of the size of `unseen`."""
    errors, said = [], []
    for seed in range(8):
        seen = made(BLOCK, (-50.0, 0.0, 50.0), seed, noise=noise, **MISTAKES)
        clouds, found = register(seen.clouds)
        assert found is not None
        errors.append(seen.error(clouds))
        said.append(np.linalg.norm(found.unseen))
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * np.mean(said)


@pytest.mark.parametrize(("noise", "share"), [("none", 0.0), ("iid", 0.0), ("d415", 0.06)])
@pytest.mark.parametrize("block", [PLATE, WIDE])
def test_walls_of_a_groove_are_no_patches(block, noise, share):
    """But for a few that noise hides, of those on the plate."""
    seen = made(block, (0.0, 30.0), 0, D415_640X480, noise=noise)
    for cloud in seen.clouds:
        patches = planar_patches(cloud)
        centres = cloud.X_BC.points(patches.centres) - CENTRE
        plate = (np.abs(centres[:, 0]) < 0.12) & (np.abs(centres[:, 1]) < 0.11)
        assert plate.sum() > 500
        assert (np.abs(centres[plate, 1]) < block.groove[0] / 2).mean() <= share
        np.testing.assert_allclose(np.linalg.norm(patches.normals, axis=1), 1.0, atol=1e-9)
        assert (np.einsum("ij,ij->i", patches.normals, patches.centres) < 0).all()


def test_clouds_without_pixels_are_refused():
    cloud = PointCloud(points=np.random.default_rng(0).normal(size=(50, 3)), viewpoints=np.zeros((1, 3)))
    with pytest.raises(CloudError, match="does not know its pixels"):
        register([cloud, cloud])
    with pytest.raises(ConfigError, match="offset_sigma"):
        RegisterConfig(offset_sigma=0.0)
