"""Bytes of cloud files as other programs write them, for the tests of the readers."""

import io
import struct
from collections.abc import Sequence

import cv2
import numpy as np
from numpy import ndarray

PLY_TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int", "i2": "short", "u2": "ushort"}


def ply_bytes(
    columns: Sequence[tuple[str, str, ndarray]], order: str = "<", *, faces: int = 0, before: bytes = b"", newline: str = "\n"
) -> bytes:
    """A PLY with vertex columns (name, numpy type code, values); order is "<", ">" or "ascii"."""
    n = len(columns[0][2])
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "ascii": "ascii"}[order]
    header = ["ply", f"format {kind} 1.0", "comment made for a test", "obj_info nothing"]
    lists = ["property list uchar int vertex_indices"]
    header += ["element strip 1", *lists] if before else []
    header += [f"element vertex {n}", *(f"property {PLY_TYPES[code]} {name}" for name, code, _ in columns)]
    header += [f"element face {faces}", *lists] if faces else []
    head = newline.join([*header, "end_header", ""]).encode()
    if order == "ascii":
        rows = zip(*(values.tolist() for _, _, values in columns), strict=True)
        body = newline.join([*(" ".join(map(repr, row)) for row in rows), *["3 0 1 2"] * faces, ""]).encode()
        return head + before + body
    table = np.empty(n, [(name, order + code) for name, code, _ in columns])
    for name, _, values in columns:
        table[name] = values
    return head + before + table.tobytes() + struct.pack(order + "B3i", 3, 0, 1, 2) * faces


def compress_lzf(data: bytes) -> bytes:
    """LZF (liblzf's format), greedy, with a table of the last place of every three bytes."""
    out, literals, seen, i = bytearray(), bytearray(), {}, 0

    def flush() -> None:
        for start in range(0, len(literals), 32):
            run = literals[start : start + 32]
            out.extend(bytes([len(run) - 1]) + run)
        literals.clear()

    while i < len(data):
        key = data[i : i + 3]
        at = seen.get(key, -1)
        seen[key] = i
        if len(key) == 3 and at >= 0 and i - at <= 8192:
            length = 3
            while length < 264 and i + length < len(data) and data[at + length] == data[i + length]:
                length += 1
            flush()
            back, code = i - at - 1, length - 2
            out.append((min(code, 7) << 5) | (back >> 8))
            out.extend([code - 7] if code >= 7 else [])
            out.append(back & 255)
            i += length
        else:
            literals.append(data[i])
            i += 1
    flush()
    return bytes(out)


def pcd_bytes(columns: Sequence[tuple[str, str, ndarray]], data: str = "binary", *, viewpoint: str = "0 0 0 1 0 0 0") -> bytes:
    """A PCD with columns (name, numpy type code, values)."""
    n = len(columns[0][2])
    letters = {"f": "F", "u": "U", "i": "I"}
    head = "\n".join(
        [
            "# .PCD v0.7 - Point Cloud Data file format",
            "VERSION 0.7",
            "FIELDS " + " ".join(name for name, _, _ in columns),
            "SIZE " + " ".join(code[1:] for _, code, _ in columns),
            "TYPE " + " ".join(letters[code[0]] for _, code, _ in columns),
            "COUNT " + " ".join("1" for _ in columns),
            f"WIDTH {n}",
            "HEIGHT 1",
            f"VIEWPOINT {viewpoint}",
            f"POINTS {n}",
            f"DATA {data}",
            "",
        ]
    ).encode()
    arrays = [np.ascontiguousarray(values, "<" + code) for _, code, values in columns]
    if data == "ascii":
        rows = zip(*(array.tolist() for array in arrays), strict=True)
        return head + "\n".join([" ".join(map(repr, row)) for row in rows]).encode() + b"\n"
    if data == "binary":
        return head + b"".join(b"".join(array[i].tobytes() for array in arrays) for i in range(n))
    body = b"".join(array.tobytes() for array in arrays)
    packed = compress_lzf(body)
    return head + struct.pack("<II", len(packed), len(body)) + packed


def npy_bytes(array: ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npz_bytes(*, compressed: bool = False, **arrays: ndarray) -> bytes:
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    return buffer.getvalue()


def text_bytes(points: ndarray, separator: str = " ", head: str = "") -> bytes:
    return (head + "".join(separator.join(map(repr, row)) + "\n" for row in points.tolist())).encode()


def png_bytes(image: ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def xyz_columns(points: ndarray, code: str = "f8") -> list[tuple[str, str, ndarray]]:
    return [(name, code, points[:, axis]) for axis, name in enumerate("xyz")]
