"""The whole job, in order: scene -> sensor -> cloud -> seam -> path -> motion -> execution -> report.

`look` is its beginning on the twin, `plan` its middle for any cloud, `finish` its end, `run` all three. Perception sees what
the sensor delivers and nothing else: the known seam is handed to the report alone. Times are taken here and nowhere else.
What is handed on are the records of `weldsim.jobs`; which stage reads which settings is in `weldsim.config`.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from weldsim.clock import Clock, Tell
from weldsim.cloud.deproject import deproject
from weldsim.cloud.files import check_plannable
from weldsim.cloud.filters import prepare
from weldsim.cloud.views import merge_views
from weldsim.config import CellConfig, digest, limits_for
from weldsim.errors import ExecutionError, InputError, WeldsimError
from weldsim.inputs import (
    CloudLike,
    ConfigLike,
    SceneLike,
    check_film,
    cloud_from,
    config_from,
    findings_from,
    result_from,
    scene_from,
    sighting_from,
)
from weldsim.jobs import Finder, PlanResult, RunResult, Sighting, Weld, check_meant, pick, seams_to_weld, unplanned
from weldsim.path.asked import leaned, wire_tip
from weldsim.path.plan import plan_paths
from weldsim.records import ExecutionLog, PointCloud, SeamFindings, TorchPath, WeldReport
from weldsim.report.limits import REGION
from weldsim.report.progress import weld_progress
from weldsim.report.weld import joined, weld_report
from weldsim.scan.stand import scan
from weldsim.seam.find import find_seams
from weldsim.search import search
from weldsim.sensor.base import true_region
from weldsim.sensor.choose import SensorName, posture

if TYPE_CHECKING:
    from pathlib import Path

    from weldsim.scan.tour import Tour
    from weldsim.scene.workpieces.base import Workpiece
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
    scene: SceneLike,
    config: ConfigLike | None = None,
    *,
    seed: int = 0,
    sensor: SensorName = "d415",
    number: int | Literal["all"] | None = None,
    near: Sequence[float] | None = None,
    video: "Path | None" = None,
    black_boxes: "Path | None" = None,
    tell: Tell | None = None,
) -> RunResult:
    """The twin scans the scene, plans and welds what it found, and is judged against the scene's known seams.

    A weld that is stopped is a result too: its report says so, and how far it came.

    Args:
        scene: what stands on the table: its name, a TOML file, or a `SceneConfig`.  config: everything else.
        seed: of the camera's noise.  sensor: which camera looks.
        number, near: which seam to weld; see `pick`; "all" welds every one that has a path, one after the other.
        video: where to write a film of the weld.  black_boxes: folder for what the safety gate leaves behind at a stop.
        tell: told of progress.
    Raises:
        WeldsimError: see the stages; finding no seam is a result, not an error.
    """
    config, clock = config_from(config), Clock(tell or (lambda stage, done: None))
    check_meant(number, near)
    check_film(video)
    seen = look(scene, config, seed=seed, sensor=sensor, clock=clock)
    result = plan(seen.cloud, config, clock=clock)
    return finish(seen, result, config, number=number, near=near, video=video, black_boxes=black_boxes, stops=True, clock=clock)


def look(
    scene: SceneLike,
    config: ConfigLike | None = None,
    *,
    seed: int = 0,
    sensor: SensorName = "d415",
    world: "World | None" = None,
    move: bool | None = None,
    clock: Clock | None = None,
) -> Sighting:
    """The scene built and scanned from all its views, which are lined up and merged into one cloud in the robot base.

    Args:
        scene: what stands on the table: its name, a TOML file, or a `SceneConfig`.  config: everything else.
        seed: of the camera's noise, 0 or more.  sensor: which camera looks.
        move: whether the arm is driven from view to view and starts the weld from there (never for the Kinect), or put there; by
            default what `config.scan.move` says.
        world: `scene` already built, by whoever looks at it several times.  clock: takes the times.
    Raises:
        SceneError, ViewError, SensorError, CloudError: see the stages.
    """
    from weldsim.scene.world import build_world

    config, clock, scene = config_from(config), clock or Clock(), scene_from(scene)
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"seed {seed!r}: a whole number, 0 or more, is needed", seed=seed)
    move = config.scan.move if move is None else move
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
    cloud: CloudLike, config: ConfigLike | None = None, *, find: Finder | None = None, clock: Clock | None = None
) -> PlanResult:
    """Seams of a cloud in the robot base, best first, and a torch path along each; none of either where there is no seam.

    A seam along which no path can be laid is named in `refused` and does not keep the others from being planned.

    Args:
        cloud: in B: a `PointCloud`, an (n, 3) array [m], a `DepthFrame`, or a file.  config: every stage's settings.
        find: a seam finder of the caller's own, in place of the one that `config.seam` names: it is handed the cloud and returns
            `SeamFindings`, a `Seam`, several, an (n, 3) polyline [m], or None.
        clock: takes the times.
    Raises:
        InputError: no cloud at all, or a finder that fails.  CloudError: a cloud that cannot show a seam.
        PathError: the path asked for fits none of the seams.
    """
    config, clock = config_from(config), clock or Clock()
    with clock.stage("cloud"):
        cloud = prepare(cloud_from(cloud), config.cloud)
        check_plannable(cloud)
    with clock.stage("seam"):
        cloud, findings, notes = search(cloud, partial(find_seams, config=config.seam) if find is None else partial(_found, find))
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
    config: ConfigLike | None = None,
    *,
    number: int | Literal["all"] | None = None,
    near: Sequence[float] | None = None,
    execute: bool = True,
    video: "Path | None" = None,
    black_boxes: "Path | None" = None,
    stops: bool = False,
    clock: Clock | None = None,
) -> RunResult:
    """What was planned on a sighting, welded by the simulated arm and judged against the scene's known seams.

    Args:
        seen: where the cloud came from.  result: what was planned on `seen.cloud`.  config: as planned with.
        number, near: which seam; see `pick`; "all" is every one that has a path.
        execute: whether the arm welds it; without, the plan alone is judged and motion and log are None.
        video, black_boxes: where to write a film of the weld, and what a stop leaves behind.
        stops: whether a weld that is stopped on its way is a result, or raised.  clock: takes the times.
    Raises:
        MotionError, ExecutionError: the arm cannot.  InputError: a seam number that there is not.
        PathError: the seam that is meant has no path.
    """
    seen, result = sighting_from(seen), result_from(result)
    config, clock, world = config_from(config), clock or Clock(), seen.world
    check_film(video)
    meant = seams_to_weld(result, number, near)
    welds = _weld(seen, meant, config, clock, video, black_boxes) if execute and meant else ()
    if welds and welds[-1].error is not None and not stops:
        raise welds[-1].error
    with clock.stage("report"):
        limits = limits_for(config, world.config)
        reports = [
            _report(seen, result, config, index, path, next((weld for weld in welds if weld.seam == index), None))
            for index, path in (*meant[: max(1, len(welds))], *(() if meant else ((0, None),)))
        ]
        report = joined(tuple(reports), limits)
    report = replace(report, timing=dict(clock.seconds))
    first = welds[0] if welds else None
    return RunResult(
        world=world,
        captures=seen.captures,
        registration=seen.registration,
        tour=seen.tour,
        plan=result,
        welded=meant[0][0] if meant else 0,
        motion=None if first is None else first.motion,
        log=None if first is None else first.log,
        others=welds[1:],
        report=report,
    )


def _report(
    seen: Sighting, result: PlanResult, config: CellConfig, index: int, path: TorchPath | None, weld: Weld | None
) -> WeldReport:
    """The report of one seam; `weld` is what was done of it."""
    world, log = seen.world, None if weld is None else weld.log
    known = tuple(seam if path is None else leaned(seam, path, config.path) for seam in world.known_seams)
    part = world.workpiece
    return weld_report(
        result.findings,
        tuple(None if each is None else replace(each, X_BT=wire_tip(each.X_BT, config.path)) for each in result.paths),
        scene=world.config.name,
        log=None if log is None else replace(log, X_BT_act=wire_tip(log.X_BT_act, config.path)),
        known=known if part.seams_are_known else None,
        true_region=true_region(seen.captures, result.cloud) if part.region_is_known else None,
        welded=index,
        unplanned=unplanned(result),
        trims=(config.path.start_trim, config.path.end_trim),
        unjudged=_unjudged(part),
        stopped=None if weld is None or weld.error is None else str(weld.error),
        progress=None if weld is None else weld_progress(weld.log, weld.path, weld.path, arc=True),
        seed=seen.seed,
        config_digest=result.config_digest,
        config=limits_for(config, world.config),
    )


def _unjudged(part: "Workpiece") -> tuple[tuple[str, str], ...]:
    """Figures for which nothing is known of a part, and why."""
    if not part.seams_are_known:
        why = "not judged: no seam is known ([mesh] names no seam file)"
        return tuple((figure, why) for figure in ("distance from the known seam", "phantom seams", REGION))
    return () if part.region_is_known else ((REGION, "not judged: the seam file has no width"),)


def _found(find: Finder, cloud: PointCloud) -> SeamFindings:
    """What the caller's own finder finds. Raises InputError where it fails."""
    name = getattr(find, "__name__", type(find).__name__)
    try:
        answer = find(cloud)
    except (WeldsimError, KeyboardInterrupt, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f"finder {name}: raised {type(error).__name__}: {error}", finder=name) from error
    return findings_from(answer, cloud, name)


