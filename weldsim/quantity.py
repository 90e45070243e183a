"""Types for numbers with a unit: `Metre` is a float in metres.

The alias only carries the unit's name, so stages can declare it without parsing text; `weldsim.config` reads it to
accept "12 mm" where a `Metre` stands. In memory every quantity is SI.
"""

from typing import Annotated

Metre = Annotated[float, "m"]
Radian = Annotated[float, "rad"]
Second = Annotated[float, "s"]
MetrePerSecond = Annotated[float, "m/s"]
RadianPerMetre = Annotated[float, "rad/m"]
RadianPerSecond = Annotated[float, "rad/s"]
Pixel = Annotated[float, "px"]
