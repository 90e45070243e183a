"""PLY clouds, ASCII or binary of either byte order: the vertices; faces and other elements are passed over.

Own reader because the counts of a header must be checked against the file before anything is allocated.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import RawCloud, Unreadable, check_count, from_columns
from weldsim.cloud.sensor_frame import rotation_of_matrix
from weldsim.cloud.table import TAKEN, parse_table
from weldsim.columns import UNITS, unit_of_comments
from weldsim.counted import counted

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_MAX_HEADER = 65_536
_COUNT, _LONGEST = "number of ", 4096  # name of a list's count, and items of a list that belongs to a vertex
_VERTICES = ("vertex", "vertices", "point", "points")
_VIEW = ("view_px", "view_py", "view_pz")
_ROWS = tuple(tuple(f"{row}_axis{axis}" for axis in "xyz") for row in "xyz")  # of PCL's rotation matrix, whatever their names say


@dataclass
class _Element:
    """One element of the header: its properties as (name, type) or, for lists, (name, count type, item type)."""

    name: str
    count: int
    properties: list[tuple[str, ...]] = field(default_factory=list)

    @property
    def has_list(self) -> bool:
        return any(len(entry) == 3 for entry in self.properties)

    def least_size(self, ascii_: bool) -> int:
        """The fewest bytes one row can take."""
        return sum(2 if ascii_ else np.dtype(entry[1]).itemsize for entry in self.properties)


def read_ply(data: bytes) -> RawCloud:
    """The vertices of the PLY file `data`. Raises Unreadable."""
    order, elements, viewpoints, unit, start = _header(data)
    left = len(data) - start
    for element in elements:
        promised = element.count * element.least_size(order == "ascii")
        if element.count < 0 or promised > left + 1:  # the last line of text may lack its newline
            raise Unreadable(
                f"its header promises {element.count} x {element.name}, at least {promised} bytes, but {left} follow: cut off?"
            )
    names = [element.name for element in elements]
    name = next((name for name in _VERTICES if name in names), None)
    if name is None:
        raise Unreadable(f"its header has no vertex element ({', '.join(names) or 'none at all'})")
    at = names.index(name)
    before, vertex = elements[:at], elements[at]
    check_count(vertex.count)
    labels = [entry[0] for entry in vertex.properties]
    if len(set(labels)) != len(labels):
        raise Unreadable("two of its vertex properties have the same name")
    if order == "ascii" and b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    read = _ascii_columns if order == "ascii" else _binary_columns
    columns = read(data, start, before, vertex, order)
    R = None
    if viewpoints is None and elements[at + 1 :] and elements[at + 1].name == "camera" and not elements[at + 1].has_list:
        viewpoints, R = _camera(read(data, start, [*before, vertex], elements[at + 1], order))
    cloud = from_columns(columns, viewpoints=viewpoints, rotation=R, unit=unit)
    view = columns.get("view")
    if viewpoints is None or len(viewpoints) < 2 or view is None or view.dtype.kind not in "iu":
        return cloud
    return replace(cloud, view=view.astype(int))


def _camera(columns: dict[str, ndarray]) -> tuple[Float[ndarray, "1 3"] | None, Float[ndarray, "3 3"] | None]:
    """Position and rotation of the camera, as PCL writes them after the points; its default, the identity, says nothing."""
    if not all(name in columns and len(columns[name]) == 1 for name in _VIEW):
        return None, None
    place = np.array([[float(columns[name][0]) for name in _VIEW]])
    if not np.isfinite(place).all():
        return None, None
    rows = np.array([[float(columns[name][0]) if name in columns else np.nan for name in names] for names in _ROWS])
    R = rotation_of_matrix(rows)
    return (None, None) if R is None and not place.any() else (place, R)


def _header(data: bytes) -> tuple[str, list[_Element], Float[ndarray, "k 3"] | None, str | None, int]:
    """Byte order ("ascii", "<" or ">"), elements, viewpoints and unit from comments, and where the body starts."""
    end = data.find(b"end_header", 0, _MAX_HEADER)
    newline = min((i for i in (data.find(b"\n", end), data.find(b"\r", end)) if i >= 0), default=-1)
    if end < 0 or newline < 0:
        raise Unreadable("its PLY header does not end")
    start = newline + (2 if data[newline : newline + 2] == b"\r\n" else 1)
    order, elements, viewpoints = "", [], None
    lines = data[:end].decode("latin1").splitlines()[1:]
    unit = unit_of_comments([f"# {line.partition(' ')[2]}" for line in lines if line.startswith(("comment ", "obj_info "))])
    for line in lines:
        match line.split():
            case ["format", "ascii", _]:
                order = "ascii"
            case ["format", "binary_little_endian", _]:
                order = "<"
            case ["format", "binary_big_endian", _]:
                order = ">"
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 18:
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, item, name] if elements and count in _TYPES and item in _TYPES:
                elements[-1].properties.append((name.lower(), _TYPES[count], _TYPES[item]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append((name.lower(), _TYPES[kind]))
            case ["comment", "viewpoint", *numbers] if len(numbers) == 3:
                place = _viewpoint(numbers)
                viewpoints = place if viewpoints is None or place is None else np.concatenate([viewpoints, place])
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise Unreadable(f"its PLY header has the line {line[:60]!r}")
    if not order:
        raise Unreadable("its PLY header names no format")
    return order, elements, viewpoints, next((name for name in TAKEN if unit and UNITS[name] == UNITS[unit]), None), start


def _viewpoint(numbers: list[str]) -> Float[ndarray, "1 3"] | None:
    try:
        return np.array([[float(number) for number in numbers]])
    except ValueError:
        return None


def _ascii_columns(data: bytes, start: int, before: list[_Element], vertex: _Element, _: str) -> dict[str, ndarray]:
    for element in before:
        for _row in range(element.count):
            start = data.find(b"\n", start) + 1
            if start == 0:
                raise Unreadable(f"it ends within its {element.name} elements")
    fixed = vertex.properties[: next((i for i, entry in enumerate(vertex.properties) if len(entry) == 3), None)]
    if len(fixed) < len(vertex.properties) and not {"x", "y", "z"} <= {entry[0] for entry in fixed}:
        return _ascii_with_lists(data, start, vertex)
    table = parse_table(data[start:], columns=len(fixed), rows=vertex.count)
    return {entry[0]: _typed(table[:, i], entry[1]) for i, entry in enumerate(fixed)}


def _ascii_with_lists(data: bytes, start: int, vertex: _Element) -> dict[str, ndarray]:
    """Columns of vertices that hold lists before other properties: word by word. Raises Unreadable."""
    lines = [line for line in data[start:].split(b"\n") if line.strip()][: vertex.count]
    kept = [entry for entry in vertex.properties if len(entry) == 2]
    rows = []
    for number, line in enumerate(lines, 1):
        words, at, row = line.split(), 0, []
        try:
            for entry in vertex.properties:
                if len(entry) == 3:
                    at += max(0, int(words[at]))
                else:
                    row.append(float(words[at]))
                at += 1
        except (ValueError, IndexError, OverflowError):
            raise Unreadable(f"its vertex {number} cannot be read: {line[:40].decode('latin1')!r}") from None
        rows.append(row)
    if len(rows) < vertex.count:
        raise Unreadable(f"its header promises {counted(vertex.count, 'point')}, the file holds {len(rows)}: cut off?")
    table = np.array(rows, float).reshape(len(rows), len(kept))
    return {entry[0]: _typed(table[:, i], entry[1]) for i, entry in enumerate(kept)}


def _typed(column: ndarray, kind: str) -> ndarray:
    """Whole numbers as integers, so that a colour of 0 to 255 is told from one of 0 to 1."""
    if kind[0] == "f" or not np.isfinite(column).all():
        return column
    return np.clip(column, -(2**31), 2**32).astype(np.int64)


def _binary_columns(data: bytes, start: int, before: list[_Element], vertex: _Element, order: str) -> dict[str, ndarray]:
    for element in before:
        start = _skip(data, start, element, order)
    row = _row(data, start, vertex, order)
    if vertex.has_list and not _are_alike(data, start, vertex.count, row):
        return _binary_with_lists(data, start, vertex, order)
    if start + vertex.count * row.itemsize > len(data):
        held = max(0, len(data) - start) // max(1, row.itemsize)
        raise Unreadable(f"its header promises {counted(vertex.count, 'point')}, the file holds {held}: cut off?")
    table = np.frombuffer(data, row, vertex.count, start)
    return {name: table[name] for name in row.names or () if not name.startswith(_COUNT) and table[name].ndim == 1}


def _are_alike(data: bytes, start: int, count: int, row: np.dtype) -> bool:
    """Whether the lists of all vertices are as long as those of the first."""
    if start + count * row.itemsize > len(data):
        return False
    table = np.frombuffer(data, row, count, start)
    return all((table[name] == table[name][0]).all() for name in row.names or () if name.startswith(_COUNT))


def _binary_with_lists(data: bytes, start: int, vertex: _Element, order: str) -> dict[str, ndarray]:
    """Columns of vertices whose lists have different lengths: the way to each is found vertex by vertex. Raises Unreadable."""
    sizes = [[np.dtype(kind).itemsize for kind in entry[1:]] for entry in vertex.properties]
    places = {entry[0]: np.empty(vertex.count, np.int64) for entry in vertex.properties if len(entry) == 2}
    order_of_count: Literal["little", "big"] = "big" if order == ">" else "little"
    at = start
    for i in range(vertex.count):
        for entry, size in zip(vertex.properties, sizes, strict=True):
            if len(entry) == 2:
                places[entry[0]][i] = at
            else:
                at += int.from_bytes(data[at : at + size[0]], order_of_count) * size[1]
            at += size[0]
        if at > len(data):
            raise Unreadable(f"its header promises {counted(vertex.count, 'point')}, the file holds {i}: cut off?")
    content = np.frombuffer(data, np.uint8)
    kinds = {entry[0]: np.dtype(order + entry[1]) for entry in vertex.properties if len(entry) == 2}
    return {
        name: content[place[:, None] + np.arange(kinds[name].itemsize)].copy().view(kinds[name])[:, 0]
        for name, place in places.items()
    }


def _row(data: bytes, start: int, vertex: _Element, order: str) -> np.dtype:
    """The layout of a vertex; a list is as long as the first vertex's. Raises Unreadable."""
    layout: list[tuple[Any, ...]] = []
    for entry in vertex.properties:
        if len(entry) == 3:
            at = start + np.dtype(layout).itemsize if layout else start
            kind = np.dtype(order + entry[1])
            if at + kind.itemsize > len(data) or kind.kind == "f":
                raise Unreadable(f"the list {entry[0]!r} of its vertices has no count")
            length = int(np.frombuffer(data, kind, 1, at)[0])
            if not 0 <= length <= _LONGEST:
                raise Unreadable(f"the list {entry[0]!r} of its vertices has {length} items (limit {_LONGEST})")
            layout += [(_COUNT + entry[0], kind), (entry[0], order + entry[2], (length,))]
        else:
            layout.append((entry[0], order + entry[1]))
    return np.dtype(layout)


def _skip(data: bytes, start: int, element: _Element, order: str) -> int:
    """Where the rows of `element` end."""
    if not element.has_list:
        return start + element.count * element.least_size(False)
    for _ in range(element.count):
        for entry in element.properties:
            size = np.dtype(entry[1]).itemsize
            if len(entry) == 3:
                if start + size > len(data):
                    raise Unreadable(f"it ends within its {element.name} elements")
                items = int(np.frombuffer(data, order + entry[1], 1, start)[0]) if entry[1][0] != "f" else -1
                if items < 0:
                    raise Unreadable(f"a list of its {element.name} elements has no count")
                start += items * np.dtype(entry[2]).itemsize
            start += size
    return start
