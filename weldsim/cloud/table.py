"""Numbers in text: tables of known width, and XYZ/TXT/CSV/PTS clouds whose layout has to be found."""

import io
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import COLOURS, METRES, NORMALS, XYZ, RawCloud, Unreadable, check_count, from_columns, unit_colours
from weldsim.columns import (
    HEADER_LINES,
    SAMPLE,
    UNITS,
    TextTable,
    by_role,
    counts,
    decode,
    find_table,
    is_number,
    plain_numbers,
    unit_of_comments,
)
from weldsim.counted import counted

_DOUBLE = re.compile(rb"(?<=[0-9.])[dD](?=[-+][0-9])")  # exponent of a Fortran double
_HEAD = 1 << 20  # bytes in which the first row is looked for
_SAMPLE = 1 << 17  # bytes in which marks between thousands are looked for
_DIGITS = b"0123456789+-.eE,; \t\r\n"
_NO_NUMBER = re.compile(
    rb"[-+]?(?:1\.#(?:QNAN|SNAN|IND|INF)\d*|nan\(\w*\)|(?<![^\s,;])(?:#?n/?a|null|none)(?![^\s,;]))", re.IGNORECASE
)
_EMPTY = re.compile(rb"(?:(?<=[,;\t])|^)[ ]*(?=[,;\t])|(?<=[,;\t])[ ]*$", re.MULTILINE)
_BRACKETED = re.compile(rb"(?:[^\n]*\n)?\s*[\[({|]*\s*[-+.\d][^\n]*[\])}|]")
_BETWEEN = re.compile(rb"[\])}][ \t]*,?\s*[\[({]")
_BRACKETS = bytes.maketrans(b"[](){}|", b" " * 7)
TAKEN = tuple(METRES)  # units that read_cloud knows by these names


def parse_table(
    text: bytes, *, columns: int | Sequence[int], rows: int | None = None, delimiter: str | None = None
) -> Float[ndarray, "rows columns"]:
    """The first `columns` numbers of each line, or those in the columns listed.

    Args:
        text: lines of numbers; blank lines and what follows a # are passed over.
        columns: how many each line must have at least, or which are read, counted from 0.
        rows: read exactly so many lines; None reads all.
        delimiter: between the numbers; None is white space, and commas are decimal ones.
    Raises:
        Unreadable: a line that is short or holds something else than numbers, or too few lines.
    """
    if not text.strip():
        raise Unreadable("its header promises points, none follow")
    text = plain_cells(text)
    if delimiter is None and b"," in text:  # decimal ones: white space parts
        text = text.replace(b",", b".")
    used = range(columns) if isinstance(columns, int) else columns
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # numpy warns on input without data
            table = np.loadtxt(io.BytesIO(text), ndmin=2, delimiter=delimiter, usecols=used, max_rows=rows, encoding="latin1")
    except (ValueError, UserWarning, OverflowError) as error:
        raise Unreadable(f"its numbers cannot be read: {str(error).rstrip('.')[:120]}") from None
    if rows is not None and len(table) < rows:
        raise Unreadable(f"its header promises {counted(rows, 'point')}, the file holds {len(table)}: cut off?")
    return table


def plain_cells(data: bytes) -> bytes:
    """The text with `nan` in place of other spellings of no number: Visual C++'s `-nan(ind)` and `1.#QNAN`, NA, null, none;
    and with e for the D of Fortran's exponents."""
    letters = data.translate(None, _DIGITS)  # almost nothing: far quicker than to look through all of it
    if b"D" in letters or b"d" in letters:
        data = _DOUBLE.sub(b"e", data)
    return _NO_NUMBER.sub(b"nan", data) if re.search(rb"nan\(|#|n/?a|null|non", letters, re.IGNORECASE) else data


