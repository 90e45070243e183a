"""The whole job, in order: scene -> sensor -> cloud -> seam -> path -> motion -> execution -> report.

`look` is its beginning on the twin, `plan` its middle for any cloud, `finish` its end, `run` all three. Perception sees what
the sensor delivers and nothing else: the known seam is handed to the report alone. Times are taken here and nowhere else.
What is handed on are the records of `weldsim.jobs`; which stage reads which settings is in `weldsim.config`.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from weldsim.clock import Clock, Tell
from weldsim.cloud.deproject import deproject
from weldsim.cloud.files import check_plannable
from weldsim.cloud.filters import prepare
from weldsim.cloud.views import merge_views
from weldsim.config import CellConfig, digest, limits_for
from weldsim.jobs import Finder, PlanResult, RunResult, Sighting, pick, to_weld, unplanned
from weldsim.path.asked import leaned, wire_tip
from weldsim.path.plan import plan_paths
from weldsim.records import ExecutionLog, PointCloud, TorchPath
from weldsim.report.weld import weld_report
from weldsim.scan.stand import scan
from weldsim.seam.find import find_seams
from weldsim.search import search
from weldsim.sensor.base import true_region
from weldsim.sensor.choose import SensorName, posture

if TYPE_CHECKING:
    from pathlib import Path

    from weldsim.motion.plan import MotionPlan
    from weldsim.scan.tour import Tour
    from weldsim.scene.config import SceneConfig
    from weldsim.scene.world import World

__all__ = [
    "Clock",
    "Finder",
    "PlanResult",
    "RunResult",
    "SensorName",
    "Sighting",
    "Tell",
    "finish",
    "look",
    "pick",
    "plan",
    "run",
    "scan",
    "true_region",
    "unplanned",
]


def run(
    scene: "SceneConfig",
    config: CellConfig | None = None,
    *,
    seed: int = 0,
    sensor: SensorName = "d415",
    number: int | None = None,
    near: Sequence[float] | None = None,
    video: "Path | None" = None,
    black_boxes: "Path | None" = None,
    tell: Tell | None = None,
) -> RunResult:
    """The twin scans the scene, plans and welds what it found, and is judged against the scene's known seams.

    Args:
        scene: what stands on the table.  config: everything else.
        seed: of the camera's noise.  sensor: which camera looks.
        number, near: which seam to weld; see `pick`.
        video: where to write a film of the weld.  black_boxes: folder for what the safety gate leaves behind at a stop.
        tell: told of progress.
    Raises:
        WeldsimError: see the stages; finding no seam is a result, not an error.
    """
    config, clock = config or CellConfig(), Clock(tell or (lambda stage, done: None))
    seen = look(scene, config, seed=seed, sensor=sensor, move=config.scan.move, clock=clock)
    result = plan(seen.cloud, config, clock=clock)
    return finish(seen, result, config, number=number, near=near, video=video, black_boxes=black_boxes, clock=clock)


def look(
    scene: "SceneConfig",
    config: CellConfig | None = None,
    *,
    seed: int = 0,
    sensor: SensorName = "d415",
    world: "World | None" = None,
    move: bool = False,
    clock: Clock | None = None,
) -> Sighting:
    """The scene built and scanned from all its views, which are lined up and merged into one cloud in the robot base.

    Args:
        scene: what stands on the table.  config: everything else.
        seed: of the camera's noise.  sensor: which camera looks.
        move: whether the arm is driven from view to view and starts the weld from there (never for the Kinect), or put there.
        world: `scene` already built, by whoever looks at it several times.  clock: takes the times.
    Raises:
        SceneError, ViewError, SensorError, CloudError: see the stages.
    """
    from weldsim.scene.world import build_world

    config, clock = config or CellConfig(), clock or Clock()
    with clock.stage("scene"):
        world = build_world(scene, twin=config.twin) if world is None else world
    if config.scan.views == "auto" and sensor != "kinect":
        from weldsim.scan.plan import plan_views

        with clock.stage("views"):
            world = replace(world, views=plan_views(world, config.scan).views)
    with clock.stage("sensor"):
        tour = _tour(world, config, seed, sensor, clock) if move and sensor != "kinect" else None
        captures = scan(world, config, seed, sensor) if tour is None else tour.captures
    with clock.stage("cloud"):
        cloud, found = merge_views([deproject(capture.frame) for capture in captures], config.cloud.register)
    return Sighting(
        world=world,
        captures=captures,
        cloud=cloud,
        registration=found,
        tour=tour,
        seed=seed,
        sensor=sensor,
        timing=dict(clock.seconds),
    )


def plan(
    cloud: PointCloud, config: CellConfig | None = None, *, find: Finder | None = None, clock: Clock | None = None
) -> PlanResult:
    """Seams of a cloud in the robot base, best first, and a torch path along each; none of either where there is no seam.

    A seam along which no path can be laid is named in `refused` and does not keep the others from being planned.

    Args:
        cloud: in B.  config: every stage's settings.
        find: a seam finder of the caller's own, in place of the one that `config.seam` names.
        clock: takes the times.
    Raises:
        CloudError: a cloud that cannot show a seam.  PathError: the path asked for fits none of the seams.
    """
    config, clock = config or CellConfig(), clock or Clock()
    with clock.stage("cloud"):
        cloud = prepare(cloud, config.cloud)
        check_plannable(cloud)
    with clock.stage("seam"):
        cloud, findings, notes = search(cloud, partial(find_seams, config=config.seam) if find is None else find)
    with clock.stage("path"):
        paths, refused = plan_paths(findings.seams, config.path)
    return PlanResult(
        cloud=cloud,
        findings=findings,
        paths=paths,
        refused=refused,
        notes=notes,
        timing=clock.seconds,
        config_digest=digest(config),
    )


def finish(
    seen: Sighting,
    result: PlanResult,
    config: CellConfig,
    *,
    number: int | None = None,
    near: Sequence[float] | None = None,
    execute: bool = True,
    video: "Path | None" = None,
    black_boxes: "Path | None" = None,
    clock: Clock | None = None,
) -> RunResult:
    """What was planned on a sighting, welded by the simulated arm and judged against the scene's known seams.

    Args:
        seen: where the cloud came from.  result: what was planned on `seen.cloud`.  config: as planned with.
        number, near: which seam; see `pick`.
        execute: whether the arm welds it; without, the plan alone is judged and motion and log are None.
        video, black_boxes: where to write a film of the weld, and what a stop leaves behind.  clock: takes the times.
    Raises:
        MotionError, ExecutionError: the arm cannot.  InputError: a seam number that there is not.
        PathError: the seam that is meant has no path.
    """
    clock, world = clock or Clock(), seen.world
    welded, path = to_weld(result, number, near)
    motion, log = _weld(seen, path, config, clock, video, black_boxes) if execute and path is not None else (None, None)
    with clock.stage("report"):
        report = weld_report(
            result.findings,
            tuple(None if each is None else replace(each, X_BT=wire_tip(each.X_BT, config.path)) for each in result.paths),
            scene=world.config.name,
            log=None if log is None else replace(log, X_BT_act=wire_tip(log.X_BT_act, config.path)),
            known=tuple(seam if path is None else leaned(seam, path, config.path) for seam in world.known_seams),
            true_region=true_region(seen.captures, result.cloud),
            welded=welded,
            unplanned=unplanned(result),
            trims=(config.path.start_trim, config.path.end_trim),
            seed=seen.seed,
            config_digest=result.config_digest,
            config=limits_for(config, world.config),
        )
    report = replace(report, timing=dict(clock.seconds))
    return RunResult(
        world=world,
        captures=seen.captures,
        registration=seen.registration,
        tour=seen.tour,
        plan=result,
        welded=welded,
        motion=motion,
        log=log,
        report=report,
    )


def _weld(
    seen: Sighting, path: TorchPath, config: CellConfig, clock: Clock, video: "Path | None", black_boxes: "Path | None"
) -> tuple["MotionPlan", ExecutionLog]:
    """The motion from the last scan view along the path, and what the simulated arm did of it."""
    from weldsim.execution.gate import SafetyGate
    from weldsim.execution.runner import execute
    from weldsim.execution.simulated import SimulatedRobot
    from weldsim.execution.video import WeldVideo
    from weldsim.motion.collision import CellCollision
    from weldsim.motion.plan import plan_motion

    world, last = seen.world, len(seen.captures) - 1
    q_start = posture(world, seen.sensor, last) if seen.tour is None else seen.tour.q
    with clock.stage("motion"):
        motion = plan_motion(path, q_start, config.motion, blocked=CellCollision(world.model))
    with clock.stage("execution"), ExitStack() as stack:
        film, simulation = None, config.execution.simulation
        if video is not None:
            film = stack.enter_context(WeldVideo(video))
            simulation = replace(simulation, frame_period=film.frame_period)
        arm = SimulatedRobot(world.model, q_start, simulation, film)
        robot = stack.enter_context(SafetyGate(arm, config.execution.gate, arc=True, folder=black_boxes))
        log = execute(robot, motion.trajectory, config.execution, lambda done: clock.tell("execution", done))
    return motion, log


def _tour(world: "World", config: CellConfig, seed: int, sensor: SensorName, clock: Clock) -> "Tour":
    from weldsim.scan.tour import drive

    tell = partial(clock.tell, "sensor")
    return drive(world, config, config.motion, config.execution, seed=seed, sensor=sensor, tell=tell)
