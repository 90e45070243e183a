"""`weldsim execute`."""

import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from weldsim.cli.dry_run import failures
from weldsim.cli.options import ConfigOptions, keep_importable
from weldsim.cli.outputs import check_folder, nearest_folder, refuse_file
from weldsim.cli.quantities import ALONG, SHARE, quantity
from weldsim.cli.show import check_rows, print_json, print_written, progress, table, times, written_json
from weldsim.cli.signals import INTERRUPTED, interrupted_once
from weldsim.errors import InputError
from weldsim.report.verdict import progress_text, stopped_at

if TYPE_CHECKING:
    from weldsim.config import CellConfig
    from weldsim.dryrun.cell import Cell
    from weldsim.dryrun.program import Program
    from weldsim.execution.robot import Robot
    from weldsim.records import ExecutionLog
    from weldsim.welding.job import Job, JobConfig

MARKS = {True: "ok", False: "FAIL", None: "-"}


@dataclass(frozen=True, kw_only=True)
class Execute(ConfigOptions):
    """Weld a path with a robot, the twin's or a real one, through the safety gate.

    Checks the contract with the robot, plans from where it stands, refuses what a dry run refuses, then moves. Writes a run
    directory with log and report. Exits 1 when the robot was refused or stopped, or the weld failed its verdict; Ctrl-C
    stops the arm, keeps its log too, and exits 130.
    """

    reads: ClassVar[tuple[str, ...]] = ("twin", "path", "motion", "execution", "report")

    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """A path (weldsim.path/1, .json) or UR poses (.csv: x y z rx ry rz)."""

    robot: Literal["sim", "ur"]
    """The simulated arm, or a UR5 over the network (or a `weldsim controller`)."""

    scene: str | None = None
    """What stands around the arm: name of a scene, or a TOML file. Default: arm and table alone."""

    host: str | None = None
    """Address of the UR controller."""

    arc: bool = False
    """Let the arc burn on the weld. Without it the same motion is made with the arc off."""

    speed_scale: Annotated[float, quantity(SHARE, "--speed-scale")] = 1.0
    """Share of the planned pace, over 0 to 1: 0.1 takes ten times as long."""

    seam: int = 1
    """Which seam of the file, counted from 1."""

    from_: Annotated[float | None, quantity(ALONG, "--from"), tyro.conf.arg(name="from")] = None
    """Go on with a weld that was stopped: up to where the seam is welded, "69 mm" say, as the report of the stop tells. The last
    `execution.overlap` before it is welded once more."""

    out: Path | None = None
    """The run directory; runs/FILE-ROBOT by default. An earlier run there is kept, as NAME.1."""

    def __call__(self) -> int:
        """0 where the weld was made within every limit, else 1."""
        keep_importable()

        from weldsim.welding.job import JobConfig, weld

        if self.host is not None and self.robot != "ur":
            raise InputError(f"--host {self.host}: the simulated arm has none; --robot ur is meant?", host=self.host)
        config = self.cell()
        folder = self.out or Path("runs") / f"{self.file.stem}-{self.robot}"
        self._check(folder)
        job = JobConfig(
            seam=self.seam - 1,
            arc=self.arc,
            speed_scale=self.speed_scale,
            start=self.from_,
            black_boxes=folder.with_name(f"{folder.name}.black-box"),
        )
        program = self._program(config)
        if job.start is not None:
            from weldsim.welding.rest import rest_of

            rest_of(program.paths[job.seam], job.start, config.execution.overlap, program.names[job.seam])

        from weldsim.clock import Clock
        from weldsim.config import paced_for
        from weldsim.dryrun.run import beside_seams
        from weldsim.welding.folder import job_document, write_job
        from weldsim.welding.seams import file_findings

        findings, cloud = file_findings(program, self.file)
        scene = None if self.scene is None else self.scene_of(self.scene)
        config = paced_for(config, scene)
        cell, known = self._cell(scene, config)
        alone = replace(program, paths=program.paths[job.seam :][:1], names=program.names[job.seam :][:1])
        for note in beside_seams(alone, cell):  # before anything moves
            print(f"weldsim: {note}", file=sys.stderr)
        with progress() as tell:
            clock = Clock(tell)
            robot = self._robot(config, cell)
            with interrupted_once():
                done = weld(program, findings, robot, cell, config, job, scene=scene, known=known, clock=clock)
            if done.report is not None and done.stopped is not None:
                done = replace(done, report=replace(done.report, way_on=self._way_on(done, folder)))
            tell("writing", None)
            kept = write_job(folder, self.file, program, findings, cloud, done, job, config, cell.name, scene, known)
        written = [folder, *([done.black_box] if done.black_box is not None else [])]
        if self.json:
            document = job_document(done, program, job, config, cell.name, scene)
            print_json({**document, **written_json(written, kept)})
        else:
            self._print(done, program, job, config, scene, written, kept)
        if done.interrupted:
            return INTERRUPTED
        return 0 if done.passed else 1

    def _program(self, config: "CellConfig") -> "Program":
        """The paths of the file. Raises InputError for anything else."""
        from weldsim.dryrun.asked import at_given_speed
        from weldsim.dryrun.read import SCRIPTS, read_program

        if self.file.suffix.lower() in SCRIPTS:
            raise InputError(f"{self.file}: a robot program runs on the controller itself; execute takes paths (.json, .csv)")
        program = at_given_speed(read_program(self.file, speed=config.path.speed), config)
        if not 1 <= self.seam <= len(program.paths):
            raise InputError(f"--seam {self.seam}: {self.file} has {len(program.paths)}, counted from 1", seam=self.seam)
        return program

    def _check(self, folder: Path) -> None:
        """Raises OutputError where the run directory cannot be written."""
        from weldsim.run_folder import check_run_folder

        if folder.name in ("", ".", ".."):
            raise InputError(f"--out {folder}: give the run directory a name of its own", path=str(folder))
        refuse_file(folder, "--out", f"a run directory is written, with path.json, report.html and more in it; {folder.stem} say")
        check_folder(nearest_folder(folder), folder)
        check_run_folder(folder)

    def _cell(self, scene: Any, config: "CellConfig") -> tuple["Cell", Any]:
        """The cell, and its known seams where it is a scene of the twin."""
        from weldsim.dryrun.cell import empty_cell, scene_cell

        if scene is None:
            return empty_cell(), None
        from weldsim.scene.world import build_world

        world = build_world(scene, twin=config.twin)
        return scene_cell(scene), world.known_seams if world.workpiece.seams_are_known else None

    def _robot(self, config: "CellConfig", cell: "Cell") -> "Robot":
        if self.robot == "sim":
            from weldsim.execution.simulated import SimulatedRobot

            return SimulatedRobot(cell.model, cell.q_start, config.execution.simulation)
        from weldsim.execution.ur_robot import UrRobot

        ur = config.execution.ur
        return UrRobot(ur if self.host is None else replace(ur, host=self.host))

    def _print(
        self,
        done: "Job",
        program: "Program",
        job: "JobConfig",
        config: "CellConfig",
        scene: Any,
        written: list[Path],
        kept: Path | None,
    ) -> None:
        name = program.names[job.seam]
        print(f"{program.source}, {name}, on {done.robot}: {_word(done)}")
        if len(program.paths) > 1:
            print(f"  seam {self.seam} of {len(program.paths)}; --seam picks another")
        for note in (*program.notes, *(() if done.trial is None else done.trial.notes)):
            print(f"  {note}")
        rows = [[c.name, c.value, c.expected, MARKS[c.passed], c.advice if c.passed is False else ""] for c in done.clauses]
        print(table(rows, ("contract", "robot", "expected", "", "")))
        if done.trial is not None and not done.trial.passed:
            looks = "" if self.from_ is not None else f"; {self._dry_run(done, written[0])} looks for a fix"  # along the whole seam
            print(f"  nothing has moved: a dry run from where the arm stands fails{looks}")
            print(table(failures(done.trial), ("waypoint", "s", "verdict", "reason")))
        if done.stopped is not None:
            print(f"  {'stopped' if done.moved else 'nothing has moved'}: {done.stopped}")
        if done.report is not None and done.stopped is not None:
            print(f"  stopped {stopped_at(done.report)}")
            print(f"  {done.report.way_on}")
        if done.report is not None:
            from weldsim.config import limits_for
            from weldsim.report.limits import checks

            found = checks(done.report, limits_for(config, scene))
            if found:
                print(table(check_rows(found), ("figure", "measured", "limit", "")))
            for reason in () if done.report.passed else done.report.reasons:
                if reason != str(done.stopped):  # which stands above
                    print(f"  {reason}")
            for warning in done.report.warnings:
                print(f"  amber: {warning}")
        if done.log is not None:
            pace = "" if job.speed_scale == 1 else f" at {100 * job.speed_scale:g} % of the pace"
            far = f"; {progress_text(done.report)}" if done.report is not None and done.stopped is None else ""
            print(f"  arc {_arc(done.log, job)}{far}; {done.log.t[-1] - done.log.t[0]:.1f} s{pace}")
        print(times(done.timing))
        print_written(written, kept)

    def _way_on(self, done: "Job", folder: Path) -> str:
        """How to go on with a weld that was stopped: the command, or that nothing is left. Args: folder, its run directory."""
        from weldsim.welding.rest import way_on

        if done.progress is None:
            return ""
        words = ["weldsim", "execute", str(self.file), "--robot", self.robot]
        words += [] if self.host is None else ["--host", self.host]
        words += [] if self.scene is None else ["--scene", self.scene]
        words += ["--arc"] if self.arc else []
        words += [] if self.speed_scale == 1 else ["--speed-scale", f"{self.speed_scale:g}"]
        words += [] if self.seam == 1 else ["--seam", str(self.seam)]
        return way_on([*words, *self._settings()], done.progress, done.path, folder, self.from_)

    def _settings(self) -> list[str]:
        """The options that repeat this command's settings."""
        given = [] if self.config is None else ["--config", str(self.config)]
        return given + [word for text in self.set for word in ("--set", text)]

    def _dry_run(self, done: "Job", folder: Path) -> str:
        """The command that repeats a job's dry run. Args: folder, its run directory."""
        from weldsim.execution.contract import own_arm

        scene = [] if self.scene is None else ["--scene", self.scene]
        start = [] if done.q_start is None else ["--start", ", ".join(f"{angle:.4f}" for angle in done.q_start)]
        own = done.facts is not None and not own_arm(done.facts).nominal
        arm = ["--arm", str(folder / "contract.json")] if own else []
        return shlex.join(["weldsim", "dry-run", str(self.file), *scene, *arm, *self._settings(), *start])


def _arc(log: "ExecutionLog", job: "JobConfig") -> str:
    """What became of the arc, in words."""
    if not job.arc:
        return "off all along: no --arc"
    return "on" if log.arc_on.any() else "permitted, never on"


def _word(done: "Job") -> str:
    if done.passed:
        if done.log is None or not done.log.arc_on.any():
            return "DONE, arc off"
        return "WELDED WITH WARNINGS" if done.report is not None and done.report.warnings else "WELDED"
    if done.moved:
        return "STOPPED" if done.stopped is not None else "FAILED"
    return "REFUSED"
