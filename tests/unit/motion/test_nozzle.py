"""The nozzle may touch nothing, the wire may: MuJoCo's verdict on steep grooves is that of plane geometry, rim included."""

import mujoco
import numpy as np
import pytest

from tests.torch_paths import START
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import torch_pose
from weldsim.motion.collision import CellCollision
from weldsim.mounts import X_WB
from weldsim.scene.cell import new_cell
from weldsim.scene.config import MaterialConfig
from weldsim.scene.tool import STICK_OUT, add_tool

MOUTH, RIM = STICK_OUT, 0.0085  # [m] behind the wire's tip, radius
WALL = 0.06  # [m] length of a groove's wall, down from its lips
SURE = 1e-4  # [m] nearer to contact than this, either verdict will do


@pytest.fixture(scope="module")
def walls() -> tuple[mujoco.MjModel, Transform]:
    """A cell with two thin boxes, walls of a groove to be placed, and the pose X_WT of the torch at START."""
    spec = new_cell(MaterialConfig())
    add_tool(spec.body("wrist_3_link"))
    for name in ("left", "right"):
        # Each in a body of its own: MuJoCo's tree of boxes is of a body's geoms as compiled.
        spec.worldbody.add_body(name=name).add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.03, WALL / 2, 0.0005])
    return spec.compile(), X_WB @ torch_pose(START)


def rim_points(X_WT: Transform) -> np.ndarray:
    """The nozzle's rim in W, and the circle 10 mm behind it."""
    around = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    circle = np.stack([RIM * np.cos(around), RIM * np.sin(around), 0 * around], axis=1)
    return X_WT.points(np.concatenate([circle - [0, 0, behind] for behind in (MOUTH, MOUTH + 0.01)]))


def place(model: mujoco.MjModel, name: str, X: Transform) -> None:
    body = model.body(name).id
    model.body_pos[body], model.body_quat[body] = X.p, X.quaternion


def test_steep_walls_are_touched_by_the_rim_exactly_where_they_should(walls: tuple[mujoco.MjModel, Transform]) -> None:
    model, X_WT = walls
    rng = np.random.default_rng(4)
    verdicts = []
    for _ in range(150):
        half, lean, along = rng.uniform(np.deg2rad(12), np.deg2rad(60)), rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4)
        # The groove's own frame: root along x through the wire's tip, opening against z.
        turn = matrix_from_rotation_vector(np.array([lean, 0, 0])) @ matrix_from_rotation_vector(np.array([0, along, 0]))
        points = rim_points(X_WT)
        gap = np.inf
        for name, side in (("left", 1.0), ("right", -1.0)):
            R = X_WT.R @ turn @ matrix_from_rotation_vector(np.array([-side * (np.pi / 2 - half), 0.0, 0.0]))
            down = R[:, 1] * side  # from the root up the wall
            down = down if down @ X_WT.R[:, 2] < 0 else -down
            normal = np.cross(R[:, 0], down)
            inwards = -(X_WT.R @ turn)[:, 2]
            normal = normal if normal @ inwards > 0 else -normal
            face = np.stack([R[:, 0], np.cross(normal, R[:, 0]), normal], axis=1)
            place(model, name, Transform("WT", face, X_WT.p + down * WALL / 2 - 0.0005 * normal))
            gap = min(gap, float(((points - X_WT.p) @ normal).min()))
        if abs(gap) < SURE:
            continue
        touch = CellCollision(model).touch(START)
        verdicts.append(touch is not None)
        assert (touch is not None) == (gap < 0), (half, lean, along, gap)
        if touch is not None:
            assert {touch.first, touch.second} & {"left", "right"}
            assert {touch.first, touch.second} & {"nozzle_mouth", "nozzle", "d415", "bracket"}
    # Both verdicts occur.
    assert 0.2 < np.mean(verdicts) < 0.8


