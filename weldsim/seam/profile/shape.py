"""Least-squares fits of a cross-section to mean sections, from many starts at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.profile.section import NARROWEST, SHARPEST, Section, footprint, turns, vertices
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
    """Depths [m] at lateral places x [m] under each shear, and their Jacobian in UNITs.

    Blurring is linear, so only the corners are differentiated by differences; what follows from them is exact.
    """
    from weldsim.seam.profile import native

    s = len(theta)
    moves = np.concatenate([np.zeros((1, 7)), DELTA * np.diag(UNIT)[:BLUR]])
    v, d = vertices(_corners((theta + moves[:, None]).reshape(-1, 7), step), shear)
    kinks = turns(v, d)
    v, kinks = v.reshape(BLUR + 1, s, *v.shape[1:]), kinks.reshape(BLUR + 1, s, *kinks.shape[1:])
    stretch = footprint(shear)
    wide, share = np.maximum(theta[:, BLUR, None] * stretch, SHARPEST), np.maximum(theta[:, TAPER], NARROWEST)
    # For each corner: its turn, how that changes with the unknowns, and its turn times how it moves.
    turn, changed = kinks[0], (kinks[1:] - kinks[0]) / DELTA
    moved = turn * (v[1:] - v[0]) / DELTA
    depth = np.repeat(d.reshape(BLUR + 1, s, *d.shape[1:])[0, ..., :1], x.shape[1], axis=2)
    jacobian = np.zeros((s, 7, *depth.shape[1:]))
    native.blurred(v[0], x, wide, share, turn, changed, moved, depth, jacobian)
    jacobian[:, BLUR] *= stretch[:, None] * UNIT[BLUR]
    jacobian[:, TAPER] *= UNIT[TAPER]
    return depth, jacobian


def _corners(theta: Float[ndarray, "s 7"], step: float) -> Float[ndarray, "s 6"]:
    middle, width, depth, floor, lean = theta.T[:BLUR]
    return np.stack([middle, width, depth, floor, lean * (1 - floor) * width / 2, np.full_like(middle, step)], axis=1)


def terms(theta: Float[ndarray, "s 7"], views: Views, step: float) -> tuple[Float[ndarray, "s k"], Float[ndarray, "s 7 k"]]:
    """Whitened residuals and their Jacobian in UNITs, those of the priors last."""
    depth, jacobian = predict(theta, step, views.at, views.shear)
    root, s = np.sqrt(views.weight), len(theta)
    w = views.depth.shape[1]  # one product of tall matrices costs less than many of small ones
    data = (((depth - views.depth) * root).reshape(-1, w) @ views.white.T).reshape(s, -1)
    slopes = ((jacobian * root).reshape(-1, w) @ views.white.T).reshape(s, 7, -1)
    slender = np.log(theta[:, 2] / theta[:, 1] / SLENDER_PRIOR[0]) / SLENDER_PRIOR[1]
    prior = np.stack([theta[:, 3] / FLOOR_PRIOR, slender, (theta[:, TAPER] - TAPER_PRIOR[0]) / TAPER_PRIOR[1]], axis=1)
    steep = np.zeros((s, 7, 3))
    steep[:, 3, 0] = UNIT[3] / FLOOR_PRIOR
    steep[:, 2, 1] = UNIT[2] / theta[:, 2] / SLENDER_PRIOR[1]
    steep[:, 1, 1] = -UNIT[1] / theta[:, 1] / SLENDER_PRIOR[1]
    steep[:, TAPER, 2] = UNIT[TAPER] / TAPER_PRIOR[1]
    return np.concatenate([data, prior], axis=1), np.concatenate([slopes, steep], axis=2)


def solve(theta: Float[ndarray, "s 7"], free: Bool[ndarray, "7"], views: Views, step: float, most: int = 15) -> list[Solution]:
    """The best section near each start, by Levenberg and Marquardt's method within LOW and HIGH, all starts at once."""
    theta = np.clip(theta, LOW, HIGH)
    damping = np.full(len(theta), 1e-2)
    residual, jacobian = terms(theta, views, step)
    cost = 0.5 * (residual**2).sum(axis=1)
    for _ in range(most):
        gram = jacobian @ jacobian.transpose(0, 2, 1)
        gradient = (jacobian @ residual[..., None])[..., 0]
        held = ~free | ((theta <= LOW) & (gradient > 0)) | ((theta >= HIGH) & (gradient < 0))
        gram[held[:, :, None] | held[:, None, :]] = 0.0
        scale = np.einsum("spp->sp", gram)
        system = gram + np.where(held, 1.0, damping[:, None] * scale + 1e-9)[:, :, None] * np.eye(7)
        move = np.linalg.solve(system, np.where(held, 0.0, -gradient)[..., None])[..., 0]
        trial = np.clip(theta + move * UNIT, LOW, HIGH)
        new_residual, new_jacobian = terms(trial, views, step)
        new_cost = 0.5 * (new_residual**2).sum(axis=1)
        better = new_cost < cost
        gain = np.where(better, cost - new_cost, 0.0)
        theta[better], residual[better], jacobian[better] = trial[better], new_residual[better], new_jacobian[better]
        cost = np.where(better, new_cost, cost)
        damping = np.where(better, np.maximum(damping * 0.2, 1e-6), np.minimum(damping * 6, 1e6))
        if (gain[better] < 1e-3 * (1 + 1e-2 * cost[better])).all() and (better | (damping > 10)).all():
            break
    return [Solution(each, float(c), free) for each, c in zip(theta, cost, strict=True)]
