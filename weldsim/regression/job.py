"""One scene and seed: scanned once, planned by every method, judged; what fails leaves its run directory.

This runs in worker processes, one core each, and its figures do not depend on which worker it was.
"""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from weldsim.config import CellConfig, digest, to_json
from weldsim.errors import InputError, MotionError, WeldsimError
from weldsim.pipeline import Clock, Finder, PlanResult, RunResult, SensorName, Sighting, finish, look, plan, true_region
from weldsim.records import Rejection, SeamFindings
from weldsim.regression.figures import Figures, figures_of
from weldsim.regression.golden import Deviation, Entries, compare
from weldsim.run_folder import MANIFEST, SCHEMA, check_run_folder, write_json, write_run

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig
    from weldsim.scene.miscalibration import TwinConfig
    from weldsim.scene.world import World

PICTURE = (1000, 80)  # width [px] and quality of the page's JPEG pictures


@dataclass(frozen=True, kw_only=True)
class Task:
    """What one worker is to do.

    Attributes:
        scene, seed: what to scan.  methods: {name: config}, each planned with.
        finders: {name of a method: the caller's own finder}.  execute: whether the arm welds too.
        golden: {method: entries} to judge by; empty for a method that has none.
        keep: folder for the run directories of what fails; None = none are written.
        sensor: what looks.
        pictures: whether a picture of each method is wanted.
    """

    scene: "SceneConfig"
    seed: int
    methods: Mapping[str, CellConfig]
    finders: Mapping[str, Finder] = field(default_factory=dict)
    execute: bool = False
    golden: Mapping[str, Entries] = field(default_factory=dict)
    keep: Path | None = None
    sensor: SensorName = "d415"
    pictures: bool = False


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one scene, method and seed came to.

    Attributes:
        figures: measured.  deviations: those that are worse than they may be; judged: whether there was anything to judge by,
            this seed or, where the record is a distribution, all seeds of the run.
        folder: run directory left behind, or None.  picture: JPEG bytes, or None.
        scan_seconds: building and scanning, shared by all methods of the scene and seed.
        fault: what a finder of one's own failed with, "" where it did not.
    """

    figures: Figures
    deviations: tuple[Deviation, ...] = ()
    judged: bool = False
    folder: str | None = None
    picture: bytes | None = None
    scan_seconds: float = 0.0
    fault: str = ""

    @property
    def passed(self) -> bool:
        """Whether no figure is worse than it may be, and no finder failed."""
        return not self.deviations and not self.fault


def carry_out(task: Task) -> tuple[Row, ...]:
    """A row for each method, in order. Raises SceneError for a scene that contradicts itself."""
    with threadpool_limits(1, user_api="blas"):
        try:
            clock = Clock()
            config = next(iter(task.methods.values()))
            world = _built(task.scene, config.twin)
            seen = look(task.scene, config, seed=task.seed, sensor=task.sensor, world=world, clock=clock)
        except InputError:  # a scene that contradicts itself: nothing to be judged
            raise
        except WeldsimError as error:  # a view out of reach, a camera that sees nothing: there is no cloud
            return tuple(_unseen(task, method, error) for method in task.methods)
        seconds = sum(seen.timing.values())
        return tuple(replace(_planned(task, method, seen), scan_seconds=seconds) for method in task.methods)


@lru_cache(maxsize=2)
def _built(scene: "SceneConfig", twin: "TwinConfig") -> "World":
    from weldsim.scene.world import build_world

    return build_world(scene, twin=twin)


def _planned(task: Task, method: str, seen: Sighting) -> Row:
    config, refused, fault, clock = task.methods[method], "", "", Clock()
    try:
        result = plan(seen.cloud, config, find=task.finders.get(method), clock=clock)
    except WeldsimError as error:  # a line that no torch can follow, say: nothing is planned then
        refused, result = str(error), _nothing(seen, method, config, str(error), clock)
        fault = refused if method in task.finders and isinstance(error, InputError) else ""
    try:
        done = finish(seen, result, config, execute=task.execute)
    except MotionError as error:
        refused, done = str(error), finish(seen, result, config, execute=False)
    figures = figures_of(
        task.scene.name,
        method,
        task.seed,
        result,
        seen.world.known_seams,
        config,
        true_region=true_region(seen.captures, result.cloud) if seen.world.workpiece.region_is_known else None,
        report=done.report,
    )
    if not seen.world.workpiece.seams_are_known:
        figures = replace(figures, phantoms=None, phantom_length=None)
    figures = replace(figures, refused=refused or "; ".join(map(str, result.refused.values())))
    entries = task.golden.get(method, {})
    deviations = compare(figures, entries)
    folder = picture = None
    if deviations and task.keep is not None:
        folder = task.keep / f"{task.scene.name}-{method}-{task.seed}"
        write_run(folder, done, config, task.scene, task.seed, seen.sensor, keep_earlier=False)
    if task.pictures:
        picture = _picture(done)
    judged = any(entry.judges(task.seed) for entry in entries.values())
    return Row(
        figures=figures,
        deviations=deviations,
        judged=judged,
        folder=None if folder is None else str(folder),
        picture=picture,
        fault=fault,
    )


def _nothing(seen: Sighting, method: str, config: CellConfig, reason: str, clock: Clock) -> PlanResult:
    """The plan of a method that gave none."""
    x, y, z = (float(value) for value in seen.cloud.points.mean(axis=0))
    findings = SeamFindings(
        seams=(),
        region=np.zeros(len(seen.cloud), np.int32),
        rejected=(Rejection(position_B=(x, y, z), length=0.0, reason=reason),),
        method=method,
    )
    return PlanResult(cloud=seen.cloud, findings=findings, paths=(), timing=clock.seconds, config_digest=digest(config))


def _unseen(task: Task, method: str, error: WeldsimError) -> Row:
    """The row of a scene that could not be scanned; its folder holds the settings and the reason."""
    known = len(_built(task.scene, task.methods[method].twin).known_seams)
    figures = Figures(
        scene=task.scene.name,
        method=method,
        seed=task.seed,
        known=known,
        missed=known,
        coverage=0.0 if known else None,
        refused=str(error),
    )
    entries = task.golden.get(method, {})
    deviations = compare(figures, entries)
    folder = None
    if deviations and task.keep is not None:
        folder = task.keep / f"{task.scene.name}-{method}-{task.seed}"
        check_run_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
        resolved = {"cell": to_json(task.methods[method]), "scene": to_json(task.scene), "seed": task.seed}
        write_json(folder / "config.json", resolved, exact=True)
        said = {"schema": SCHEMA, "scene": task.scene.name, "seed": task.seed, "method": method, "refused": str(error)}
        write_json(folder / MANIFEST, said)
    judged = any(entry.judges(task.seed) for entry in entries.values())
    return Row(figures=figures, deviations=deviations, judged=judged, folder=None if folder is None else str(folder))


def _picture(done: RunResult) -> bytes:
    """The run's picture as a small JPEG."""
    import cv2

    from weldsim.report.png import write_png

    with tempfile.TemporaryDirectory() as folder:
        path = write_png(
            Path(folder) / "picture.png",
            done.report,
            done.plan.cloud,
            done.plan.findings,
            done.plan.paths,
            known=done.world.known_seams,
            welded=done.welded,
        )
        image = np.asarray(cv2.imread(str(path)))
    width, quality = PICTURE
    small = cv2.resize(image, (width, round(width * image.shape[0] / image.shape[1])), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
