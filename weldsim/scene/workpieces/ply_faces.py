"""Vertices and polygons of a PLY mesh, text or binary, faces of any number of corners."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

_CODES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H", "uint16": "H",
    "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    """One property: the code of its number, and of its count where it is a list."""

    name: str
    code: str
    count: str | None


@dataclass(frozen=True)
class _Element:
    name: str
    rows: int
    properties: list[_Property]


def read_ply_mesh(data: bytes) -> tuple[Float[ndarray, "v 3"], list[list[int]]]:
    """The vertices, and each face's corners in order. Raises ValueError, struct.error or IndexError for what is no PLY mesh."""
    end = data.index(b"end_header")
    start = data.index(b"\n", end) + 1
    order, elements = _header(data[:end].decode("latin1").splitlines())
    body = _text_rows(data[start:], elements) if order == "" else _binary_rows(data, start, order, elements)
    vertices, polygons = [], []
    for element, row in body:
        if element == "vertex":
            vertices.append([float(row[axis]) for axis in "xyz"])
        elif element == "face":
            polygons.append([int(corner) for corner in next(row[name] for name in _CORNERS if name in row)])
    points = np.array(vertices, float).reshape(-1, 3)
    for corners in polygons:
        if len(corners) < 3 or min(corners) < 0 or max(corners) >= len(points):
            raise ValueError(f"a face has the corners {corners[:6]} of {len(points)} vertices")
    return points, polygons


def _header(lines: list[str]) -> tuple[str, list[_Element]]:
    """Byte order ("<", ">", or "" for text) and what follows."""
    order, elements = "?", []
    for line in lines:
        match line.split():
            case ["format", kind, _]:
                order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[kind]
            case ["element", name, rows]:
                elements.append(_Element(name, int(rows), []))
            case ["property", "list", count, kind, name]:
                elements[-1].properties.append(_Property(name, _CODES[kind], _CODES[count]))
            case ["property", kind, name]:
                elements[-1].properties.append(_Property(name, _CODES[kind], None))
            case _:
                pass
    if order == "?":
        raise ValueError("its header names no format")
    return order, elements


def _text_rows(body: bytes, elements: list[_Element]) -> Iterator[tuple[str, dict]]:
    words = iter(body.split())
    for element in elements:
        for _ in range(element.rows):
            row = {}
            for each in element.properties:
                word = next(words, None)
                if word is None:
                    raise ValueError(f"it ends within its {element.name} elements")
                row[each.name] = float(word) if each.count is None else [float(next(words)) for _ in range(int(word))]
            yield element.name, row


def _binary_rows(data: bytes, at: int, order: str, elements: list[_Element]) -> Iterator[tuple[str, dict]]:
    for element in elements:
        plain = all(each.count is None for each in element.properties)
        whole = struct.Struct(order + "".join(each.code for each in element.properties)) if plain else None
        names = [each.name for each in element.properties]
        for _ in range(element.rows):
            if whole is not None:
                yield element.name, dict(zip(names, whole.unpack_from(data, at), strict=True))
                at += whole.size
                continue
            row = {}
            for each in element.properties:
                number = 1
                if each.count is not None:
                    (number,) = struct.unpack_from(order + each.count, data, at)
                    at += struct.calcsize(order + each.count)
                values = struct.unpack_from(f"{order}{int(number)}{each.code}", data, at)
                at += struct.calcsize(f"{order}{int(number)}{each.code}")
                row[each.name] = values[0] if each.count is None else list(values)
            yield element.name, row
