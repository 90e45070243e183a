"""Timing of joint paths at random, smooth and with kinks: no limit is exceeded, and none is kept from without need."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from weldsim.motion.config import MotionConfig
from weldsim.motion.follow import JointPath
from weldsim.motion.rail import Rail
from weldsim.motion.timing import piece_move
from weldsim.records import Segment


def joint_path(q: CubicSpline) -> JointPath:
    return JointPath(segment=Segment.WELD, spline=q, position_error=0.0, axis_error=0.0, solved=len(q.x))


def rail(length: float, speed: float, later: float | None = None) -> Rail:
    """A line along x; from its middle on the torch is asked for the speed `later` [m/s]."""
    s = np.linspace(0.0, length, 201)
    return Rail(
        s=s,
        p=np.stack([s, 0 * s, 0 * s], axis=1),
        quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (201, 1)),
        speed=np.where(s < length / 2, speed, speed if later is None else later),
        index=np.arange(201),
        start=0.0,
        end=length,
        roll_free=True,
    )


def kinked(seed: int) -> CubicSpline:
    """Joints that turn steadily between kinks, at up to 40 rad/m; each kink is rounded over 0.1 to 3 mm."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.uniform(0.005, 0.115, rng.integers(1, 7)))
    width = rng.uniform(0.0001, 0.003, len(at))
    change = rng.uniform(-40, 40, (len(at), 6))
    near = (at[:, None] + width[:, None] * np.linspace(-3, 3, 25)).ravel()
    s = np.unique(np.concatenate([np.linspace(0.0, 0.12, 61), near[(near > 0) & (near < 0.12)]]))
    s = s[np.concatenate([[True], np.diff(s) > 2e-5])]
    bent = width[:, None] * np.logaddexp(0.0, (s - at[:, None]) / width[:, None])
    return CubicSpline(s, bent.T @ change)


@pytest.mark.parametrize("speed", [0.002, 0.008, 0.04, 0.3])
@pytest.mark.parametrize("seed", range(12))
def test_no_limit_is_exceeded_on_joint_paths_with_kinks(seed: int, speed: float) -> None:
    path = joint_path(kinked(seed))
    for config in (MotionConfig(), MotionConfig(joint_jerk_limit=40.0, joint_acceleration_limit=3.0, joint_speed_limit=0.5)):
        move = piece_move(rail(float(path.spline.x[-1]), speed, later=0.6 * speed), path, config)
        assert np.abs(move.qd).max() <= config.joint_speed_limit
        assert np.abs(move.qdd).max() <= config.joint_acceleration_limit
        assert np.abs(np.diff(move.qdd, axis=0)).max() / config.period <= config.joint_jerk_limit
        assert move.speed.max() <= speed * (1 + 1e-9)
        assert np.diff(move.s).min() >= 0
        np.testing.assert_allclose(move.s[[0, -1]], [0.0, path.spline.x[-1]], atol=1e-12)


@pytest.mark.parametrize("bend", [2e4, 1e5])
def test_a_bend_is_passed_as_fast_as_a_steady_speed_allows(bend: float) -> None:
    """For 5 mm one joint bends by `bend` [rad/m2]: a steady v takes an acceleration of bend v^2, and no jerk between its ends."""
    config = MotionConfig(joint_jerk_limit=1e6)
    s = np.unique(np.concatenate([np.linspace(0.0, 0.1, 51), np.linspace(0.045, 0.055, 501)]).round(9))
    soft = 1e-4  # [m] over which the bend begins and ends
    rate = bend * soft * (np.logaddexp(0.0, (s - 0.0475) / soft) - np.logaddexp(0.0, (s - 0.0525) / soft))
    rate -= 0.0025 * bend
    q = np.zeros((len(s), 6))
    q[:, 2] = CubicSpline(s, rate).antiderivative()(s)
    move = piece_move(rail(0.1, 0.05), joint_path(CubicSpline(s, q)), config)
    inside = (move.s > 0.0485) & (move.s < 0.0515)
    np.testing.assert_allclose(move.speed[inside], np.sqrt(0.97 * config.joint_acceleration_limit / bend), rtol=0.02)
