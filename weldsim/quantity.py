"""Types for numbers with a unit: `Metre` is a float in metres.

The alias only carries the unit's name, so stages can declare it without parsing text; `weldsim.config` reads it to
accept "12 mm" where a `Metre` stands. In memory every quantity is SI.
"""

import math
from collections.abc import Mapping
from typing import Annotated, get_args, get_type_hints

from weldsim.errors import ConfigError

Metre = Annotated[float, "m"]
Radian = Annotated[float, "rad"]
Second = Annotated[float, "s"]
MetrePerSecond = Annotated[float, "m/s"]
RadianPerMetre = Annotated[float, "rad/m"]
RadianPerSecond = Annotated[float, "rad/s"]
Pixel = Annotated[float, "px"]

REACH = (-3.0, 3.0)
"""[m] of any place in a cell: a bare number beyond was meant as millimetres."""
SIZE = (0.0, 3.0)
"""[m] of any size of a part: likewise."""
TURN = (-2 * math.pi, 2 * math.pi)
"""[rad] of any angle: a bare number beyond was meant as degrees."""


def require_within(config: object, ranges: Mapping[str, tuple[float, float]], table: str = "") -> None:
    """Nothing, when every named field of `config` lies in its range, ends included; SI.

    A range is wide: it holds whatever could be meant, and keeps out what would run for ever, fill the memory or be no number
    of use, a figure in millimetres or degrees written without its unit above all.

    Raises:
        ConfigError: one that does not; `data`: key, value, limit.
    """
    for name, (low, high) in ranges.items():
        value = getattr(config, name)
        if not low <= value <= high:
            key = f"{table}.{name}".lstrip(".")
            units = _units(get_type_hints(type(config), include_extras=True)[name])
            unit = "".join(f" {name}" for name in units)
            raise ConfigError(
                f"{key} = {value:g}{unit} is outside {low:g} to {high:g}{unit}",
                key=key,
                value=value,
                limit=(low, high),
                **({"unit": units[0]} if units else {}),
            )


def _units(hint: object) -> tuple[str, ...]:
    """The unit that a type carries, also where it may be None; () for a plain number."""
    if marks := getattr(hint, "__metadata__", ()):
        return (str(marks[0]),)
    return next(filter(None, map(_units, get_args(hint))), ())
