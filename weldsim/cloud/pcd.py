"""PCD clouds (ascii, binary, binary_compressed), as PCL writes them.

Own reader: `pypcd4` brings pydantic and a C extension without wheels, and believes the counts of a header.
"""

import struct

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import METRES, RawCloud, Unreadable, check_count, from_columns
from weldsim.cloud.sensor_frame import rotation_of_quaternion
from weldsim.cloud.table import parse_table
from weldsim.columns import UNITS, unit_of_comments
from weldsim.counted import counted

_MAX_HEADER = 65_536
_MAX_RATIO = 264 // 3 + 1  # an LZF token of 3 bytes stands for at most 264


def read_pcd(data: bytes) -> RawCloud:
    """The points of the PCD file `data`. Raises Unreadable."""
    header, start = _header(data)
    row = _row(header)
    count = _count(header)
    check_count(count)
    match [word.lower() for word in header["DATA"]]:
        case ["ascii"]:
            fields = _ascii(data[start:], row, count)
        case ["binary"]:
            if count * row.itemsize > len(data) - start:
                held = (len(data) - start) // row.itemsize
                raise Unreadable(f"its header promises {counted(count, 'point')}, the file holds {held}: cut off?")
            table = np.frombuffer(data, row, count, start)
            fields = {name: table[name] for name in row.names or ()}
        case ["binary_compressed"]:
            fields = _compressed(data, start, row, count)
        case other:
            raise Unreadable(f"its data is {' '.join(other)[:40]!r}, not ascii, binary or binary_compressed")
    fields = {name: column for name, column in fields.items() if column.ndim == 1}
    viewpoints, R = _pose(header)
    comments = [line for line in data[:start].decode("latin1").split("\n") if line.startswith("#")]
    said = unit_of_comments(comments)
    unit = next((name for name in METRES if said is not None and METRES[name] == UNITS[said]), None)
    return from_columns(fields | _unpacked_colours(fields), viewpoints=viewpoints, rotation=R, unit=unit)


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    """The words after each keyword, and where the body starts."""
    header, start = {}, 0
    while "DATA" not in header:
        end = data.find(b"\n", start, _MAX_HEADER)
        if end < 0:
            raise Unreadable("its PCD header does not end")
        words = data[start:end].decode("latin1").split("#")[0].split()
        if words:
            header["FIELDS" if words[0].upper() == "COLUMNS" else words[0].upper()] = words[1:]
        start = end + 1
    missing = [key for key in ("FIELDS", "SIZE", "TYPE") if key not in header]
    if missing:
        raise Unreadable(f"its PCD header lacks {', '.join(missing)}")
    return header, start


def _whole(words: list[str]) -> list[int]:
    if not all(word.isascii() and word.isdigit() and len(word) < 18 for word in words):
        raise Unreadable(f"its PCD header has {' '.join(words)[:40]!r} where whole numbers belong")
    return [int(word) for word in words]


def _row(header: dict[str, list[str]]) -> np.dtype:
    """The layout of one point. Padding fields, all called "_", get names of their own."""
    names, kinds = header["FIELDS"], header["TYPE"]
    sizes = _whole(header["SIZE"])
    counts = _whole(header.get("COUNT", ["1"] * len(names)))
    if not len(names) == len(kinds) == len(sizes) == len(counts) or len(names) > 256 or not names:
        raise Unreadable("its PCD header gives FIELDS, SIZE, TYPE and COUNT of different lengths")
    layout = []
    for i, (name, kind, size, count) in enumerate(zip(names, kinds, sizes, counts, strict=True)):
        code = {"F": "f", "I": "i", "U": "u"}.get(kind.upper(), "?") + str(size)
        if code not in ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8") or not 1 <= count <= 65_536:
            raise Unreadable(f"its field {name[:20]!r} has TYPE {kind[:8]} SIZE {size} COUNT {count}")
        unique = name.lower() if name != "_" and name.lower() not in [entry[0] for entry in layout] else f"_{i}"
        layout.append((unique, "<" + code) if count == 1 else (unique, "<" + code, (count,)))
    return np.dtype(layout)


def _count(header: dict[str, list[str]]) -> int:
    if "POINTS" in header:
        values = _whole(header["POINTS"])
    else:
        values = [int(np.prod(_whole(header.get("WIDTH", [])) + _whole(header.get("HEIGHT", ["1"])), dtype=object))]
    if len(values) != 1:
        raise Unreadable("its PCD header does not say how many points follow")
    return values[0]


