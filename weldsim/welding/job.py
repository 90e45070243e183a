"""The job: a path welded by a robot, or refused for a stated reason before anything moves."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.clock import Clock
from weldsim.config import CellConfig, digest, limits_for
from weldsim.dryrun.cell import Cell
from weldsim.dryrun.program import Program
from weldsim.dryrun.verdict import Trial
from weldsim.dryrun.waypoints import try_waypoints
from weldsim.errors import ExecutionError, InputError, Interrupted
from weldsim.execution.contract import Clause, contract, own_arm, require_kept
from weldsim.execution.gate import SafetyGate
from weldsim.execution.resample import LEAST_SCALE, at_period, slowed
from weldsim.execution.robot import Robot
from weldsim.execution.runner import execute
from weldsim.path.asked import leaned, wire_tip
from weldsim.quantity import Metre
from weldsim.records import ExecutionLog, KnownSeam, RobotFacts, SeamFindings, Segment, TorchPath, WeldProgress, WeldReport
from weldsim.report.progress import weld_progress
from weldsim.report.weld import weld_report
from weldsim.scene.config import SceneConfig
from weldsim.welding.rest import rest_of

INTERRUPT = "interrupt"  # the rule that a stop by Ctrl-C is told under


@dataclass(frozen=True, kw_only=True)
class JobConfig:
    """What is asked of a job.

    Attributes:
        seam: which path of the program, from 0.  arc: whether the arc may burn.  speed_scale: share of the planned pace.
        start: arc length up to where the seam is welded already [m], None for a weld from its beginning.
        black_boxes: folder for what the gate leaves behind at a stop.
    """

    seam: int = 0
    arc: bool = False
    speed_scale: float = 1.0
    start: Metre | None = None
    black_boxes: Path | None = None

    def __post_init__(self) -> None:
        if not LEAST_SCALE <= self.speed_scale <= 1.0:
            raise InputError(f"--speed-scale {self.speed_scale:g} is outside {LEAST_SCALE:g} to 1")


@dataclass(frozen=True, eq=False, kw_only=True)
class Job:
    """What became of it.

    Attributes:
        robot: its name.  facts, clauses: what the robot said of itself, and the contract line by line.
        q_start: where the robot stood [rad], and trial: the dry run from there; None where the contract was broken.
        log: what the arm did, None where it was not moved.  report: its figures.
        stopped: why the robot was refused or stopped, or None.  black_box: where it was written, or None.
        path: as it was welded.  progress: how far, None where it was not moved.  timing: seconds a stage.
    """

    robot: str
    facts: RobotFacts | None
    clauses: tuple[Clause, ...]
    q_start: Float[ndarray, "6"] | None
    trial: Trial | None
    log: ExecutionLog | None
    report: WeldReport | None
    stopped: ExecutionError | None
    black_box: Path | None
    path: TorchPath
    timing: dict[str, float]
    progress: WeldProgress | None = None

    @property
    def moved(self) -> bool:
        return self.log is not None

    @property
    def passed(self) -> bool:
        """Whether it was welded, and within every limit."""
        return self.stopped is None and self.report is not None and self.report.passed

    @property
    def interrupted(self) -> bool:
        """Whether somebody stopped it by hand while it moved."""
        return self.stopped is not None and self.stopped.data.get("rule") == INTERRUPT


def weld(
    program: Program,
    findings: SeamFindings,
    robot: Robot,
    cell: Cell,
    config: CellConfig,
    job: JobConfig,
    *,
    scene: SceneConfig | None = None,
    known: tuple[KnownSeam, ...] | None = None,
    clock: Clock | None = None,
) -> Job:
    """A path of a program executed by a robot through its safety gate.

    Nothing moves unless the robot keeps its contract and the whole motion, planned from where the robot says it stands and with the
    DH figures that it tells of itself, passes the dry run and every rule of the gate. Ctrl-C while it moves stops the arm and ends
    the job, which keeps its log; earlier it is raised as ever.

    Args:
        program: as `read_program` gives it, with paths.  findings: its seams, one a path.
        robot: not yet connected; it is disconnected in the end.
        cell: what stands around the arm; where the arm stands is read from the robot.
        config: every stage's settings.  job: what is asked.
        scene, known: the scene and its known seams, where it is one of the twin.
        clock: takes the times.
    Raises:
        InputError: a seam that the program does not have, or a start that is not on it.
        ExecutionError: the robot cannot be connected.
    """
    clock = clock or Clock()
    if not 0 <= job.seam < len(program.paths):
        raise InputError(f"seam {job.seam + 1}: {program.source} has {len(program.paths)}, counted from 1", seam=job.seam + 1)
    path = whole = program.paths[job.seam]
    if job.start is not None:
        path = rest_of(whole, job.start, config.execution.overlap, program.names[job.seam])
    facts: RobotFacts | None = None
    clauses: tuple[Clause, ...] = ()
    q_start, trial, log, stopped = None, None, None, None
    gate = SafetyGate(robot, config.execution.gate, arc=job.arc, folder=job.black_boxes)
    with clock.stage("connect"):
        gate.connect()
    try:
        with clock.stage("contract"):
            facts = gate.facts()
            clauses = contract(facts, gate.state(), config.execution.contract)
            require_kept(clauses, gate.name)
            gate.arm = own_arm(facts)
        with clock.stage("dry run"):
            q_start = np.array(gate.state().q)
            here = replace(cell.fitted(gate.arm), q_start=q_start)
            _, trial = try_waypoints(path, program.names[job.seam], here, replace(config.motion, period=gate.period))
        if trial.passed and trial.trajectory is not None:
            trajectory = at_period(slowed(trial.trajectory, job.speed_scale), gate.period)
            with clock.stage("execution"):
                log = execute(gate, trajectory, config.execution, lambda done: clock.tell("execution", done))
    except ExecutionError as error:
        stopped = error
        found = error.data.get("log")
        log = found if isinstance(found, ExecutionLog) else None
    except Interrupted as interrupt:
        stopped = ExecutionError(str(interrupt), rule=INTERRUPT)
        log = interrupt.log if isinstance(interrupt.log, ExecutionLog) else None
    finally:
        gate.disconnect()
    path = replace(path, speed=path.speed * job.speed_scale)
    report = progress = None
    if log is not None:
        with clock.stage("report"):
            progress = weld_progress(log, path, whole, arc=job.arc)
            report = job_report(
                program, findings, path, log, config, job, scene=scene, known=known, stopped=stopped, progress=progress
            )
        report = replace(report, timing=dict(clock.seconds))
    return Job(
        robot=gate.name,
        facts=facts,
        clauses=clauses,
        q_start=q_start,
        trial=trial,
        log=log,
        report=report,
        stopped=stopped,
        black_box=gate.black_box,
        path=path,
        timing=dict(clock.seconds),
        progress=progress,
    )


def judged(log: ExecutionLog) -> ExecutionLog:
    """The log with the whole weld as if the arc had burnt: what a job that was not to light the arc is judged by."""
    return log if log.arc_on.any() else replace(log, arc_on=np.array([segment == Segment.WELD for segment in log.segments]))


def job_report(
    program: Program,
    findings: SeamFindings,
    path: TorchPath,
    log: ExecutionLog,
    config: CellConfig,
    job: JobConfig,
    *,
    scene: SceneConfig | None,
    known: tuple[KnownSeam, ...] | None,
    stopped: ExecutionError | None,
    progress: WeldProgress | None = None,
) -> WeldReport:
    """The report of `weldsim run` on what was executed; a stop fails it, whatever its figures."""
    paths = tuple(path if i == job.seam else each for i, each in enumerate(program.paths))
    log = log if job.arc else judged(log)
    left_out = float(path.s[path.weld][0] - program.paths[job.seam].s[0])
    report = weld_report(
        findings,
        tuple(replace(each, X_BT=wire_tip(each.X_BT, config.path)) for each in paths),
        scene="empty cell" if scene is None else scene.name,
        log=replace(log, X_BT_act=wire_tip(log.X_BT_act, config.path)),
        known=None if known is None else tuple(leaned(seam, path, config.path) for seam in known),
        welded=job.seam,
        trims=(config.path.start_trim + left_out, config.path.end_trim),
        stopped=None if stopped is None else str(stopped),
        progress=progress,
        config_digest=digest(config),
        config=limits_for(config, scene),
    )
    if job.arc and job.speed_scale != 1 and log.arc_on.any():
        more = f"{1 / job.speed_scale:.3g} times the metal for each millimetre"
        pace = f"welded at {100 * job.speed_scale:g} % of the path's pace: {more}"
        report = replace(report, warnings=(*report.warnings, pace))
    return report