def test_the_wire_may_touch_and_the_mouth_behind_it_may_not(walls: tuple[mujoco.MjModel, Transform]) -> None:
    model, X_WT = walls
    flat = Transform("WT", X_WT.R, X_WT.p)
    place(model, "right", Transform("WT", X_WT.R, X_WT.p + X_WT.R @ np.array([0.0, 0.0, 0.2])))
    for behind, touches in ((-0.001, False), (0.014, False), (MOUTH - 5e-4, False), (MOUTH + 1e-3, True)):
        # A small plate across the wire whose near face is `behind` the tip.
        place(model, "left", Transform("WT", flat.R, flat.points(np.array([[0.0, 0.0, 0.0005 - behind]]))[0]))
        assert (CellCollision(model).touch(START) is not None) is touches, behind


@pytest.mark.parametrize("distance", [-0.002, 0.001, 0.008, 0.015, 0.020, 0.027])
def test_how_near_a_body_is_that_is_not_touched(walls: tuple[mujoco.MjModel, Transform], distance: float) -> None:
    """A small plate across the wire, its near face so far ahead of the nozzle's mouth [m]."""
    model, X_WT = walls
    place(model, "right", Transform("WT", X_WT.R, X_WT.p + X_WT.R @ np.array([0.0, 0.0, 0.2])))
    place(model, "left", Transform("WT", X_WT.R, X_WT.points(np.array([[0.0, 0.0, distance - MOUTH + 0.0005]]))[0]))
    collision = CellCollision(model)
    gap, first, second = collision.nearest(START)
    assert gap == pytest.approx(distance, abs=1e-5)
    assert collision.gap(START) == gap
    assert first.startswith("nozzle")
    assert second == "left"


def test_a_body_put_elsewhere_is_as_near_as_it_is_there(walls: tuple[mujoco.MjModel, Transform]) -> None:
    model, X_WT = walls
    place(model, "right", Transform("WT", X_WT.R, X_WT.p + X_WT.R @ np.array([0.0, 0.0, 0.2])))
    collision = CellCollision(model)
    for distance in (0.005, 0.02, 0.01):
        there = X_WT.points(np.array([[0.0, 0.0, distance - MOUTH + 0.0005]]))[0]
        collision.shift("left", there, Transform("WT", X_WT.R, there).quaternion)
        assert collision.gap(START) == pytest.approx(distance, abs=1e-5)


def test_everything_drawn_of_the_tool_but_the_wire_is_in_a_collision_body(walls: tuple[mujoco.MjModel, Transform]) -> None:
    model, _ = walls
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    tool = [g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body("tool").id]
    solid = [g for g in tool if model.geom_contype[g]]
    drawn = [g for g in tool if not model.geom_contype[g] and model.geom(g).name != "wire"]
    assert len(drawn) > 15
    for geom in drawn:
        points = _surface(model, data, geom)
        outside = np.min([_distance(model, data, other, points) for other in solid], axis=0)
        assert outside.max() < 2e-4, model.geom(geom).name


def _surface(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Points on a box, cylinder or capsule (its cylinder), in W."""
    size, grid = model.geom_size[geom], np.linspace(-1, 1, 9)
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        local = np.array([[x, y, z] for x in grid for y in grid for z in grid]) * size
    else:
        around = np.linspace(0, 2 * np.pi, 48)
        local = np.array([[size[0] * np.cos(a), size[0] * np.sin(a), size[1] * z] for a in around for z in grid])
    return local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def _distance(model: mujoco.MjModel, data: mujoco.MjData, geom: int, points: np.ndarray) -> np.ndarray:
    """Signed distance of points from a box, cylinder or capsule."""
    local, size = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3), model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
        local[:, 2] -= np.clip(local[:, 2], -size[1], size[1])
        return np.linalg.norm(local, axis=1) - size[0]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        over = np.abs(local) - size
    else:
        over = np.stack([np.hypot(local[:, 0], local[:, 1]) - size[0], np.abs(local[:, 2]) - size[1]], axis=1)
    return np.minimum(over.max(axis=1), 0) + np.linalg.norm(np.maximum(over, 0), axis=1)
