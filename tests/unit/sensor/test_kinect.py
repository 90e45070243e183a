"""The Kinect v2 model: noise law, mixed pixels at steps, ranges, filters, corners; on phasors and on rendered surfaces."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.depth_scenes import FLAT, fillet, profile_scene
from weldsim.errors import ConfigError
from weldsim.frames import Transform
from weldsim.mounts import KINECT_V2
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import Label, View
from weldsim.sensor.exact import TwinScene
from weldsim.sensor.kinect import KinectConfig, axial_sigma, hanging, phasors, unwrapped
from weldsim.sensor.time_of_flight import KinectV2

SMALL = CameraIntrinsics(width=160, height=120, fx=365.456, fy=365.456, cx=80.0, cy=60.0)
IDEAL = KinectConfig(noise=0.0, depth_unit=0.0, smoothing=False, edge_filter=False)


@pytest.mark.parametrize(("z", "sigma"), [(1.0, 1.30e-3), (1.5, 1.42e-3), (2.0, 1.70e-3)])
def test_plane_noise_follows_the_published_law(z: float, sigma: float) -> None:
    """Millimetre steps add 0.29 mm in quadrature."""
    scene, view = profile_scene(FLAT, z, reach=3.0)
    errors = []
    for seed in range(3):
        capture = KinectV2(scene, SMALL, seed=seed).capture(view)
        assert capture.truth is not None
        errors.append(capture.frame.depth - capture.truth.depth)
    assert np.isfinite(errors).all()
    assert np.std(errors) == pytest.approx(np.hypot(sigma, 0.29e-3), rel=0.10)
    assert abs(np.mean(errors)) < 0.1e-3


@pytest.mark.parametrize("degrees", [40, 60])
def test_noise_grows_with_the_angle_as_published(degrees: int) -> None:
    scene, view = profile_scene(FLAT, 1.2, reach=3.0, tilt=np.radians(degrees))
    capture = KinectV2(scene, SMALL, replace(KinectConfig(), depth_unit=0.0, smoothing=False), seed=1).capture(view)
    assert capture.truth is not None
    middle = (np.abs(capture.truth.depth - 1.2) < 0.03) & np.isfinite(capture.frame.depth)
    assert middle.sum() > 500
    expected = {40: 1.42e-3, 60: 1.86e-3}[degrees]
    assert axial_sigma(np.array([1.2]), np.radians([degrees]))[0] == pytest.approx(expected, abs=0.01e-3)
    assert np.std((capture.frame.depth - capture.truth.depth)[middle]) == pytest.approx(expected, rel=0.10)


@pytest.mark.parametrize("seed", range(3))
def test_any_range_is_unwrapped(seed: int) -> None:
    reach = np.random.default_rng(seed).uniform(0.3, 9.0, (40, 50)).astype(np.float32)
    received = phasors(reach, np.ones_like(reach), 1, 0.0)
    assert np.abs(unwrapped(received) - reach).max() < 1e-4


def block_scene() -> tuple[TwinScene, View]:
    """A 50 mm block of 0.2 x 0.2 m on a floor 1 m below the camera, turned by 17 degrees."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom type='plane' size='3 3 .1'/>"
        "<geom type='box' size='.1 .1 .025' pos='0 0 .025' euler='0 0 17'/></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = TwinScene(
        model=model,
        data=data,
        X_WB=Transform("WB", np.eye(3), np.zeros(3)),
        labels=np.array([Label.TABLE, Label.PART], np.uint8),
    )
    return scene, View(X_BC=Transform("BC", np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0])))


@pytest.mark.parametrize("supersample", [2, 3])
def test_pixels_hang_between_the_surfaces_at_a_step(supersample: int) -> None:
    """Figure V10: 0.6 to 0.9 pixels of the middle half of the step for each pixel of perimeter; none without blur."""
    scene, view = block_scene()

    def mixed(config: KinectConfig) -> float:
        depth = KinectV2(scene, SMALL, config).capture(view).frame.depth
        return float(((depth > 0.9625) & (depth < 0.9875)).sum()) / (4 * 0.2 * SMALL.fx / 0.95)

    assert 0.6 <= mixed(replace(IDEAL, supersample=supersample)) <= 0.9
    assert mixed(replace(IDEAL, supersample=1, blur=0.0)) < 0.05


def test_the_filter_removes_what_hangs_and_what_stands_alone() -> None:
    z = np.full((12, 20), 1.0, np.float32)
    z[:, 10:] = 1.2
    z[:, 9] = 1.1  # between the two
    z[6, 4] = 1.5  # alone
    z[2, 15] = np.nan
    found = hanging(z, KinectConfig())
    assert found[:, 9].all()
    assert found[6, 4]
    assert found.sum() == 12 + 1


def test_errors_that_are_parameters() -> None:
    scene, view = profile_scene(FLAT, 1.0, reach=3.0)
    near = KinectV2(scene, SMALL, IDEAL).capture(view).frame.depth
    assert np.abs(near - 1.0)[5:-5, 5:-5].max() < 1e-4
    offset = KinectV2(scene, SMALL, replace(IDEAL, offset=0.024)).capture(view).frame.depth
    assert offset[60, 80] - near[60, 80] == pytest.approx(0.024, abs=1e-5)
    waves = KinectV2(scene, SMALL, replace(IDEAL, wiggling=0.005)).capture(view).frame.depth
    assert 0.003 < np.abs(waves - near).max() <= 0.0051


def test_an_inner_corner_is_pulled_away_by_bounced_light() -> None:
    """Light by way of the other side comes later: both sides of a corner of 90 degrees seem farther, a plane does not."""
    x = (np.arange(SMALL.width) + 0.5 - SMALL.cx) / SMALL.fx
    sides = (np.abs(x) > 0.03) & (np.abs(x) < 0.10)
    for profile, low, high in ((fillet(), 2e-3, 20e-3), (FLAT, -0.1e-3, 0.1e-3)):
        scene, view = profile_scene(profile, 1.0, reach=0.3)
        for bounces in (0, 8):
            capture = KinectV2(scene, SMALL, replace(IDEAL, bounces=bounces)).capture(view)
            assert capture.truth is not None
            error = (capture.frame.depth - capture.truth.depth)[30:-30, sides].mean()
            assert low < error < high if bounces else abs(error) < 0.1e-3


def test_nothing_outside_the_drivers_range() -> None:
    for z in (0.4, 5.0):
        scene, view = profile_scene(FLAT, z, reach=8.0)
        assert np.isnan(KinectV2(scene, SMALL).capture(view).frame.depth).all()


def test_the_image_is_512_by_424() -> None:
    assert (KINECT_V2.width, KINECT_V2.height) == (512, 424)


@pytest.mark.parametrize(("key", "value"), [("noise", -1.0), ("nearest", 5.0), ("edge_near", 0.0)])
def test_impossible_settings_are_refused(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=r"kinect\."):
        KinectConfig(**{key: value})
