"""The cross-section a camera would see, and its least-squares fit, compiled by numba on first use and cached.

A section is a polyline of four corners, blurred by two boxes; see `weldsim.seam.profile.section` for its coordinates and
`weldsim.seam.profile.shape` for its unknowns.

Import this module inside functions only: it brings numba in, which takes long.
"""

from typing import no_type_check

import numba
import numpy as np

from weldsim.seam.profile.section import EDGE, NARROWEST, SHARPEST
from weldsim.seam.profile.shape import (
    BLUR,
    BLUR_PRIOR,
    DELTA,
    FLOOR_PRIOR,
    HIGH,
    LOW,
    SLENDER_PRIOR,
    TAPER,
    TAPER_PRIOR,
    UNIT,
)

_jit = numba.njit(cache=True, nogil=True, error_model="numpy")
PRIORS = 4  # residuals of floor, slenderness, taper and blur, after those of the data
UNKNOWNS = 7
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-6, 1e6
STUCK = 10.0  # a damping under which a step that gains nothing says that there is nothing to gain
SMALL_GAIN = (1e-8, 1e-2)  # of the cost: absolute, and over the cost


@_jit
@no_type_check
def corners(middle, width, depth, floor, lean, step, shear, v, bend):
    """Corners of what is seen of a section under a shear: their places v (4,) [m] from the left lip to the right one, and the
    change of slope at each, bend (4,). Returns the depth left of the section [m]."""
    left, right = middle + width / 2 + step / 2 * shear, middle - width / 2 - step / 2 * shear
    half = max(floor * width, EDGE) / 2
    centre = middle + lean - depth * shear
    bl, br = centre + half, centre - half
    # A wall steeper than the sight line is hidden: its edge becomes a jump onto what lies behind it.
    to_right, to_left, span = max(br - right, EDGE), max(left - bl, EDGE), left - right
    dl = step / 2 + (depth - step / 2) * min(span / to_right, 1.0) if br > left else depth
    dr = -step / 2 + (depth + step / 2) * min(span / to_left, 1.0) if bl < right else depth
    bl = min(max(bl, right + 2 * EDGE), left - EDGE)
    br = min(max(br, right + EDGE), left - 2 * EDGE)
    bl = max(bl, br + EDGE)
    v[0], v[1], v[2], v[3] = left, bl, br, right
    first = (dl + step / 2) / max(left - bl, EDGE)
    second = (dr - dl) / max(bl - br, EDGE)
    third = (step / 2 - dr) / max(br - right, EDGE)
    bend[0], bend[1], bend[2], bend[3] = first, second - first, third - second, -third
    return -step / 2


@_jit
@no_type_check
def blurred(v, bend, wide, share, x):
    """What a corner adds at x to a polyline averaged over two boxes, `wide` and `share` times it wide: max(v - x, 0) blurred,
    and its slopes in v, in `wide` and in `share`. A ramp averaged over two boxes is a second difference of cubes."""
    narrow = share * wide
    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    scale = 1.0 / (wide * narrow)
    y = v - x
    a, b, c, d = max(y + outer, 0.0), max(y + inner, 0.0), max(y - inner, 0.0), max(y - outer, 0.0)
    aa, bb, cc, dd = a * a, b * b, c * c, d * d
    ramp = (a * aa - b * bb - c * cc + d * dd) * (scale / 6)
    slope = (aa - bb - cc + dd) * (scale / 2)
    over, under = (aa - dd) * (scale / 4), (bb - cc) * (scale / 4)
    widening = over * (1 + share) - under * (1 - share) - 2 * ramp / wide
    tapering = (over + under) * wide - ramp / share
    return ramp, slope, widening, tapering


