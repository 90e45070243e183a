"""Tables of keys and values in text: JSON, TOML, and lines of `key: value` as ROS, OpenCV and camera tools print them."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from weldsim.cloud.sources import read_bytes
from weldsim.columns import decode, is_number
from weldsim.errors import CloudFileError

_MOST = 1 << 20  # bytes that are read
_TAG = re.compile(r"^!![\w-]+\s*")
_COMMA_NUMBER = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")


def read_table(path: str | Path) -> dict[str, Any]:
    """The keys of a JSON, TOML or `key: value` file, tables within tables; a bare JSON list stands under "matrix".

    Raises:
        CloudFileError: a file that is missing, no text, or holds no keys.
    """
    text = decode(read_bytes(path)[:_MOST])
    if "\0" in text or "\ufffd" in text:
        raise CloudFileError(f"{path}: is no text", path=str(path), reason="binary")
    for parse in (json.loads, tomllib.loads, _lines):
        try:
            parsed = parse(text)
        except (ValueError, RecursionError):
            continue
        if isinstance(parsed, dict) and parsed:
            return parsed
        if isinstance(parsed, list):
            return {"matrix": parsed}
    if text.lstrip("\ufeff \n\t").startswith("<"):
        raise CloudFileError(f"{path}: is XML; give the same figures as JSON or YAML", path=str(path), reason="XML")
    raise CloudFileError(f"{path}: is neither JSON nor TOML nor lines of `key: value`", path=str(path), reason="no table")


def _lines(text: str) -> dict[str, Any]:
    """The keys of `key: value` lines, those further in belonging to the last one further out that has no value of its own.

    Raises:
        ValueError: a key that is there twice with different values.
    """
    top: dict[str, Any] = {}
    open_tables: list[tuple[int, dict[str, Any]]] = [(-1, top)]
    last: tuple[dict[str, Any], str] | None = None
    for line in _whole_lines(text):
        indent, bare = len(line) - len(line.lstrip()), line.strip()
        if bare.startswith("- ") and last is not None:
            table, key = last
            items = table[key] if isinstance(table.get(key), list) else []
            table[key] = [*items, _value(bare[2:])]
            continue
        key, colon, value = bare.partition(":")
        if not colon or bare.startswith(("#", "%", "//", "---")):
            continue
        while indent <= open_tables[-1][0]:
            open_tables.pop()
        table, key = open_tables[-1][1], key.strip().strip("\"'")
        value = _TAG.sub("", value.split(" #")[0].strip())
        if value:
            found = _value(value)
            if key in table and table[key] != found:
                raise ValueError(f"key {key} is there twice")
            table[key], last = found, None
        else:
            inner: dict[str, Any] = {}
            table[key] = inner
            open_tables.append((indent, inner))
            last = (table, key)
    return {key: value for key, value in top.items() if value not in ({}, "")}


def _whole_lines(text: str) -> list[str]:
    """Lines, a list in brackets that goes over several joined to one."""
    lines: list[str] = []
    for line in text.split("\n"):
        starts = line.lstrip().startswith("[") and bool(lines) and lines[-1].rstrip().endswith(":")
        if starts or (lines and lines[-1].count("[") > lines[-1].count("]")):
            lines[-1] += " " + line.strip()
        else:
            lines.append(line)
    return lines


def _value(text: str) -> Any:
    """A number, a list of numbers, or else the text; JSON where it is that."""
    text = _TAG.sub("", text.strip())
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        pass
    if text[:1] + text[-1:] == "{}" and ":" in text:
        pairs = [part.partition(":") for part in text[1:-1].split(",")]
        return {key.strip().strip("\"'"): _value(value) for key, _, value in pairs}
    inside = text[1:-1] if text[:1] + text[-1:] in ("[]", "()", "{}") else text
    pointed = [word.replace(",", ".") if _COMMA_NUMBER.fullmatch(word) else word for word in inside.split()]
    numbers = pointed if all(map(is_number, pointed)) else [word for word in re.split(r"[,\s]+", inside) if word]
    if not numbers or not all(map(is_number, numbers)):
        return text.strip("\"'")
    return float(numbers[0]) if len(numbers) == 1 and inside == text else [float(number) for number in numbers]
