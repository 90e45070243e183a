"""Text tables as other programs write them: their encoding, comments, separators, decimal commas and named columns.

Shared by the readers of clouds and seams. `find_table` looks at the first lines of a text and says how its rows are
written and what its columns are called; `read_name` says what a column's name means, and its unit.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

HEADER_LINES = 64  # titles, comments and column names may take this many lines before the first row
SAMPLE = 256  # rows that are looked at for decimal commas
UNITS = {
    "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0,
    "cm": 1e-2, "centimeter": 1e-2, "centimeters": 1e-2, "centimetre": 1e-2, "centimetres": 1e-2,
    "mm": 1e-3, "millimeter": 1e-3, "millimeters": 1e-3, "millimetre": 1e-3, "millimetres": 1e-3,
    "um": 1e-6, "micron": 1e-6, "microns": 1e-6, "micrometer": 1e-6, "micrometre": 1e-6,
    "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "\"": 0.0254, "zoll": 0.0254,
    "ft": 0.3048, "feet": 0.3048, "foot": 0.3048,
}  # fmt: skip
"""Metres per unit of length, by the names that headers give it."""
OTHER_UNITS = {"rad", "radian", "radians", "deg", "degree", "degrees", "\u00b0", "s", "sec", "ms", "m/s", "mm/s", "-", "1"}
"""What a line of units may hold besides."""

AXES, NORMALS, COLOURS = ("x", "y", "z"), ("nx", "ny", "nz"), ("red", "green", "blue")
_DELIMITERS = (";", "\t", ",", None)
_NUMBER = re.compile(r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf(?:inity)?)", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[-+]?(?:\d+,\d*|,\d+)(?:[eE][-+]?\d+)?")
_COMMENT = re.compile(r"\s*[\"']?(?:#|//|/\*|%|!|\*|--|REM\b|;(?!\s*[-+.\d]))", re.IGNORECASE)
_TRAILING = re.compile(r"\s*(?:#|//|%|!).*$")
_UNIT_SAID = re.compile(r"\bunits?\b(?:\s+(?:of\s+)?lengths?)?(?:\s*[:=\[(]|\s+is\b|\s+in\b)+\s*([A-Za-z]+)", re.IGNORECASE)
_UNIT_MEANT = re.compile(
    r"\b(?:coordinates?|values?|points?|positions?|lengths?|dimensions?|all)\b[\w ]*? in ([A-Za-z]+)\b", re.IGNORECASE
)
_UNIT_ALONE = re.compile(r"\W*([A-Za-z]+)\W*")
_UNIT_TITLE = re.compile(
    r"[\s\"']*(?:length[ _-]*|scale[ _-]*)?(?:units?|einheit(?:en)?)(?:\s+of\s+lengths?)?\b[\s\"']*[:=;,\t ]", re.IGNORECASE
)
_GROUPED = re.compile(
    r"(?:(?<=[;\t\"])|^)[ ]*[-+]?(?:(?P<point>\d{1,3}(?:\.\d{3})+,\d+)|(?P<comma>\d{1,3}(?:,\d{3})+\.\d+)"
    r"|(?P<blank>\d{1,3}(?:[\u00a0\u202f'\u2019]\d{3})+(?:[.,]\d+)?|\d{1,3}(?: \d{3})+[.,]\d+))[ ]*(?=[;\t\"]|$)",
    re.MULTILINE,
)
_MARKS = {"point": re.compile(r"\."), "comma": re.compile(","), "blank": re.compile("[ \u00a0\u202f'\u2019]")}
_DOUBLE = re.compile(r"(?<=[\d.])[dD](?=[-+]\d)")  # exponent of a Fortran double
_QUOTED = re.compile(r'"([^"\n]*)"')
_PLACE = "positions?|pos|points?|pts?|p|coordinates?|coords?|koordinaten?|coord|vertex|vertices|locations?|loc"
_PLACES = re.compile(
    f"{_PLACE}|cartesian|fields?|world|base|robot|global|xyz|geometry|pose|translation|cloud|value|wert|axis|achse"
)
_NORMAL = re.compile("normals?|norm|n")
_COLOUR = re.compile("rgba?|colou?rs?|diffuse")
_JOINED_AXIS = re.compile(f"(?:{_PLACE})?([xyz])(?:{_PLACE})?")
_JOINED_NORMAL = re.compile("(?:normals?|norm|n)([xyz])")
_SURVEY = {"easting": "x", "northing": "y", "elevation": "z", "altitude": "z", "height": "z"}
_TRANSLATION = {"tx": "x", "ty": "y", "tz": "z"}
_COLOUR_NAMES = {"r": "red", "g": "green", "b": "blue", "rf": "red", "gf": "green", "bf": "blue"}
_OTHERS = re.compile(
    "id|ids|index|idx|no|nr|number|num|row|name|names|element|elements|intensity|reflectance|reflectivity|amplitude|scalar|label|class|classification|time|"
    "timestamp|stamp|gpstime|ring|depth|range|distance|confidence|snr|quality|curvature|alpha|a|i|s|return|returnnumber|count"
)


@dataclass(frozen=True)
class ColumnName:
    """What a column is called: `text` as it stands in the file.

    Attributes:
        role: x, y, z, nx, ny, nz, red, green, blue, width, or "other" for names known to be none of them; None = not understood.
        unit: as the name gives it, lower case; None = it gives none.
    """

    text: str
    role: str | None
    unit: str | None


@dataclass(frozen=True)
class TextTable:
    """How the rows of a text are written.

    Attributes:
        first: index of the first row among the lines.
        delimiter: between cells; None is white space.
        decimal_comma: whether a comma is a decimal point.
        width: how many cells the first row has.
        names: of the columns, one each (but see `doubled`); None where no line names them.
    """

    first: int
    delimiter: str | None
    decimal_comma: bool
    width: int
    names: tuple[ColumnName, ...] | None

    @property
    def doubled(self) -> bool:
        """Whether rows between commas have twice as many cells as there are names: their decimal points are commas too."""
        return self.names is not None and self.delimiter == "," and self.width == 2 * len(self.names)

    def cells(self, line: str) -> list[str]:
        """The cells of a row, without comment and quotes, numbers with decimal points."""
        line = line if is_comment(line) else _TRAILING.sub("", line)
        cells = split(line, self.delimiter)
        return [_pointed(cell) for cell in cells] if self.decimal_comma else cells


def decode(data: bytes) -> str:
    """The text in `data`: UTF-8 or UTF-16, with or without its mark, else cp1252, which every byte reads as.

    Only comments, titles and names can differ by it: numbers are ASCII. Line ends become newlines.
    """
    if (order := utf_16(data)) is not None:
        text = data.decode(order, errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.removeprefix(b"\xef\xbb\xbf").decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def utf_16(data: bytes) -> str | None:
    """The codec of UTF-16 text: by its mark, or because every other one of its first bytes is zero; None of anything else."""
    if len(data) % 2:
        return None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    head = data[:256]
    for order, zeros, letters in (("utf-16-le", head[1::2], head[::2]), ("utf-16-be", head[::2], head[1::2])):
        if len(head) >= 16 and not any(zeros) and all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in letters):
            return order
    return None


def plain_numbers(text: str) -> str:
    """The text with numbers such as 1.234,567 or 1,234.567 as 1234,567 and 1234.567, and Fortran's 1.5D-03 as 1.5e-03.

    Marks between thousands are taken out only between semicolons, tabs or quotes, where a comma parts no columns, and only
    where a number has both marks, or groups parted by blanks or apostrophes, so that no other reading is left.
    """

    def plain(found: re.Match[str]) -> str:
        around = text[max(found.start() - 1, 0) : found.start()] + text[found.end() : found.end() + 1]
        return _MARKS[found.lastgroup or ""].sub("", found[0].strip(" ")) if any(mark in around for mark in ';\t"') else found[0]

    return _DOUBLE.sub("e", _GROUPED.sub(plain, text))


def unit_of_comments(lines: Sequence[str]) -> str | None:
    """The unit of length that comments or titles give, "units: mm" say; None where none does, or several do."""
    units = {unit for line in lines if (unit := _unit_of_line(line)) is not None}
    return units.pop() if len(units) == 1 else None


def _unit_of_line(line: str) -> str | None:
    """The unit of length that a comment, or a title that begins with the word unit, gives."""
    bare = _COMMENT.sub("", line, count=1) if is_comment(line) else line
    found = []
    if (title := _UNIT_TITLE.match(bare)) is not None and re.fullmatch(r"\s*in\W*", bare[title.end() - 1 :]) is None:
        found.append(_UNIT_ALONE.fullmatch(bare[title.end() :]))
    if bare is not line:
        alone = _UNIT_ALONE.fullmatch(bare)
        found += [_UNIT_SAID.search(bare), _UNIT_MEANT.search(bare), None if alone is None or alone[1] == "in" else alone]
    return next((unit for match in found if match is not None and (unit := match[1].lower()) in UNITS), None)


def is_comment(line: str) -> bool:
    """Whether a line begins like a comment of some language: # // % ! * -- REM, or ; before anything but a number."""
    return _COMMENT.match(line) is not None


