"""UR poses out of a text table: a position and a rotation on each row, as whatever program wrote it."""

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.columns import (
    AXES,
    UNITS,
    ColumnName,
    TextTable,
    find_table,
    is_comment,
    is_number,
    plain_numbers,
    read_name,
    unit_of_comments,
)
from weldsim.counted import counted
from weldsim.errors import InputError
from weldsim.frames import matrix_from_quaternion, matrix_from_rotation_vector, rotation_vector_from_matrix
from weldsim.records import MILLIMETRE_SPAN

LONGEST_TURN = 2 * np.pi + 1e-6  # [rad] of a rotation vector
FURTHEST = 3.0  # [m] from the base: further is a unit mistaken
LEAST_MICROMETRES = 2e4  # read as metres: what lies further out than 20 m in millimetres
OUT_OF_REACH = 1.5  # [m] from the base: no tip of this arm is further away
LARGEST_ANGLE = 360.0  # [deg] of a joint
WANTED = ("x", "y", "z", "rx", "ry", "rz")
QUATERNION, ANGLES = ("qx", "qy", "qz", "qw"), ("roll", "pitch", "yaw")
POSE = re.compile(r"\s*(?:(?:global\s+)?\w+\s*[=:]\s*)?\"?\s*p?\[+([^\[\]]*)\]+\s*\"?\s*[,;]?\s*")  # as programs write it
ROTATION = re.compile(r"(?:r|rv|rot|rotvec|rotation|rotvector|rotationvector)[ _.:-]*([xyzw])")
OF_QUATERNION = re.compile(r"(?:q|quat|quaternion|orientation|orient)[ _.:-]*([xyzw])")
NUMBERED = {"q0": "qw", "q1": "qx", "q2": "qy", "q3": "qz"}
WITHIN = re.compile(r"(?:field|pose|transform|msg)[ _.:-]+")  # what a message's columns begin with
RECORDED = re.compile(r"(?:actual|target)_tcp_pose[ _.:-]?([0-5])")  # as ur_rtde and UR's own recorder call them
OF_THE_TOOL = re.compile(r"(?:tcp|tool0|tool|tip|torch|flange|ee)[ _.:-]+")
JOINT = re.compile(
    r"(?:actual_|target_)?(?:q|j|a|joint|axis|theta|gelenk|achse)[ _.:-]?\d(?:[ _](?:deg|rad))?"
    r"|base|shoulder(?:[ _].*)?|elbow(?:[ _].*)?|wrist.*"
)
MOTION = re.compile(  # columns that say how a robot is to move or weld
    r"(?:travel|weld|welding|torch|tcp|tool|lin|linear)?[ _-]*"
    r"(?:speed|velocity|vel|feed(?:[ _-]?rate)?|acc|acceleration|geschwindigkeit)"
    r"|v|a|f|arc(?:[ _-]?on)?|weld(?:ing)?(?:[ _-]?on)?|blend(?:[ _-]?radius)?|zone|dwell|wait|wire(?:[ _-]?feed)?|current|voltage"
)
RADIANS = ("rad", "radian", "radians")
DEGREES = ("deg", "degree", "degrees", "\u00b0", "\u00ba")
BARE = ("", "-", "1")  # units of a quaternion
TURNS = dict.fromkeys(("", *RADIANS), 1.0) | dict.fromkeys(DEGREES, float(np.pi / 180))  # [rad] per unit
AFTER = re.compile(rf"[ _./-]+(?:in[ _]+)?({'|'.join(map(re.escape, (*UNITS, *RADIANS, *DEGREES)))})\.?$")  # a unit behind a name
LONGEST_VECTOR = np.deg2rad(180.5)  # [rad] of a rotation vector in degrees: longer ones are roll, pitch and yaw
FEW_DEGREES = np.deg2rad(7.0)  # [rad] to which radians come that are taken for degrees


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseTable:
    """Attributes: poses, in order, as UR writes them [m, rad]; lines, of the file, from 1, of each; labels, of the seam of each,
    None where no column names it; comments, all of them; notes, what the reader was not sure of; ignored, columns that say how to
    move or weld."""

    poses: Float[ndarray, "n 6"]
    lines: tuple[int, ...]
    labels: tuple[str, ...] | None
    comments: str
    notes: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()


