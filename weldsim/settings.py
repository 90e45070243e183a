"""Settings as people give them: TOML tables and `key=value` overrides, with where each value came from.

Imports nothing heavy: commands that only look at a file's title read it here.
"""

import difflib
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any, Literal

from weldsim.errors import ConfigError

ALIKE = 0.75  # from which likeness on a word counts as a misspelt other one
ALIKE_PART = 0.6  # the same for the table and the name of a dotted key, each

MEANT_NAMES = {
    **dict.fromkeys(("rotation", "rot", "rz", "turn", "heading", "theta"), "yaw"),
    **dict.fromkeys(("pitch", "roll", "rx", "ry", "slope", "lean"), "tilt"),
    **dict.fromkeys(("height", "elevation"), "z"),
    **dict.fromkeys(("velocity", "feed", "feedrate", "travel_speed"), "speed"),
    **dict.fromkeys(("diameter", "bend"), "radius"),
    **dict.fromkeys(("thick",), "thickness"),
    **dict.fromkeys(("stickout", "stick_out", "standoff"), "ctwd"),
}
"""What people say for the name of a setting, in a table that has it."""

MEANT_VALUES = {
    "method": {**dict.fromkeys(("ours", "default"), "profile"), **dict.fromkeys(("published", "paper"), "thesis")},
    "workpiece": {
        **dict.fromkeys(("groove", "grooved", "grooved_plate"), "groove_plate"),
        **dict.fromkeys(("bare", "flat", "blank"), "plain_plate"),
        **dict.fromkeys(("pipe", "tube"), "cylinder"),
        **dict.fromkeys(("box", "block", "cube"), "cuboid"),
        **dict.fromkeys(("branched", "branches", "fork"), "y"),
        **dict.fromkeys(("stl", "cad", "file"), "mesh"),
    },
    "finish": {
        **dict.fromkeys(("steel", "metal", "shiny", "bright", "polished"), "ground"),
        **dict.fromkeys(("scale", "mill", "rolled"), "mill_scale"),
        **dict.fromkeys(("dusted", "sprayed", "dull"), "matte"),
        **dict.fromkeys(("dark",), "black"),
    },
    "shape": {
        **dict.fromkeys(("line",), "straight"),
        **dict.fromkeys(("curve", "curved", "circle"), "arc"),
        **dict.fromkeys(("wave", "sine"), "s"),
    },
    "views": dict.fromkeys(("automatic", "planned"), "auto"),
    "series": {**dict.fromkeys(("ur5", "cb"), "cb3"), **dict.fromkeys(("ur5e", "e-series", "eseries"), "e")},
}
"""What people say for a choice of a setting."""

NOTHING = ("none", "no", "off", "nothing", "without")
"""What people say where something is to be left out."""


@dataclass(frozen=True)
class Source:
    """Where a value comes from. Attributes: kind; name, of the file, scene or option."""

    kind: Literal["default", "scene", "file", "command line"]
    name: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {self.name}".rstrip()


DEFAULT, COMMAND_LINE = Source("default"), Source("command line")
Given = Mapping[str, Source]
"""Dotted key of every value that was given, and where."""


