"""UR poses out of a text table: x y z [m] and rx ry rz [rad] on each row, as whatever program wrote it."""

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.columns import AXES, ColumnName, TextTable, find_table, is_comment, is_number, read_name
from weldsim.errors import InputError
from weldsim.records import MILLIMETRE_SPAN

LONGEST_TURN = 2 * np.pi + 1e-6  # [rad] of a rotation vector
FURTHEST = 3.0  # [m] from the base: further is a unit mistaken
OUT_OF_REACH = 1.5  # [m] from the base: no tip of this arm is further away
LARGEST_ANGLE = 360.0  # [deg] of a joint
WANTED = ("x", "y", "z", "rx", "ry", "rz")
POSE = re.compile(r"\s*\"?\s*p?\[(.*)\]\s*\"?\s*[,;]?\s*")  # a pose as robot programs write it
ROTATION = re.compile(r"(?:r|rv|rot|rotvec|rotation|rotvector|rotationvector)[ _.:-]*([xyz])")
RECORDED = re.compile(r"(?:actual|target)_tcp_pose[ _.:-]?([0-5])")  # as ur_rtde and UR's own recorder call them
OF_THE_TOOL = re.compile(r"(?:tcp|tool0|tool|tip|torch|flange|ee)[ _.:-]+")
JOINT = re.compile(
    r"(?:actual_|target_)?(?:q|j|a|joint|axis|theta|gelenk|achse)[ _.:-]?\d(?:[ _](?:deg|rad))?"
    r"|base|shoulder(?:[ _].*)?|elbow(?:[ _].*)?|wrist.*"
)
IN_METRES = ("", "m", "rad", "m/s", "s")


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseTable:
    """Attributes: poses, in order, as UR writes them [m, rad]; labels, of the seam of each, None where no column names it;
    comments, all of them; note, what the reader was not sure of, or ""."""

    poses: Float[ndarray, "n 6"]
    labels: tuple[str, ...] | None
    comments: str
    note: str = ""


def read_poses(text: str, where: str) -> PoseTable:
    """The poses of a table whose columns may be named, then in any order, and parted by semicolons, tabs, commas or blanks.

    Args:
        text: lines of six numbers, `p[...]` around them or not, with decimal points or commas; comments are passed over.
        where: the file, for errors.
    Raises:
        InputError: fewer than two rows, a row that is short or holds something else, names without x y z rx ry rz, another
            unit than metres and radians, numbers that are millimetres, degrees or joint angles.
    """
    lines = [found[1] if (found := POSE.fullmatch(line)) else line for line in text.split("\n")]
    comments = " ".join(line for line in lines if is_comment(line))
    table = find_table(lines, least=len(WANTED))
    body = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not is_comment(line)]
    if table is None:
        _refuse(lines, body, where)
    assert table is not None
    body = [(number, line) for number, line in body if number > table.first]
    if len(body) < 2:
        raise InputError(f"{where}: {len(body)} poses; a path needs two", path=where)
    columns, label = _columns(table, lines, where)
    rows, labels = [], []
    for number, line in body:
        cells = table.cells(line)
        if len(cells) != (table.width if table.names else len(WANTED)):
            _refuse_width(len(cells), table, number, where)
        values = [float(cells[k]) if is_number(cells[k]) else np.nan for k in columns]
        if not np.isfinite(values).all():
            raise InputError(f"{where}: line {number}: a number is missing or not finite", path=where, line=number)
        rows.append(values)
        labels.append("" if label is None else cells[label])
    poses = np.array(rows, float)
    check_poses(poses, where, [number for number, _ in body])
    near = float(np.linalg.norm(poses[:, :3], axis=1).min())
    note = f"every pose is over {near:.2g} m from the base: if these are six joint angles, movej in a .script takes them"
    return PoseTable(
        poses=poses,
        labels=None if label is None else tuple(labels),
        comments=comments,
        note=note if near > OUT_OF_REACH else "",
    )