def read_poses(text: str, where: str) -> PoseTable:
    """The poses of a table whose columns may be named, then in any order, and parted by semicolons, tabs, commas or blanks.

    Names may be those of a rotation vector, of a quaternion, or roll, pitch and yaw about fixed axes, and give units.

    Args:
        text: lines of six numbers, `p[...]` around them or not, with decimal points or commas; comments are passed over.
        where: the file, for errors.
    Raises:
        InputError: fewer than two rows, a row that is short or holds something else, names without a position and a rotation, a
            unit that leaves the pose open, numbers that are millimetres, degrees or joint angles.
    """
    lines = [found[1] if (found := POSE.fullmatch(line)) else line for line in plain_numbers(text).split("\n")]
    comments = " ".join(line for line in lines if is_comment(line))
    table = find_table(lines, least=len(WANTED))
    body = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not is_comment(line)]
    if table is None:
        _refuse(lines, body, where)
    assert table is not None
    body = [(number, line) for number, line in body if number > table.first]
    if len(body) < 2:
        raise InputError(f"{where}: {counted(len(body), 'pose')}; a path needs two", path=where)
    columns, label = _columns(table, lines, where)
    rows, labels = [], []
    for number, line in body:
        cells = table.cells(line)
        if len(cells) != (table.width if table.names else len(WANTED)):
            _refuse_width(len(cells), table, number, where)
        values = [float(cells[column.at]) if is_number(cells[column.at]) else np.nan for column in columns]
        if not np.isfinite(values).all():
            raise InputError(f"{where}: line {number}: a number is missing or not finite", path=where, line=number)
        rows.append(values)
        labels.append("" if label is None else cells[label])
    numbers = [number for number, _ in body]
    values = np.array(rows, float) * [column.scale for column in columns]
    _check_vectors(values, columns, table, where, numbers)
    poses = _ur_poses(values, columns, where, numbers)
    check_poses(poses, where, numbers, columns[0].scale)
    near = float(np.linalg.norm(poses[:, :3], axis=1).min())
    notes = []
    if near > OUT_OF_REACH:
        notes.append(f"every pose is over {near:.2g} m from the base: if these are six joint angles, movej in a .script takes them")
    if (degrees := _in_degrees(table, columns)) and columns[3].what == "rx":
        notes.append(
            f"{degrees} are read as a rotation vector in degrees; if they are roll, pitch and yaw, name them roll [deg], pitch"
            " [deg], yaw [deg]"
        )
    if degrees and np.abs(values[:, 3:]).max() < FEW_DEGREES:
        notes.append(f"{degrees} are all under {np.rad2deg(FEW_DEGREES):.0f} deg: if they are radians, name them so, [rad]")
    return PoseTable(
        poses=poses,
        lines=tuple(numbers),
        labels=None if label is None else tuple(labels),
        comments=comments,
        notes=tuple(notes),
        ignored=tuple(name.text for name in table.names or () if MOTION.fullmatch(_bare(name).strip(" _-"))),
    )