def load_toml(path: str | Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        ConfigError: the file is missing, unreadable, not UTF-8 or not TOML (with the line).
    """
    if not isinstance(path, str | Path):
        raise ConfigError(f"config: {path!r:.60} is no TOML file; its path, or tables, are wanted")
    try:
        return tomllib.loads(Path(path).read_bytes().decode())
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file", path=str(path)) from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})", path=str(path)) from None
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        reason = "not UTF-8 text" if isinstance(error, UnicodeDecodeError) else f"{error}{_quoted(Path(path), str(error))}"
        raise ConfigError(f"{path}: no TOML: {reason}", path=str(path)) from None


def _quoted(path: Path, reason: str) -> str:
    """How the line that is no TOML is written, where quotes about its value make it one; else nothing."""
    match = re.search(r"at line (\d+)", reason)
    lines = path.read_text(errors="replace").splitlines()
    if match is None or not 1 <= int(match[1]) <= len(lines):
        return ""
    key, equals, value = (part.strip() for part in lines[int(match[1]) - 1].partition("="))
    line = f'{key} = "{value.strip(chr(34) + chr(39))}"'
    try:
        tomllib.loads(line)
    except ValueError:
        return ""
    return f"; write {line}" if equals and value else ""


def apply_overrides(data: Mapping[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """A copy of `data` with every `dotted.key=value` set; the value is TOML if it reads as such, else plain text.

    Raises:
        ConfigError: no `=`, an empty key, or a key that leads through a value.
    """
    return with_sources(data, DEFAULT, overrides)[0]


def with_sources(
    data: Mapping[str, Any], source: Source, overrides: Iterable[str] | Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Source]]:
    """`apply_overrides`, and where each value that is now in the tables came from: `source`, or the command line."""
    result: dict[str, Any] = deepcopy(dict(data))
    given = dict.fromkeys(leaves(result), source)
    for text, (parts, value) in _each(overrides):
        table = result
        for depth, part in enumerate(parts[:-1]):
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                raise ConfigError(f"override {text!r}: {'.'.join(parts[: depth + 1])} is a value, not a table", value=text)
        table[parts[-1]] = value
        key = ".".join(parts)
        given = {known: where for known, where in given.items() if not (known == key or known.startswith(f"{key}."))}
        given |= dict.fromkeys(leaves(value, key), COMMAND_LINE)
    return result, given


def nested(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables in which a dotted key, "path.speed" say, stands for the tables that it names."""
    out: dict[str, Any] = {}
    for key, value in tables.items():
        inner = nested(value) if isinstance(value, Mapping) else value
        for part in reversed(str(key).split(".")[1:]):
            inner = {part: inner}
        name = str(key).partition(".")[0]
        both = isinstance(inner, Mapping) and isinstance(out.get(name), dict)
        out[name] = _merged(out[name], inner) if both else inner
    return out


def _merged(first: dict[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """Two tables as one; of two values the second."""
    both = {key for key in first.keys() & second.keys() if isinstance(first[key], dict) and isinstance(second[key], Mapping)}
    return {**first, **second, **{key: _merged(first[key], second[key]) for key in both}}


def key_of(override: str) -> str:
    """The dotted key that `key=value` sets. Raises ConfigError."""
    return ".".join(_split(override)[0])


def leaves(value: Any, key: str = "") -> Iterator[str]:
    """Dotted keys of all values in nested tables; an array counts as one value."""
    if not isinstance(value, Mapping):
        yield key
        return
    for name, inner in value.items():
        yield from leaves(inner, f"{key}.{name}".lstrip("."))


def value_at(tables: Mapping[str, Any], key: str) -> Any:
    """What stands at a dotted key, views[0].tilt say; None where nothing does."""
    value: Any = tables
    for part in key.replace("[", ".").replace("]", "").split("."):
        if isinstance(value, Mapping):
            value = value.get(part)
        elif isinstance(value, list | tuple) and part.isdecimal() and int(part) < len(value):
            value = value[int(part)]
        else:
            return None
    return value


def nearest(word: str, known: Iterable[str]) -> str:
    """The one of `known` that `word` is a misspelling of, or ""."""
    return next(iter(difflib.get_close_matches(word, list(known), n=1, cutoff=ALIKE)), "")


def named_like(word: str, known: Iterable[str]) -> list[str]:
    """Those of the dotted keys whose last part `word` is a misspelling of: the nearest, in whatever tables it is."""
    last = {one: one.rpartition(".")[2] for one in known}
    name = nearest(word, dict.fromkeys(last.values()))
    return [one for one, own in last.items() if own == name]


def meant_keys(key: str, known: Iterable[str]) -> list[str]:
    """The dotted keys that may be meant where `key` is none: its tables left out or others before it, or misspelt."""
    known, parts = list(known), key.split(".")
    for start in range(len(parts)):
        end = ".".join(parts[start:])
        if found := [one for one in known if one == end or one.endswith(f".{end}")]:
            return (_alike(key, found) if start and len(found) > 1 else []) or found
    return _alike(key, known)


def _alike(key: str, known: Iterable[str]) -> list[str]:
    """The dotted key of which both tables and name are a misspelling, if any."""
    table, _, name = key.rpartition(".")
    scored, known = [], list(known)
    inside = [one for one in known if one.rpartition(".")[0] == table]
    if said := [one for one in inside if one.rpartition(".")[2] == MEANT_NAMES.get(name.lower())]:
        return said
    for one in inside or known:  # a table that there is was meant
        its_table, _, its_name = one.rpartition(".")
        likeness = [SequenceMatcher(None, *pair).ratio() for pair in ((name, its_name), (table, its_table)) if any(pair)]
        if min(likeness) >= ALIKE_PART:
            scored.append((sum(likeness), one))
    below = [one for one in known if table and one.startswith(f"{table}.")]
    return [max(scored)[1]] if scored else named_like(name, below) or named_like(name, known)


def _each(overrides: Iterable[str] | Mapping[str, Any]) -> Iterator[tuple[str, tuple[list[str], Any]]]:
    """Each override as it was given, with the parts of its key and its value; one may be given alone, or all as a mapping."""
    if isinstance(overrides, Mapping):
        flat = nested(overrides)
        yield from ((key, (key.split("."), value_at(flat, key))) for key in leaves(flat))
        return
    yield from ((text, _split(text)) for text in listed(overrides))


def listed(overrides: Any) -> list[Any]:
    """Overrides one by one. Raises ConfigError for what is no list of them."""
    if isinstance(overrides, str):
        return [overrides]
    if not isinstance(overrides, Iterable):
        raise ConfigError(f"overrides {overrides!r:.60}: a list of dotted.key=value, or a mapping, is wanted", value=overrides)
    return list(overrides)


def _split(text: str) -> tuple[list[str], Any]:
    """Parts of the key, and the value."""
    key, equals, value = text.partition("=") if isinstance(text, str) else ("", "", "")
    parts = [part.strip() for part in key.split(".")]
    if not equals or not all(parts):
        raise ConfigError(f"override {text!r}: write dotted.key=value, seam.method=thesis say", value=text)
    return parts, _toml_value(value.strip())


def _toml_value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if list(parsed) == ["value"] else text
