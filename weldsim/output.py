"""Files that appear whole or not at all."""

import os
from pathlib import Path

from weldsim.errors import OutputError

DEVICES = ("/dev", "/dev/fd")


def place_of(path: Path | str) -> Path:
    """The file that `path` means, links followed, so that a link is written through and not replaced.

    Raises:
        OutputError: a folder, or a device, pipe or socket: a rename would put a file in its place.
    """
    place = Path(os.path.realpath(path))
    if place.is_dir():
        raise OutputError(f"{path}: is a folder; give a file name", path=str(path))
    # /dev/stdout may lead to a regular file: replaced, it would no longer be the one that stdout writes to.
    parent = os.path.realpath(Path(path).parent)
    if parent in DEVICES or parent.startswith("/proc/") or (place.exists() and not place.is_file()):
        raise OutputError(f"{path}: is no regular file; give a file name (--json prints to stdout)", path=str(path))
    return place


def write_whole(path: Path | str, content: bytes | str) -> Path:
    """`path`, where `content` now lies: written beside it under a temporary name, then renamed onto it.

    Args:
        path: the file to make or replace; its folder must exist.
        content: bytes, or text to be stored as UTF-8.
    Raises:
        OutputError: the folder is missing, is no folder, or cannot be written; `path` is no regular file.
    """
    target, place = Path(path), place_of(path)
    temporary = place.with_name(f".{place.name}.{os.getpid()}.part")
    data = content.encode() if isinstance(content, str) else content
    try:
        temporary.write_bytes(data)
        os.replace(temporary, place)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written ({error.strerror or error})", path=str(target)) from error
    finally:
        # Also when interrupted; after the rename there is nothing left to remove.
        if temporary.parent.is_dir():
            temporary.unlink(missing_ok=True)
    return target
