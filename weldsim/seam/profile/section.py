"""The cross-section a camera would see of a groove: a trapezoid or V sheared by the sight line and blurred by a window.

Coordinates: x to the left on the parent surface, where the sight line meets it; depth below it, in the scale in which
planes stay planes (inverse depth). A sheared trapezoid stays piecewise linear there, and a stereo camera's support
window blurs it symmetrically: so the midpoint of the lips is not drawn towards either wall, as a centroid is.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

EDGE = 5e-5  # [m] width given to a vertical wall
SHARPEST = 4e-4  # [m] a narrower window is not told from none by cells of half a millimetre
NARROWEST = 0.05  # of the wider box
LEVELS = 12  # shears at which a whole image is evaluated; between them it is interpolated


@dataclass(frozen=True, kw_only=True)
class Section:
    """A groove's cross-section.

    Attributes:
        middle: midpoint of the lips [m].  width: between the lips [m].  depth: of the bottom [m].
        floor: width of the bottom over `width`, 0 = V, towards 1 = square.
        lean: how far the bottom's middle is to the left of the lips' [m].
        blur: width of the camera's support window on a surface that faces it [m].
        taper: of the blur: 0 = a box, as where the groove runs along the image's rows or columns, 1 = a triangle, at 45 deg.
        step: how much higher the left lip lies than the right one [m]; depths count from the middle between them.
    """

    middle: float
    width: float
    depth: float
    floor: float
    lean: float
    blur: float
    step: float = 0.0
    taper: float = 0.5

    def image(self, x: Float[ndarray, "w"], shear: Float[ndarray, "m"]) -> tuple[Float[ndarray, "m w"], Float[ndarray, "m w"]]:
        """Apparent depth [m] at x [m] for every shear, and how it changes as the section moves to the left.

        Args:
            shear: (m,) how far the sight line drifts to the left for each metre inward.
        """
        from weldsim.seam.profile import native_section

        low, high = float(shear.min()), float(shear.max())
        levels = 1 if high - low < 1e-4 else LEVELS
        table = np.linspace(low, high, levels)
        depth, change = np.empty((2, levels, len(x)))
        shape = np.array([self.middle, self.width, self.depth, self.floor, self.lean, self.step, self.blur, self.taper])
        native_section.image(shape, np.ascontiguousarray(x, dtype=float), table, depth, change)
        if levels == 1:
            return np.repeat(depth, len(shear), axis=0), np.repeat(change, len(shear), axis=0)
        place = (shear - low) / (high - low) * (levels - 1)
        whole = np.minimum(place.astype(int), levels - 2)
        u = (place - whole)[:, None]
        return depth[whole] * (1 - u) + depth[whole + 1] * u, change[whole] * (1 - u) + change[whole + 1] * u


def footprint(shear: Float[ndarray, "*k"]) -> Float[ndarray, "*k"]:
    """How much wider a camera's window lies on the surface, across the groove, than on a surface that faces the camera.

    A window as wide as high in the image is stretched by 1 / cos(tilt) towards the tilt: across the groove by
    sqrt(1 + shear^2).
    """
    return np.sqrt(1.0 + shear * shear)