def check_poses(poses: Float[ndarray, "n 6"], where: str, lines: list[int], scale: float = 1.0) -> None:
    """Nothing, when UR poses are in metres and radians. Raises InputError naming the line.

    Args:
        scale: metres per unit that the file gives its positions.
    """
    far, turn = np.linalg.norm(poses[:, :3], axis=1), np.linalg.norm(poses[:, 3:], axis=1)
    distant = far.max() > FURTHEST or np.ptp(poses[:, :3], axis=0).max() > MILLIMETRE_SPAN
    turned = turn.max() > LONGEST_TURN
    worst = int((far if distant else turn).argmax())
    at, value = f"{where}: line {lines[worst]}", float((far if distant else turn)[worst])
    length, unit = ("micrometres", "um") if far.max() > LEAST_MICROMETRES else ("millimetres", "mm")
    needed = "x y z [m] and rx ry rz [rad] are needed"
    given = next(name for name in ("m", "mm", "cm", "um", "in", *UNITS) if UNITS[name] == scale)
    if distant and scale != 1.0:
        said = f"{value:.4g} m from the base (limit {FURTHEST:g} m), read in {given} as the file says; is that its unit?"
        raise InputError(f"{at}: {said}", line=lines[worst], value=value)
    units = [unit if distant else given] * 3 + ["deg" if turned else "rad"] * 3
    named = (
        f"; or name the columns {', '.join(f'{name} [{unit}]' for name, unit in zip(WANTED, units, strict=True))} in a first line"
    )
    if distant and turned:
        angles = float(np.abs(poses).max()) <= LARGEST_ANGLE
        what = f"six joint angles in degrees, or {length} and degrees" if angles else f"{length} and degrees"
        advice = "; joint angles: movej([d2r(...), ...]) in a .script" if angles else ""
        raise InputError(f"{at}: {_said(poses[worst])}: looks like {what}; {needed}{named}{advice}", line=lines[worst], value=value)
    if distant:
        raise InputError(
            f"{at}: {value:.4g} m from the base (limit {FURTHEST:g} m): looks like {length}; {needed}{named}",
            line=lines[worst],
            value=value,
        )
    if turned:
        raise InputError(
            f"{at}: rotation vector of length {value:.4g} (limit 2 pi): looks like degrees; {needed}{named}",
            line=lines[worst],
            value=value,
        )


def _check_vectors(values: Float[ndarray, "n k"], columns: list["_Column"], table: TextTable, where: str, lines: list[int]) -> None:
    """Nothing, when what is called rx ry rz in degrees can be a rotation vector. Raises InputError naming the line."""
    degrees = _in_degrees(table, columns)
    turn = np.linalg.norm(values[:, 3:6], axis=1)
    worst = int(turn.argmax())
    if degrees and columns[3].what == "rx" and turn[worst] > LONGEST_VECTOR:
        raise InputError(
            f"{where}: line {lines[worst]}: {degrees} make a rotation vector of {np.rad2deg(turn[worst]):.0f} deg (limit 180 deg);"
            " if they are roll, pitch and yaw, name them roll [deg], pitch [deg], yaw [deg]",
            line=lines[worst],
        )


def _in_degrees(table: TextTable, columns: list["_Column"]) -> str:
    """The names of the rotation's columns, where they are in degrees, else ""."""
    if table.names is None or columns[3].scale == 1.0:
        return ""
    return ", ".join(table.names[column.at].text for column in columns[3:])


def _said(pose: Float[ndarray, "6"]) -> str:
    return ", ".join(f"{value:g}" for value in pose)


@dataclass(frozen=True)
class _Column:
    """Attributes: what it holds (x, rx, qw, roll, say); at, its place; scale, metres or radians per unit."""

    what: str
    at: int
    scale: float = 1.0