@_jit
@no_type_check
def image(shape, x, shear, out, change):
    """Apparent depth out (g, w) [m] of a section at x (w,) [m] under each shear (g,), and its change as the section moves to
    the left (g, w).

    Args:
        shape: (8,) middle, width, depth [m], floor, lean, step, blur [m], taper.
    """
    middle, width, depth, floor, lean, step, blur, taper = shape
    v, bend = np.empty(4), np.empty(4)
    share = max(taper, NARROWEST)
    for g in range(len(shear)):
        level = corners(middle, width, depth, floor, lean, step, shear[g], v, bend)
        wide = max(blur * np.sqrt(1.0 + shear[g] * shear[g]), SHARPEST)
        out[g] = level
        change[g] = 0.0
        for c in range(4):
            for k in range(len(x)):
                ramp, slope, _, _ = blurred(v[c], bend[c], wide, share, x[k])
                out[g, k] += bend[c] * ramp
                change[g, k] += bend[c] * slope


@_jit
@no_type_check
def _seen(theta, step, shear, v, bend):
    middle, width, depth, floor, lean = theta[0], theta[1], theta[2], theta[3], theta[4]
    return corners(middle, width, depth, floor, lean * (1 - floor) * width / 2, step, shear, v, bend)


@_jit
@no_type_check
def predict(theta, step, x, shear, depth, jacobian):
    """Depths (g, w) [m] at lateral places x (g, w) [m] under each shear (g,), and their Jacobian (7, g, w) in UNITs.

    Blurring is linear, so only the corners are differentiated by differences; what follows from them is exact.
    """
    v0, bend0, v, bend = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    changed, moved, other = np.empty((BLUR, 4)), np.empty((BLUR, 4)), theta.copy()
    share = max(theta[TAPER], NARROWEST)
    jacobian[:] = 0.0
    for g in range(len(shear)):
        stretch = np.sqrt(1.0 + shear[g] * shear[g])
        wide = max(theta[BLUR] * stretch, SHARPEST)
        level = _seen(theta, step, shear[g], v0, bend0)
        for p in range(BLUR):
            other[p] = theta[p] + DELTA * UNIT[p]
            _seen(other, step, shear[g], v, bend)
            other[p] = theta[p]
            for c in range(4):  # how the corner's bend changes, and its bend times how it moves
                changed[p, c] = (bend[c] - bend0[c]) / DELTA
                moved[p, c] = bend0[c] * (v[c] - v0[c]) / DELTA
        depth[g] = level
        for c in range(4):
            for k in range(x.shape[1]):
                ramp, slope, widening, tapering = blurred(v0[c], bend0[c], wide, share, x[g, k])
                depth[g, k] += bend0[c] * ramp
                for p in range(BLUR):
                    jacobian[p, g, k] += changed[p, c] * ramp + moved[p, c] * slope
                jacobian[BLUR, g, k] += bend0[c] * widening * stretch * UNIT[BLUR]
                jacobian[TAPER, g, k] += bend0[c] * tapering * UNIT[TAPER]


@_jit
@no_type_check
def terms(theta, step, x, shear, seen, root, white, sharp, residual, jacobian):
    """Whitened residuals (g w + PRIORS,) and their Jacobian (7, g w + PRIORS) in UNITs, the priors' last.

    Args:
        x, seen, root: (g, w) places [m], depths [m] and roots of weights.
        white: (w, w) the transpose of what makes the noise of cells independent; (0, 0) where it is taken to be so.
        sharp: how much likelier no blur is than a wide one, log likelihood.
    """
    views, w = x.shape
    depth, slopes = np.empty((views, w)), np.empty((UNKNOWNS, views, w))
    predict(theta, step, x, shear, depth, slopes)
    for g in range(views):
        for k in range(w):
            depth[g, k] = (depth[g, k] - seen[g, k]) * root[g, k]
            for p in range(UNKNOWNS):
                slopes[p, g, k] *= root[g, k]
    at = views * w
    if len(white):
        residual[:at] = np.dot(depth, white).ravel()
        jacobian[:, :at] = np.dot(slopes.reshape(UNKNOWNS * views, w), white).reshape(UNKNOWNS, at)
    else:
        residual[:at] = depth.ravel()
        jacobian[:, :at] = slopes.reshape(UNKNOWNS, at)
    jacobian[:, at:] = 0.0
    residual[at] = theta[3] / FLOOR_PRIOR
    residual[at + 1] = np.log(theta[2] / theta[1] / SLENDER_PRIOR[0]) / SLENDER_PRIOR[1]
    residual[at + 2] = (theta[TAPER] - TAPER_PRIOR[0]) / TAPER_PRIOR[1]
    blur, turn = theta[BLUR], np.sqrt(theta[BLUR] * theta[BLUR] + BLUR_PRIOR * BLUR_PRIOR)
    residual[at + 3] = np.sqrt(2.0 * sharp) * blur / turn
    jacobian[3, at] = UNIT[3] / FLOOR_PRIOR
    jacobian[2, at + 1] = UNIT[2] / theta[2] / SLENDER_PRIOR[1]
    jacobian[1, at + 1] = -UNIT[1] / theta[1] / SLENDER_PRIOR[1]
    jacobian[TAPER, at + 2] = UNIT[TAPER] / TAPER_PRIOR[1]
    jacobian[BLUR, at + 3] = UNIT[BLUR] * np.sqrt(2.0 * sharp) * BLUR_PRIOR * BLUR_PRIOR / (turn * turn * turn)