def check_poses(poses: Float[ndarray, "n 6"], where: str, lines: list[int]) -> None:
    """Nothing, when UR poses are in metres and radians. Raises InputError naming the line."""
    far, turn = np.linalg.norm(poses[:, :3], axis=1), np.linalg.norm(poses[:, 3:], axis=1)
    distant = far.max() > FURTHEST or np.ptp(poses[:, :3], axis=0).max() > MILLIMETRE_SPAN
    worst = int((far if distant else turn).argmax())
    at, value = f"{where}: line {lines[worst]}", float((far if distant else turn)[worst])
    needed = "x y z [m] and rx ry rz [rad] are needed"
    if distant and turn.max() > LONGEST_TURN:
        angles = float(np.abs(poses).max()) <= LARGEST_ANGLE
        what = "six joint angles in degrees, or millimetres and degrees" if angles else "millimetres and degrees"
        advice = "; joint angles: movej([d2r(...), ...]) in a .script" if angles else ""
        raise InputError(f"{at}: {_said(poses[worst])}: looks like {what}; {needed}{advice}", line=lines[worst], value=value)
    if distant:
        raise InputError(
            f"{at}: {value:.4g} m from the base (limit {FURTHEST:g} m): looks like millimetres; {needed}",
            line=lines[worst],
            value=value,
        )
    if turn.max() > LONGEST_TURN:
        raise InputError(
            f"{at}: rotation vector of length {value:.4g} (limit 2 pi): looks like degrees; {needed}",
            line=lines[worst],
            value=value,
        )


def _said(pose: Float[ndarray, "6"]) -> str:
    return ", ".join(f"{value:g}" for value in pose)


def _columns(table: TextTable, lines: list[str], where: str) -> tuple[list[int], int | None]:
    """Where x y z rx ry rz stand, and the name of the seam, if it has a column."""
    if table.names is None:
        return list(range(len(WANTED))), None
    if table.doubled:
        raise InputError(f"{where}: twice as many columns as names: decimal commas need ; between the columns", path=where)
    found: dict[str, int] = {}
    for i, name in enumerate(table.names):
        if (wanted := _wanted(name)) is None:
            continue
        if wanted in found and name.text.lower() != wanted:
            continue  # x is called just so by one column, and somehow like it by another
        found[wanted] = i
    listed = ", ".join(name.text for name in table.names if name.text)[:120]
    if missing := [name for name in WANTED if name not in found]:
        joints = sum(JOINT.fullmatch(_bare(name)) is not None for name in table.names) >= len(WANTED)
        hint = "these are joint angles: movej in a .script takes them; " if joints else ""
        raise InputError(
            f"{where}: column {missing[0]} is missing among {listed}; {hint}x y z rx ry rz [m, rad] are needed", path=where
        )
    for wanted in WANTED:
        name = table.names[found[wanted]]
        if (unit := _unit(name)) not in IN_METRES:
            line = next((n for n, text in enumerate(lines[: table.first], 1) if name.text in text), table.first)
            raise InputError(
                f"{where}: line {line}: column {wanted} is in {unit}; metres and radians are needed", path=where, line=line
            )
    label = next((i for i, name in enumerate(table.names) if name.text.lower() in ("seam", "naht")), None)
    return [found[wanted] for wanted in WANTED], label


def _wanted(name: ColumnName) -> str | None:
    """Which of x y z rx ry rz a column holds, or None."""
    bare = _bare(name)
    if (recorded := RECORDED.fullmatch(bare)) is not None:
        return WANTED[int(recorded[1])]
    bare = OF_THE_TOOL.sub("", bare)
    bare = re.sub(r"_(m|mm|rad|deg)$", "", bare)
    if (turn := ROTATION.fullmatch(bare)) is not None:
        return f"r{turn[1]}"
    role = read_name(bare).role
    return role if role in AXES else None


def _bare(name: ColumnName) -> str:
    """A column's name without the unit in brackets, lower case."""
    return re.sub(r"[\[({].*", "", name.text.lower()).strip()


def _unit(name: ColumnName) -> str:
    if name.unit is not None:
        return name.unit
    found = re.search(r"_(m|mm|cm|rad|deg)$", name.text.lower())
    return "" if found is None else found[1]


def _refuse(lines: list[str], body: list[tuple[int, str]], where: str) -> None:
    """Raises InputError: no row of six numbers."""
    if not body:
        raise InputError(f"{where}: 0 poses; a path needs two", path=where)
    rows = find_table(lines, least=3)
    if rows is not None:
        _refuse_width(rows.width, rows, rows.first + 1, where)
    number, line = body[-1]
    raise InputError(
        f"{where}: line {number}: {line.strip()[:60]!r} is no pose; x y z rx ry rz [m, rad] are needed", path=where, line=number
    )


def _refuse_width(width: int, table: TextTable, number: int, where: str) -> None:
    """Raises InputError: a row of another number of columns than is wanted."""
    expected = table.width if table.names else len(WANTED)
    hint = ""
    if width == 7 and not table.names:
        hint = " (x y z and a quaternion are no UR pose)"
    elif width == 12:
        hint = " (decimal commas need ; between the columns)"
    elif width > len(WANTED) and not table.names:
        hint = " (name them on the first line)"
    raise InputError(
        f"{where}: line {number}: {width} columns, expected {expected}: x y z rx ry rz [m, rad]{hint}", path=where, line=number
    )
