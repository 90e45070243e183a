"""The sensors on the real cell: the wrist camera of the arm, the labels of its geoms, both back ends on the workpiece."""

import numpy as np
import pytest

from weldsim.scene.config import SceneConfig
from weldsim.scene.world import World, build_world
from weldsim.sensor.base import Label, View
from weldsim.sensor.exact import ExactSensor, twin_scene
from weldsim.sensor.renderer import camera_pose


@pytest.fixture(scope="module")
def world() -> World:
    return build_world(SceneConfig())


def test_the_wrist_camera_stands_at_the_view(world: World) -> None:
    data = world.new_data(world.view_joints(0))
    X_WC = camera_pose(world.model, data, "d415")
    assert X_WC.matrix == pytest.approx((world.X_WB @ world.views[0]).matrix, abs=1e-9)


@pytest.mark.render
def test_the_arm_does_not_block_its_own_view_and_back_ends_agree(world: World) -> None:
    data = world.new_data(world.view_joints(0))
    view = View(X_BC=world.views[0])
    gl, rays = (
        ExactSensor(twin_scene(world, data), world.intrinsics, backend=b, colour=False).capture(view) for b in ("egl", "embree")
    )
    assert gl.truth is not None
    assert rays.truth is not None
    assert (gl.truth.labels == rays.truth.labels).mean() > 0.999
    workpiece = np.isin(gl.truth.labels, (Label.PART, Label.GROOVE)) & (gl.truth.labels == rays.truth.labels)
    assert workpiece.mean() > 0.1
    assert np.abs(gl.frame.depth - rays.frame.depth)[workpiece].max() < 5e-6
    assert (gl.truth.labels == Label.GROOVE).mean() > 5e-3
    assert Label.ROBOT not in gl.truth.labels


def test_groove_pixels_lie_below_the_parent_surface(world: World) -> None:
    """The label is of the surface seen: groove points are 0 to 8 mm under the plate's face, part points not under it."""
    data = world.new_data()
    capture = ExactSensor(twin_scene(world, data), world.intrinsics, backend="embree", colour=False).capture(
        View(X_BC=world.views[0])
    )
    assert capture.truth is not None
    points = world.intrinsics.rays() * capture.truth.depth[..., None].astype(float)
    X_PC = world.X_BP.inverse() @ world.views[0]
    height = X_PC.points(points[capture.truth.labels == Label.GROOVE])[:, 2]
    assert height.min() == pytest.approx(-world.config.groove.depth, abs=0.3e-3)
    assert -0.6e-3 < height.max() < 2e-6
    face = X_PC.points(points[capture.truth.labels == Label.PART])[:, 2]
    assert np.median(face) == pytest.approx(0.0, abs=2e-6)
