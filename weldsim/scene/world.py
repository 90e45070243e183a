"""The compiled cell: arm, torch, cameras, table and part in one MuJoCo model, with what is known of the part."""

from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.errors import SceneError, ViewError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES, inverse
from weldsim.mounts import D415_640X480, X_FC, X_WB
from weldsim.records import CameraIntrinsics, KnownSeam
from weldsim.scene.cell import new_cell
from weldsim.scene.config import SceneConfig, make_workpiece, part_pose
from weldsim.scene.fixture import add_fixture
from weldsim.scene.mesh_cache import cached_mesh
from weldsim.scene.miscalibration import TwinConfig
from weldsim.scene.quiet import keep_quiet
from weldsim.scene.shapes import Group, box, mesh_geom
from weldsim.scene.standing import Standing
from weldsim.scene.tool import add_tool
from weldsim.scene.workpieces.base import Workpiece

Label = Literal["groove", "part", "clamp", "table", "robot", "room"]

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1_link", "wrist_2_link", "wrist_3_link")  # bodies, each with its joint
HOME = np.array([-1.57, -1.30, -1.90, -1.50, 1.57, 0.0])  # [rad] elbow up, the wrist over the table, the camera looking down
AWAY = HOME + np.array([np.pi, 0.0, 0.0, 0.0, 0.0, 0.0])  # [rad] turned off the table, out of the overhead camera's sight


@dataclass(frozen=True, eq=False, kw_only=True)
class World:
    """A scene, compiled. The model is MuJoCo's and can be changed by its users; everything else cannot.

    Attributes:
        config: what it was built from.
        model: the compiled model; its world frame is W. Sites "flange" and "torch_tip", cameras "d415", "kinect",
            "overview" and "closeup", joints and actuators named as in `weldsim.kinematics.JOINT_NAMES`.
        workpiece: the part.  X_BP: its pose in the base.  X_WB: the base in the world.
        known_seams: its true seams in the base, for `report` and tests alone.
        views: X_BC of each scan view, in order.
        intrinsics: of the wrist camera.
        twin: how the cell differs from what its software believes.
        labels: {geom id: what it belongs to}, for every geom.
        qpos, dof, actuators: (6,) indices of the arm's joints in qpos, in qvel, and of its servos in ctrl.
        notes: what is odd about how the part stands, a clause each: it hangs in the air, say.
    """

    config: SceneConfig
    model: Any
    workpiece: Workpiece
    X_BP: Transform
    X_WB: Transform
    known_seams: tuple[KnownSeam, ...]
    views: tuple[Transform, ...]
    intrinsics: CameraIntrinsics
    twin: TwinConfig
    labels: dict[int, Label]
    qpos: Int[ndarray, "6"]
    dof: Int[ndarray, "6"]
    actuators: Int[ndarray, "6"]
    notes: tuple[str, ...] = ()

    def new_data(self, q: Float[ndarray, "6"] = HOME) -> Any:
        """A fresh simulation state with the arm at rest at q [rad], servos holding it there."""
        data = mujoco.MjData(self.model)
        data.qpos[self.qpos] = q
        data.ctrl[self.actuators] = q
        mujoco.mj_forward(self.model, data)
        return data

    def site_pose(self, data: Any, site: str = "torch_tip") -> Transform:
        """X_BT of the torch tip, or X_BF with site="flange", as the simulation has it now."""
        names = {"torch_tip": "WT", "flange": "WF"}[site]
        found = data.site(site)
        return self.X_WB.inverse() @ Transform(names, found.xmat.reshape(3, 3), found.xpos)

    def camera_pose(self, view: int, data: Any) -> Transform:
        """X_BC at which the wrist camera really stands when the arm in `data` believes to hold it at the view."""
        return self.views[view] if self.twin.perfect else self.site_pose(data, "flange") @ self.twin.X_FC

    def geoms(self, label: Label) -> Int[ndarray, "k"]:
        """Ids of the geoms with this label."""
        return np.array([geom for geom, found in self.labels.items() if found == label], dtype=np.int64)

    def view_joints(self, view: int = 0, near: Float[ndarray, "6"] = HOME) -> Float[ndarray, "6"]:
        """Joint angles [rad] that put the wrist camera at the view, touch nothing and leave the part in sight, nearest to `near`.

        Raises:
            ViewError: no solution, or only ones that collide or hold the arm between camera and part.
        """
        X_BF = self.views[view] @ X_FC.inverse()
        solutions = inverse(X_BF)
        solutions = solutions + 2 * np.pi * np.round((near - solutions) / (2 * np.pi))
        data = mujoco.MjData(self.model)
        for q in solutions[np.abs(solutions - near).max(axis=1).argsort()] if len(solutions) else ():
            data.qpos[self.qpos] = q
            mujoco.mj_fwdPosition(self.model, data)
            if data.ncon == 0 and (np.abs(q) <= JOINT_LIMIT).all() and self._part_in_sight(data):
                return q
        reason = "every joint solution collides or hides the part" if len(solutions) else "no joint solution"
        raise ViewError(
            f"scan view {view + 1}: {reason} with the flange at ({X_BF.p[0]:.3f}, {X_BF.p[1]:.3f}, {X_BF.p[2]:.3f}) m in base;"
            " change the view's standoff, tilt or roll, or move the part",
            view=view,
            position=tuple(X_BF.p),
        )

    def start_joints(self) -> Float[ndarray, "6"]:
        """Where the arm waits for its job [rad]: with the camera at the last view, or at HOME or AWAY where it cannot be."""
        try:
            return self.view_joints(len(self.views) - 1)
        except ViewError:
            return np.array(HOME if self.new_data(HOME).ncon == 0 else AWAY, float)

    def _part_in_sight(self, data: Any) -> bool:
        """Whether no ray from the wrist camera to the part's outline or middle meets the robot."""
        eye = data.camera("d415").xpos
        shares = np.array([0.0, 0.35, 0.7, 0.95])[:, None, None]
        targets = (self.X_WB @ self.X_BP).points((shares * self.workpiece.base_corners).reshape(-1, 3))
        geom, visual = np.zeros(1, np.int32), np.array([1, 1, 1, 0, 0, 0], np.uint8)
        for ray in targets - eye:
            mujoco.mj_ray(self.model, data, eye, ray, visual, 1, -1, geom, None)
            if self.labels.get(int(geom[0])) == "robot":
                return False
        return True


