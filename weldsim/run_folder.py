"""The folder that a run leaves behind: whole or not at all, and never in place of something else."""

import io
import itertools
import json
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from weldsim.cloud.depth_output import write_depth_frame
from weldsim.cloud.files import write_cloud
from weldsim.cloud.register import Registration
from weldsim.config import CellConfig, for_scene, limits_for, to_json
from weldsim.errors import OutputError
from weldsim.inputs import ConfigLike, SceneLike, config_from, run_from, scene_from
from weldsim.output import write_whole
from weldsim.path.files import path_document, write_path_csv, write_path_json
from weldsim.pipeline import RunResult
from weldsim.records import ExecutionLog
from weldsim.report.html import write_html
from weldsim.report.png import png
from weldsim.report.weld import report_json
from weldsim.rounded import rounded
from weldsim.sensor.choose import SensorName, depth_step

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

SCHEMA = "weldsim.run/1"
MANIFEST = "run.json"


def check_run_folder(folder: Path) -> None:
    """Nothing, when a run may be written there.

    Raises:
        OutputError: a file, or a folder that holds something other than a run.
    """
    if not os.path.lexists(folder):
        return
    if not folder.is_dir() or folder.is_symlink():
        raise OutputError(f"{folder}: is no folder; give another --out", path=str(folder))
    if any(folder.iterdir()) and not _is_run(folder):
        raise OutputError(f"{folder}: holds something other than a run and is left alone; give another --out", path=str(folder))


def write_run(
    folder: Path | str,
    result: RunResult,
    config: ConfigLike | None,
    scene: SceneLike,
    seed: int,
    sensor: SensorName,
    *,
    keep_earlier: bool = True,
) -> Path | None:
    """The folder, and where an earlier run that stood there is kept now; None where there was none, or none was to be kept.

    It holds config.json (resolved), path.json, path.csv, cloud.ply, a depth image with intrinsics and pose for each view,
    scan.npz where the arm was driven to them, views.json where there were several (how they were lined up), report.json,
    report.html, report.png, log.npz where the arm moved, and run.json, which says what is what.

    Raises:
        OutputError: it cannot be written; nothing is left then.  InputError: no run, config or scene.
    """
    done, cell, stood = run_from(result), config_from(config), scene_from(scene)
    return folder_in_place(Path(folder), lambda place: _fill(place, done, cell, stood, seed, sensor), keep_earlier=keep_earlier)


def folder_in_place(folder: Path, fill: Callable[[Path], None], *, keep_earlier: bool = True) -> Path | None:
    """`folder`, with what `fill` writes into a folder beside it that is then renamed.

    Args:
        folder: an earlier run there is renamed to FOLDER.1, FOLDER.2, ... first.  fill: writes into the folder it is given.
        keep_earlier: whether that is kept, or replaced.
    Returns:
        Where the earlier run is kept now; None where there was none or it was replaced.

    Raises:
        OutputError: it cannot be written, or holds something other than a run; nothing is left then.
    """
    check_run_folder(folder)
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        temporary.mkdir(parents=True)
        fill(temporary)
        return _put_in_place(temporary, folder, keep_earlier=keep_earlier)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})", path=str(folder)) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _fill(folder: Path, result: RunResult, config: CellConfig, scene: "SceneConfig", seed: int, sensor: SensorName) -> None:
    plan, report = result.plan, result.report
    resolved = {"cell": to_json(for_scene(config, scene)), "scene": to_json(scene), "seed": seed, "sensor": sensor}
    write_json(folder / "config.json", resolved, exact=True)  # it is read back
    source = {"scene": scene.name, "seed": seed, "sensor": sensor, "points": len(plan.cloud), "method": plan.findings.method}
    reasons = {index: str(error) for index, error in plan.refused.items()}
    document = path_document(plan.findings.seams, plan.paths, report.timing, source, plan.config_digest, refused=reasons)
    write_path_json(folder / "path.json", document)
    write_path_csv(folder / "path.csv", document)
    write_cloud(folder / "cloud.ply", plan.cloud)
    for index, capture in enumerate(result.captures):
        name = "depth" if len(result.captures) == 1 else f"depth_{index}"
        write_depth_frame(folder / f"{name}.png", capture.frame, depth_unit=depth_step(sensor, config))
    if result.tour is not None:
        write_whole(folder / "scan.npz", tour_bytes(result.tour.logs))
    if result.registration is not None:
        write_json(folder / "views.json", views_document(result.registration))
    limits = limits_for(config, scene)
    write_json(folder / "report.json", report_json(report, limits))
    seen = {"log": result.log, "known": result.world.known_seams, "welded": result.welded, "config": limits}
    others = {weld.seam: weld.log for weld in result.others}
    picture = png(report, plan.cloud, plan.findings, plan.paths, **seen)
    write_html(folder / "report.html", report, plan.cloud, plan.findings, plan.paths, others=others, still=picture, **seen)
    write_whole(folder / "report.png", picture)
    if result.log is not None:
        write_whole(folder / "log.npz", log_bytes({result.welded: result.log, **others}))
    manifest = {
        "schema": SCHEMA,
        "scene": scene.name,
        "seed": seed,
        "sensor": sensor,
        "method": plan.findings.method,
        "passed": report.passed,
        "config_digest": plan.config_digest,
        "versions": report.versions,
        "files": sorted(path.name for path in folder.iterdir()),
    }
    write_json(folder / MANIFEST, manifest)


