"""Files that appear whole or not at all."""

import os
from pathlib import Path

from weldsim.errors import OutputError


def write_whole(path: Path | str, content: bytes | str) -> Path:
    """Where `content` now lies: written beside `path` under a temporary name, then renamed onto it.

    Args:
        path: the file to make or replace; its folder must exist.
        content: bytes, or text to be stored as UTF-8.
    Raises:
        OutputError: the folder is missing, is no folder, or cannot be written.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; give a file name", path=str(target))
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    data = content.encode() if isinstance(content, str) else content
    try:
        temporary.write_bytes(data)
        os.replace(temporary, target)
    except OSError as error:
        temporary.unlink(missing_ok=True) if temporary.parent.is_dir() else None
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})", path=str(target)) from error
    return target
