"""Types for numbers with a unit: `Metre` is a float in metres.

The alias only carries the unit's name, so stages can declare it without parsing text; `weldsim.config` reads it to
accept "12 mm" where a `Metre` stands. In memory every quantity is SI.
"""

from collections.abc import Mapping
from typing import Annotated

from weldsim.errors import ConfigError

Metre = Annotated[float, "m"]
Radian = Annotated[float, "rad"]
Second = Annotated[float, "s"]
MetrePerSecond = Annotated[float, "m/s"]
RadianPerMetre = Annotated[float, "rad/m"]
RadianPerSecond = Annotated[float, "rad/s"]
Pixel = Annotated[float, "px"]


def require_within(config: object, ranges: Mapping[str, tuple[float, float]], table: str = "") -> None:
    """Nothing, when every named field of `config` lies in its range, ends included; SI.

    Raises:
        ConfigError: one that does not; `data`: key, value, limit.
    """
    for name, (low, high) in ranges.items():
        value = getattr(config, name)
        if not low <= value <= high:
            key = f"{table}.{name}".lstrip(".")
            raise ConfigError(f"{key} = {value:g} is outside {low:g} to {high:g}", key=key, value=value, limit=(low, high))
