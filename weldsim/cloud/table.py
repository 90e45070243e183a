"""Numbers in text: tables of known width, and XYZ/TXT/CSV/PTS clouds whose layout has to be found."""

import io
import re
import warnings

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import NORMALS, XYZ, RawCloud, Unreadable, check_count, from_columns, unit_colours

_HEADER_LINES = 64  # titles, comments and column names may take this many lines before the first point
_COMMENT_LINE = re.compile(rb"^[ \t]*(?://|%)[^\n]*", re.MULTILINE)


def parse_table(
    text: bytes, *, columns: int, rows: int | None = None, delimiter: str | None = None
) -> Float[ndarray, "rows columns"]:
    """The first `columns` numbers of each line.

    Args:
        text: lines of numbers; blank lines and what follows a # are passed over.
        columns: how many each line must have at least.
        rows: read exactly so many lines; None reads all.
        delimiter: between the numbers; None is white space.
    Raises:
        Unreadable: a line that is short or holds something else than numbers, or too few lines.
    """
    if not text.strip():
        raise Unreadable("its header promises points, none follow")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # numpy warns on input without data
            table = np.loadtxt(
                io.BytesIO(text), ndmin=2, delimiter=delimiter, usecols=range(columns), max_rows=rows, encoding="latin1"
            )
    except (ValueError, UserWarning, OverflowError) as error:
        raise Unreadable(f"its numbers cannot be read: {str(error).rstrip('.')[:120]}") from None
    if rows is not None and len(table) < rows:
        raise Unreadable(f"its header promises {rows} points, the file holds {len(table)}: cut off?")
    return table


def read_text(data: bytes) -> RawCloud:
    """The points of a text file: x y z first on each line, or under a line of names that says where.

    White space, comma or semicolon between; decimal commas where semicolons separate. Six unnamed columns are colours when
    the last three are whole numbers up to 255, normals when they are unit vectors; further columns are passed over.

    Raises:
        Unreadable: no line of three numbers at the beginning, or a later line that is none.
    """
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\0" in data[:65_536]:
        raise Unreadable("it is binary, and no PLY, PCD, NPZ or NPY")
    if b"\r" in data and b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    if _COMMENT_LINE.search(data):
        data = _COMMENT_LINE.sub(lambda match: b"#" + match[0].lstrip()[1:], data)
    start, first, header = _first_row(data)
    body = data[start:]
    if ";" in first and "," in first and "." not in first:
        body, first = body.replace(b",", b"."), first.replace(",", ".")
    delimiter, width = max(((mark, _leading_numbers(first.split(mark))) for mark in (None, ";", ",")), key=lambda pair: pair[1])
    if width < 3:
        raise Unreadable(f"it is no cloud: its numbers are separated in more than one way: {first[:40]!r}")
    table = parse_table(body, columns=width, delimiter=delimiter)
    check_count(len(table))
    if len(header) >= width and all(name in header[:width] for name in XYZ[0]):
        return from_columns({name: table[:, i] for i, name in reversed(list(enumerate(header[:width])))})
    return _unnamed(table)


def _first_row(data: bytes) -> tuple[int, str, list[str]]:
    """Where the first line with three numbers starts, that line, and the column names above it (or none)."""
    start, header = 0, []
    for _ in range(_HEADER_LINES):
        end = data.find(b"\n", start)
        line = data[start : end if end >= 0 else len(data)][:4096].decode("latin1").split("#")
        words = re.split(r"[;,\s]+", line[0].strip()) if line[0].strip() else []
        if _leading_numbers(words) >= 3:
            return start, line[0].strip(), header
        named = [word.strip("\"'").lower() for word in re.split(r"[;,\s/]+", " ".join(line)) if word]
        header = named if named else header
        if end < 0:
            break
        start = end + 1
    raise Unreadable(f"it is no cloud: none of its first {_HEADER_LINES} lines starts with three numbers")


def _leading_numbers(words: list[str]) -> int:
    """How many of the first words are numbers."""
    for count, word in enumerate(words):
        try:
            float(word)
        except ValueError:
            return count
    return len(words)


def _unnamed(table: Float[ndarray, "n k"]) -> RawCloud:
    points, rest = table[:, :3], table[:, 3:6]
    if table.shape[1] != 6 or not np.isfinite(rest).all():
        return RawCloud(points=points)
    if (rest == np.round(rest)).all() and rest.min() >= 0 and 1 < rest.max() <= 255:
        return RawCloud(points=points, colours=unit_colours(rest, whole=True))
    if np.mean(np.abs(np.linalg.norm(rest, axis=1) - 1.0) < 0.02) > 0.9:
        return from_columns(dict(zip((*XYZ[0], *NORMALS[0]), table.T, strict=True)))
    return RawCloud(points=points)