def read_text(data: bytes) -> RawCloud:
    """The points of a text file: x y z first on each line, or in the columns that a line above the first names so.

    White space, comma or semicolon between, brackets around or not; decimal commas where a comma is not what separates. A
    cell that is empty, or says that it is no number, is none. Names are believed, and their units. Six unnamed columns are
    colours when the last three are whole numbers up to 255, normals when they are unit vectors; further columns are passed
    over, and a name of each point before them.

    Raises:
        Unreadable: no line of three numbers at the beginning, names without x, y and z, or a later line that is no row.
    """
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\0" in data[:65_536]:
        raise Unreadable("it is binary, and no PLY, PCD, NPZ or NPY")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    data = _ungrouped(plain_cells(data))
    lines = _head(data)
    table = find_table(lines)
    if table is None and _BRACKETED.match(data) is not None:  # as Python prints lists, or between bars
        data = _BETWEEN.sub(b"\n", data).translate(_BRACKETS)
        lines = _head(data)
        table = find_table(lines)
    if table is None:
        raise Unreadable(f"it is no cloud: none of its first {HEADER_LINES} lines starts with three numbers")
    columns, units = _columns(table, lines[table.first : table.first + SAMPLE])
    points = _read(data, table, list(columns.values()))
    check_count(len(points))
    said = unit_of_comments(lines[: table.first])
    said = next((name for name in TAKEN if said is not None and UNITS[name] == UNITS[said]), None)
    if table.names is None:
        _check_grid(points, table, lines[table.first : table.first + SAMPLE])
        return replace(_unnamed(points, table.width), unit=said)
    named = dict(zip(columns, points.T, strict=True))
    scales = [UNITS[unit] for unit in units.values()]
    same = len(set(scales)) == 1 and next((name for name in TAKEN if UNITS[name] == scales[0]), None)
    if units and not same:  # each its own, or one that nobody can ask for: metres then
        for axis in XYZ[0]:
            named[axis] = named[axis] * UNITS[units.get(axis, "m")]
    return from_columns(named, unit=same or ("m" if units else said))


def _ungrouped(data: bytes) -> bytes:
    """The text without marks between thousands, where its first rows have some."""
    head = data[:_SAMPLE]
    if not any(mark in head for mark in (b";", b"\t", b'"')) or plain_numbers(decode(head)) == decode(head):
        return data
    return plain_numbers(decode(data)).encode()


def _head(data: bytes) -> list[str]:
    """The first lines, whole ones alone."""
    head = data[:_HEAD]
    return decode(head if len(data) <= _HEAD else head[: head.rfind(b"\n") + 1]).split("\n")


def _columns(table: TextTable, rows: Sequence[str]) -> tuple[dict[str, int], dict[str, str]]:
    """Which columns are read, by what they hold (or by their number where nothing names them), and the axes' units."""
    if table.names is None:
        cells = table.cells(rows[0])
        start = 0 if is_number(cells[0]) else 1
        numbers = next((i for i, cell in enumerate(cells[start:]) if not is_number(cell)), len(cells) - start)
        _check_decimals(table, rows)
        return {str(i): start + i for i in range(6 if numbers == 6 else 3)}, {}
    if table.doubled:
        raise Unreadable("its rows have twice as many columns as there are names: with decimal commas put ; between the columns")
    try:
        found = by_role(table.names)
    except ValueError as error:
        raise Unreadable(str(error)) from None
    units = {axis: unit for axis in XYZ[0] if (unit := table.names[found[axis]].unit) is not None}
    for axis, unit in units.items():
        if unit not in UNITS:
            text = table.names[found[axis]].text
            raise Unreadable(f"its column {text[:40]!r} is in {unit[:20]}; lengths are in m, cm, mm or in")
    if len(units) in (1, 2) and len(set(units.values())) == 1:  # written once, meant for all
        units = dict.fromkeys(XYZ[0], next(iter(units.values())))
    together = [names for names in (*NORMALS[:1], *COLOURS[:1]) if all(name in found for name in names)]
    wanted = [*XYZ[0], *(name for names in together for name in names)]
    return {name: found[name] for name in wanted}, units