def is_number(cell: str) -> bool:
    """Whether a cell is a number with a decimal point."""
    return _NUMBER.fullmatch(cell) is not None


def split(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line between delimiters, stripped of blanks and quotes, without empty ones at the end."""
    line = line.strip(" \r\n" if delimiter == "\t" else None)
    if '"' in line:
        line = _QUOTED.sub(lambda quoted: _pointed(quoted[1]).replace(delimiter or " ", "\0"), line)
    cells = [cell.strip().strip("\"'").replace("\0", delimiter or " ").strip() for cell in line.split(delimiter)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def find_table(lines: Sequence[str], *, least: int = 3) -> TextTable | None:
    """How the rows among the first lines of a text are written; None where none of the first HEADER_LINES is a row.

    Args:
        least: how many numbers make a line a row; its first cell may be a name, of a point say.
    """
    for first, line in enumerate(lines[:HEADER_LINES]):
        if not line.strip() or is_comment(line):
            continue
        delimiter, numbers = _delimiter(line)
        cells = split(_TRAILING.sub("", line), delimiter)
        row = [is_number(cell) or _is_comma_number(cell, delimiter) for cell in cells]
        if numbers < least:
            continue
        names = _names(lines[:first], delimiter, len(cells))
        if not (all(row[:least]) or all(row[1 : least + 1]) or _has_place(names, row)):
            continue
        names = None if names is None else _aligned(names, lines[first : first + SAMPLE], delimiter, len(cells))
        if names is None and _counts_columns(cells) and len(lines) > first + 1 and "." in lines[first + 1]:
            continue  # the numbers that pandas gives columns without names
        comma = delimiter != "," and _has_decimal_commas(lines[first : first + SAMPLE], delimiter)
        return TextTable(first, delimiter, comma, len(cells), names)
    return None


def read_name(cell: str) -> ColumnName:
    """What a column's name means, whatever program wrote it: `Z (m)`, `pos_y`, `"Points:0"`, `NormalX`, `x_mm`."""
    text = cell.strip().strip("\"'").strip()
    bare, unit = text, None
    if (bracketed := re.search(r"\s*[\[({<]\s*([^\])}>]*?)\s*[\])}>]\s*$", text)) is not None:
        bare, unit = text[: bracketed.start()], bracketed[1].lower() or None
    elif "/" in text:
        bare, unit = (part.strip() for part in text.lower().rsplit("/", 1))
        bare, unit = (bare, unit) if _unit(unit) in UNITS else (text, None)
    words = _words(bare)
    if unit is None and len(words) > 1 and words[-1] in UNITS:
        before = words[:-2] if words[-2] == "in" else words[:-1]
        if _role(before) in (*AXES, "width"):
            unit, words = words[-1], before
    return ColumnName(text, _role(words), None if unit is None else _unit(unit))


def by_role(names: Sequence[ColumnName]) -> dict[str, int]:
    """Which column has each role. Raises ValueError where x, y and z are not there once each, saying so in one clause."""
    found: dict[str, int] = {}
    listed = ", ".join(name.text or "(no name)" for name in names)[:120]
    for role in (*AXES, *NORMALS, *COLOURS, "width"):
        at = [i for i, name in enumerate(names) if name.role == role]
        plain = [i for i in at if names[i].text.lower() == role]
        at = plain if len(plain) == 1 else at
        if len(at) > 1 and role in AXES:
            raise ValueError(f"two of its columns may be {role}: {listed}; name one x, one y and one z")
        found |= {role: at[0]} if at else {}
    if missing := [axis for axis in AXES if axis not in found]:
        raise ValueError(f"none of its columns is {' or '.join(missing)}: {listed}; name them x, y and z, with a unit x [mm]")
    return found


# Inside -------------------------------------------------------------------------------------------------------------


def _unit(text: str) -> str:
    return text.strip().lower().replace("\u00b5", "u").replace("\u03bc", "u").rstrip(".") or "m"


def _words(text: str) -> list[str]:
    """The words of a name, lower case, parted at marks, at capitals and before digits."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return re.findall(r"[a-z\u00b5\u00e0-\u00ff]+|\d+", parted.lower())


def _role(words: list[str]) -> str | None:
    if not words:
        return "other"
    rest = [word for word in words if not _PLACES.fullmatch(word)]
    placed = len(rest) < len(words)
    normal = [word for word in rest if not _NORMAL.fullmatch(word)]
    colour = [word for word in rest if not _COLOUR.fullmatch(word)]
    one = rest[0] if len(rest) == 1 else ""
    if (axis := _JOINED_AXIS.fullmatch(one)) is not None:
        return axis[1]
    if one in _SURVEY:
        return _SURVEY[one]
    if one in _TRANSLATION:
        return _TRANSLATION[one]
    if placed and one in ("0", "1", "2"):
        return AXES[int(one)]
    if (axis := _JOINED_NORMAL.fullmatch(one)) is not None:
        return f"n{axis[1]}"
    if len(normal) == 1 and len(normal) < len(rest) and normal[0] in (*AXES, "0", "1", "2"):
        return f"n{normal[0]}" if normal[0] in AXES else NORMALS[int(normal[0])]
    if len(colour) == 1 and len(colour) < len(rest) and colour[0] in ("0", "1", "2"):
        return COLOURS[int(colour[0])]
    if len(colour) == 1 and (colour[0] in _COLOUR_NAMES or colour[0] in COLOURS):
        return _COLOUR_NAMES.get(colour[0], colour[0])
    if rest and rest[-1] in ("width", "breite"):
        return "width"
    if not rest or all(_OTHERS.fullmatch(word) or _COLOUR.fullmatch(word) or _NORMAL.fullmatch(word) for word in rest):
        return "other"
    return None


def _is_comma_number(cell: str, delimiter: str | None) -> bool:
    return delimiter != "," and _COMMA_NUMBER.fullmatch(cell) is not None


def _pointed(cell: str) -> str:
    return cell.replace(",", ".") if _COMMA_NUMBER.fullmatch(cell) else cell


def _delimiter(line: str) -> tuple[str | None, int]:
    """What parts a line into most numbers, and how many."""
    best, most = None, 0
    for delimiter in _DELIMITERS:
        cells = split(_TRAILING.sub("", line), delimiter)
        if delimiter == "\t" and "" in cells[1:]:
            continue  # columns lined up with several of them
        numbers = sum(is_number(cell) or _is_comma_number(cell, delimiter) for cell in cells)
        if numbers > most:
            best, most = delimiter, numbers
    return best, most


def _has_decimal_commas(lines: Sequence[str], delimiter: str | None) -> bool:
    """Whether numbers among the cells have commas, and none has a point."""
    cells = [cell for line in lines if not is_comment(line) for cell in split(_TRAILING.sub("", line), delimiter)]
    return any(map(_COMMA_NUMBER.fullmatch, cells)) and not any("." in cell and is_number(cell) for cell in cells)


def _counts_columns(cells: list[str]) -> bool:
    return cells == [str(i) for i in range(len(cells))]


def _names(above: Sequence[str], delimiter: str | None, width: int) -> tuple[ColumnName, ...] | None:
    """The columns' names from the lines above the first row, nearest first; None where no line there names them.

    A comment is one only where two of its names at least are understood; any other line also where it has as many cells as
    a row. A line of units may lie between.
    """
    units: list[str] | None = None
    for line in reversed(above):
        if not line.strip():
            continue
        comment = is_comment(line)
        comment = comment and not (delimiter == ";" and line.lstrip().startswith(";"))
        bare = _COMMENT.sub("", line, count=1).lstrip("#/%!*- ") if comment else line
        cells = _header_cells(bare, delimiter, width)
        if len(cells) == width and _are_units(cells):
            units = cells
            continue
        names = [read_name(cell) for cell in cells]
        known = sum(name.role not in (None, "other") for name in names)
        if known >= 2 or (not comment and len(cells) == width and not all(map(is_number, cells))):
            if units is not None and len(names) == width:
                given = [_unit(cell.strip("[]()")) if cell else None for cell in units]
                names = [ColumnName(name.text, name.role, name.unit or unit) for name, unit in zip(names, given, strict=True)]
            return tuple(names)
        if not comment and not all(map(is_number, cells)):
            return None
    return None


def _are_units(cells: list[str]) -> bool:
    """Whether cells are a line of units, a length among them."""
    found = [_unit(cell.strip("[]()")) for cell in cells if cell]
    return any(unit in UNITS for unit in found) and all(unit in UNITS or unit in OTHER_UNITS for unit in found)


def _has_place(names: tuple[ColumnName, ...] | None, row: Sequence[bool]) -> bool:
    """Whether columns are named x, y and z, and hold numbers; others may hold names of frames, say."""
    if names is None or len(names) != len(row):
        return False
    try:
        found = by_role(names)
    except ValueError:
        return False
    return all(row[found[axis]] for axis in AXES)


def _aligned(names: tuple[ColumnName, ...], rows: Sequence[str], delimiter: str | None, width: int) -> tuple[ColumnName, ...]:
    """A name for each cell of a row. Where one is missing and the first cells number or name the rows, it is theirs (R, pandas)."""
    if len(names) == width - 1:
        first = [split(_TRAILING.sub("", row), delimiter)[:1] for row in rows if row.strip() and not is_comment(row)]
        if not all(cell and is_number(cell[0]) for cell in first) or counts([float(cell[0]) for cell in first]):
            names = (ColumnName("", "other", None), *names)
    if delimiter == "," and width == 2 * len(names):
        return names
    unnamed = [ColumnName("", "other", None)] * (width - len(names))
    return (*names, *unnamed)[:width]


def counts(values: Sequence[float]) -> bool:
    """Whether values number their rows, from 0 or 1."""
    return len(values) > 2 and values[0] in (0, 1) and all(b - a == 1 for a, b in pairwise(values))


def _header_cells(line: str, delimiter: str | None, width: int) -> list[str]:
    """The cells of a line of names: between the rows' delimiters, or others where only those give a row's number of cells."""
    if line.startswith((",", ";", "\t")):  # the index of pandas has no name
        line = '""' + line
    tries = [_worded(line) if mark is None else split(line, mark) for mark in (delimiter, *_DELIMITERS)]
    return next((cells for cells in tries if len(cells) == width), max(tries, key=_understood))


def _understood(cells: list[str]) -> int:
    return sum(read_name(cell).role not in (None, "other") for cell in cells)


def _worded(line: str) -> list[str]:
    """The words of a line, a unit in brackets kept with the word before it."""
    return [cell.strip("\"'") for cell in re.findall(r'"[^"]*"|[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?|[\[(][^\])]*[\])]', line)]
