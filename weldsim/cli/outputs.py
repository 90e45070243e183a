"""Places to write to, tried before the long work."""

import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from weldsim.errors import InputError, OutputError
from weldsim.output import place_of


def check_outputs(outputs: Iterable[Path | None], inputs: Iterable[Path | None] = ()) -> None:
    """Nothing, when every output can be written; nothing is left behind.

    Raises:
        OutputError: a folder or device where a file is meant, a folder that is missing or cannot be written.
        InputError: an output that is given twice or would overwrite an input.
    """
    taken = {path.resolve(): "is read by this command" for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        place = path.resolve()
        if place in taken:
            raise InputError(f"{path}: {taken[place]}; write elsewhere", path=str(path))
        taken[place] = "is given twice"
        file = place_of(path)
        check_folder(path.parent if file == Path(os.path.abspath(path)) else file.parent, path)


def check_folder(folder: Path, path: Path) -> None:
    """Nothing, when files can be made in `folder`. Raises OutputError about `path`."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        if not folder.is_dir():
            reason = "it is a file, no folder" if folder.exists() else "no such folder"
        raise OutputError(f"{path}: cannot be written in {folder} ({reason})", path=str(path)) from None


def nearest_folder(path: Path) -> Path:
    """The closest folder above `path` that exists."""
    return next(folder for folder in path.resolve().parents if folder.exists())


def check_suffix(path: Path | None, allowed: tuple[str, ...], what: str, *, others: Mapping[str, str] | None = None) -> None:
    """Raises OutputError when `path` does not end as `what` does; `others` are options that write what it ends as."""
    if path is not None and path.name.lower() in allowed:
        raise OutputError(f"{path}: a name is missing before {path.name}", path=str(path))
    if path is not None and path.suffix.lower() not in allowed:
        option = (others or {}).get(path.suffix.lower())
        hint = f"; did you mean {option} {path}?" if option is not None else ""
        raise OutputError(f"{path}: {what} ends in {' or '.join(allowed)}{hint}", path=str(path), allowed=list(allowed))


def refuse_run(folder: Path, option: str) -> None:
    """Raises OutputError where files of their own would replace those of a run."""
    if (folder / "run.json").is_file():
        raise OutputError(f"{option} {folder}: holds a run, whose report would be lost; give another folder", path=str(folder))


FILES = (".json", ".csv", ".html", ".htm", ".pdf", ".png", ".jpg", ".svg", ".mp4", ".toml", ".ply", ".npz", ".txt", ".md", ".xml")


def refuse_file(folder: Path, option: str, why: str) -> None:
    """Raises OutputError where the name of a folder to be made is that of a file."""
    if folder.suffix.lower() in FILES and not folder.is_dir():
        raise OutputError(f"{option} {folder}: {why}", path=str(folder))
