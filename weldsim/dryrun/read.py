"""Files to programs: `weldsim.path/1`, CSV of UR poses, URScript; anything else is refused in one line."""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.dryrun.program import Base, Program, Tool
from weldsim.dryrun.urscript import parse_script
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.mounts import X_FT
from weldsim.path.files import read_path_json, torch_paths
from weldsim.quantity import MetrePerSecond
from weldsim.records import MILLIMETRE_SPAN, Segment, TorchPath

SCRIPTS = (".script", ".urscript", ".ur")
LONGEST_TURN = 2 * np.pi + 1e-6  # [rad] of a rotation vector
SHORTEST = 1e-6  # [m] of a path
FURTHEST = 3.0  # [m] from the base: further is a unit mistaken
POSE = re.compile(r"\s*p?\[(.*)\]\s*")  # a pose as robot programs write it
HALF_TURN = Transform("BB", np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


def read_program(
    path: Path | str,
    *,
    tool: Tool | None = None,
    base: Base = "controller",
    speed: MetrePerSecond = 0.008,
    roll_free: bool | None = None,
    q_start: Float[ndarray, "6"] | None = None,
) -> Program:
    """What the file asks of the arm.

    Args:
        path: JSON, CSV or URScript, told by the suffix.
        tool: which frame a CSV's or script's poses are of; by default what the file says, else tool0 for a bare CSV (a robot
            program's own poses) and the torch for a script.
        base: in which base a CSV's poses are; `base_link` is the controller's turned half a turn about z.
        speed: torch speed where the file names none [m/s].
        roll_free: whether the torch may turn about its wire; by default a path's may, a robot program's may not.
        q_start: where the arm stands [rad], for a script that asks.
    Raises:
        InputError: a file that is missing, malformed, in millimetres, with numbers that are not finite, or too short.
    """
    path = Path(path)
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
    if path.suffix.lower() in (".csv", ".txt"):
        return _csv(path, text, tool, base, speed, bool(roll_free))
    raise InputError(f"{path}: .json (weldsim.path/1), .csv (UR poses) or .script (URScript) is needed", path=str(path))


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
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})", path=str(path)) from error
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no UTF-8 text", path=str(path)) from None


def _csv(path: Path, text: str, tool: Tool | None, base: Base, speed: MetrePerSecond, roll_free: bool) -> Program:
    rows = [(number, row.strip()) for number, row in enumerate(text.splitlines(), 1) if row.strip()]
    comments = " ".join(row for _, row in rows if row.startswith("#"))
    body = [(number, _cells(row.partition("#")[0])) for number, row in rows if not row.startswith("#")]
    head: list[str] = []
    if body and all(_number(cell) is None for cell in body[0][1][-6:]):
        head, body = _head(path, *body[0]), body[1:]
    labels, poses = _poses(path, head, body)
    told = "tool0" if "tool0" in comments else "torch" if "torch" in comments else None
    notes = []
    if tool is None and told is None:
        notes.append(
            "the file does not say which frame its poses are of: read as tool0 (--tool torch reads them as the wire's tip)"
        )
    X_BE = Transform.from_rotation_vector("BT", poses[:, 3:], poses[:, :3])
    if base == "base_link":
        turned = HALF_TURN.R @ X_BE.R
        X_BE = Transform("BT", turned, X_BE.p @ HALF_TURN.R.T)
    chosen = tool or told or "tool0"
    X_BT = X_BE if chosen == "torch" else Transform("BF", X_BE.R, X_BE.p) @ X_FT
    paths, names = [], []
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
    return Program(source=path.name, kind="csv", paths=tuple(paths), names=tuple(names), notes=tuple(notes))


def _poses(path: Path, head: list[str], body: list[tuple[int, list[str]]]) -> tuple[list[str], Float[ndarray, "n 6"]]:
    """Label and UR pose of each row, checked."""
    if len(body) < 2:
        raise InputError(f"{path}: {len(body)} poses; a path needs two", path=str(path))
    columns = list(range(-6, 0))
    if head:
        wanted = ("x", "y", "z", "rx", "ry", "rz")
        missing = [name for name in wanted if name not in head]
        if missing:
            raise InputError(f"{path}: column {missing[0]} is missing; x y z rx ry rz [m, rad] are needed", path=str(path))
        columns = [head.index(name) for name in wanted]
    labels, poses = [], []
    for number, cells in body:
        if len(cells) != (len(head) or 6):
            raise InputError(
                f"{path}: line {number}: {len(cells)} columns, expected {len(head) or 6}: x y z rx ry rz [m, rad]"
                + (" (x y z and a quaternion are no UR pose)" if len(cells) == 7 else "")
                + (" (decimal commas need ; between the columns)" if len(cells) == 12 else ""),
                path=str(path),
                line=number,
            )
        values = [_number(cells[k]) for k in columns]
        if any(value is None or not np.isfinite(value) for value in values):
            raise InputError(f"{path}: line {number}: a number is missing or not finite", path=str(path), line=number)
        labels.append(cells[head.index("seam")].strip() if "seam" in head else path.stem)
        poses.append(values)
    table = np.array(poses, float)
    check_poses(table, str(path), [number for number, _ in body])
    return labels, table


def check_poses(poses: Float[ndarray, "n 6"], where: str, lines: list[int]) -> None:
    """Nothing, when UR poses are in metres and radians. Raises InputError naming the line."""
    far = np.linalg.norm(poses[:, :3], axis=1)
    if far.max() > FURTHEST or np.ptp(poses[:, :3], axis=0).max() > MILLIMETRE_SPAN:
        worst = int(far.argmax())
        raise InputError(
            f"{where}: line {lines[worst]}: {far[worst]:.4g} m from the base (limit {FURTHEST:g} m): looks like millimetres",
            line=lines[worst],
            value=float(far[worst]),
        )
    turn = np.linalg.norm(poses[:, 3:], axis=1)
    if turn.max() > LONGEST_TURN:
        worst = int(turn.argmax())
        raise InputError(
            f"{where}: line {lines[worst]}: rotation vector of length {turn[worst]:.4g} (limit 2 pi): looks like degrees",
            line=lines[worst],
            value=float(turn[worst]),
        )


def _cells(row: str) -> list[str]:
    """A row's cells, between semicolons or tabs (numbers may then have decimal commas), commas, or blanks."""
    mark = next((mark for mark in (";", "\t", ",") if mark in row), None)
    if (written := POSE.fullmatch(row)) is not None:
        row = written.group(1)
    if mark is not None:
        row = row.rstrip().removesuffix(mark)  # some programs end every row with one
    cells = row.split(mark)
    return [cell.strip().strip('"').replace(",", ".") for cell in cells]


def _head(path: Path, number: int, cells: list[str]) -> list[str]:
    """Names of the columns; a unit in brackets may follow each."""
    names = []
    for cell in cells:
        name, _, unit = cell.lower().replace("(", "[").partition("[")
        if (unit := unit.strip(" ])")) not in ("", "m", "rad", "m/s"):
            message = f"{path}: line {number}: column {name.strip()} is in {unit}; metres and radians are needed"
            raise InputError(message, path=str(path), line=number)
        names.append(name.strip())
    return names


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