@_jit
@no_type_check
def _step(gram, gradient, held, damping, move):
    """The damped Gauss-Newton step into move (7,), by Cholesky's decomposition; unknowns held stay."""
    lower = np.zeros((UNKNOWNS, UNKNOWNS))
    for i in range(UNKNOWNS):
        for j in range(i + 1):
            value = 0.0 if held[i] or held[j] else gram[i, j]
            if i == j:
                value = 1.0 if held[i] else value * (1.0 + damping) + 1e-9
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(max(value, 1e-12)) if i == j else value / lower[j, j]
    for i in range(UNKNOWNS):
        value = 0.0 if held[i] else -gradient[i]
        for k in range(i):
            value -= lower[i, k] * move[k]
        move[i] = value / lower[i, i]
    for i in range(UNKNOWNS - 1, -1, -1):
        value = move[i]
        for k in range(i + 1, UNKNOWNS):
            value -= lower[k, i] * move[k]
        move[i] = value / lower[i, i]


@_jit
@no_type_check
def solve(theta, free, step, x, shear, seen, root, white, sharp, most, costs):
    """The best section near each start, by Levenberg and Marquardt's method within LOW and HIGH; theta (s, 7) in place.

    Args:
        free: (7,).  x to sharp: as in `terms`.  most: turns.  costs: (s,) half the sums of squares.
    """
    size = x.size + PRIORS
    residual, new_residual = np.empty(size), np.empty(size)
    jacobian, new_jacobian = np.empty((UNKNOWNS, size)), np.empty((UNKNOWNS, size))
    gram, gradient, move = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    held, trial = np.empty(UNKNOWNS, np.bool_), np.empty(UNKNOWNS)
    for s in range(len(theta)):
        one = theta[s]
        terms(one, step, x, shear, seen, root, white, sharp, residual, jacobian)
        cost, damping, fresh = 0.5 * (residual * residual).sum(), FIRST_DAMPING, True
        for _ in range(most):
            if fresh:
                gram = np.dot(jacobian, jacobian.T)
                gradient = np.dot(jacobian, residual)
            for i in range(UNKNOWNS):
                out = (one[i] <= LOW[i] and gradient[i] > 0) or (one[i] >= HIGH[i] and gradient[i] < 0)
                held[i] = out or not free[i]
            _step(gram, gradient, held, damping, move)
            for i in range(UNKNOWNS):
                trial[i] = min(max(one[i] + move[i] * UNIT[i], LOW[i]), HIGH[i])
            terms(trial, step, x, shear, seen, root, white, sharp, new_residual, new_jacobian)
            new_cost = 0.5 * (new_residual * new_residual).sum()
            fresh = new_cost < cost
            if fresh:
                gain, cost = cost - new_cost, new_cost
                one[:] = trial
                residual, new_residual, jacobian, new_jacobian = new_residual, residual, new_jacobian, jacobian
                damping = max(damping * 0.2, LEAST_DAMPING)
                if gain < SMALL_GAIN[0] * (1 + SMALL_GAIN[1] * cost):
                    break
            else:
                damping = min(damping * 6, MOST_DAMPING)
                if damping > STUCK:
                    break
        costs[s] = cost
