"""Torch paths along seams: the tip stays on the seam, the wire on its bisector, nothing flips or turns too fast."""

from dataclasses import replace

import numpy as np
import pytest

from weldsim.curves import arc_length, interpolate, project, tangents
from weldsim.errors import ConfigError, PathError
from weldsim.frames import unit
from weldsim.path.asked import leaned, wire_tip
from weldsim.path.config import PathConfig
from weldsim.path.directions import limited, one_sided, smooth, turn
from weldsim.path.plan import plan_path
from weldsim.records import KnownSeam, Seam, Segment

SEEDS = range(8)


def seam(seed: int, *, noise: float = 0.0, step: float = 1e-3, sigma: bool = False) -> Seam:
    """A seam on a bent surface turned at will: normals rock about travel and nod along it, by up to 0.3 deg/mm; `noise` [rad]."""
    rng = np.random.default_rng(seed)
    u = np.arange(0.0, rng.uniform(0.08, 0.25), step)
    a, b, radius = (rng.uniform(low, high) for low, high in ((0, 6.3), (0, 6.3), (0.1, 0.4)))
    flat = np.stack([u, 0.012 * np.sin(u / 0.03 + a), 0 * u], axis=1)
    flat[:, 2] = -(flat[:, 0] ** 2) / (2 * radius)
    t = tangents(flat)
    up = np.stack([flat[:, 0] / radius, 0.2 * np.sin(u / 0.04 + b), np.ones_like(u)], axis=1)
    n = unit(up - np.einsum("ij,ij->i", up, t)[:, None] * t)
    n = unit(n + noise * rng.normal(size=n.shape))
    n = unit(n - np.einsum("ij,ij->i", n, t)[:, None] * t)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R = q * np.sign(np.linalg.det(q))
    points = flat @ R.T + [0.1, -0.45, 0.05]
    return Seam(
        points_B=points,
        s=arc_length(points),
        tangents_B=t @ R.T,
        normals_B=n @ R.T,
        sigma=np.linspace(1e-4, 3e-4, len(u)) if sigma else None,
        width=0.014,
        confidence=0.9,
    )


def straight(n: int = 101) -> Seam:
    """100 mm along x on a level plate."""
    points = np.stack([np.linspace(0, 0.1, n), np.full(n, -0.45), np.full(n, 0.02)], axis=1)
    x, z = np.tile([1.0, 0, 0], (n, 1)), np.tile([0, 0, 1.0], (n, 1))
    return Seam(points_B=points, s=arc_length(points), tangents_B=x, normals_B=z)


def wire_turn(path) -> np.ndarray:
    """Turn of the wire between poses over their distance [rad/m]."""
    return turn(path.X_BT.R[:, :, 2]) / np.diff(path.s)


@pytest.mark.parametrize("seed", SEEDS)
def test_tip_is_on_the_seam_from_end_to_end_in_steps(seed):
    found = seam(seed)
    path = plan_path(found, PathConfig(step=0.0005))
    distance, _, _ = project(path.X_BT.p, found.points_B)
    assert distance.max() < 1e-9
    np.testing.assert_allclose(path.X_BT.p[[0, -1]], found.points_B[[0, -1]], atol=1e-12)
    assert np.diff(path.s).max() <= 0.0005 + 1e-12
    np.testing.assert_allclose(path.s, arc_length(path.X_BT.p), atol=1e-9)
    assert path.s[-1] == pytest.approx(found.length, abs=1e-9)
    assert set(path.segments) == {Segment.WELD}
    assert path.arc_on.all()


