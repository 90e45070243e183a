"""The bytes of an input file, or the reason why there are none."""

import zlib
from pathlib import Path

from weldsim.errors import CloudFileError

_MAX_BYTES = 4 << 30


def read_bytes(path: str | Path) -> bytes:
    """All bytes of the file, at least one.

    Raises:
        CloudFileError: missing, a folder or device, empty, over 4 GB, or not ours to read.
    """
    if not isinstance(path, str | Path):
        raise CloudFileError(f"{path!r:.60} is no file; the path of one is wanted", reason="no file")
    where = Path(path)

    def refuse(reason: str) -> CloudFileError:
        return CloudFileError(f"{path}: {reason}", path=str(path), reason=reason)

    try:
        if where.is_dir():
            inside = where / "cloud.ply"  # of a run directory
            raise refuse(f"is a folder; did you mean {inside}?" if inside.is_file() else "is a folder, a file is needed")
        if not where.exists():
            raise refuse("no such file")
        if not where.is_file():
            raise refuse("is no regular file")
        size = where.stat().st_size
        if size == 0:
            raise refuse("is empty")
        if size > _MAX_BYTES:
            raise refuse(f"has {size} bytes (limit {_MAX_BYTES}); crop or thin it first")
        return where.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise refuse(f"cannot be read ({getattr(error, 'strerror', None) or error})") from None


def unpacked(path: str | Path, data: bytes) -> bytes:
    """The content of gzip-compressed bytes; other bytes as they are.

    Raises:
        CloudFileError: damaged or cut off, or over 4 GB unpacked.
    """
    if data[:2] != b"\x1f\x8b":
        return data
    try:
        unpacker = zlib.decompressobj(wbits=31)  # of a gzip header
        content = unpacker.decompress(data, _MAX_BYTES)
        whole, damage = unpacker.eof, ""
    except zlib.error as error:
        content, whole, damage = b"", False, f" ({error})"
    if not whole or not content:
        long = len(content) >= _MAX_BYTES
        reason = f"has over {_MAX_BYTES} bytes unpacked; crop it first" if long else f"its gzip data is damaged or cut off{damage}"
        raise CloudFileError(f"{path}: {reason}", path=str(path), reason=reason)
    return content
