"""`weldsim dry-run`."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from weldsim import units
from weldsim.cli.options import ConfigOptions, choose_platform, keep_importable, refuse_together
from weldsim.cli.outputs import check_outputs, check_suffix
from weldsim.cli.quantities import JOINTS, LEANED, MOVED, TURNED, WELD_SPEED, quantities, quantity
from weldsim.cli.show import print_json, progress, table
from weldsim.counted import counted
from weldsim.dryrun.names import Base, Tool
from weldsim.errors import InputError, SensorError

if TYPE_CHECKING:
    from weldsim.arm import Arm
    from weldsim.dryrun.cell import Cell
    from weldsim.dryrun.change import Change
    from weldsim.dryrun.margin import Margin
    from weldsim.dryrun.verdict import DryRun, Trial, Verdict
    from weldsim.motion.config import MotionConfig
    from weldsim.records import TorchPath

TOLD = 40  # failures in full


@dataclass(frozen=True, kw_only=True)
class DryRunCommand(ConfigOptions):
    """Check a path or robot program before anything moves: a verdict per waypoint, what would help, cycle time.

    Exits 1 when it would fail.
    """

    reads: ClassVar[tuple[str, ...]] = ("twin", "path", "motion", "execution", "report")  # a job's settings may be handed on

    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """A path (weldsim.path/1, .json), UR poses (.csv: x y z rx ry rz) or URScript (.script)."""

    scene: str | None = None
    """What stands around the arm: name of a scene, or a TOML file."""

    empty: bool = False
    """Arm and table alone (the default)."""

    start: Annotated[tuple[float, ...] | None, quantities(JOINTS, "--start")] = None
    """Where the arm stands: six joint angles, "-90 deg, -75 deg, ..." or radians. Default: the scene's last view, or home."""

    arm: Path | None = None
    """Whose arm it is, in place of a nominal UR5: a controller's calibration.conf, or the contract.json of a run directory that
    `weldsim execute` left, which holds what the controller told. For paths."""

    tool: Tool | None = None
    """Which frame the poses of a CSV or script are of: the wire's tip, or the bare flange. Default: what the file says."""

    base: Base | None = None
    """In which base a CSV's poses are: the UR controller's, or base_link, which is turned half a turn about z; by default what
    the file says, else the controller's."""

    roll: bool = False
    """Leave the rotation about the wire of a CSV's poses free."""

    turn: Annotated[float | None, quantity(TURNED, "--turn")] = None
    """Turn the torch about its wire first, "-15 deg" say, at every pose; fixes are told in such options."""

    lean: Annotated[tuple[float, ...] | None, quantities(LEANED, "--lean")] = None
    """Lean the torch first: added work angle and travel angle, "5 deg, 0 deg"."""

    move: Annotated[tuple[float, ...] | None, quantities(MOVED, "--move")] = None
    """Move part, fixture and job first, along x and y of the base: "20 mm, -35 mm"."""

    speed: Annotated[float | None, quantity(WELD_SPEED, "--speed")] = None
    """Weld at this speed at most: "5 mm/s"."""

    no_fix: bool = False
    """Do not look for changes that would help."""

    html: Path | None = None
    """Where to write a page: verdicts, joint plots, a picture of the first failure, or of halfway where there is none."""

    out: Path | None = None
    """Where to write the dry run as JSON."""

    png: Path | None = None
    """Where to write the picture of the first failure, or of halfway where there is none."""

    reach_map: Path | None = None
    """Where to write a picture of the table: where the part could stand so that the whole seam can be welded (first seam)."""

    export: Path | None = None
    """Where to write the planned motion as URScript; only where the dry run passes."""

    def __call__(self) -> int:
        """0 where the job would pass, else 1."""
        refuse_together(scene=self.scene, empty=self.empty or None)
        check_suffix(self.html, (".html",), "a page")
        check_suffix(self.png, (".png",), "a picture")
        check_suffix(self.out, (".json",), "a dry run")
        check_suffix(self.reach_map, (".png",), "a reach map")
        check_suffix(self.export, (".script", ".urscript"), "a program")
        check_outputs((self.html, self.out, self.png, self.reach_map, self.export), (self.config, self.file, self.arm))
        _ = choose_platform() if self.draws else keep_importable()
        config = self.cell()
        self._refuse_idle_options()
        change = self._change()

        from weldsim.config import paced_for
        from weldsim.dryrun.asked import at_given_speed
        from weldsim.dryrun.change import changed
        from weldsim.dryrun.read import read_program
        from weldsim.dryrun.run import dry_run

        config = paced_for(config, None if self.scene is None else self.scene_of(self.scene))
        cell = self._cell()
        program = read_program(
            self.file,
            tool=self.tool,
            base=self.base,
            speed=config.path.speed,
            roll_free=True if self.roll else None,
            q_start=cell.q_start,
        )
        program = at_given_speed(program, config)
        if program.kind == "script" and (self.reach_map is not None or self.export is not None):
            raise InputError(f"{self.file}: --reach-map and --export are for paths; this is a robot program already")
        if program.kind == "script" and self.arm is not None:
            raise InputError(f"{self.file}: --arm is for paths; the joint angles of a robot program are an arm's own already")
        if program.from_start and self.start is None:
            stands = ", ".join(f"{units.to_deg(q):.1f}" for q in cell.q_start.tolist())
            note = f"{program.from_start}: the arm is taken to stand at {stands} deg; --start says where it does"
            program = replace(program, notes=(*program.notes, note))
        program, cell = changed(program, cell, change)
        with progress() as tell:
            result = dry_run(program, cell, config.motion, fix=not self.no_fix, tell=tell)
            written, trouble = self._write(result, cell, config.motion.joint_speed_limit)
            extra: dict[str, Any] = {}
            if self.reach_map is not None:
                extra = {"reach_map": self._map(program.paths[0], cell, config.motion, lambda done: tell("reach map", done))}
                written.append(self.reach_map)
            if self.export is not None and result.passed:
                written.append(self._export(result, cell, config.motion))
        if self.json:
            from weldsim.dryrun.verdict import dry_run_json

            print_json({**dry_run_json(result), **extra, "written": [str(path) for path in written]})
        else:
            self._print(result, written, trouble)
        return 0 if result.passed else 1

    def _refuse_idle_options(self) -> None:
        """Raises InputError for an option that says what a file of this kind says itself."""
        from weldsim.dryrun.read import TABLES

        kind = self.file.suffix.lower()
        if kind == ".json" and self.tool is not None:
            raise InputError(f"--tool {self.tool}: changes nothing here: poses of a {kind} path are the wire's tip")
        if kind not in TABLES and self.base == "base_link":
            raise InputError(
                f"--base {self.base}: changes nothing here: it is for a CSV; poses of {kind or 'this'} are the controller's"
            )
        if kind not in (*TABLES, ".json") and self.roll:
            raise InputError("--roll: changes nothing here: it is for the poses of a CSV")

    @property
    def draws(self) -> bool:
        """Whether a picture of the cell was asked for, on a page or alone."""
        return self.html is not None or self.png is not None

    def _change(self) -> "Change":
        import numpy as np

        from weldsim.dryrun.change import Change

        lean, move = (None if given is None else np.array(given) for given in (self.lean, self.move))
        return Change(turn=self.turn, lean=lean, move=move, speed=self.speed)

    def _cell(self) -> "Cell":
        import numpy as np

        from weldsim.dryrun.cell import empty_cell, scene_cell

        q_start = None if self.start is None else np.array(self.start)
        cell = empty_cell(q_start) if self.scene is None else scene_cell(self.scene_of(self.scene), q_start)
        return cell if self.arm is None else cell.fitted(self._arm(self.arm))

    def _arm(self, file: Path) -> "Arm":
        """The arm of a file, near enough to a nominal one."""
        from weldsim.arm import Arm
        from weldsim.controller.calibration import read_calibration
        from weldsim.execution.contract import ANOTHER
        from weldsim.welding.folder import read_told_arm

        found = read_told_arm(file) if file.suffix.lower() == ".json" else Arm(dh=read_calibration(file).dh)
        if (off := found.deviation()) > ANOTHER:
            raise InputError(f"--arm {file}: {1e3 * off:.0f} mm from a nominal UR5 (limit {1e3 * ANOTHER:g} mm): it is another arm")
        return found

    def _write(self, result: "DryRun", cell: "Cell", speed_limit: float) -> tuple[list[Path], str]:
        """What was written, and why a picture was not. Args: speed_limit of the joints [rad/s]."""
        import json

        from weldsim.dryrun.verdict import dry_run_json
        from weldsim.output import write_whole
        from weldsim.rounded import rounded

        written, trouble = [], ""
        pictures: tuple[bytes | None, ...] = (None,) * len(result.trials)
        if self.draws:
            try:
                pictures = tuple(self._picture(trial, cell) for trial in result.trials)
            except SensorError as error:
                trouble = str(error)
        if self.html is not None:
            from weldsim.dryrun.page import write_page

            written.append(write_page(self.html, result, pictures, speed_limit=speed_limit))
        if self.png is not None:
            failed = next((i for i, trial in enumerate(result.trials) if not trial.passed), 0)
            if (png := pictures[failed]) is not None:
                written.append(write_whole(self.png, png))
        if self.out is not None:
            written.append(write_whole(self.out, json.dumps(rounded(dry_run_json(result)), indent=1, allow_nan=False) + "\n"))
        return written, trouble

    def _map(self, path: "TorchPath", cell: "Cell", config: "MotionConfig", tell: Any) -> dict[str, Any]:
        """The reach map, drawn; as JSON."""
        from weldsim.dryrun.reach import reach_json, reach_map, reach_picture
        from weldsim.output import write_whole

        found = reach_map(path, cell, config, tell=tell)
        write_whole(self.reach_map, reach_picture(found, self.file.stem))  # type: ignore[arg-type] - asked for
        return reach_json(found)

    def _export(self, result: "DryRun", cell: "Cell", config: "MotionConfig") -> Path:
        """All welds one after the other, from the start and back; they may also begin where arms wait, if that way is clear."""
        import numpy as np

        from weldsim.execution.urscript import script_text
        from weldsim.motion.sweep import touched
        from weldsim.output import write_whole
        from weldsim.scene.world import AWAY, HOME

        waiting = (np.asarray(q, float) for q in (HOME, AWAY))
        text = script_text(
            *(trial.trajectory for trial in result.trials if trial.trajectory is not None),
            starts=[q for q in waiting if touched(q, cell.q_start, cell.collision) is None],
            title=f"{result.source}, {', '.join(trial.name for trial in result.trials)}",
            arm=cell.arm,
            joint_acceleration=config.joint_acceleration,
            lead_speed=config.lead_speed,
        )
        return write_whole(self.export, text)  # type: ignore[arg-type] - asked for

    def _picture(self, trial: "Trial", cell: "Cell") -> bytes:
        from weldsim.dryrun.picture import picture

        return picture(trial, cell)

    def _print(self, result: "DryRun", written: list[Path], trouble: str) -> None:
        word = f"would pass, cycle time {result.cycle:.1f} s" if result.passed else "WOULD FAIL"
        print(f"{result.source} in the cell {result.cell}: {word}")
        for note in result.notes:
            print(f"  {note}")
        for trial, fixes in zip(result.trials, result.fixes, strict=True):
            state = f"{trial.cycle:.1f} s" if trial.passed else "fails"
            what = "motion" if trial.verdicts[0].line else "waypoint"
            print(f"  {trial.name}: {counted(len(trial.verdicts), what)}, {units.to_mm(trial.length):.0f} mm, {state}")
            if rows := failures(trial):
                print(table(rows, (what, "s", "verdict", "reason")))
            if trial.margins:
                print(table([_margin_row(margin) for margin in trial.margins], ("figure", "worst", "limit", "at", "")))
            for fix in fixes:
                alone = f"{trial.name} alone " if fix.breaks else ""
                told = f"; {', '.join(fix.breaks)} would fail with it" if fix.breaks else ""
                print(f"  {alone}would pass: {fix.text}{told}")
                print(f"    with {fix.how}")
            if rows and not fixes and not self.no_fix:
                print("  no change that was tried would help")
            for note in trial.notes:
                print(f"  {note}")
        if trouble:
            print(f"  {trouble}")
        for path in written:
            print(f"  wrote {path}")


def failures(trial: "Trial") -> list[list[str]]:
    """Lines of a table of all that failed, TOLD of them at most; what is not reached is named once, after them."""
    from weldsim.dryrun.verdict import runs

    bad = [(a, b) for a, b in runs(trial.verdicts) if not a.ok]
    own = [pair for pair in bad if pair[0].why != "not reached"]
    rows = [_row(a, b) for a, b in own[:TOLD]]
    if len(own) > TOLD:
        rows.append([f"{len(own) - TOLD} more", "", "", "all are in --out and --html"])
    late = [pair for pair in bad if pair[0].why == "not reached"]
    count = sum(b.index - a.index + 1 for a, b in late)
    if len(late) == 1:
        rows.append(_row(*late[0]))
    elif late:
        rows.append([f"{count} others", "", "not reached", late[0][0].text])
    return rows


def _margin_row(margin: "Margin") -> list[str]:
    """One line of the table of margins."""
    return [margin.figure, *margin.said, margin.when, margin.of]


def _row(first: "Verdict", last: "Verdict") -> list[str]:
    """One line of the table of failures."""
    from weldsim.dryrun.verdict import span

    return [span(first, last), "" if first.s is None else f"{units.to_mm(first.s):.1f} mm", first.why, first.text]
