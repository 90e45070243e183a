"""Least-squares fits of a cross-section to mean sections, from many starts at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.profile.section import Section
from weldsim.seam.profile.views import Views

# Unknowns: middle, width, depth [m]; floor; lean over the most that leaves no wall overhanging; blur [m]; taper.
LEAN, BLUR, TAPER = 4, 5, 6
LOW = np.array([-0.02, 0.002, 1e-4, 0.0, -1.0, 0.0, 0.05])
HIGH = np.array([0.02, 0.045, 0.1, 1.0, 1.0, 0.015, 1.0])
UNIT = np.array([1e-3, 1e-3, 1e-3, 0.1, 0.1, 1e-3, 0.2])
DELTA = 1e-4  # of a unit, for the corners' differences
FLOOR_PRIOR = 0.3  # standard deviation of the floor
SLENDER_PRIOR = (0.6, 0.3)  # depth over width: 0.6 times or over e^0.3; grooves for welding are opened to 60 to 90 deg
TAPER_PRIOR = (0.5, 0.2)
SHARP, BLUR_PRIOR = 16.0, 0.0005  # log likelihood of no blur over one wider than so many metres, where there is no noise either


@dataclass(frozen=True, eq=False)
class Solution:
    """Unknowns theta (7,), half the sum of squares they leave, and which of them were free."""

    theta: Float[ndarray, "7"]
    cost: float
    free: Bool[ndarray, "7"]


def unknowns(section: Section) -> Float[ndarray, "7"]:
    """The unknowns of a section."""
    most = max((1 - section.floor) * section.width / 2, 1e-4)
    lean = float(np.clip(section.lean / most, -1, 1))
    return np.array([section.middle, section.width, section.depth, section.floor, lean, section.blur, section.taper])


def section_of(theta: Float[ndarray, "7"], step: float) -> Section:
    """The section of a set of unknowns; `step` [m] is not one of them."""
    middle, width, depth, floor, lean, blur, taper = theta.tolist()
    most = (1 - floor) * width / 2
    return Section(middle=middle, width=width, depth=depth, floor=floor, lean=lean * most, blur=blur, taper=taper, step=step)


def twin(theta: Float[ndarray, "*s 7"]) -> Float[ndarray, "*s 7"]:
    """Unknowns of another section that looks much the same: its walls reach as far sideways as this one's blur, and its
    blur as far as this one's walls.

    A wall is a step averaged over its own reach, and the blur averages it once more: in which order is not to be seen.
    So a V without blur is a square slot of half its width under a window of that width. Between the two only priors decide.
    """
    width, floor, blur = (theta[..., k] for k in (1, 3, BLUR))
    reach = (1 - floor) * width / 2
    middle = width - reach  # between the walls, half way down
    other = theta.copy()
    other[..., 1] = middle + blur
    other[..., 3] = np.maximum(middle - blur, 0.0) / other[..., 1]
    other[..., BLUR] = reach
    return np.clip(other, LOW, HIGH)


def predict(
    theta: Float[ndarray, "s 7"], step: float, x: Float[ndarray, "g w"], shear: Float[ndarray, "g"]
) -> tuple[Float[ndarray, "s g w"], Float[ndarray, "s 7 g w"]]:
    """Depths [m] at lateral places x [m] under each shear, and their Jacobian in UNITs."""
    from weldsim.seam.profile import native_section

    depth, jacobian = np.empty((len(theta), *x.shape)), np.empty((len(theta), 7, *x.shape))
    for each, some, slopes in zip(theta, depth, jacobian, strict=True):
        native_section.predict(each, step, x, shear, some, slopes)
    return depth, jacobian


def terms(theta: Float[ndarray, "7"], views: Views, step: float) -> tuple[Float[ndarray, "k"], Float[ndarray, "7 k"]]:
    """Whitened residuals and their Jacobian in UNITs, those of the priors last."""
    from weldsim.seam.profile import native_section

    size = views.depth.size + native_section.PRIORS
    residual, jacobian = np.empty(size), np.empty((7, size))
    native_section.terms(theta, step, *_told(views), residual, jacobian)
    return residual, jacobian


def solve(theta: Float[ndarray, "s 7"], free: Bool[ndarray, "7"], views: Views, step: float, most: int = 15) -> list[Solution]:
    """The best section near each start, by Levenberg and Marquardt's method within LOW and HIGH."""
    from weldsim.seam.profile import native_section

    theta, cost = np.clip(theta, LOW, HIGH), np.empty(len(theta))
    native_section.solve(theta, free, step, *_told(views), most, cost)
    return [Solution(each, float(c), free) for each, c in zip(theta, cost, strict=True)]


def _told(views: Views) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray, float]:
    """What the views tell, as the compiled fit takes it."""
    white = np.ascontiguousarray(views.white.T)
    return views.at, views.shear, views.depth, np.sqrt(views.weight), white, SHARP if views.quiet else 0.0
