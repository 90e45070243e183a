"""What every depth sensor promises, run over all of them: exact by OpenGL and by rays, both D415s, the Kinect v2, replay."""

import numpy as np
import pytest

from tests.twin_scenes import CENTRE_W, PLATE_TOP, camera_above, grooved_scene
from weldsim.errors import SensorError
from weldsim.frames import Transform
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics
from weldsim.sensor.active_stereo import D415Stereo
from weldsim.sensor.base import Capture, DepthSensor, Label, View
from weldsim.sensor.exact import ExactSensor
from weldsim.sensor.kinect import KinectConfig
from weldsim.sensor.replay import ReplaySensor
from weldsim.sensor.stereo import D415Fast
from weldsim.sensor.time_of_flight import KinectV2

SMALL = CameraIntrinsics(width=400, height=240, fx=617.0, fy=616.5, cx=216.1, cy=113.9)
TWINS = [pytest.param("gl", marks=pytest.mark.render), "embree", "d415", "d415-stereo", "kinect"]
KINDS = [*TWINS, "replay"]
NOISY = ("d415", "d415-stereo", "kinect")
UNITS = {"d415": range(6)}  # its noise is alike over as much as the clamp: what several units see is averaged
NEAR = KinectConfig(nearest=0.2)  # the scene's views are those of the wrist camera
SCENE = grooved_scene()


def make_sensor(kind: str, seed: int = 0, intrinsics: CameraIntrinsics = SMALL) -> DepthSensor:
    if kind == "gl":
        return ExactSensor(SCENE, intrinsics, backend="egl")
    exact = ExactSensor(SCENE, intrinsics, backend="embree")
    if kind == "embree":
        return exact
    if kind == "d415":
        return D415Fast(exact, seed=seed)
    if kind == "d415-stereo":
        return D415Stereo(SCENE, intrinsics, seed=seed)
    if kind == "kinect":
        return KinectV2(SCENE, intrinsics, NEAR, seed=seed)
    return ReplaySensor([exact.capture(view(seed=k)).frame for k in range(3)])


def view(seed: int = 1, exposure: int = 0) -> View:
    return View(X_BC=SCENE.X_WB.inverse() @ camera_above(seed), exposure=exposure, t=1.5)


def equal(a: Capture, b: Capture) -> bool:
    return np.array_equal(a.frame.depth, b.frame.depth, equal_nan=True)


@pytest.mark.parametrize("intrinsics", [SMALL], ids=["400x240"])
@pytest.mark.parametrize("kind", KINDS)
class TestEverySensor:
    def test_the_frame_is_as_promised(self, kind: str, intrinsics: CameraIntrinsics) -> None:
        sensor = make_sensor(kind, intrinsics=intrinsics)
        frame = sensor.capture(view()).frame
        assert sensor.intrinsics is intrinsics
        assert frame.intrinsics is intrinsics
        assert frame.depth.shape == (intrinsics.height, intrinsics.width)
        assert frame.depth.dtype == np.float32
        seen = np.isfinite(frame.depth)
        assert seen.mean() > 0.5
        assert (np.isnan(frame.depth) | (frame.depth > 0.2) & (frame.depth < 1.0)).all()
        assert not frame.depth.flags.writeable
        assert frame.source

    def test_no_return_is_nan(self, kind: str, intrinsics: CameraIntrinsics) -> None:
        if kind == "replay":
            with pytest.raises(SensorError, match="there are 3"):
                make_sensor(kind, intrinsics=intrinsics).capture(view(exposure=3))
            return
        up = View(X_BC=Transform("BC", np.eye(3), np.array([0.0, -0.4, 0.5])))
        assert np.isnan(make_sensor(kind, intrinsics=intrinsics).capture(up).frame.depth).all()

    def test_equal_seeds_give_equal_bytes(self, kind: str, intrinsics: CameraIntrinsics) -> None:
        first, second = (make_sensor(kind, seed=7, intrinsics=intrinsics).capture(view()) for _ in range(2))
        assert first.frame.depth.tobytes() == second.frame.depth.tobytes()
        assert first.frame.colour is not None
        assert second.frame.colour is not None
        assert first.frame.colour.tobytes() == second.frame.colour.tobytes()

    def test_captures_do_not_depend_on_those_before(self, kind: str, intrinsics: CameraIntrinsics) -> None:
        sensor = make_sensor(kind, intrinsics=intrinsics)
        first = sensor.capture(view(exposure=0))
        sensor.capture(view(seed=2, exposure=1))
        assert equal(first, sensor.capture(view(exposure=0)))

    def test_colour_is_registered_to_depth(self, kind: str, intrinsics: CameraIntrinsics) -> None:
        """The red clamp stands 20 mm above the plate: red pixels lie at its height."""
        heights = []
        for seed in UNITS.get(kind, (0,)):
            frame = make_sensor(kind, seed, intrinsics).capture(view()).frame
            assert frame.colour is not None
            rgb = frame.colour.astype(int)
            red = (rgb[..., 0] > 2.5 * rgb[..., 1]) & (rgb[..., 0] > 60) & np.isfinite(frame.depth)
            assert red.sum() > 100
            points = frame.intrinsics.rays()[red] * frame.depth[red][:, None].astype(float)
            heights.append(np.median((SCENE.X_WB @ frame.X_BC).points(points)[:, 2]))
        assert np.mean(heights) == pytest.approx(PLATE_TOP + 0.02, abs=1e-3)

    def test_points_land_where_the_plate_is(self, kind: str, intrinsics: CameraIntrinsics) -> None:
        """Pose, intrinsics and half pixels agree: the plate's top comes out at its height, within the noise."""
        heights = []
        for seed in UNITS.get(kind, (0,)):
            frame = make_sensor(kind, seed, intrinsics).capture(view()).frame
            points = (frame.intrinsics.rays() * frame.depth[..., None].astype(float))[np.isfinite(frame.depth)]
            points_W = (SCENE.X_WB @ frame.X_BC).points(points)
            across = (points_W - CENTRE_W)[:, :2] @ np.array([np.cos(0.2), np.sin(0.2)])
            along = (points_W - CENTRE_W)[:, :2] @ np.array([-np.sin(0.2), np.cos(0.2)])
            top = (np.abs(across) > 0.02) & (np.abs(across) < 0.045) & (np.abs(along) < 0.03)
            assert top.sum() > 300
            heights.append(points_W[top, 2].mean())
        assert np.mean(heights) == pytest.approx(PLATE_TOP, abs=0.2e-3)