def _check_decimals(table: TextTable, rows: Sequence[str]) -> None:
    """Raises Unreadable where six columns between commas are three numbers with decimal commas: 0,012 is no two whole numbers."""
    if table.delimiter != "," or table.width != 6:
        return
    cells = [row for row in map(table.cells, rows) if len(row) == 6]
    whole = all(re.fullmatch(r"[-+]?\d+", cell) for row in cells for cell in row)
    if whole and any(re.fullmatch(r"0\d+", cell) for row in cells for cell in row[1::2]):
        raise Unreadable("its numbers seem to have decimal commas, and commas between them: put ; between them")


def _check_grid(points: Float[ndarray, "n k"], table: TextTable, rows: Sequence[str]) -> None:
    """Raises Unreadable where one or two whole numbers stand before three others: a label or an intensity, or row and column
    of a scan, and then x y z."""
    cells = [row for row in map(table.cells, rows) if len(row) == table.width and all(map(is_number, row))]
    if not cells or len(points) < 100:
        return
    broken = [any("." in row[i] for row in cells) for i in range(min(table.width, 5))]
    for count, what in ((1, "column is"), (2, "two columns are")):
        whole = not any(broken[:count]) and bool((points[:, :count] == np.round(points[:, :count])).all())
        if count == 1 and counts(points[:, 0].tolist()):
            continue  # told by itself
        if whole and len(broken) >= count + 3 and all(broken[count : count + 3]):
            named, meant = ("row column", "row and column of a scan") if count == 2 else ("label", "a label or an intensity")
            raise Unreadable(
                f"its first {what} whole numbers and three others follow, {meant} perhaps: name the columns in a first line"
                f" ({named} x y z, say)"
            )


def _read(data: bytes, table: TextTable, columns: list[int]) -> Float[ndarray, "n k"]:
    """The numbers in those columns of every row. Raises Unreadable, naming the first line that is none."""
    start = 0
    for _ in range(table.first):
        start = data.find(b"\n", start) + 1
    body = re.sub(_COMMENTS if table.delimiter != ";" else _COMMENTS_BUT_SEMICOLONS, b"#", data[start:])
    if b'"' in body:
        body = re.sub(rb'"([^"\n]*)"', lambda quoted: quoted[1].replace(b",", b"."), body)
    if table.delimiter is not None and (table.delimiter * 2).encode() in body.replace(b" ", b""):
        body = _EMPTY.sub(b"nan", body)
    if table.delimiter != "," and b"," in body and (table.decimal_comma or not re.search(rb"\d\.\d", body)):
        body = body.replace(b",", b".")
    try:
        return parse_table(body, columns=columns, delimiter=table.delimiter)
    except Unreadable:
        for number, line in enumerate(body.split(b"\n"), table.first + 1):
            text = line.decode("latin1").partition("#")[0]
            cells = [cell.strip() for cell in text.split(table.delimiter)]
            if text.strip() and not all(i < len(cells) and is_number(cells[i]) for i in columns):
                shown = text.strip()[:40]
                raise Unreadable(f"its numbers cannot be read: line {number}: {shown!r}, not like the rows before") from None
        raise


_COMMENTS_BUT_SEMICOLONS = re.compile(rb"^[ \t]*(?://|/\*|%|!|\*|--|REM\b)", re.MULTILINE | re.IGNORECASE)
_COMMENTS = re.compile(rb"^[ \t]*(?:;|//|/\*|%|!|\*|--|REM\b)", re.MULTILINE | re.IGNORECASE)


def _unnamed(table: Float[ndarray, "n k"], width: int) -> RawCloud:
    points, rest = table[:, :3], table[:, 3:6]
    numbered = width > 3 and len(table) >= 100 and counts(points[:, 0].tolist())
    if table.shape[1] != 6 or not np.isfinite(rest).all():
        return RawCloud(points=points, numbered=numbered)
    if (rest == np.round(rest)).all() and rest.min() >= 0 and 1 < rest.max() <= 255:
        return RawCloud(points=points, colours=unit_colours(rest, whole=True), numbered=numbered)
    if np.mean(np.abs(np.linalg.norm(rest, axis=1) - 1.0) < 0.02) > 0.9:
        return from_columns(dict(zip((*XYZ[0], *NORMALS[0]), table.T, strict=True)))
    return RawCloud(points=points, numbered=numbered)
