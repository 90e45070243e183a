"""Quantities on the command line: one parser, with units and ranges, for every option that takes one.

A bare number is SI. One that can hardly be SI, for it was surely meant in millimetres or degrees, is asked back; with its unit
it is taken wherever it lies in the range.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tyro.constructors import PrimitiveConstructorSpec

from weldsim import units
from weldsim.errors import InputError

TURN = 2 * math.pi


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What an option takes.

    Attributes:
        unit: in SI, "" for a plain number.  low, high: its range [SI], ends included.
        bare: greatest size of a number without a unit [SI]; below 0 none but 0 goes without.
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
ALONG = Quantity(unit="m", low=0.0, high=10.0, bare=0.99, example="69 mm")
WELD_SPEED = Quantity(unit="m/s", low=1e-4, high=1.0, bare=0.25, example="5 mm/s")
COUNT = Quantity(unit="m", low=1e-6, high=0.1, bare=0.01, example="1 mm")
SHARE = Quantity(unit="", low=1e-3, high=1.0)
PACE = Quantity(unit="", low=0.01, high=100.0)
SPELL = Quantity(unit="s", low=0.0, high=3600.0, example="5 s")


def quantity(kind: Quantity, option: str) -> "PrimitiveConstructorSpec[float | None]":
    """What makes tyro read an option as one quantity: float [SI] in the command, "15 deg" on the command line."""
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=f'"{kind.example}"' if kind.unit else "NUMBER",
        instance_from_str=lambda words: several(words, kind, option)[0],
        is_instance=lambda value: value is None or isinstance(value, int | float),
        str_from_instance=lambda value: [_shown(value)],
    )


def quantities(kind: Quantity, option: str, *, words: int = 1) -> "PrimitiveConstructorSpec[tuple[float, ...] | None]":
    """The same for several: in one word, "20 mm, -35 mm", or in a word each."""
    return PrimitiveConstructorSpec(
        nargs=words,
        metavar=" ".join(name.upper() for name in kind.names) if words > 1 else f'"{", ".join([kind.example] * len(kind.names))}"',
        instance_from_str=lambda given: several(given, kind, option) if words > 1 else listed(given[0], kind, option),
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [", ".join(map(_shown, value or (None,)))],
    )


def listed(text: str, kind: Quantity, option: str) -> tuple[float, ...]:
    """The SI values of "20 mm, -35 mm". Raises InputError."""
    return several([part.strip() for part in text.replace(";", ",").split(",")], kind, option)


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
