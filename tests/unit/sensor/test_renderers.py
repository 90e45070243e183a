"""Both renderers give the exact depth of a pinhole camera: against MuJoCo's own rays, each other and closed forms."""

import cv2
import mujoco
import numpy as np
import pytest
from numpy import ndarray

from tests.twin_scenes import CENTRE_W, PLATE_TOP, camera_above, grooved_scene
from weldsim.errors import SensorError
from weldsim.frames import Transform
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import Label
from weldsim.sensor.embree import EmbreeRenderer
from weldsim.sensor.exact import TwinScene
from weldsim.sensor.renderer import Render, Renderer, camera_pose, make_renderer
from weldsim.sensor.solids import geom_triangles

FLAT = (Label.TABLE, Label.PART, Label.GROOVE)
SKEWED = CameraIntrinsics(width=320, height=200, fx=300.0, fy=340.0, cx=101.3, cy=130.8)
LARGE = CameraIntrinsics(width=1000, height=600, fx=800.0, fy=800.0, cx=500.0, cy=300.0)  # beyond the offscreen buffer


@pytest.fixture(scope="module")
def scene() -> TwinScene:
    return grooved_scene()


@pytest.fixture(scope="module", params=[pytest.param("egl", marks=pytest.mark.render), "embree"])
def renderer(request: pytest.FixtureRequest, scene: TwinScene) -> Renderer:
    return make_renderer(scene.model, request.param)


def cast(scene: TwinScene, X_WC: Transform, intrinsics: CameraIntrinsics) -> tuple[ndarray, ndarray]:
    """Depth [m] and geom of every pixel by MuJoCo's double-precision rays, visible groups only."""
    rays = intrinsics.rays().reshape(-1, 3) @ X_WC.R.T
    length = np.linalg.norm(rays, axis=1)
    geom, distance = np.zeros(len(rays), np.int32), np.zeros(len(rays))
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    directions = (rays / length[:, None]).ravel()
    mujoco.mj_multiRay(scene.model, scene.data, X_WC.p, directions, groups, 1, -1, geom, distance, None, len(rays), mujoco.mjMAXVAL)
    z = np.where(geom >= 0, distance / length, np.nan)
    shape = (intrinsics.height, intrinsics.width)
    return z.reshape(shape), geom.reshape(shape)


def away_from_edges(geom: ndarray, z: ndarray | None = None) -> ndarray:
    """Pixels whose eight neighbours show the same geom, and with `z` [m] the same plane (where 1 / z is linear)."""
    ids, around = geom.astype(np.float32), np.ones((3, 3), np.uint8)
    inside = cv2.dilate(ids, around) == cv2.erode(ids, around)
    if z is None:
        return inside
    bent = np.abs(cv2.filter2D(np.nan_to_num(1 / z), cv2.CV_64F, np.array([[1.0, 1, 1], [1, -8, 1], [1, 1, 1]]))) > 1e-9
    return inside & ~bent


@pytest.mark.parametrize("intrinsics", [D415_640X480, SKEWED, LARGE], ids=["thesis", "skewed", "large"])
@pytest.mark.parametrize("seed", range(3))
def test_depth_equals_rays(renderer: Renderer, scene: TwinScene, intrinsics: CameraIntrinsics, seed: int) -> None:
    X_WC = camera_above(seed)
    image = renderer.render(scene.data, X_WC, intrinsics, colour=False)
    z, geom = cast(scene, X_WC, intrinsics)
    flat = np.isin(scene.labels, FLAT)[np.maximum(geom, 0)] & (geom >= 0) & away_from_edges(geom, z)
    assert flat.mean() > 0.5
    assert (image.geom[flat] == geom[flat]).all()
    limit = 1e-6 if renderer.backend != "embree" else 5e-6
    assert np.abs(image.depth[flat] - z[flat]).max() < limit
    # Curved shapes are drawn as facets: the same silhouette to a pixel, the depth to a fraction of a millimetre.
    assert (image.geom != geom).mean() < 2e-3


@pytest.mark.render
@pytest.mark.parametrize("seed", range(3))
def test_backends_agree(scene: TwinScene, seed: int) -> None:
    X_WC = camera_above(10 + seed)
    gl = make_renderer(scene.model, "egl").render(scene.data, X_WC, D415_640X480)
    embree = make_renderer(scene.model, "embree").render(scene.data, X_WC, D415_640X480)
    same = gl.geom == embree.geom
    assert same.mean() > 0.999
    workpiece = same & np.isin(np.append(scene.labels, Label.NONE)[gl.geom], FLAT)
    assert np.abs(gl.depth - embree.depth)[workpiece].max() < 5e-6


def test_embree_is_as_smooth_as_its_facets(scene: TwinScene) -> None:
    """Curved shapes: within the sagitta of 96 facets of MuJoCo's analytic rays."""
    X_WC = camera_above(1)
    image = EmbreeRenderer(scene.model).render(scene.data, X_WC, D415_640X480, colour=False)
    z, geom = cast(scene, X_WC, D415_640X480)
    curved = np.isin(geom, [scene.model.geom(name).id for name in ("bolt", "pin", "stud")]) & (image.geom == geom)
    error = np.abs(image.depth - z)[curved & away_from_edges(geom)]
    assert error.size > 500
    assert np.median(error) < 3e-5


