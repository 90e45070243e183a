"""The folder that an executed job leaves behind: the same log and report as a run of the twin, whole or not at all."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from weldsim.arm import Arm
from weldsim.config import CellConfig, digest, limits_for, to_json
from weldsim.dryrun.program import Program
from weldsim.dryrun.verdict import DryRun, dry_run_json
from weldsim.errors import InputError
from weldsim.execution.contract import Clause
from weldsim.output import write_whole
from weldsim.records import KnownSeam, PointCloud, RobotFacts, SeamFindings
from weldsim.report.html import write_html
from weldsim.report.png import png
from weldsim.report.weld import report_json, versions
from weldsim.run_folder import MANIFEST, SCHEMA, folder_in_place, log_bytes, write_json
from weldsim.welding.job import Job, JobConfig, judged

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig


def write_job(
    folder: Path,
    file: Path,
    program: Program,
    findings: SeamFindings,
    cloud: PointCloud,
    done: Job,
    job: JobConfig,
    config: CellConfig,
    cell: str,
    scene: "SceneConfig | None" = None,
    known: tuple[KnownSeam, ...] | None = None,
) -> Path | None:
    """The folder: config.json, the path file, contract.json, dry_run.json, and where the arm was moved log.npz, report.json,
    report.html, report.png; run.json says what is what.

    Returns:
        Where an earlier run that stood there is kept now; None where there was none.
    Raises:
        OutputError: it cannot be written; nothing is left then.
    """

    def fill(place: Path) -> None:
        resolved = {"cell": to_json(config), "scene": None if scene is None else to_json(scene), "job": job_json(job)}
        write_json(place / "config.json", resolved, exact=True)
        shutil.copyfile(file, place / f"path{file.suffix.lower()}")
        write_json(place / "contract.json", contract_json(done.clauses, done.facts))
        if done.trial is not None:
            dry = DryRun(source=program.source, cell=cell, trials=(done.trial,), fixes=((),), notes=program.notes)
            write_json(place / "dry_run.json", dry_run_json(dry))
        if done.log is not None and done.report is not None:
            limits = limits_for(config, scene)
            write_whole(place / "log.npz", log_bytes({job.seam: done.log}))
            write_json(place / "report.json", report_json(done.report, limits))
            paths = tuple(done.path if i == job.seam else each for i, each in enumerate(program.paths))
            shown = {"log": done.log if job.arc else judged(done.log), "known": known or (), "welded": job.seam, "config": limits}
            picture = png(done.report, cloud, findings, paths, **shown)
            write_html(place / "report.html", done.report, cloud, findings, paths, still=picture, **shown)
            write_whole(place / "report.png", picture)
        write_json(
            place / MANIFEST,
            {
                "schema": SCHEMA,
                "scene": None if scene is None else scene.name,
                "robot": done.robot,
                "source": program.source,
                "passed": done.passed,
                "moved": done.moved,
                "stopped": None if done.stopped is None else str(done.stopped),
                "progress": progress_json(done),
                "black_box": None if done.black_box is None else done.black_box.name,
                "config_digest": digest(config),
                "versions": versions(),
                "files": sorted(path.name for path in place.iterdir()),
            },
        )

    return folder_in_place(folder, fill)


def job_json(job: JobConfig) -> dict[str, Any]:
    return {"seam": job.seam + 1, "arc": job.arc, "speed_scale": job.speed_scale, "from": job.start}


def progress_json(done: Job) -> dict[str, Any] | None:
    """How far the weld came [m], and the command that goes on with it; None where nothing was moved."""
    if done.progress is None:
        return None
    return {**asdict(done.progress), "way_on": done.report.way_on or None if done.report is not None else None}


def contract_json(clauses: tuple[Clause, ...], facts: RobotFacts | None) -> dict[str, Any]:
    """The contract as JSON values: its lines, and the plain facts; dh as `RobotFacts` has it."""
    plain = ("model", "series", "version", "serial", "dh_note", "payload_kg", "remote_control", "safety", "mode", "program_running")
    told = None
    if facts is not None:
        told = {name: getattr(facts, name) for name in plain} | {"dh": None if facts.dh is None else facts.dh.tolist()}
    return {
        "schema": "weldsim.contract/1",
        "kept": all(clause.passed is not False for clause in clauses) and bool(clauses),
        "facts": told,
        "clauses": [asdict(clause) for clause in clauses],
    }


def read_told_arm(file: Path) -> Arm:
    """The arm that a controller told of, from the contract.json that a job left.

    Raises:
        InputError: it cannot be read, is none, or the controller did not tell; `data`: path.
    """
    try:
        facts = json.loads(file.read_text(encoding="utf-8"))["facts"]
        dh = None if facts is None else facts["dh"]
        figures = None if dh is None else np.array(dh, float)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})", path=str(file)) from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: is no contract.json of a job", path=str(file)) from error
    if figures is None:
        raise InputError(f"{file}: the controller did not tell of its arm", path=str(file))
    if figures.shape != (6, 4) or not np.isfinite(figures).all():
        raise InputError(f"{file}: facts.dh: six rows of four numbers are needed", path=str(file))
    return Arm(dh=figures)


def job_document(
    done: Job, program: Program, job: JobConfig, config: CellConfig, cell: str, scene: "SceneConfig | None" = None
) -> dict[str, Any]:
    """What became of a job, as JSON values; `scene` may have limits of its own."""
    dry = None
    if done.trial is not None:
        dry = dry_run_json(DryRun(source=program.source, cell=cell, trials=(done.trial,), fixes=((),), notes=program.notes))
    stopped = done.stopped
    keep = ("rule", "what", "value", "limit", "t", "s", "segment")
    data = {} if stopped is None else {name: stopped.data[name] for name in keep if name in stopped.data}
    return {
        "schema": "weldsim.execute/1",
        "robot": done.robot,
        "source": program.source,
        "cell": cell,
        **job_json(job),
        "passed": done.passed,
        "moved": done.moved,
        "stopped": None if stopped is None else {"text": str(stopped), **json.loads(json.dumps(data, default=str))},
        "progress": progress_json(done),
        "black_box": None if done.black_box is None else str(done.black_box),
        "contract": contract_json(done.clauses, done.facts),
        "dry_run": dry,
        "report": None if done.report is None else report_json(done.report, limits_for(config, scene)),
        "timing": {stage: round(seconds, 4) for stage, seconds in done.timing.items()},
    }