def build_world(
    config: SceneConfig,
    intrinsics: CameraIntrinsics = D415_640X480,
    twin: TwinConfig = TwinConfig(),  # noqa: B008 - frozen
) -> World:
    """The compiled scene.

    Args:
        config: the scene.
        intrinsics: of the wrist camera's depth image.
        twin: how the cell differs from what its software believes.
    Raises:
        SceneError: a scene that contradicts itself, or a part that stands in the arm's base or beside the table.
    """
    if not config.views:
        raise SceneError(f"scene {config.name!r}: no scan view; give one at least", scene=config.name, key="views")
    keep_quiet()
    workpiece = make_workpiece(config)
    X_BP = part_pose(config.pose, workpiece)
    model = compose(config, workpiece, X_BP, intrinsics, twin).compile()
    standing = Standing(model=model)
    check_standing(config, standing)
    joints = [model.joint(name) for name in JOINT_NAMES]
    return World(
        config=config,
        model=model,
        workpiece=workpiece,
        X_BP=X_BP,
        X_WB=X_WB,
        known_seams=workpiece.known_seams(X_BP),
        views=tuple(view.pose(X_BP) for view in config.views),
        intrinsics=intrinsics,
        twin=twin,
        labels={i: _label(model, i) for i in range(model.ngeom)},
        qpos=np.array([joint.qposadr[0] for joint in joints]),
        dof=np.array([joint.dofadr[0] for joint in joints]),
        actuators=np.array([model.actuator(name).id for name in JOINT_NAMES]),
        notes=standing.notes,
    )


def check_standing(config: SceneConfig, standing: Standing) -> None:
    """Raises SceneError where part or fixture cannot stand, with the nearest place where they can."""
    if (fault := standing.fault()) is None:
        return
    move = standing.clear_place()
    if move is None:
        advice = "turn it (pose.yaw) or take a smaller part"
    else:
        x, y = 1e3 * (np.array([config.pose.x, config.pose.y]) + move)
        advice = f'the nearest place where it can stand: pose.x = "{x:.10g} mm", pose.y = "{y:.10g} mm"'
    raise SceneError(f"pose of scene {config.name!r}: {fault}; {advice}", scene=config.name, key="pose", fault=fault)


def compose(
    config: SceneConfig,
    workpiece: Workpiece,
    X_BP: Transform,
    intrinsics: CameraIntrinsics = D415_640X480,
    twin: TwinConfig = TwinConfig(),  # noqa: B008 - frozen
) -> Any:
    """The scene as a MuJoCo specification, not compiled: room, arm, tool, and the part at X_BP with what holds it.

    Raises:
        SceneError: a fixture that does not fit the part.
    """
    spec = new_cell(config.material)
    _misplace_joints(spec, twin)
    add_tool(spec.body("wrist_3_link"), intrinsics)
    _add_part(spec, config, workpiece, X_BP)
    return spec


def _misplace_joints(spec: Any, twin: TwinConfig) -> None:
    """Every joint moved on its link by the arm's error."""
    if twin.perfect:
        return
    for name, shift, turn in zip(LINKS, *twin.joint_errors(), strict=True):
        body = spec.body(name)
        error = Transform("SS", matrix_from_rotation_vector(turn), shift)
        true = Transform.from_quaternion("SS", np.array(body.quat, float), np.array(body.pos, float)) @ error
        body.pos, body.quat = true.p, true.quaternion


def _add_part(spec: Any, config: SceneConfig, workpiece: Workpiece, X_BP: Transform) -> None:
    """The part as two visual meshes, groove and the rest, boxes to collide with, and what holds it."""
    base = spec.worldbody.add_body(name="fixture", pos=X_WB.p, quat=X_WB.quaternion)
    part = base.add_body(name="part", pos=X_BP.p, quat=X_BP.quaternion)
    mesh = cached_mesh(workpiece)
    mesh_geom(spec, part, "part", *mesh.part(groove=False), "part", group=Group.WORKPIECE)
    if mesh.groove.any():
        mesh_geom(spec, part, "groove", *mesh.part(groove=True), "groove", group=Group.WORKPIECE)
    for i, block in enumerate(workpiece.collision_boxes()):
        geom = box(part, f"part_collision_{i}", block.centre, block.half, "collision", group=Group.COLLISION, collide=True)
        geom.quat = Transform("PS", block.R, block.centre).quaternion
    add_fixture(spec, base, part, config.fixture, workpiece, X_BP)


def _label(model: Any, geom: int) -> Label:
    """What a geom belongs to, by its body and name."""
    name = model.geom(geom).name
    root = model.body(model.body_rootid[model.geom_bodyid[geom]]).name
    if root == "ur5_base":
        return "robot"
    if name == "groove":
        return "groove"
    if name.startswith("part"):
        return "part"
    if name.startswith(("clamp", "wedge", "stand")):
        return "clamp"
    return "table" if name == "table" else "room"
