"""Files to programs: `weldsim.path/1`, CSV of UR poses, URScript; anything else is refused in one line."""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.columns import decode
from weldsim.curves import arc_length
from weldsim.dryrun.pose_table import FURTHEST, read_poses
from weldsim.dryrun.program import Base, Program, Tool
from weldsim.dryrun.urscript import parse_script
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.mounts import X_FT
from weldsim.path.files import read_path_json, torch_paths
from weldsim.quantity import MetrePerSecond
from weldsim.records import Segment, TorchPath

SCRIPTS = (".script", ".urscript", ".ur")
TABLES = (".csv", ".txt", ".tsv")
SHORTEST = 1e-6  # [m] of a path
HALF_TURN = Transform("BB", np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


def read_program(
    path: Path | str,
    *,
    tool: Tool | None = None,
    base: Base | None = None,
    speed: MetrePerSecond = 0.008,
    roll_free: bool | None = None,
    q_start: Float[ndarray, "6"] | None = None,
) -> Program:
    """What the file asks of the arm.

    Args:
        path: JSON, CSV or URScript, told by the suffix.
        tool: which frame a CSV's or script's poses are of; by default what the file says, else tool0 for a bare CSV (a robot
            program's own poses) and the torch for a script.
        base: in which base a CSV's poses are; `base_link` is the controller's turned half a turn about z. By default what the
            file says, else the controller's.
        speed: torch speed where the file names none [m/s].
        roll_free: whether the torch may turn about its wire; by default a path's may, a robot program's may not.
        q_start: where the arm stands [rad], for a script that asks.
    Raises:
        InputError: a file that is missing, malformed, in millimetres, with numbers that are not finite, or too short.
    """
    path = Path(path)
    _refuse_others(path)
    _refuse_unused(path, tool, base, roll_free)
    if path.suffix.lower() == ".json":
        document = read_path_json(path)
        paths = torch_paths(document, speed=speed)
        if not paths:
            raise InputError(f"{path}: holds no seam with poses; there is nothing to check", path=str(path))
        for each, seam in zip(paths, document["seams"], strict=True):
            far = float(np.linalg.norm(each.X_BT.p, axis=1).max())
            if far > FURTHEST:
                raise InputError(
                    f"{path}: {seam['id']}: {far:.4g} m from the base (limit {FURTHEST:g} m): looks like millimetres", value=far
                )
        if roll_free is not None:
            paths = tuple(_with_roll(each, roll_free) for each in paths)
        return Program(source=path.name, kind="path", paths=paths, names=tuple(seam["id"] for seam in document["seams"]))
    text = _text(path)
    if path.suffix.lower() in SCRIPTS:
        return parse_script(text, source=str(path), X_FT=None if tool is None else _mount(tool), q_start=q_start)
    return _csv(path, text, tool, base, speed, bool(roll_free))


def _refuse_others(path: Path) -> None:
    """Raises InputError for a folder, or a file of another kind."""
    wanted = ".json (weldsim.path/1), .csv (UR poses) or .script (URScript) is needed"
    if path.is_dir():
        inside = path / "path.json"  # of a run directory
        raise InputError(f"{path}: is a folder; {f'did you mean {inside}?' if inside.is_file() else wanted}", path=str(path))
    if path.suffix.lower() == ".urp":
        raise InputError(f"{path}: is PolyScope's own; the .script that it saves beside it is read", path=str(path))
    if path.suffix.lower() not in (".json", *SCRIPTS, *TABLES):
        raise InputError(f"{path}: {wanted}", path=str(path))


def _refuse_unused(path: Path, tool: Tool | None, base: Base | None, roll_free: bool | None) -> None:
    """Raises InputError for what a file of this kind says itself."""
    suffix = path.suffix.lower()
    if suffix == ".json" and tool is not None:
        raise InputError(f"{path}: --tool is for CSV and scripts; poses of a weldsim.path/1 are the wire's tip", path=str(path))
    if suffix not in TABLES and base == "base_link":
        raise InputError(f"{path}: --base is for CSV; this file's poses are in the controller's base", path=str(path))
    if suffix in SCRIPTS and roll_free:
        raise InputError(f"{path}: --roll is for paths; a robot program's poses are taken as they are", path=str(path))


def _with_roll(path: TorchPath, roll_free: bool) -> TorchPath:
    return TorchPath(
        X_BT=path.X_BT,
        s=path.s,
        speed=path.speed,
        arc_on=path.arc_on,
        segments=path.segments,
        roll_free=roll_free,
        sigma=path.sigma,
    )


def _mount(tool: Tool) -> Transform:
    """Flange to the frame that poses are of."""
    return X_FT if tool == "torch" else Transform("FT", np.eye(3), np.zeros(3))


def _text(path: Path) -> str:
    """The text of a file in whatever encoding: only comments and names can differ by it."""
    try:
        text = decode(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})", path=str(path)) from error
    if "\0" in text:
        raise InputError(f"{path}: is no text", path=str(path))
    return text


def _csv(path: Path, text: str, tool: Tool | None, base: Base | None, speed: MetrePerSecond, roll_free: bool) -> Program:
    table = read_poses(text, str(path))
    poses, labels = table.poses, table.labels or (path.stem,) * len(table.poses)
    told = "tool0" if "tool0" in table.comments else "torch" if "torch" in table.comments else None
    notes = list(table.notes)
    if tool is None and told is None:
        notes.append(
            "the file does not say which frame its poses are of: read as tool0 (--tool torch reads them as the wire's tip)"
        )
    if table.ignored:
        notes.append(
            f"what these columns say is not read: {', '.join(table.ignored)}; the arc burns along the whole path, at one speed"
            " (--speed)"
        )
    if base is None and "base_link" in table.comments:
        base = "base_link"
        notes.append("the file says base_link: read so, half a turn about z from the controller's (--base controller does not)")
    X_BE = Transform.from_rotation_vector("BT", poses[:, 3:], poses[:, :3])
    if base == "base_link":
        turned = HALF_TURN.R @ X_BE.R
        X_BE = Transform("BT", turned, X_BE.p @ HALF_TURN.R.T)
    chosen = tool or told or "tool0"
    X_BT = X_BE if chosen == "torch" else Transform("BF", X_BE.R, X_BE.p) @ X_FT
    paths, names, lines = [], [], []
    for name in dict.fromkeys(labels):
        mine = [i for i, label in enumerate(labels) if label == name]
        if len(mine) < 2:
            raise InputError(f"{path}: {name}: 1 pose; a path needs two", path=str(path))
        p = X_BT.p[mine]
        paths.append(
            TorchPath(
                X_BT=Transform("BT", X_BT.R[mine], p),
                s=arc_length(p),
                speed=np.full(len(mine), speed),
                arc_on=np.ones(len(mine), bool),
                segments=(Segment.WELD,) * len(mine),
                roll_free=roll_free,
            )
        )
        if paths[-1].s[-1] < SHORTEST:
            raise InputError(f"{path}: {name}: all {len(mine)} poses are in one place; a path has a length", path=str(path))
        names.append(name)
        lines.append(tuple(table.lines[i] for i in mine))
    return Program(source=path.name, kind="csv", paths=tuple(paths), names=tuple(names), lines=tuple(lines), notes=tuple(notes))