@pytest.mark.parametrize("seed", SEEDS)
def test_wire_is_the_inward_normal_and_x_is_travel(seed):
    found = seam(seed)
    path = plan_path(found)
    at = np.searchsorted(path.s, found.s - 1e-9).clip(0, len(path.s) - 1)
    R = path.X_BT.R[at]
    off = np.degrees(np.arccos(np.clip(-np.einsum("ij,ij->i", R[:, :, 2], found.normals_B), -1, 1)))
    assert off.max() < 0.7  # what smoothing over 5 mm takes off a rocking surface
    off = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", R[:, :, 0], found.tangents_B), -1, 1)))
    assert off.max() < 3.5  # the tightest bend has a radius of 75 mm
    np.testing.assert_allclose(np.cross(path.X_BT.R[:, :, 2], path.X_BT.R[:, :, 0]), path.X_BT.R[:, :, 1], atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_unsmoothed_wire_is_exactly_the_inward_normal(seed):
    found = seam(seed)
    path = plan_path(found, PathConfig(smoothing=0.0))
    at = np.searchsorted(path.s, found.s - 1e-9).clip(0, len(path.s) - 1)
    np.testing.assert_allclose(path.X_BT.R[at][:, :, 2], -found.normals_B, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_turn_of_the_wire_keeps_its_limit_whatever_the_normals_do(seed):
    for noise, smoothing, limit in ((0.02, 0.005, 17.45), (0.3, 0.002, 17.45), (0.3, 0.0, 17.45), (0.2, 0.003, 14.0)):
        path = plan_path(seam(seed, noise=noise), PathConfig(smoothing=smoothing, turn_limit=limit))
        assert wire_turn(path).max() <= limit * (1 + 1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_normals_of_either_sign_give_the_same_path(seed):
    found = seam(seed)
    flips = np.where(np.random.default_rng(seed).random(len(found.s)) < 0.3, -1.0, 1.0)
    turned = plan_path(replace(found, normals_B=found.normals_B * flips[:, None]))
    np.testing.assert_allclose(turned.X_BT.R, plan_path(found).X_BT.R, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_of_the_normals_is_smoothed_away(seed):
    smooth_wire = plan_path(seam(seed)).X_BT.R[:, :, 2]
    noisy = seam(seed, noise=0.05)
    off = [
        np.sqrt(
            np.mean(turn_between(plan_path(noisy, PathConfig(smoothing=length, turn_limit=1e4)).X_BT.R[:, :, 2], smooth_wire) ** 2)
        )
        for length in (0.0, 0.005)
    ]
    assert off[1] < 0.5 * off[0]


def turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1, 1))


@pytest.mark.parametrize("angle", [-0.4, -0.1, 0.0, 0.2, 0.5])
def test_push_is_positive_and_the_wire_points_ahead(angle):
    R = plan_path(straight(), PathConfig(travel_angle=angle)).X_BT.R
    np.testing.assert_allclose(R[:, :, 2], np.tile([np.sin(angle), 0, -np.cos(angle)], (len(R), 1)), atol=1e-12)


@pytest.mark.parametrize("angle", [-0.4, -0.1, 0.0, 0.2, 0.5])
def test_positive_work_angle_leans_the_torch_to_the_right_of_travel(angle):
    path = plan_path(straight(), PathConfig(work_angle=angle))
    body = -path.X_BT.R[:, :, 2]
    right = np.array([0.0, -1.0, 0.0])  # of travel along x with z up
    np.testing.assert_allclose(body @ right, np.full(len(body), np.sin(angle)), atol=1e-12)
    np.testing.assert_allclose(path.X_BT.R[:, :, 0], np.tile([1.0, 0, 0], (len(body), 1)), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_process_angles_are_measured_against_the_upright_torch_and_keep_the_tip(seed):
    found, rng = seam(seed), np.random.default_rng(seed)
    work, travel = rng.uniform(-0.5, 0.5, 2)
    upright, leaned = plan_path(found), plan_path(found, PathConfig(work_angle=work, travel_angle=travel))
    np.testing.assert_allclose(leaned.X_BT.p, upright.X_BT.p, atol=1e-12)
    z = np.einsum("nij,nj->ni", np.swapaxes(upright.X_BT.R, 1, 2), leaned.X_BT.R[:, :, 2])
    assert np.abs(np.arcsin(z[:, 0]) - travel).max() < 1e-4  # slerp between nodes leaves a trace
    assert np.abs(np.arctan2(-z[:, 1], z[:, 2]) - work).max() < 1e-4


@pytest.mark.parametrize("seed", SEEDS)
def test_longer_ctwd_draws_the_torch_back_along_its_wire(seed):
    config = PathConfig(work_angle=0.3, travel_angle=-0.2)
    near, far = plan_path(seam(seed), config), plan_path(seam(seed), replace(config, ctwd=config.nominal_ctwd + 0.004))
    nodes = near.X_BT.p[:1], far.X_BT.p[:1]
    np.testing.assert_allclose(nodes[1] - nodes[0], -0.004 * near.X_BT.R[:1, :, 2], atol=1e-9)
    distance, _, _ = project(far.X_BT.p, near.X_BT.p)
    assert distance.max() <= 0.004 + 1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_trims_cut_the_ends_and_reverse_goes_back(seed):
    found = seam(seed, sigma=True)
    forth = plan_path(found, PathConfig(start_trim=0.010, end_trim=0.025))
    _, _, s = project(forth.X_BT.p[[0, -1]], found.points_B)
    np.testing.assert_allclose(s, [0.010, found.length - 0.025], atol=1e-9)
    back = plan_path(found, PathConfig(start_trim=0.025, end_trim=0.010, reverse=True))
    np.testing.assert_allclose(back.X_BT.p[[0, -1]], forth.X_BT.p[[-1, 0]], atol=1e-9)
    np.testing.assert_allclose(back.X_BT.R[0, :, 2], forth.X_BT.R[-1, :, 2], atol=1e-6)
    np.testing.assert_allclose(back.X_BT.R[0, :, 0], -forth.X_BT.R[-1, :, 0], atol=1e-6)
    for path in (forth, back):
        _, _, s = project(path.X_BT.p, found.points_B)
        np.testing.assert_allclose(path.sigma, np.interp(s, found.s, found.sigma), atol=1e-9)


def test_trims_that_leave_nothing_are_refused():
    with pytest.raises(PathError, match=r"leave 1\.0 mm of a seam 100\.0 mm long"):
        plan_path(straight(), PathConfig(start_trim=0.05, end_trim=0.049))
    assert PathError("x").exit_code == 1


def test_normal_along_travel_is_refused():
    line = straight()
    with pytest.raises(PathError, match="deg from its travel"):
        plan_path(replace(line, normals_B=np.tile(unit(np.array([1.0, 0, 0.1])), (101, 1))))


@pytest.mark.parametrize(
    "wrong",
    [
        *({"step": 0.0}, {"step": 1e-6}, {"speed": -1.0}, {"turn_limit": 0.0}, {"ctwd": 0.0}, {"start_trim": -0.001}),
        *({"smoothing": -1e-3}, {"work_angle": 1.2}, {"travel_angle": float("nan")}, {"speed": float("nan")}),
    ],
)
def test_config_out_of_range_is_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        PathConfig(**wrong)


@pytest.mark.parametrize("seed", SEEDS)
def test_speed_and_roll_are_the_configs(seed):
    path = plan_path(seam(seed), PathConfig(speed=0.0061, roll_free=False))
    assert (path.speed == 0.0061).all()
    assert not path.roll_free


def test_steady_turn_is_kept_to_its_ends():
    s = np.linspace(0, 0.2, 201)
    z = np.stack([np.sin(2 * s), 0 * s, -np.cos(2 * s)], axis=1)
    assert turn_between(smooth(s, z, 0.01), z).max() < 2e-3  # a local mean would be off by 0.016 at the ends


def test_smoothing_weighs_by_length_not_by_count():
    dense = np.sort(np.concatenate([np.linspace(0, 0.1, 101), np.linspace(0.02, 0.05, 2000)]))
    even = np.linspace(0, 0.1, 101)
    bumps = [np.stack([0.2 * np.exp(-(((s - 0.06) / 0.01) ** 2)), 0 * s, -np.ones_like(s)], axis=1) for s in (even, dense)]
    results = [smooth(s, unit(bump), 0.008) for s, bump in zip((even, dense), bumps, strict=True)]
    at = np.searchsorted(dense, even)
    assert turn_between(results[0], results[1][at]).max() < 5e-3


def test_limiter_leaves_slow_turns_and_treats_both_directions_alike():
    s = np.linspace(0, 0.1, 101)
    slow = np.stack([np.sin(5 * s), 0 * s, -np.cos(5 * s)], axis=1)
    assert limited(s, slow, 5.01) is slow
    step = np.where(s[:, None] < 0.05, [0.0, 0.0, -1.0], unit(np.array([0.5, 0.0, -1.0])))
    there, back = limited(s, step, 10.0), limited(s, step[::-1], 10.0)[::-1]
    assert turn_between(there, back).max() < 0.02
    assert turn(there).max() <= 10.0 * 1e-3 + 1e-9
    assert turn_between(there[[0, -1]], step[[0, -1]]).max() < 1e-9


def test_one_side_is_the_side_of_the_many():
    z = np.tile([0.0, 0.0, 1.0], (9, 1))
    sign = np.array([-1, 1, 1, 1, -1, 1, 1, 1, -1.0])
    np.testing.assert_array_equal(one_sided(z * sign[:, None]), z)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_what_was_asked_is_where_the_path_is(seed, reverse):
    found, rng = seam(seed), np.random.default_rng(seed)
    work, travel = rng.uniform(-0.5, 0.5, 2)
    config = PathConfig(work_angle=work, travel_angle=travel, ctwd=0.021, reverse=reverse, smoothing=0.0)
    path = plan_path(found, config)
    known = KnownSeam(
        opening_B=found.points_B,
        root_B=found.points_B,
        left_B=found.points_B,
        right_B=found.points_B,
        tangents_B=found.tangents_B,
        bisectors_B=-found.normals_B,
        s=found.s,
    )
    tip = wire_tip(path.X_BT, config).p
    distance, _, s = project(tip, found.points_B)
    assert distance.max() < 2e-5  # slerp between nodes while the torch is 6 mm away
    wanted = unit(interpolate(found.s, leaned(known, path, config).bisectors_B, s))
    assert turn_between(path.X_BT.R[:, :, 2], wanted).max() < 2e-3
    assert leaned(known, path, PathConfig()) is known


@pytest.mark.parametrize("name", ["ctwd", "nominal_ctwd"])
def test_a_contact_tip_is_near_its_work(name: str) -> None:
    with pytest.raises(ConfigError, match=r"outside 0\.001 to 0\.1"):
        PathConfig(**{name: 1e9})