def _weld(
    seen: Sighting,
    meant: Sequence[tuple[int, TorchPath]],
    config: CellConfig,
    clock: Clock,
    video: "Path | None",
    black_boxes: "Path | None",
) -> tuple[Weld, ...]:
    """The motion from the last scan view along the paths, one after the other, and what the simulated arm did of each: of those
    after one at which it was stopped there is none.

    Raises:
        MotionError: nothing has moved.
    """
    from weldsim.execution.gate import SafetyGate
    from weldsim.execution.runner import execute
    from weldsim.execution.simulated import SimulatedRobot
    from weldsim.execution.video import WeldVideo
    from weldsim.motion.collision import CellCollision
    from weldsim.motion.sequence import plan_sequence

    world, last = seen.world, len(seen.captures) - 1
    q_start = posture(world, seen.sensor, last) if seen.tour is None else seen.tour.q
    names = [f"seam {index + 1}" for index, _ in meant]
    with clock.stage("motion"):
        blocked = CellCollision(world.model)
        motions = plan_sequence([path for _, path in meant], q_start, config.motion, blocked=blocked, names=names)
    welds: list[Weld] = []
    with clock.stage("execution"), ExitStack() as stack:
        film, simulation = None, config.execution.simulation
        if video is not None:
            film = stack.enter_context(WeldVideo(video))
            simulation = replace(simulation, frame_period=film.frame_period)
        arm = SimulatedRobot(world.model, q_start, simulation, film)
        robot = stack.enter_context(SafetyGate(arm, config.execution.gate, arc=True, folder=black_boxes))
        for k, ((index, path), motion) in enumerate(zip(meant, motions, strict=True)):
            weld = partial(Weld, seam=index, path=path, motion=motion)
            tell = partial(_tell_part, clock, k, len(meant))
            try:
                welds.append(weld(log=execute(robot, motion.trajectory, config.execution, tell)))
            except ExecutionError as error:
                log = error.data.get("log")
                if not isinstance(log, ExecutionLog):  # before anything moved
                    raise
                welds.append(weld(log=log, error=error))
                break
    return tuple(welds)


def _tell_part(clock: Clock, k: int, count: int, done: float) -> None:
    """Progress of the k-th of `count` welds."""
    clock.tell("execution", (k + done) / count)


def _tour(world: "World", config: CellConfig, seed: int, sensor: SensorName, clock: Clock) -> "Tour":
    from weldsim.scan.tour import drive

    tell = partial(clock.tell, "sensor")
    return drive(world, config, config.motion, config.execution, seed=seed, sensor=sensor, tell=tell)
