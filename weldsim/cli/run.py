"""`weldsim run`."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from weldsim.cli.options import ConfigOptions, Method, SceneName, choose_platform, refuse_together
from weldsim.cli.outputs import check_folder, check_outputs, check_suffix, nearest_folder, refuse_file
from weldsim.cli.quantities import POINT, quantities
from weldsim.cli.show import check_rows, print_json, print_written, progress, reasons_refused, table, times, written_json
from weldsim.errors import InputError, SensorError
from weldsim.sensor.names import SensorName

if TYPE_CHECKING:
    from weldsim.config import CellConfig
    from weldsim.jobs import RunResult
    from weldsim.records import WeldReport
    from weldsim.report.limits import ReportConfig


@dataclass(frozen=True, kw_only=True)
class Run(ConfigOptions):
    """Scan, plan and weld a workpiece in the twin, and judge the weld against the true seam.

    Writes a run directory and exits 1 when the verdict is FAILED.
    """

    scene: SceneName
    """Name of a scene (`weldsim scenes`), or a TOML file."""

    seed: int = 0
    """Of the camera's noise."""

    sensor: SensorName = "d415"
    """What looks: the model of a D415 or D435, rendered and matched infrared images, the Kinect v2 above, or exact depth."""

    method: Method | None = None
    """Seam finder: ours (the default) or the published one."""

    seam: int | Literal["all"] | None = None
    """Which seam to weld, counted from 1, the best one (the default); `all` welds every one, one after the other."""

    near: Annotated[tuple[float, float, float] | None, quantities(POINT, "--near", words=3)] = None
    """Weld the seam nearest to this point in the base: metres, or each with its unit, "-450 mm" say."""

    video: Path | None = None
    """Where to write a film of the weld, MP4."""

    out: Path | None = None
    """The run directory; runs/SCENE-SEED by default. An earlier run there is kept, as NAME.1."""

    def __call__(self) -> int:
        """0 where the verdict is passed, else 1."""
        refuse_together(seam=self.seam, near=self.near)
        if self.seed < 0:
            raise InputError(f"--seed {self.seed}: 0 or more is needed", seed=self.seed)
        if isinstance(self.seam, int) and self.seam < 1:
            raise InputError(f"--seam {self.seam}: seams are counted from 1", seam=self.seam)
        config, scene = self.cell(self.method), self.scene_config()
        folder = self.out or Path("runs") / f"{scene.name}-{self.seed}"
        self._check(folder)

        from weldsim.config import limits_for
        from weldsim.pipeline import run
        from weldsim.run_folder import check_run_folder, write_run

        check_run_folder(folder)
        if choose_platform() == "embree" and self.video is not None:
            raise SensorError("--video: films need OpenGL, and none works here; `weldsim doctor` says what is missing")
        with progress() as tell:
            result = run(
                scene,
                config,
                seed=self.seed,
                sensor=self.sensor,
                number=self.seam,
                near=self.near,
                video=self.video,
                black_boxes=folder.with_name(f"{folder.name}.black-box"),
                tell=tell,
            )
            if result.report.stopped is not None:
                result = replace(result, report=replace(result.report, way_on=self._way_on(result, folder)))
            tell("writing", None)
            kept = write_run(folder, result, config, scene, self.seed, self.sensor)
        written = [folder, *([self.video] if self.video is not None and result.log is not None else [])]
        limits, found = limits_for(config, scene), result.plan.findings
        unseen = (
            ()
            if found.seams
            else (f"no seam was found: {reasons_refused(found, config.seam.profile)}{self._hint(result, config)}",)
        )
        if self.json:
            self._print_json(result.report, limits, written, kept)
        else:
            self._print(
                result.report,
                limits,
                len(found.seams),
                (*result.world.workpiece.notes, *result.world.notes, *notes(result), *unseen),
            )
            print_written(written, kept)
        return 0 if result.report.passed else 1

    def _hint(self, result: "RunResult", config: "CellConfig") -> str:
        """With which settings a seam is found in the cloud; empty where none that was tried helps."""
        from weldsim.cloud.config import CloudConfig
        from weldsim.hints import hint_of_sides

        plan = result.plan
        return hint_of_sides(plan.cloud, replace(config, cloud=CloudConfig()), plan.findings.rejected)

    def _way_on(self, result: "RunResult", folder: Path) -> str:
        """How to go on with a weld that was stopped: the command that welds the rest of the planned path."""
        from weldsim.welding.rest import way_on

        index = result.others[-1].seam if result.others else result.welded
        path = result.plan.paths[index]
        if result.report.progress is None or path is None:
            return ""
        number = sum(each is not None for each in result.plan.paths[: index + 1])
        words = ["weldsim", "execute", str(folder / "path.json"), "--robot", "sim", "--scene", self.scene, "--arc"]
        words += [] if number == 1 else ["--seam", str(number)]
        words += [] if self.config is None else ["--config", str(self.config)]
        words += [word for text in self.set for word in ("--set", text)]
        return way_on(words, result.report.progress, path, folder)

    def scene_config(self) -> Any:
        """The scene, without a name that could lead out of its folder. Raises SceneError, ConfigError."""
        scene = self.scene_of(self.scene)
        if not scene.name or any(mark in scene.name for mark in ("/", "\\", "\0")) or scene.name.startswith("."):
            raise InputError(f"{self.scene}: name {scene.name!r} cannot name a folder", name=scene.name)
        return scene

    def _check(self, folder: Path) -> None:
        """Raises OutputError where something cannot be written."""
        check_suffix(self.video, (".mp4",), "a film")
        check_outputs((self.video,), (self.config,))
        if folder.name in ("", ".", ".."):
            raise InputError(f"--out {folder}: give the run directory a name of its own", path=str(folder))
        refuse_file(folder, "--out", f"a run directory is written, with path.json, report.html and more in it; {folder.stem} say")
        check_folder(nearest_folder(folder), folder)

    def _print_json(self, report: "WeldReport", limits: "ReportConfig", written: list[Path], kept: Path | None) -> None:
        from weldsim.report.weld import report_json

        print_json({**report_json(report, limits), **written_json(written, kept)})

    def _print(self, report: "WeldReport", limits: "ReportConfig", found: int, notes: tuple[str, ...]) -> None:
        from weldsim.report.limits import checks
        from weldsim.report.verdict import verdict

        word, why = verdict(report, found, limits)
        print(f"{report.scene}, seed {report.seed}, {self.sensor}, method {report.method}: {word}, {why}")
        if report.way_on:
            print(f"  {report.way_on}")
        print(table(check_rows(checks(report, limits)), ("figure", "measured", "limit", "")))
        for reason in () if report.passed else report.reasons[1:]:
            print(f"  {reason}")
        for warning in report.warnings:
            print(f"  amber: {warning}")
        if 0 < report.welded < report.seams and self.seam != "all" and report.stopped is None:
            print("  --seam all welds every one")
        for note in notes:
            print(f"  {note}")
        print(times(report.timing))


def notes(result: "RunResult") -> tuple[str, ...]:
    """What the plans of the motions have to say, by seam where there are several."""
    if not result.others:
        return result.motion.notes if result.motion else ()
    motions = [(result.welded, result.motion), *((weld.seam, weld.motion) for weld in result.others)]
    return tuple(f"seam {index + 1}: {note}" for index, motion in motions if motion is not None for note in motion.notes)
