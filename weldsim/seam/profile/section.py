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
        low, high = float(shear.min()), float(shear.max())
        levels = 1 if high - low < 1e-4 else LEVELS
        table = np.linspace(low, high, levels)
        v, d = vertices(np.array([[self.middle, self.width, self.depth, self.floor, self.lean, self.step]]), table)
        slopes = turns(v, d)
        ramp, ramp_slope, _, _ = ramps(v[..., None] - x, self.blur * footprint(table)[None], np.array([self.taper]))
        depth = d[0, :, :1] + np.einsum("gj,gjw->gw", slopes[0], ramp[0])
        change = np.einsum("gj,gjw->gw", slopes[0], ramp_slope[0])
        if levels == 1:
            return np.repeat(depth, len(shear), axis=0), np.repeat(change, len(shear), axis=0)
        place = (shear - low) / (high - low) * (levels - 1)
        whole = np.minimum(place.astype(int), levels - 2)
        u = (place - whole)[:, None]
        return depth[whole] * (1 - u) + depth[whole + 1] * u, change[whole] * (1 - u) + change[whole + 1] * u


def vertices(shape: Float[ndarray, "s 6"], shear: Float[ndarray, "g"]) -> tuple[Float[ndarray, "s g 4"], Float[ndarray, "s g 4"]]:
    """Corners (x, depth) [m] of what is seen of each section under each shear, from the left lip to the right one.

    Args:
        shape: (s, 6) middle, width, depth, floor, lean, step of each section.
    """
    middle, width, depth, floor, lean, step = (column[:, None] for column in shape.T)
    left, right = middle + width / 2 + step / 2 * shear, middle - width / 2 - step / 2 * shear
    half = np.maximum(floor * width, EDGE) / 2
    centre = middle + lean - depth * shear
    bl, br = centre + half, centre - half
    # A wall steeper than the sight line is hidden: its edge becomes a jump onto what lies behind it.
    to_right, to_left = np.maximum(br - right, EDGE), np.maximum(left - bl, EDGE)
    span = left - right
    dl = np.where(br > left, step / 2 + (depth - step / 2) * np.minimum(span / to_right, 1.0), depth)
    dr = np.where(bl < right, -step / 2 + (depth + step / 2) * np.minimum(span / to_left, 1.0), depth)
    bl = np.clip(bl, right + 2 * EDGE, left - EDGE)
    br = np.clip(br, right + EDGE, left - 2 * EDGE)
    bl = np.maximum(bl, br + EDGE)
    level = np.zeros_like(bl)
    return np.stack([left + 0 * bl, bl, br, right + 0 * bl], axis=-1), np.stack(
        [level - step / 2, dl, dr, level + step / 2], axis=-1
    )


def turns(v: Float[ndarray, "*b 4"], d: Float[ndarray, "*b 4"]) -> Float[ndarray, "*b 4"]:
    """Change of slope of a polyline at each vertex; it is level beyond its ends."""
    slopes = np.diff(d, axis=-1) / np.maximum(v[..., :-1] - v[..., 1:], EDGE)
    flat = np.zeros((*slopes.shape[:-1], 1))
    return np.diff(np.concatenate([flat, slopes, flat], axis=-1), axis=-1)


def footprint(shear: Float[ndarray, "*k"]) -> Float[ndarray, "*k"]:
    """How much wider a camera's window lies on the surface, across the groove, than on a surface that faces the camera.

    A window as wide as high in the image is stretched by 1 / cos(tilt) towards the tilt: across the groove by
    sqrt(1 + shear^2).
    """
    return np.sqrt(1.0 + shear * shear)


def ramps(
    y: Float[ndarray, "s g *k"], blur: Float[ndarray, "s g"], taper: Float[ndarray, "s"]
) -> tuple[Float[ndarray, "s g *k"], Float[ndarray, "s g *k"], Float[ndarray, "s g *k"], Float[ndarray, "s g *k"]]:
    """max(y, 0) averaged over two boxes, `blur` and `taper` times it wide; its slopes in y, in `blur` and in `taper`.

    A polyline is a sum of ramps, so this blurs it; a ramp averaged over two boxes is a second difference of cubes.
    """
    beside = [1] * (y.ndim - 2)
    wide = np.maximum(blur, SHARPEST).reshape(*blur.shape, *beside)
    share = np.maximum(taper, NARROWEST).reshape(-1, 1, *beside)
    narrow = share * wide
    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    a, b, c, d = (np.maximum(y + k, 0.0) for k in (outer, inner, -inner, -outer))
    aa, bb, cc, dd = a * a, b * b, c * c, d * d
    scale = 1 / (wide * narrow)
    ramp = (a * aa - b * bb - c * cc + d * dd) * (scale / 6)
    slope = (aa - bb - cc + dd) * (scale / 2)
    over, under = (aa - dd) * (scale / 4), (bb - cc) * (scale / 4)
    widening = over * (1 + share) - under * (1 - share) - 2 * ramp / wide
    tapering = (over + under) * wide - ramp / share
    return ramp, slope, widening, tapering
