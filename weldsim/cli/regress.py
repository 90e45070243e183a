"""`weldsim regress`."""

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from weldsim.cli.options import SCENE_PREFIX, ConfigOptions, choose_platform, parted
from weldsim.cli.outputs import check_folder, check_outputs, check_suffix, nearest_folder
from weldsim.cli.show import print_json, progress, table
from weldsim.counted import counted
from weldsim.errors import InputError
from weldsim.sensor.names import SensorName
from weldsim.settings import key_of

if TYPE_CHECKING:
    from weldsim.regression import Golden, Regression


GOLDEN_SENSOR: SensorName = "d415"  # with which golden figures are recorded


@dataclass(frozen=True, kw_only=True)
class Regress(ConfigOptions):
    """Hold every scene's figures against recorded ones, and say which are worse, where and by how much.

    Each scene is scanned once for every seed and planned by both methods; every figure of the plan against the known seam is
    compared with tests/regression/golden.json (in an installed package: weldsim/_data/regression/golden.json). Exits 1 when a
    figure is worse than its tolerance allows, or a finder of your own fails; a better figure never fails. A seed that fails
    leaves its run directory. The published method, whose single seeds are a matter of chance, is judged over all seeds: of 3
    or more, against the 40 recorded.
    """

    scenes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="SCENE ...")] = ()
    """Names or TOML files; all that come with weldsim by default."""

    methods: Annotated[tuple[str, ...], tyro.conf.arg(metavar="METHOD ...")] = ("profile", "thesis")
    """Seam finders: profile, thesis, or your own as package.module:function or file.py:function, which is handed the cloud."""

    seeds: int = 3
    """How many seeds of the camera's noise: 0 to SEEDS - 1."""

    jobs: int = field(default_factory=lambda: min(4, os.cpu_count() or 1))
    """Processes, a core each; as many as there are cores, 4 at most, by default."""

    sensor: SensorName = GOLDEN_SENSOR
    """What looks. Recorded figures are those of the default; by any other sensor nothing is judged unless --golden is given."""

    execute: bool = False
    """Let the simulated arm weld what was planned too. Left out by default: it takes several times as long as everything
    else, and what it adds to the error of the plan depends on the arm, not on what perception sees."""

    junit: Path | None = None
    """Where to write JUnit XML for a continuous-integration system."""

    html: Path | None = None
    """Where to write a self-contained page with the table and a picture of every scene."""

    golden: Path | None = None
    """Another file of golden figures."""

    keep: Path = Path("runs/regress")
    """Folder for the run directories of what fails."""

    update: bool = False
    """Accept the figures: rewrite the golden file, SEEDS of each scene, and of the published method 40 (or SEEDS, if more). Needs
    --reason."""

    reason: str | None = None
    """Why the golden figures change; kept beside every figure that does."""

    def __call__(self) -> int:
        """0 where nothing is worse, else 1; 0 after an update."""
        from weldsim.regression import default_golden, regress
        from weldsim.regression.distribution import RECORDED_SEEDS
        from weldsim.regression.figures import CHAOTIC

        path = self.golden or default_golden()
        if "seam.method" in map(key_of, self.set):
            raise InputError("--set seam.method: each of --methods runs in its turn; did you mean --methods?")
        self._check(path)
        golden = self._golden(path)
        config = self.cell()
        scenes = [self.scene_of(name) for name in parted(self.scenes)] or None
        choose_platform()
        with progress() as tell:
            outcome = regress(
                scenes,
                methods=parted(self.methods),
                seeds=self.seeds,
                seeds_of=dict.fromkeys(CHAOTIC, max(self.seeds, RECORDED_SEEDS)) if self.update else None,
                jobs=self.jobs,
                config=config,
                sensor=self.sensor,
                execute=self.execute,
                golden=golden,
                keep=None if self.update else self.keep,
                pictures=self.html is not None,
                tell=tell,
            )
        written = self._write(outcome, golden, path)
        if self.json:
            print_json(self._document(outcome, path, written))
        else:
            self._print(outcome, path, written)
        return 0 if outcome.passed or self.update else 1

    def _check(self, path: Path) -> None:
        """Raises InputError for options that do not go together, OutputError for places that cannot be written."""
        from weldsim.regression.finders import told_apart
        from weldsim.regression.golden import is_packed

        told_apart(parted(self.methods), None)
        if self.update and not (self.reason or "").strip():
            raise InputError("--update: needs --reason, which is kept beside every figure that changes")
        if self.reason is not None and not self.update:
            raise InputError("--reason: is for --update")
        if self.update and (self.config is not None or self.set):
            raise InputError("--update: golden figures are those of the default settings; leave --config and --set out")
        if self.update and self.sensor != GOLDEN_SENSOR and self.golden is None:
            raise InputError(f"--update: golden figures are those of {GOLDEN_SENSOR}; give --golden for {self.sensor}'s own")
        if self.update and is_packed(path):
            raise InputError(f"--update: {path} belongs to the installed package; give --golden", path=str(path))
        if any(text.startswith(SCENE_PREFIX) for text in self.set) and not self.scenes:
            raise InputError("--set scene.KEY: name the scenes with --scenes")
        for name, value in (("seeds", self.seeds), ("jobs", self.jobs)):
            if value < 1:
                raise InputError(f"--{name} {value}: 1 or more is needed", key=name, value=value)
        check_suffix(self.junit, (".xml",), "JUnit output")
        check_suffix(self.html, (".html", ".htm"), "a page")
        check_outputs((self.junit, self.html, path if self.update else None), (self.config, None if self.update else path))
        if not self.update:
            check_folder(nearest_folder(self.keep / "run"), self.keep)

    @property
    def _judges(self) -> bool:
        """Whether there are figures to judge this sensor by."""
        return self.sensor == GOLDEN_SENSOR or self.golden is not None

    def _golden(self, path: Path) -> "Golden":
        """What to judge by; nothing yet where the first recording is asked for, nor for a sensor without any."""
        from weldsim.regression import Golden, read_golden

        first = self.update and not path.exists()
        return Golden() if first or not self._judges else read_golden(path)

    def _write(self, outcome: "Regression", golden: "Golden", path: Path) -> list[Path]:
        written = []
        if self.junit is not None:
            from weldsim.regression.junit import write_junit

            written.append(write_junit(self.junit, outcome))
        if self.html is not None:
            from weldsim.regression.page import write_page

            written.append(write_page(self.html, outcome))
        if self.update:
            from weldsim.regression import updated, write_golden
            from weldsim.scene.files import scene_names

            renewed = updated(golden, [row.figures for row in outcome.rows], self.reason or "")
            if not self.scenes:  # all scenes ran: what is recorded of others is of scenes that are no more
                renewed = replace(renewed, scenes={k: v for k, v in renewed.scenes.items() if k in scene_names()})
            written.append(write_golden(path, renewed))
        return written

    def _document(self, outcome: "Regression", path: Path, written: list[Path]) -> dict[str, Any]:
        from weldsim.regression.distribution import FALSE_ALARMS
        from weldsim.regression.text import sentence, shift_sentence

        rows = [
            {
                "scene": row.figures.scene,
                "method": row.figures.method,
                "seed": row.figures.seed,
                "passed": row.passed,
                "judged": row.judged,
                "figures": row.figures.judged(),
                "timing": {"scan": row.scan_seconds, **row.figures.timing},
                "refused": row.figures.refused or None,
                "worse": [sentence(deviation) for deviation in row.deviations],
                "folder": row.folder,
            }
            for row in outcome.rows
        ]
        return {
            "passed": outcome.passed,
            "sensor": self.sensor,
            "golden": str(path) if self._judges else None,
            "units": {"length": "m", "angle": "rad", "time": "s"},
            "seconds": outcome.seconds,
            "jobs": outcome.jobs,
            "rows": rows,
            "over_all_seeds": {
                "false_alarm_rate": FALSE_ALARMS,
                "tests": outcome.judgement.tests,
                "worse": [shift_sentence(shift) for shift in outcome.shifts],
            },
            "written": [str(place) for place in written],
        }

    def _print(self, outcome: "Regression", path: Path, written: list[Path]) -> None:
        from weldsim.regression.text import HEAD, refusals, rows_of_text, sentence, shift_sentence, unjudged

        print(table(rows_of_text(outcome), HEAD))
        where = f"{counted(len(outcome.rows), 'plan')} in {outcome.seconds:.1f} s with {counted(outcome.jobs, 'process')}"
        print(f"  {where}; median / worst of {counted(outcome.seeds, 'seed')}")
        for line in refusals(outcome):
            print(f"  {line}")
        for row in outcome.rows:
            for deviation in row.deviations:
                print(f"  WORSE {sentence(deviation)}")
            if row.folder is not None:
                print(f"  left {row.folder}")
        for shift in outcome.shifts:
            print(f"  WORSE {shift_sentence(shift)}")
        if failed := sum(bool(row.fault) for row in outcome.rows):
            print(f"  FAILED {counted(failed, 'plan')}, by a fault of the finder's own")
        if unjudged(outcome):
            print(f"  {unjudged(outcome)}")
        if not self._judges:
            print(f"  nothing is judged: {path} holds figures of {GOLDEN_SENSOR}, not of {self.sensor}")
        elif not self.update:
            count = len(outcome.deviations) + len(outcome.shifts)
            worse = "nothing is" if not count else f"{counted(count, 'figure')} {'is' if count == 1 else 'are'}"
            print(f"  {worse} worse than {path} allows")
        for place in written:
            print(f"  wrote {place}")
