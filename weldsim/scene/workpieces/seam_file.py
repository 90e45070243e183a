"""The seam of one's own part: a text file of points on the groove's opening, in order."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.columns import (
    AXES,
    NORMALS,
    UNITS,
    ColumnName,
    TextTable,
    by_role,
    counts,
    decode,
    find_table,
    is_comment,
    is_number,
    plain_numbers,
    unit_of_comments,
)
from weldsim.counted import counted
from weldsim.errors import SceneError

COLUMNS = (*AXES, *NORMALS, "width")
UNNAMED = {3: AXES, 4: (*AXES, "width"), 6: COLUMNS[:6], 7: COLUMNS}
MOST = 100_000  # lines
_BRACKETED = re.compile(r"^\s*[\[({]+([-+.\d\s,;eE]+)[\])}]+\s*[,;]?\s*$")  # a point as Python and others print it
UNIT_LENGTH = 0.25  # by which normals without names may be off 1: rotation vectors look like them
LABELS = ("seam", "line", "curve", "weld", "segment", "part", "polyline", "path", "seam_id", "line_id", "group")
POINT_NAMES = ("name", "names", "element", "elements", "label", "id", "nr", "no", "number", "index")  # of points, or of lines
WANTED = "wanted are x, y, z, and perhaps nx, ny, nz and width"


@dataclass(frozen=True, eq=False, kw_only=True)
class SeamFile:
    """What a seam file says.

    Attributes:
        points: (n, 3) of the opening, in order [m].
        normals: (n, 3) out of the surface, not of unit length perhaps; None where not given.
        width: (n,) between the lips [m]; None where not given.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"] | None
    width: Float[ndarray, "n"] | None


def read_seam_file(path: Path, scale: float) -> SeamFile:
    """The seam in a CSV file: x, y, z on each line, optionally nx, ny, nz (the surface's outward normal) and width.

    Columns may be named on the first line, then in any order; without names they are x y z, x y z width, x y z nx ny nz, or
    x y z nx ny nz width. Semicolons, tabs, commas or white space part them; a comma is a decimal one where it is not what
    parts. A unit after a name (`x [mm]`) outranks `scale`. Comments are passed over, whatever they begin with.

    Args:
        path: of the file.  scale: metres per unit of its lengths.
    Raises:
        SceneError: a file that is missing, no text, or malformed (with the line), or fewer than two different points.
    """
    lines = _lines(path)
    table = find_table(lines, least=1)
    if table is None:
        _refuse_names(path, lines)
        raise SceneError(f"{path}: no points; a seam needs two, x, y, z on each line", path=str(path))
    unit = unit_of_comments(lines[: table.first])
    column, scales = _columns(path, table, scale if unit is None else UNITS[unit])
    rows = [_row(path, number, line, table, column) for number, line in enumerate(lines[table.first :], table.first + 1)]
    numbers = np.array([row for row in rows if row is not None])
    points = np.stack([numbers[:, i] * scales[name] for i, name in enumerate(column) if name in AXES], axis=1)
    _refuse_commas(path, table, numbers, column)
    _refuse_lines(path, table, lines)
    count = len(points)
    moved = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 0])
    numbers, points = numbers[moved], points[moved]
    if len(points) < 2:
        which = "one point" if count == 1 else "its points are all the same"
        raise SceneError(f"{path}: {which}; a seam needs two", path=str(path))
    if table.names is None and table.width > len(AXES) and counts(numbers[:, 0].tolist()):
        raise SceneError(
            f"{path}, line {table.first + 1}: what would be x counts the rows; name the columns in a first line: id,x,y,z say",
            path=str(path),
        )
    values = {name: numbers[:, i] for i, name in enumerate(column)}
    normals = np.stack([values[name] for name in NORMALS], axis=1) if "nx" in values else None
    if normals is not None and not (np.linalg.norm(normals, axis=1) > 1e-6).all():
        raise SceneError(f"{path}: a normal is zero", path=str(path), key="nx")
    width = values["width"] * scales["width"] if "width" in values else None
    if width is not None and not (width > 0).all():
        raise SceneError(f"{path}: a width is not positive", path=str(path), key="width")
    if normals is not None and table.names is None and len(column) == 6:
        length = np.linalg.norm(normals, axis=1)
        if (worst := float(length[np.abs(length - 1.0).argmax()])) and abs(worst - 1.0) > UNIT_LENGTH:
            raise SceneError(
                f"{path}: the last three columns are no unit normals (length {worst:.3g}), rotation vectors perhaps: leave them"
                " out, or name the columns x,y,z,nx,ny,nz in a first line where they are normals",
                path=str(path),
                key="nx",
            )
    return SeamFile(points=points, normals=normals, width=width)