def _columns(table: TextTable, lines: list[str], where: str) -> tuple[list[_Column], int | None]:
    """The columns of a pose, position first, and the one that names the seam, if there is one."""
    if table.names is None:
        said = UNITS[unit_of_comments(lines) or "m"]
        return [_Column(what, i, said if what in AXES else 1.0) for i, what in enumerate(WANTED)], None
    if table.doubled:
        raise InputError(f"{where}: twice as many columns as names: decimal commas need ; between the columns", path=where)
    named: dict[str, list[int]] = {}
    bare = [_bare(name) for name in table.names]
    counted_from_0 = NUMBERED.keys() <= set(bare)
    turned = any(match[1] == "w" for name in table.names if (match := ROTATION.fullmatch(_inner(name))) is not None)
    for i, name in enumerate(table.names):
        wanted = NUMBERED.get(bare[i]) if counted_from_0 else None
        if (wanted := wanted or _wanted(name, turned)) is not None:
            named.setdefault(wanted, []).append(i)
    # x may be called just so by one column, and somehow like it by others
    exact = {wanted: [i for i in at if bare[i] == wanted] for wanted, at in named.items()}
    found = {wanted: (exact[wanted] or at)[0] for wanted, at in named.items()}
    rotation = next((kind for kind in (WANTED[3:], QUATERNION, ANGLES) if all(name in found for name in kind)), WANTED[3:])
    if missing := [name for name in (*AXES, *rotation) if name not in found]:
        listed = ", ".join(name.text for name in table.names if name.text)[:120]
        joints = sum(JOINT.fullmatch(_bare(name)) is not None for name in table.names) >= len(WANTED)
        hint = "these are joint angles: movej in a .script takes them; " if joints else ""
        hint = hint or _other_rotation(set(bare))
        raise InputError(
            f"{where}: column {missing[0]} is missing among {listed}; {hint}x y z rx ry rz [m, rad] are needed, or"
            " qx qy qz qw or roll pitch yaw for the rotation",
            path=where,
        )
    for name in (*AXES, *rotation):
        if len(either := exact[name] or named[name]) > 1:
            both = " and ".join(table.names[i].text for i in either[:2])
            wanted = " ".join((*AXES, *rotation))
            raise InputError(
                f"{where}: two of its columns may be {name}: {both}; call those that are meant {wanted}, or leave the others out",
                path=where,
            )
    columns = [_Column(name, found[name], _scale(name, table, found, lines, where)) for name in (*AXES, *rotation)]
    label = next((i for i, name in enumerate(table.names) if name.text.lower() in ("seam", "naht")), None)
    return columns, label


def _other_rotation(names: set[str]) -> str:
    """What to call a rotation of other robots' makers, or a direction without one; "" for none of theirs."""
    if {"q1", "q2", "q3", "q4"} <= names:
        return "is w its q1, as ABB's is, or its q4? name them qw qx qy qz in their order; "
    if {"a", "b", "c"} <= names and "d" not in names:
        return "A B C of KUKA are yaw pitch roll about fixed axes, of milling machines not: name them so; "
    if {"w", "p", "r"} <= names:
        return "W P R of Fanuc are roll pitch yaw about fixed axes: name them so; "
    if ({"i", "j", "k"} <= names and "w" not in names) or {"nx", "ny", "nz"} <= names:
        return "a normal leaves the roll of the torch open; "
    return ""


def _scale(wanted: str, table: TextTable, found: dict[str, int], lines: list[str], where: str) -> float:
    """Metres or radians per unit of a column. Raises InputError for a unit that is neither, or leaves the pose open."""
    assert table.names is not None
    name = table.names[found[wanted]]
    kind = next(kind for kind in (AXES, WANTED[3:], QUATERNION, ANGLES) if wanted in kind)
    unit = _unit(name) or (unit_of_comments(lines[: table.first]) or "" if kind is AXES else "")
    scales = {AXES: {"": 1.0} | UNITS, QUATERNION: dict.fromkeys(BARE, 1.0)}.get(kind, TURNS)
    of_kind = {scales.get(_unit(table.names[found[each]]) or unit) for each in kind}
    if unit in scales and len(of_kind) == 1:
        return scales[unit]
    line = next((n for n, text in enumerate(lines[: table.first], 1) if name.text in text), table.first)
    if unit in scales:
        said = ", ".join(table.names[found[each]].text for each in kind)
        raise InputError(f"{where}: line {line}: {said} are not all in one unit; give each of them the same", path=where, line=line)
    needed = {AXES: "m, mm, cm, um or in", QUATERNION: "no unit"}.get(kind, "rad or deg")
    raise InputError(f"{where}: line {line}: column {name.text} is in {unit}; {needed} is needed", path=where, line=line)


