"""Quantities on the command line: one parser, with units and ranges, for every option that takes one.

A bare number is SI. One that can hardly be SI, for it was surely meant in millimetres or degrees, is asked back; with its unit
it is taken wherever it lies in the range.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tyro.constructors import PrimitiveConstructorSpec

from weldsim import units
from weldsim.errors import InputError

TURN = 2 * math.pi
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_VALUES = re.compile(rf"[\[({{\s]*(?:{_NUMBER.pattern}\s*[A-Za-z°µμ%/]*[,;\s\])}}]*)+")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What an option takes.

    Attributes:
        unit: in SI, "" for a plain number.  low, high: its range [SI], ends included.
        bare: greatest size of a number without a unit [SI]; below 0 none goes without.
        example: one value as people write it.  names: of its values, where it takes several.
    """

    unit: str
    low: float
    high: float
    bare: float = math.inf
    example: str = ""
    names: tuple[str, ...] = ("value",)


POINT = Quantity(unit="m", low=-100.0, high=100.0, bare=5.0, example="-750 mm", names=("x", "y", "z"))
TURNED = Quantity(unit="rad", low=-TURN, high=TURN, bare=0.99, example="-15 deg")
LEANED = Quantity(unit="rad", low=-TURN / 6, high=TURN / 6, bare=0.99, example="5 deg", names=("work angle", "travel angle"))
JOINTS = Quantity(unit="rad", low=-TURN, high=TURN, example="-90 deg", names=tuple(f"joint {k}" for k in range(1, 7)))
MOVED = Quantity(unit="m", low=-3.0, high=3.0, bare=0.99, example="20 mm", names=("x", "y"))
ALONG = Quantity(unit="m", low=-100.0, high=100.0, bare=-1.0, example="69 mm")  # on a seam, whose own ends are told
WELD_SPEED = Quantity(unit="m/s", low=1e-4, high=1.0, bare=0.25, example="5 mm/s")
COUNT = Quantity(unit="m", low=1e-6, high=0.1, bare=0.01, example="1 mm")
SHARE = Quantity(unit="", low=1e-3, high=1.0)
PACE = Quantity(unit="", low=0.01, high=100.0)
SPELL = Quantity(unit="s", low=0.0, high=3600.0, example="5 s")


@dataclass(frozen=True)
class QuantitySpec(PrimitiveConstructorSpec[Any]):
    """What makes tyro read an option as quantities. Attribute: kind, of each."""

    kind: Quantity | None = None


def quantity(kind: Quantity, option: str) -> QuantitySpec:
    """What makes tyro read an option as one quantity: float [SI] in the command, "15 deg" on the command line."""
    return QuantitySpec(
        kind=kind,
        nargs=1,
        metavar=f'"{kind.example}"' if kind.unit else "NUMBER",
        instance_from_str=lambda words: several(words, kind, option)[0],
        is_instance=lambda value: value is None or isinstance(value, int | float),
        str_from_instance=lambda value: [_shown(value)],
    )


def quantities(kind: Quantity, option: str, *, words: int = 1) -> QuantitySpec:
    """The same for several: in one word, "20 mm, -35 mm", or in a word each."""
    return QuantitySpec(
        kind=kind,
        nargs=words,
        metavar=" ".join(name.upper() for name in kind.names) if words > 1 else f'"{", ".join([kind.example] * len(kind.names))}"',
        instance_from_str=lambda given: several(given, kind, option) if words > 1 else listed(given[0], kind, option),
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [", ".join(map(_shown, value or (None,)))],
    )


def listed(text: str, kind: Quantity, option: str) -> tuple[float, ...]:
    """The SI values of "20 mm, -35 mm". Raises InputError."""
    return several(units.row(text, len(kind.names)), kind, option)


def gathered(words: Sequence[str], kinds: Mapping[str, QuantitySpec]) -> list[str]:
    """The words of a command line in which the values of each of these options stand in as many words as it takes.

    A shell parts `--speed 5 mm/s` and `--move 20 mm 30 mm` at their blanks, and people write points with and without commas.
    Words that are no such values stay as they are, to be refused for what they are.

    Args:
        kinds: of the options, "--speed" say.
    """
    out: list[str] = []
    at = 0
    while at < len(words):
        word = words[at]
        if word == "--":
            return [*out, *words[at:]]
        option, equals, first = word.partition("=")
        spec = kinds.get(option.replace("_", "-"))
        at += 1
        if spec is None or spec.kind is None:
            out.append(word)
            continue
        run, end = _values([first] if equals else [], words[at:], spec.kind)
        parts = units.row(run, len(spec.kind.names))
        if not (end or equals) or (spec.nargs != 1 and len(parts) != spec.nargs):
            out.append(word)
            continue
        at += end
        out += [option, *parts] if spec.nargs != 1 else [option, run]
    return out


def _values(begun: list[str], words: Sequence[str], kind: Quantity) -> tuple[str, int]:
    """The text of the values at the head of the words, and how many words they are. Args: begun, text before the words."""
    text, count = "".join(begun), len(kind.names)
    given = len(_NUMBER.findall(text))
    for end, word in enumerate(words):
        if given and re.search(r"\d\.?$", text) and (word.rstrip(",;") == "%" or units.is_unit(word.rstrip(",;"))):
            text = f"{text} {word}"
        elif given < count and _VALUES.fullmatch(word):
            text = f"{text} {word}" if not text or text.rstrip().endswith((",", ";")) else f"{text}, {word}"
            given += max(1, len(_NUMBER.findall(word)))
        else:
            return text.strip(), end
    return text.strip(), len(words)


def several(words: Sequence[str], kind: Quantity, option: str) -> tuple[float, ...]:
    """The SI values of words, one each. Raises InputError."""
    whole = ", ".join(words) if len(kind.names) > 1 else " ".join(words)
    if len(words) != len(kind.names):
        raise InputError(
            f"{option} {whole!r}: {len(words)} given, {len(kind.names)} needed, with commas between: {', '.join(kind.names)}",
            option=option,
            value=whole,
        )
    return tuple(_value(word, kind, f"{option} {whole!r}") for word in words)


def _value(word: str, kind: Quantity, where: str) -> float:
    share = None if kind.unit else units.percent(word)
    number = _plain(word, where) if share is None else share
    if number is None and not kind.unit:
        raise InputError(f"{where}: {word!r} is no number", value=word)
    value = units.parse(word, kind.unit, where=where) if number is None else number
    bare = kind.bare if number is not None else math.inf
    low, high = max(kind.low, -bare), min(kind.high, bare)
    if low <= value <= high:
        return value
    unit = f" {kind.unit}".rstrip()
    if not kind.low <= value <= kind.high:
        said = f"{value:.6g}{unit} is outside {kind.low:.4g} to {kind.high:.4g}{unit}"
    else:
        said = f"{value:.6g}{unit}? write the unit"
    meant = units.meant(word, kind.unit, kind.low, kind.high)
    if kind is SHARE and share is None:
        meant = units.meant_percent(value, kind.low, kind.high)
    raise InputError(f"{where}: {said}{f'; {meant}' if meant else ''}", value=value, limit=(kind.low, kind.high))


def _plain(word: str, where: str) -> float | None:
    """A finite number without a unit, or None. Raises InputError for one that is not finite."""
    try:
        number = float(word)
    except ValueError:
        return None
    if not math.isfinite(number):
        raise InputError(f"{where}: a finite number is needed", value=word)
    return number


def _shown(value: float | None) -> str:
    """As help shows a default."""
    return "None" if value is None else f"{value:g}"