def _pose(header: dict[str, list[str]]) -> tuple[Float[ndarray, "1 3"] | None, Float[ndarray, "3 3"] | None]:
    """Position and rotation of the sensor that the header gives; the default, seven numbers of an identity, says nothing."""
    try:
        numbers = [float(word) for word in header.get("VIEWPOINT", [])]
    except ValueError:
        return None, None
    if len(numbers) != 7 or not np.isfinite(numbers).all():
        return None, None
    if numbers in ([0, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 0]):  # an identity whose w is last, and none at all
        return None, None
    R = rotation_of_quaternion(numbers[3:])
    return (None, None) if R is None and not any(numbers[:3]) else (np.array([numbers[:3]]), R)


def _ascii(text: bytes, row: np.dtype, count: int) -> dict[str, ndarray]:
    widths = [int(np.prod(row[name].shape)) for name in row.names or ()]
    if 2 * count * sum(widths) > len(text) + 1:
        raise Unreadable(f"its header promises {counted(count, 'point')}, more than {len(text)} bytes of text can hold: cut off?")
    table = parse_table(text, columns=sum(widths), rows=count)
    starts = np.cumsum([0, *widths])
    fields = {}
    for name, width, at in zip(row.names or (), widths, starts, strict=False):
        if width == 1:
            column, kind = table[:, at], row[name]
            whole = kind.kind in "iu" and np.isfinite(column).all() and (np.abs(column) < 2.0**53).all()
            with np.errstate(over="ignore"):
                fields[name] = column.astype(np.int64 if whole else kind if kind.kind == "f" else np.float64)
    return fields


def _compressed(data: bytes, start: int, row: np.dtype, count: int) -> dict[str, ndarray]:
    """The columns of a binary_compressed body: sizes, then LZF data that holds field after field."""
    if len(data) < start + 8:
        raise Unreadable("it ends before its compressed data")
    packed, unpacked = struct.unpack_from("<II", data, start)
    if unpacked != count * row.itemsize:
        needed = f"{counted(count, 'point')} of {row.itemsize} bytes"
        raise Unreadable(f"its compressed data claims {unpacked} bytes, its header {needed}")
    if packed > len(data) - start - 8 or unpacked > packed * _MAX_RATIO:
        raise Unreadable(f"its compressed data claims {packed} bytes, {len(data) - start - 8} follow: cut off?")
    body = decompress_lzf(data[start + 8 : start + 8 + packed], unpacked)
    fields, at = {}, 0
    for name in row.names or ():
        kind = row[name]
        column = np.frombuffer(body, kind.base, count * int(np.prod(kind.shape)), at)
        fields[name] = column.reshape(count, *kind.shape)
        at += count * kind.itemsize
    return fields


def decompress_lzf(packed: bytes, size: int) -> bytearray:
    """The `size` bytes that LZF-packed bytes stand for (liblzf's format). Raises Unreadable.

    In Python: a million points take about a second, and nothing in a hostile file can reach memory it should not.
    """
    out, i, end = bytearray(), 0, len(packed)
    try:
        while i < end:
            control = packed[i]
            i += 1
            if control < 32:  # control + 1 bytes as they are
                out += packed[i : i + control + 1]
                i += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[i]
                i += 1
            length += 2
            back = ((control & 31) << 8) + packed[i] + 1
            i += 1
            at = len(out) - back
            if at < 0:
                raise Unreadable("its compressed data refers to before its beginning")
            if back >= length:
                out += out[at : at + length]
            else:
                out += (out[at:] * (length // back + 1))[:length]
            if len(out) > size:
                break
    except IndexError:
        raise Unreadable("its compressed data ends within a token") from None
    if len(out) != size or i > end:
        raise Unreadable(f"its compressed data unpacks to {len(out)} bytes, {size} are due")
    return out


def _unpacked_colours(fields: dict[str, ndarray]) -> dict[str, ndarray]:
    """Columns r, g, b from PCL's packed `rgb` or `rgba`: 0x00RRGGBB, stored as a whole number or as a float's bits."""
    packed = next((fields[name] for name in ("rgb", "rgba") if name in fields), None)
    if packed is None:
        return {}
    bits = packed.astype(np.float32).view(np.uint32) if packed.dtype.kind == "f" else packed.astype(np.int64)
    return {name: (bits >> shift) & 255 for name, shift in (("r", 16), ("g", 8), ("b", 0))}