def _ur_poses(values: Float[ndarray, "n k"], columns: list[_Column], where: str, lines: list[int]) -> Float[ndarray, "n 6"]:
    """Poses as UR writes them, from rotation vectors, quaternions, or roll, pitch and yaw about fixed axes [m, rad]."""
    kind, turns = columns[3].what, values[:, 3:]
    if kind == "qx":
        length = np.linalg.norm(turns, axis=1)
        worst = int(np.abs(length - 1.0).argmax())
        if abs(length[worst] - 1.0) > 0.01:
            raise InputError(
                f"{where}: line {lines[worst]}: a quaternion of length {length[worst]:.4g}, not 1", path=where, line=lines[worst]
            )
        return np.hstack([values[:, :3], rotation_vector_from_matrix(matrix_from_quaternion(turns[:, [3, 0, 1, 2]]))])
    if kind == "roll":
        worst = int(np.abs(turns).max(axis=1).argmax())
        if (angle := float(np.abs(turns[worst]).max())) > LONGEST_TURN:
            raise InputError(
                f"{where}: line {lines[worst]}: an angle of {angle:.4g} rad: looks like degrees; name them roll [deg], pitch [deg],"
                " yaw [deg]",
                path=where,
                line=lines[worst],
            )
        x, y, z = (matrix_from_rotation_vector(turns[:, i : i + 1] * np.eye(3)[i]) for i in range(3))
        return np.hstack([values[:, :3], rotation_vector_from_matrix(z @ y @ x)])
    return values


def _wanted(name: ColumnName, turned: bool) -> str | None:
    """What of a pose a column holds, or None. `turned`: whether rotation.x and so on are of a quaternion."""
    bare = _bare(name)
    if (recorded := RECORDED.fullmatch(bare)) is not None:
        return WANTED[int(recorded[1])]
    bare = _inner(name)
    if (turn := OF_QUATERNION.fullmatch(bare)) is not None:
        return f"q{turn[1]}"
    if (turn := ROTATION.fullmatch(bare)) is not None:
        return f"{'q' if turned else 'r'}{turn[1]}"
    if bare in ANGLES:
        return bare
    role = read_name(bare).role
    return role if role in AXES else None


def _inner(name: ColumnName) -> str:
    """A column's name without unit, and without the tool and the message that it is of."""
    bare = AFTER.sub("", _bare(name))
    return OF_THE_TOOL.sub("", WITHIN.sub("", bare))


def _bare(name: ColumnName) -> str:
    """A column's name without the unit in brackets, lower case."""
    return re.sub(r"[\[({<].*", "", name.text.lower()).strip()


def _unit(name: ColumnName) -> str:
    """The unit that a column's name gives, or ""."""
    if name.unit is not None:
        return name.unit
    found = AFTER.search(name.text.lower())
    return "" if found is None else found[1]


def _refuse(lines: list[str], body: list[tuple[int, str]], where: str) -> None:
    """Raises InputError: no row of six numbers."""
    if not body:
        raise InputError(f"{where}: 0 poses; a path needs two", path=where)
    rows = find_table(lines, least=3)
    if rows is not None and rows.names is not None:
        _columns(rows, lines, where)
    if rows is not None and rows.width != len(WANTED):
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
        hint = " (with a quaternion name them on the first line: x y z qx qy qz qw, w where it is)"
    elif width == 12 and table.delimiter == ",":
        hint = " (decimal commas need ; between the columns)"
    elif width > len(WANTED) and not table.names:
        hint = " (name them on the first line)"
    raise InputError(
        f"{where}: line {number}: {counted(width, 'column')}, expected {expected}: x y z rx ry rz [m, rad]{hint}",
        path=where,
        line=number,
    )
