"""Methods by name: weldsim's own, and seam finders of the user's as "package.module:function" or "file.py:function"."""

import importlib
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, cast, get_args

from weldsim.errors import InputError
from weldsim.jobs import Finder
from weldsim.settings import nearest

Method = Literal["profile", "thesis"]
METHODS: tuple[Method, ...] = get_args(Method)


def told_apart(methods: str | Sequence[str], finders: Mapping[str, Finder] | None) -> tuple[list[Method], dict[str, Finder]]:
    """weldsim's own methods among those named, and {name: finder} of the others and of the caller's.

    Raises:
        InputError: a method that there is not; a finder that cannot be loaded.
    """
    own: list[Method] = []
    given: list[str] = [methods] if isinstance(methods, str) else list(methods)
    others: dict[str, Finder] = {}
    for name in given:
        if name in METHODS:
            own.append(cast(Method, name))
        else:
            label, finder = load_finder(name)
            if label in others:
                raise InputError(f"method {label} is given twice", method=label)
            others[label] = finder
    return own, {**others, **(finders or {})}


def load_finder(name: str) -> tuple[str, Finder]:
    """What a user's finder is called in tables and folders, and the finder itself.

    Args:
        name: "package.module:function", found from the current folder too, or "folder/file.py:function".
    Raises:
        InputError: it is none of these, or its module cannot be imported.
    """
    module, _, function = name.rpartition(":")
    if not module or not function:
        meant = nearest(name, METHODS)
        dotted = name.rpartition(".")
        if not meant and dotted[0] and not name.endswith(".py"):
            meant = f"{dotted[0]}:{dotted[2]}"
        if name.endswith(".py"):
            meant = f"{name}:FUNCTION"
        raise InputError(
            f"method {name!r} is not one of {', '.join(METHODS)}, nor package.module:function"
            + (f"; did you mean {meant}?" if meant else ""),
            method=name,
        )
    folder = str(Path.cwd())
    if module.endswith(".py"):
        if not Path(module).is_file():
            raise InputError(f"method {name}: {module}: no such file", method=name)
        folder, module = str(Path(module).resolve().parent), Path(module).stem
    if folder not in sys.path:
        sys.path.insert(0, folder)
    found = _attribute(_imported(module, name), function, name)
    if not callable(found):
        raise InputError(f"method {name}: {function} is no function", method=name)
    return f"{module}:{function}", cast(Finder, found)


def _imported(module: str, name: str) -> object:
    try:
        return importlib.import_module(module)
    except Exception as error:  # whatever the user's module raises
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"method {name}: {module} cannot be imported ({said})", method=name) from error


def _attribute(module: object, function: str, name: str) -> Any:
    found: Any = module
    for part in function.split("."):
        if not hasattr(found, part):
            meant = nearest(part, [one for one in vars(found) if not one.startswith("_")])
            raise InputError(f"method {name}: there is no {part}{f'; did you mean {meant}?' if meant else ''}", method=name)
        found = getattr(found, part)
    return found
