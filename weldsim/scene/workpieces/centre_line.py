"""Centre lines of grooves in a plate: planar curves in closed form, parametrised by x, from one plate edge to the other."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import REACH, Metre, require_within

FAR = (0.0, 10.0)  # [m] a bare number beyond was meant as millimetres; a radius of 10 m is straight on any plate
RADII, WAVELENGTHS = (1e-3, FAR[1]), (0.01, FAR[1])  # [m]
FARTHEST = 2.0  # [m] of the line from the plate's middle: no plate is larger


@dataclass(frozen=True)
class CentreLineConfig:
    """Where a groove runs over its plate, seen from above.

    Attributes:
        shape: "straight"; "arc", a circular arc that bulges towards +y; "s", one sine that bends both ways.
        radius: of the arc, or the smallest radius of the sine [m]; not used by a straight line.
        wavelength: of the sine [m].
        offset: of the whole line towards +y [m].
    """

    shape: Literal["straight", "arc", "s"] = "straight"
    radius: Metre = 0.10
    wavelength: Metre = 0.30
    offset: Metre = 0.0

    def __post_init__(self) -> None:
        require_within(self, {"radius": FAR, "wavelength": FAR, "offset": REACH}, "centre_line")


class CentreLine(ABC):
    """A planar curve y(x) with its slope and arc length in closed form."""

    @abstractmethod
    def y(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        """Height of the line [m] at x [m]."""

    @abstractmethod
    def slope(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        """dy/dx at x [m]."""

    @abstractmethod
    def arc_length(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        """Signed arc length [m] from x = 0."""

    @property
    @abstractmethod
    def smallest_radius(self) -> float:
        """Smallest radius of curvature [m]; infinite for a straight line."""

    def tangents(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n 2"]:
        """Unit tangents, towards +x."""
        slope = self.slope(x)
        return np.stack([np.ones_like(slope), slope], axis=1) / np.hypot(1.0, slope)[:, None]


@final
@dataclass(frozen=True)
class StraightLine(CentreLine):
    """y = offset."""

    offset: float

    def y(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return np.full_like(x, self.offset)

    def slope(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return np.zeros_like(x)

    def arc_length(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return x.copy()

    @property
    def smallest_radius(self) -> float:
        return np.inf


@final
@dataclass(frozen=True)
class CircularArc(CentreLine):
    """A circle of `radius` about (0, centre_y), its upper half."""

    radius: float
    centre_y: float

    def y(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return self.centre_y + np.sqrt(self.radius**2 - x**2)

    def slope(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return -x / np.sqrt(self.radius**2 - x**2)

    def arc_length(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return self.radius * np.arcsin(x / self.radius)

    @property
    def smallest_radius(self) -> float:
        return self.radius


@final
@dataclass(frozen=True)
class SineLine(CentreLine):
    """y = offset + amplitude sin(2 pi x / wavelength); its curvature at the crest is amplitude (2 pi / wavelength)^2."""

    amplitude: float
    wavelength: float
    offset: float

    @property
    def wavenumber(self) -> float:
        return 2 * np.pi / self.wavelength

    def y(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return self.offset + self.amplitude * np.sin(self.wavenumber * x)

    def slope(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        return self.amplitude * self.wavenumber * np.cos(self.wavenumber * x)

    def arc_length(self, x: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
        from scipy.special import ellipeinc  # slow to load, and no other line needs it

        # sqrt(1 + a^2 cos^2) = sqrt(1 + a^2) sqrt(1 - m sin^2) with m = a^2 / (1 + a^2): an elliptic integral of the second kind.
        steepest = (self.amplitude * self.wavenumber) ** 2
        return np.sqrt(1 + steepest) / self.wavenumber * ellipeinc(self.wavenumber * x, steepest / (1 + steepest))

    @property
    def smallest_radius(self) -> float:
        return 1 / (self.amplitude * self.wavenumber**2)


def make_centre_line(config: CentreLineConfig, length: float) -> CentreLine:
    """The centre line over a plate of `length` [m] along x, an arc placed so that it is centred on `offset`.

    Raises:
        SceneError: a radius or wavelength outside RADII or WAVELENGTHS, or an arc too tight to span the plate.
    """
    if abs(config.offset) > FARTHEST:
        raise SceneError(
            f"centre line: offset {config.offset * 1e3:g} mm must be at most {FARTHEST * 1e3:g} mm", key="offset", limit=FARTHEST
        )
    if config.shape == "straight":
        return StraightLine(config.offset)
    for key, limits in (("radius", RADII), ("wavelength", WAVELENGTHS)):
        value, (low, high) = getattr(config, key), limits
        if (key == "radius" or config.shape == "s") and not low <= value <= high:
            raise SceneError(
                f"centre line: {key} {value * 1e3:g} mm must be {low * 1e3:g} to {high * 1e3:g} mm", key=key, limit=limits
            )
    if config.shape == "arc":
        if config.radius <= length / 2:
            raise SceneError(
                f"centre line: an arc of radius {config.radius * 1e3:g} mm cannot span a plate {length * 1e3:g} mm long;"
                f" use a radius over {length * 500:g} mm",
                key="radius",
                limit=length / 2,
            )
        lowest = np.sqrt(config.radius**2 - (length / 2) ** 2)
        return CircularArc(config.radius, config.offset - (config.radius + lowest) / 2)
    return SineLine((config.wavelength / (2 * np.pi)) ** 2 / config.radius, config.wavelength, config.offset)