def views_document(found: Registration) -> dict[str, Any]:
    """How views were lined up, as JSON values [m], [rad]."""
    return {"schema": "weldsim.views/1", "units": {"length": "m", "angle": "rad"}, **asdict(found)}


def tour_bytes(logs: tuple[ExecutionLog, ...]) -> bytes:
    """The arm's way from view to view as an NPZ: arrays as in the log of a weld, and `view`, which view each row leads to."""
    names = ("t", "q_cmd", "q_act", "qd_act")
    arrays: dict[str, Any] = {name: np.concatenate([getattr(log, name) for log in logs]) for name in names}
    arrays["view"] = np.repeat(np.arange(len(logs)), [len(log.t) for log in logs])
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def log_bytes(logs: Mapping[int, ExecutionLog]) -> bytes:
    """Logs of a job as one NPZ: arrays by name, one log after the other; X_BT_act as position and quaternion wxyz, events as
    lines of text, and `seam`, the number of the seam that each row belongs to, from 1.

    Args:
        logs: by the seam's index, in order.
    """
    each = list(logs.values())
    # A log begins with the state in which the one before it ended.
    new = [log.t > (each[k - 1].t[-1] if k else -np.inf) for k, log in enumerate(each)]
    names = ("t", "q_cmd", "q_act", "qd_act", "s_cmd", "arc_on")
    columns = [{name: getattr(log, name) for name in names} for log in each]
    for column, log, index in zip(columns, each, logs, strict=True):
        if all(other.torque is not None for other in each):
            column["torque"] = log.torque
        column["position_B"], column["quaternion_wxyz"] = log.X_BT_act.p, log.X_BT_act.quaternion
        column["segments"] = np.array([segment.value for segment in log.segments])
        column["seam"] = np.full(len(log.t), index + 1)
    rows = list(zip(columns, new, strict=True))
    arrays: dict[str, Any] = {name: np.concatenate([column[name][keep] for column, keep in rows]) for name in columns[0]}
    arrays["events"] = np.array([f"{event.t:.3f} s {event.kind}: {event.text}" for log in each for event in log.events])
    arrays["period"], arrays["robot"] = np.array(each[0].period), np.array(each[0].robot)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _put_in_place(new: Path, folder: Path, *, keep_earlier: bool) -> Path | None:
    """`new` renamed to `folder`; an earlier run there is moved aside first, and then removed or told where it is."""
    if not folder.exists() or not any(folder.iterdir()):
        os.replace(new, folder)
        return None
    old = _aside(folder) if keep_earlier else folder.with_name(f".{folder.name}.{os.getpid()}.old")
    os.replace(folder, old)
    try:
        os.replace(new, folder)
    except OSError:
        os.replace(old, folder)
        raise
    if keep_earlier:
        return old
    shutil.rmtree(old, ignore_errors=True)
    return None


def _aside(folder: Path) -> Path:
    """The first of FOLDER.1, FOLDER.2, ... that is free."""
    return next(place for n in itertools.count(1) if not os.path.lexists(place := folder.with_name(f"{folder.name}.{n}")))


def _is_run(folder: Path) -> bool:
    try:
        return json.loads((folder / MANIFEST).read_text()).get("schema") == SCHEMA
    except (OSError, ValueError, AttributeError):
        return False


def write_json(path: Path, content: dict[str, Any], *, exact: bool = False) -> None:
    """Nothing; the file is written whole, readable, floats rounded unless `exact`, without numbers that JSON has not."""
    write_whole(path, json.dumps(content if exact else rounded(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n")
