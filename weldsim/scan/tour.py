"""The arm driven from view to view by its own servos, an exposure wherever it really came to rest."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import MotionError, UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES, flange_pose, inverse_near
from weldsim.mounts import X_FC
from weldsim.records import ExecutionLog, JointTrajectory, Segment
from weldsim.sensor.base import Capture, View
from weldsim.sensor.choose import SensorName, SensorTables, make_sensor

if TYPE_CHECKING:
    from weldsim.execution.config import ExecutionConfig
    from weldsim.motion.config import MotionConfig
    from weldsim.motion.timing import Move
    from weldsim.scene.world import World

BACK_OFF = (0.10, 0.20)  # [m] how far the camera draws back from the part before a detour

Blocked = Callable[[Float[ndarray, "6"]], str | None]
Joints = Float[ndarray, "6"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Tour:
    """A scan as it was driven.

    Attributes:
        captures: one a view; each frame's X_BC is where the reported joints put the camera.
        logs: what the arm did on the way to each view.
        q: joint angles where it stands in the end [rad].
    """

    captures: tuple[Capture, ...]
    logs: tuple[ExecutionLog, ...]
    q: Joints


def drive(
    world: "World",
    tables: SensorTables,
    motion: "MotionConfig",
    execution: "ExecutionConfig",
    *,
    seed: int = 0,
    sensor: SensorName = "d415",
    tell: Callable[[float], None] = lambda done: None,
) -> Tour:
    """The arm starts at home, or turned off the table where a tall part stands in its home, goes from view to view in their
    order and exposes at rest.

    Args:
        world: the scene.  tables: settings of the cameras.  seed: of the camera's noise.  sensor: a camera on the wrist.
        motion, execution: limits of the air moves; how the simulated arm behaves.
        tell: told the fraction done.
    Raises:
        ViewError: a view that the arm cannot take.  MotionError: one that it cannot get to; `data`: view, reason.
        ExecutionError, SensorError: the arm or the camera cannot.
    """
    from weldsim.execution.gate import SafetyGate
    from weldsim.execution.runner import execute
    from weldsim.execution.simulated import SimulatedRobot
    from weldsim.motion.collision import CellCollision
    from weldsim.scene.world import AWAY, HOME
    from weldsim.sensor.exact import twin_scene

    blocked, captures, logs = CellCollision(world.model), [], []
    q = np.array(HOME if blocked(HOME) is None else AWAY, float)
    arm = SimulatedRobot(world.model, q, execution.simulation)
    with SafetyGate(arm, execution.gate) as robot:
        camera = make_sensor(sensor, twin_scene(world, arm.data), world.intrinsics, tables, seed=seed)
        try:
            for view in range(len(world.views)):
                goal = world.view_joints(view, q)
                logs.append(execute(robot, way(q, goal, motion, blocked, view), execution))
                q = robot.state().q
                stands = world.site_pose(arm.data, "flange") @ world.twin.X_FC
                capture = camera.capture(View(X_BC=stands, t=robot.state().t))
                captures.append(replace(capture, frame=replace(capture.frame, X_BC=flange_pose(q) @ X_FC)))
                tell((view + 1) / len(world.views))
        finally:
            camera.close()
    return Tour(captures=tuple(captures), logs=tuple(logs), q=np.array(q, float))


def way(start: Joints, goal: Joints, config: "MotionConfig", blocked: Blocked, view: int = 0) -> JointTrajectory:
    """Joint moves through the air from start to goal that touch nothing: straight, else drawing the camera back, else as a
    random search finds.

    Raises:
        MotionError: none of these is clear; `data`: view, reason.
    """
    from weldsim.motion.roam import roam
    from weldsim.motion.sweep import touched
    from weldsim.motion.timing import air_move

    touch = None
    for stops in _detours(start, goal):
        found = next((t for a, b in pairwise(stops) if (t := touched(a, b, blocked)) is not None), None)
        if found is None:
            break
        touch = touch or found
    else:
        stops = roam(start, goal, blocked)
    if stops is None:
        raise MotionError(
            f"scan view {view + 1}: the arm finds no way there: {touch}; change the view, or the order of views",
            view=view,
            reason=touch,
        )
    return _joined([air_move(a, b, 0.0, config) for a, b in pairwise(stops)], config.period)


def _detours(start: Joints, goal: Joints) -> Iterator[list[Joints]]:
    yield [start, goal]
    for distance in BACK_OFF:
        before, after = _drawn_back(start, distance), _drawn_back(goal, distance)
        if after is not None:
            yield [start, after, goal]
        if before is not None:
            yield [start, before, goal]
        if before is not None and after is not None:
            yield [start, before, after, goal]


def _drawn_back(q: Joints, distance: float) -> Joints | None:
    """Joint angles with the camera `distance` [m] back along its axis, nearest to q; None where there are none."""
    X_BC = flange_pose(q) @ X_FC
    try:
        back = inverse_near(Transform("BC", X_BC.R, X_BC.p - distance * X_BC.R[:, 2]) @ X_FC.inverse(), q)
    except UnreachableError:
        return None
    return back if np.abs(back - q).max() < 1.5 and np.abs(back).max() <= JOINT_LIMIT else None


def _joined(moves: "list[Move]", period: float) -> JointTrajectory:
    """The moves one after the other, from rest to rest."""
    keep = [slice(0, None)] + [slice(1, None)] * (len(moves) - 1)
    q, qd, qdd = (np.concatenate([getattr(m, name)[k] for m, k in zip(moves, keep, strict=True)]) for name in ("q", "qd", "qdd"))
    n = len(q)
    return JointTrajectory(
        t=period * np.arange(n),
        q=q,
        qd=qd,
        qdd=qdd,
        s=np.zeros(n),
        arc_on=np.zeros(n, bool),
        segments=(Segment.AIR,) * n,
        joint_names=JOINT_NAMES,
    )