def test_pixel_centres_are_at_half(renderer: Renderer, scene: TwinScene) -> None:
    """A plane seen askew: depth is z0 / (1 - tan u) at the pixel's centre, so half a pixel off would be 0.3 mm here."""
    tilt = 0.5
    R = np.diag([1.0, -1.0, -1.0]) @ Transform.from_rotation_vector("CC", np.array([0.0, tilt, 0.0]), np.zeros(3)).R
    X_WC = Transform("WC", R, np.array([0.0, 0.4, 0.75 + 0.4]))  # the table's top is at 0.75
    image = renderer.render(scene.data, X_WC, D415_640X480, colour=False)
    table = image.geom == scene.model.geom("table").id
    table &= away_from_edges(image.geom)
    z = -0.4 / (D415_640X480.rays() @ R[2])
    assert np.abs(image.depth - z)[table].max() < (5e-6 if renderer.backend == "embree" else 1e-6)
    shifted = np.abs(image.depth[:, 1:] - 0.5 * (z[:, 1:] + z[:, :-1]))[table[:, 1:]]
    assert shifted.mean() > 5e-5


def test_a_miss_is_nan(renderer: Renderer, scene: TwinScene) -> None:
    up = Transform("WC", np.eye(3), np.array([0.0, 0.4, 1.3]))
    image = renderer.render(scene.data, up, SKEWED)
    assert np.isnan(image.depth).all()
    assert (image.geom == -1).all()
    edge = Transform("WC", np.diag([1.0, -1.0, -1.0]), np.array([0.9, 0.4, 0.8]))
    image = renderer.render(scene.data, edge, SKEWED)
    assert 0.1 < np.isnan(image.depth).mean() < 0.9
    assert (np.isnan(image.depth) == (image.geom == -1)).all()
    assert (image.depth[image.geom >= 0] > 0).all()


def test_hidden_groups_and_sites_are_not_seen(renderer: Renderer, scene: TwinScene) -> None:
    """A collision box (group 3) and a site lie between camera and plate."""
    X_WC = Transform("WC", np.diag([1.0, -1.0, -1.0]), CENTRE_W + np.array([0.0, 0.0, 0.4]))
    image = renderer.render(scene.data, X_WC, D415_640X480, colour=False)
    assert scene.model.geom("ghost").id not in image.geom
    assert image.geom[226, 200] == scene.model.geom("plate").id
    assert image.depth[226, 200] == pytest.approx(CENTRE_W[2] + 0.4 - PLATE_TOP, abs=1e-6)


@pytest.mark.parametrize("angle", [-0.4, 0.0, 0.3])
def test_wrist_camera_follows_the_arm(renderer: Renderer, scene: TwinScene, angle: float) -> None:
    data = mujoco.MjData(scene.model)
    data.qpos[0] = angle
    mujoco.mj_forward(scene.model, data)
    X_WC = camera_pose(scene.model, data, "wrist")
    c, s = np.cos(angle), np.sin(angle)
    assert X_WC.p == pytest.approx([-0.6 + 0.6 * c, 0.45, 1.2 - 0.6 * s], abs=1e-12)
    assert X_WC.R[:, 2] == pytest.approx([-s, 0.0, -c], abs=1e-12)  # looks down at rest
    image = renderer.render(data, X_WC, D415_640X480, colour=False)
    moved = TwinScene(model=scene.model, data=data, X_WB=scene.X_WB, labels=scene.labels)
    z, geom = cast(moved, X_WC, D415_640X480)
    box = np.isin(geom, [scene.model.geom(name).id for name in ("table", "plate")]) & away_from_edges(geom, z)
    assert box.mean() > 0.3
    assert np.abs(image.depth - z)[box].max() < 5e-6


def test_colour_is_registered_to_depth(renderer: Renderer, scene: TwinScene) -> None:
    """The red clamp is red where its geom is seen, and hardly elsewhere."""
    image: Render = renderer.render(scene.data, camera_above(2), D415_640X480)
    assert image.colour is not None
    red = (image.colour[..., 0] > 2.0 * image.colour[..., 1]) & (image.colour[..., 0] > 40)
    clamp = image.geom == scene.model.geom("clamp").id
    assert (red & clamp).sum() / (red | clamp).sum() > 0.8


def test_an_unknown_camera_names_the_known_ones(scene: TwinScene) -> None:
    with pytest.raises(SensorError, match="wrist"):
        camera_pose(scene.model, scene.data, "elbow")


def test_a_height_field_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><asset><hfield name='hill' nrow='2' ncol='2' size='1 1 1 1' elevation='0 1 0 1'/></asset>"
        "<worldbody><geom name='hill' type='hfield' hfield='hill'/></worldbody></mujoco>"
    )
    with pytest.raises(SensorError, match="hill"):
        geom_triangles(model, 0)