@pytest.mark.parametrize("kind", NOISY)
def test_noise_follows_seed_view_and_exposure(kind: str) -> None:
    base = make_sensor(kind, seed=1).capture(view())
    assert not equal(base, make_sensor(kind, seed=2).capture(view()))
    assert not equal(base, make_sensor(kind, seed=1).capture(view(exposure=1)))
    assert base.truth is not None
    errors = []
    for k in (1, 2):
        capture = make_sensor(kind, seed=1).capture(view(seed=k))
        assert capture.truth is not None
        errors.append(capture.frame.depth - capture.truth.depth)
    both = np.isfinite(errors[0]) & np.isfinite(errors[1]) & (np.abs(errors[0]) < 2e-3) & (np.abs(errors[1]) < 2e-3)
    assert abs(np.corrcoef(errors[0][both], errors[1][both])[0, 1]) < 0.1  # another view, other noise


@pytest.mark.parametrize("kind", TWINS)
def test_the_twin_knows_what_was_in_view(kind: str) -> None:
    """Truth is that of the same pixels: labels and depth of the exact camera, and the frame agrees with it within its noise."""
    capture = make_sensor(kind).capture(view())
    truth, exact = capture.truth, make_sensor("embree").capture(view()).truth
    assert truth is not None
    assert exact is not None
    assert {Label.TABLE, Label.PART, Label.GROOVE, Label.CLAMP} <= set(np.unique(truth.labels))
    assert ((truth.labels == Label.NONE) == np.isnan(truth.depth)).all()
    same = truth.labels == exact.labels
    assert same.mean() > 0.999
    assert np.nanmedian(np.abs(truth.depth - exact.depth)) < 1e-6
    assert np.nanmedian(np.abs(capture.frame.depth - truth.depth)) < 1.5e-3


@pytest.mark.parametrize("kind", KINDS)
def test_closing_twice_is_allowed(kind: str) -> None:
    sensor = make_sensor(kind)
    sensor.close()
    sensor.close()


def test_a_recording_has_no_truth() -> None:
    assert make_sensor("replay").capture(view()).truth is None


def test_the_noise_model_needs_truth() -> None:
    with pytest.raises(SensorError, match="exact depth"):
        D415Fast(make_sensor("replay")).capture(view())


def test_replay_refuses_no_frames_and_mixed_cameras() -> None:
    with pytest.raises(SensorError, match="no frames"):
        ReplaySensor([])
    frames = [make_sensor("embree", intrinsics=i).capture(view()).frame for i in (D415_640X480, SMALL)]
    with pytest.raises(SensorError, match="frame 1"):
        ReplaySensor(frames)