def _lines(path: Path) -> list[str]:
    """The file's lines. Raises SceneError."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"mesh.seam {path}: no such file", path=str(path), key="seam") from None
    except OSError as error:
        raise SceneError(f"mesh.seam {path}: cannot be read ({error.strerror})", path=str(path), key="seam") from None
    text = decode(data)
    if "\0" in text:
        raise SceneError(f"mesh.seam {path}: is no text", path=str(path), key="seam")
    lines = [_BRACKETED.sub(r"\1", line) for line in plain_numbers(text).split("\n")]
    if len(lines) > MOST:
        raise SceneError(f"mesh.seam {path}: {len(lines)} lines; at most {MOST} are read", path=str(path), limit=MOST)
    return lines


def _columns(path: Path, table: TextTable, scale: float) -> tuple[dict[str, int], dict[str, float]]:
    """Where each column stands, axes first and in order, and the metres per unit of those that are lengths."""
    if table.names is None:
        if table.width not in UNNAMED:
            raise SceneError(
                f"{path}, line {table.first + 1}: {counted(table.width, 'column')}; wanted are 3 (x y z), 4 (and width),"
                " 6 (x y z nx ny nz) or 7",
                path=str(path),
                allowed=tuple(UNNAMED),
            )
        return {name: i for i, name in enumerate(UNNAMED[table.width])}, dict.fromkeys(COLUMNS, scale)
    if table.doubled:
        raise SceneError(f"{path}: twice as many columns as names: with decimal commas put ; between the columns", path=str(path))
    found = _named(path, table.names)
    scales = {name: _scale(path, table.names[at], scale) for name, at in found.items() if name not in NORMALS}
    return found, scales


def _named(path: Path, names: tuple[ColumnName, ...]) -> dict[str, int]:
    listed = ", ".join(name.text for name in names)[:60]
    names = _with_direction(names)
    try:
        found = by_role(names)
    except ValueError:
        found = {}
    if found and (label := next((one.text for one in names if one.role is None and one.text.strip().lower() in LABELS), "")):
        raise SceneError(
            f"{path}: column {label!r} tells lines apart; a part has one seam: keep the rows of one, and its x, y, z",
            path=str(path),
            allowed=COLUMNS,
        )
    roles = [name.role for name in names if name.role not in ("other", "red", "green", "blue")]
    if not found or None in roles or len(set(roles)) < len(roles) or len(set(NORMALS) & set(roles)) not in (0, 3):
        raise SceneError(f"{path}: columns {listed!r}; {WANTED}", path=str(path), allowed=COLUMNS)
    return {name: found[name] for name in COLUMNS if name in found}


def _with_direction(names: tuple[ColumnName, ...]) -> tuple[ColumnName, ...]:
    """The names with i, j and k, as measuring machines call a direction, for normals, where no others are and no quaternion."""
    texts = [name.text.strip().lower() for name in names]
    if {"i", "j", "k"} <= set(texts) and not {"w", "s"} & set(texts) and not any(name.role in NORMALS for name in names):
        roles = dict(zip("ijk", NORMALS, strict=True))
        return tuple(replace(name, role=roles.get(text, name.role)) for name, text in zip(names, texts, strict=True))
    return names


def _scale(path: Path, name: ColumnName, scale: float) -> float:
    """Metres per unit of a column. Raises SceneError for a unit that is no length."""
    if name.unit is None:
        return scale
    if name.unit not in UNITS:
        raise SceneError(
            f"{path}: column {name.text[:40]!r} is in {name.unit[:20]}; lengths are in m, cm, mm or in", path=str(path)
        )
    return UNITS[name.unit]


def _row(path: Path, number: int, line: str, table: TextTable, column: dict[str, int]) -> list[float] | None:
    """The numbers of a line in the order of `column`; None for a blank line or a comment."""
    if not line.strip() or is_comment(line) or not (cells := table.cells(line)):
        return None
    if len(cells) != table.width:
        raise SceneError(
            f"{path}, line {number}: {counted(len(cells), 'column')}, {table.width} before", path=str(path), line=number
        )
    wanted = [cells[at] for at in column.values()]
    if not all(map(is_number, wanted)):
        raise SceneError(f"{path}, line {number}: {' '.join(cells)[:60]!r} are no numbers", path=str(path), line=number)
    row = [float(cell) for cell in wanted]
    if not np.isfinite(row).all():
        raise SceneError(f"{path}, line {number}: a number that is not finite", path=str(path), line=number)
    return row


def _refuse_names(path: Path, lines: list[str]) -> None:
    """Raises SceneError where a line of names stands above no rows that could be read."""
    left = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not is_comment(line)]
    if len(left) > 1:
        number, line = left[1]
        raise SceneError(f"{path}, line {number}: {line.strip()[:60]!r} are no numbers; {WANTED}", path=str(path), line=number)


def _refuse_lines(path: Path, table: TextTable, lines: list[str]) -> None:
    """Raises SceneError where a column of names has some of them again: it tells lines apart, not points."""
    at = next((i for i, name in enumerate(table.names or ()) if name.text.strip().lower() in POINT_NAMES), None)
    if at is None or table.names is None:
        return
    rows = [table.cells(line) for line in lines[table.first :] if line.strip() and not is_comment(line)]
    called = [row[at] for row in rows if len(row) > at]
    if 1 < len(set(called)) < len(called):
        again = next(name for i, name in enumerate(called) if name in called[:i])
        raise SceneError(
            f"{path}: column {table.names[at].text!r} has {again[:30]!r} more than once: does it tell lines apart? a part has one"
            " seam: keep the rows of one, and its x, y, z",
            path=str(path),
        )


def _refuse_commas(path: Path, table: TextTable, numbers: Float[ndarray, "n k"], column: dict[str, int]) -> None:
    """Raises SceneError where six whole numbers between commas are x, y, z with decimal commas rather than a point and a normal."""
    if table.names is not None or table.delimiter != "," or len(column) != 6 or (numbers != np.round(numbers)).any():
        return
    length = np.linalg.norm(numbers[:, 3:], axis=1)
    if (numbers[:, 1::2] >= 0).all() and (length > 1.01).any():
        raise SceneError(
            f"{path}, line {table.first + 1}: six whole numbers, of which the last three are no unit normal: with decimal commas"
            " put ; between the columns",
            path=str(path),
            line=table.first + 1,
        )
