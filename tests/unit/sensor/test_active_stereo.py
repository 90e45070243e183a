"""The reference D415 on surfaces in closed form: the maker's noise law, rounding of a groove, the blind band, bare metal.

One or two seeds, for each view takes half a second; `experiments/03_sensor_figures.py` has more.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.depth_scenes import FLAT, points_in_part, profile_depth, profile_scene, v_groove
from weldsim.errors import ConfigError
from weldsim.records import CameraIntrinsics
from weldsim.sensor.active_stereo import D415Stereo
from weldsim.sensor.base import Finish
from weldsim.sensor.infrared import InfraredConfig, dot_pattern, gain
from weldsim.sensor.stereo_config import D415StereoConfig

EXACT = D415StereoConfig(depth_unit=0.0, disparity_step=0.0)
SMALL = CameraIntrinsics(width=420, height=260, fx=617.0, fy=617.0, cx=230.0, cy=130.0)
FB = SMALL.fx * 0.055


def seen(profile: list[tuple[float, float]], z: float, config: D415StereoConfig = EXACT, seed: int = 0, **kw) -> tuple:
    """Depth and exact depth [m]."""
    scene, view = profile_scene(profile, z, **kw)
    capture = D415Stereo(scene, SMALL, config, seed=seed).capture(view)
    return capture.frame.depth, capture.truth.depth


def middle(image: ndarray) -> ndarray:
    return image[15:-15, 125:-15]


@pytest.mark.parametrize("z", [0.36, 0.45, 0.56])
def test_plane_noise_follows_the_makers_law(z: float) -> None:
    depth, truth = seen(FLAT, z, tilt=0.1)
    assert np.abs(truth - profile_depth(SMALL, FLAT, z, tilt=0.1)).max() < 5e-6
    error = middle(depth - truth)
    assert np.isfinite(error).mean() > 0.995
    assert np.nanstd(error) == pytest.approx(z**2 * 0.08 / FB, rel=0.25)
    assert abs(np.nanmean(error)) < 0.2e-3


def test_noise_is_alike_over_five_pixels_and_mostly_stays() -> None:
    scene, view = profile_scene(FLAT, 0.45)
    camera = D415Stereo(scene, SMALL, EXACT)
    error = [FB / middle(camera.capture(replace(view, exposure=k)).frame.depth) - FB / 0.45 for k in range(2)]
    for axis in (0, 1):
        field = np.moveaxis(np.nan_to_num(error[0] - np.nanmean(error[0])), axis, 0)
        correlation = [np.mean(field[: len(field) - lag] * field[lag:]) for lag in range(12)]
        assert 4.5 <= np.interp(-np.exp(-1), -np.array(correlation) / correlation[0], np.arange(12)) <= 6.0
    temporal = np.nanstd(error[0] - error[1]) / np.sqrt(2)
    assert 0.05 < temporal / np.nanstd(error[0]) < 0.4


def test_a_small_groove_is_rounded_off() -> None:
    """The 6 x 5 mm V of figure V4 at 0.40 m: 1.9 to 2.9 mm deep, its bottom where it is."""
    depth, truth = seen(v_groove(0.006, 0.005), 0.40)
    across = points_in_part(SMALL, truth, 0.40)[..., 0]
    height = points_in_part(SMALL, depth, 0.40)[..., 2]
    strips = [np.nanmean(height[np.abs(across - x) < 0.5e-3]) for x in np.arange(-20, 21) * 1e-3]
    assert 1.9e-3 <= -np.min(strips) <= 2.9e-3
    assert abs(int(np.argmin(strips)) - 20) <= 1
    assert abs(np.mean(strips[:12])) < 0.15e-3


@pytest.mark.parametrize("z", [0.35, 0.50])
def test_the_left_band_is_blind(z: float) -> None:
    depth, _ = seen(FLAT, z, D415StereoConfig())
    assert abs(np.median(np.isfinite(depth).argmax(axis=1)) - FB / z) <= 3
    assert np.isfinite(depth[:, round(FB / z) + 6 :]).mean() > 0.99


def test_nothing_is_reported_nearer_than_the_search_range() -> None:
    depth, truth = seen(FLAT, 0.27, D415StereoConfig(), tilt=0.5)
    assert np.nanmin(truth) < FB / 126 < np.nanmin(depth) + 0.5e-3
    near, far = truth < FB / 126 - 4e-3, truth > FB / 126 + 4e-3
    assert min(near.sum(), far.sum()) > 20000
    assert np.isfinite(depth[near]).mean() < 0.05  # a wrong match for a few
    assert np.isfinite(depth[far][:, None]).mean() > 0.3


def test_bare_metal_has_a_hole_where_it_faces_the_camera_and_black_has_noise() -> None:
    """Ground steel square to the camera loses the highlight; turned away by 20 degrees it does not."""
    facing, _ = seen(FLAT, 0.40, finish=Finish.GROUND)
    turned, _ = seen(FLAT, 0.40, finish=Finish.GROUND, tilt=0.35)
    assert np.isnan(middle(facing)).mean() > 0.03
    assert np.isnan(middle(turned)).mean() < 0.02
    noise = [np.nanstd(middle(np.subtract(*seen(FLAT, 0.40, finish=finish)))) for finish in (Finish.MATTE, Finish.BLACK)]
    assert noise[1] > noise[0]


def test_dots_fill_the_field_and_exposure_follows_the_light() -> None:
    config = InfraredConfig()
    pattern = dot_pattern(config, 0)
    assert pattern.mean() == pytest.approx(1.0, abs=1e-3)
    blocks = pattern[: pattern.shape[0] // 8 * 8, : pattern.shape[1] // 8 * 8]
    blocks = blocks.reshape(8, pattern.shape[0] // 8, 8, -1, order="A").mean(axis=(1, 3))
    assert blocks.std() < 0.1
    assert not np.array_equal(pattern, dot_pattern(config, 1))
    light = np.full((10, 10), 0.3, np.float32)
    assert gain(light, config) * 0.3 == pytest.approx(config.exposure)
    assert gain(light * 0, config) == gain(light * 1e-6, config) < np.inf


@pytest.mark.parametrize(("cls", "key", "value"), [(InfraredConfig, "dots", 0), (D415StereoConfig, "baseline", -0.1)])
def test_impossible_settings_are_refused(cls: type, key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=key):
        cls(**{key: value})
