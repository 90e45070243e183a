"""The cross-section a camera would see of a groove: a trapezoid or V sheared by the sight line and blurred by a window.

Coordinates: x to the left on the parent surface, where the sight line meets it; depth below it, in the scale in which
planes stay planes (inverse depth). A sheared trapezoid stays piecewise linear there, and a stereo camera's support
window blurs it symmetrically: so the midpoint of the lips is not drawn towards either wall, as a centroid is.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.optimize import least_squares

LEAN_SCORE = 3.6  # standard deviations by which a lean must stand out from block to block
FIRST_STARTS = ((4e-4, 0.1), (4e-3, 0.1), (4e-4, 0.7))  # blur [m], floor
POOR_FIT = 0.3  # a symmetric section that leaves more than this may be hiding a leaning one
LEAN_GAIN = 0.5  # a lean that halves the cost needs no vote
LIKELY_LEAN = 0.02  # of the width: the standard deviation of a lean that went unnoticed
EDGE = 5e-5  # [m] width given to a vertical wall


@dataclass(frozen=True, kw_only=True)
class Section:
    """A groove's cross-section.

    Attributes:
        middle: midpoint of the lips [m].  width: between the lips [m].  depth: of the bottom [m].
        floor: width of the bottom over `width`, 0 = V, towards 1 = square.
        lean: how far the bottom's middle is to the left of the lips' [m].
        blur: width of the camera's support window on the surface [m].
    """

    middle: float
    width: float
    depth: float
    floor: float
    lean: float
    blur: float

    def depth_at(self, x: Float[ndarray, "*k"], shear: Float[ndarray, "*k"]) -> Float[ndarray, "*k"]:
        """Apparent depth [m] at x [m] where the sight line drifts `shear` to the left for each metre inward."""
        left, right = self.middle + self.width / 2, self.middle - self.width / 2
        centre = self.middle + self.lean - self.depth * shear
        half = self.floor * self.width / 2
        bottom_left, bottom_right = centre + half, centre - half
        # A wall steeper than the sight line is hidden: its edge becomes a jump onto what lies behind it.
        depth_left = np.where(bottom_left < left, self.depth, self.depth * _ratio(left - right, bottom_right - right))
        depth_right = np.where(bottom_right > right, self.depth, self.depth * _ratio(left - right, left - bottom_left))
        bl, br = np.minimum(bottom_left, left - EDGE), np.maximum(bottom_right, right + EDGE)
        bl, br = np.maximum(bl, right + 2 * EDGE), np.minimum(br, left - 2 * EDGE)
        bl = np.maximum(bl, br + EDGE)
        dl, dr = np.minimum(depth_left, self.depth), np.minimum(depth_right, self.depth)
        vertices = [(np.full_like(bl, left), 0.0 * bl), (bl, dl), (br, dr), (np.full_like(bl, right), 0.0 * bl)]
        return _blurred(x, vertices, self.blur)


def _ratio(a: Float[ndarray, "*k"] | float, b: Float[ndarray, "*k"]) -> Float[ndarray, "*k"]:
    return np.where(b > a, a / np.maximum(b, 1e-12), 1.0)


def _blurred(x: Float[ndarray, "*k"], vertices: list[tuple[ndarray, ndarray]], blur: float) -> Float[ndarray, "*k"]:
    """A polyline (vertices from left to right, 0 outside) averaged over two boxes, `blur` and half of it wide.

    A polyline is a sum of ramps; a ramp averaged over two boxes is a second difference of cubic ramps.
    """
    wide = max(blur, 4e-4)
    narrow = wide / 2
    slopes = [(d1 - d0) / np.minimum(v1 - v0, -EDGE) for (v0, d0), (v1, d1) in pairwise(vertices)]
    changes = [slopes[0], *(b - a for a, b in pairwise(slopes)), -slopes[-1]]
    out = np.zeros(np.shape(x))
    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    for (vertex, _), change in zip(vertices, changes, strict=True):
        y = vertex - x  # ramps open to the right, where x is smaller
        ramp = _cube(y + outer) - _cube(y + inner) - _cube(y - inner) + _cube(y - outer)
        out = out - change * ramp / (wide * narrow)
    return out


def _cube(y: Float[ndarray, "*k"]) -> Float[ndarray, "*k"]:
    positive = np.maximum(y, 0.0)
    return positive * positive * positive / 6.0


NAMES = ("middle", "width", "depth", "floor", "lean", "blur")


def fit_section(
    x: Float[ndarray, "k"],
    shear: Float[ndarray, "k"],
    depth: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    start: Section,
    block: Int[ndarray, "k"],
    noise: float,
    *,
    first: bool = False,
) -> tuple[Section, float]:
    """The section that fits depths measured at x, and its middle's standard deviation [m].

    Robust weighted least squares. It is symmetric unless the data speak against that: `lean` and the lips' middle are
    nearly exchangeable under blur and noise, so a lean is believed only where block after block asks for it
    (`LEAN_SCORE`); where it is not, the deviation allows for an undetected one.

    Args:
        x, shear, depth, weight: (k,) cells of the strip; weight = how many independent looks each cell is worth.
        start: initial values.  noise: standard deviation of one look [m].
        block: (k,) which stretch of the seam each cell belongs to; noise is taken as independent between stretches.
        first: `start` is a rough guess: begin from sharp, blurred, V and square sections, and keep the best. Blur can
            stand in for a floor, so one start may end in the wrong one.
    """
    starts = [replace(start, blur=blur, floor=floor) for blur, floor in FIRST_STARTS] if first else [start]
    plain, cost = min((_solve(x, shear, depth, weight, each, noise, symmetric=True) for each in starts), key=lambda found: found[1])
    score, sigma, exchange = _lean_evidence(plain, x, shear, depth, weight, block)
    leaning = [start] if start.lean else []
    if abs(score) > LEAN_SCORE or (first and _misfit(plain, x, shear, depth, weight) > POOR_FIT):
        width = max(start.width, plain.width)
        leaning += [plain, *(replace(plain, lean=side * width, width=width, blur=4e-4, floor=0.1) for side in (0.35, -0.35))]
    if leaning:
        solved = (_solve(x, shear, depth, weight, each, noise, symmetric=False) for each in leaning)
        best, lower = min(solved, key=lambda found: found[1])
        if abs(score) > LEAN_SCORE or lower < LEAN_GAIN * cost:
            _, sigma, exchange = _lean_evidence(best, x, shear, depth, weight, block)
            return best, min(abs(exchange) * sigma, 0.1 * best.width)
    allowed = LIKELY_LEAN * plain.width
    return plain, abs(exchange) / float(np.hypot(1 / max(sigma, 1e-9), 1 / allowed))


def _misfit(
    section: Section, x: Float[ndarray, "k"], shear: Float[ndarray, "k"], depth: Float[ndarray, "k"], weight: Float[ndarray, "k"]
) -> float:
    """rms of what the section leaves over the rms of the depth."""
    left = weight @ (section.depth_at(x, shear) - depth) ** 2
    return float(np.sqrt(left / max(float(weight @ depth**2), 1e-30)))


def _lean_evidence(
    section: Section,
    x: Float[ndarray, "k"],
    shear: Float[ndarray, "k"],
    depth: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    block: Int[ndarray, "k"],
) -> tuple[float, float, float]:
    """How strongly the residuals ask for a lean: score, lean's deviation [m], shift of the middle for a unit of lean.

    The sensitivity to lean is made orthogonal to that of every other parameter; each block then votes, and the score is
    the sum of the votes over their own scatter, so that correlated noise within a block cannot pass for evidence.
    """
    deltas = {"middle": 1e-4, "width": 1e-4, "depth": 1e-4, "floor": 0.02, "blur": 1e-4, "lean": 1e-4}
    base = section.depth_at(x, shear)
    columns = [(replace(section, **{name: getattr(section, name) + d}).depth_at(x, shear) - base) / d for name, d in deltas.items()]
    others, lean = np.stack(columns[:-1], axis=1), columns[-1]
    weighted = others * weight[:, None]
    normal = others.T @ weighted
    normal[np.diag_indices_from(normal)] *= 1 + 1e-9
    shares = np.linalg.lstsq(normal, weighted.T @ lean, rcond=1e-12)[0]
    free = lean - others @ shares
    limit = 3 * max(float(np.median(np.abs(depth - base))) * 1.4826, 1e-6)
    votes = np.bincount(block, weights=weight * free * np.clip(depth - base, -limit, limit))
    votes = votes[np.bincount(block) > 0]
    scatter = float(np.sqrt((votes**2).sum()))
    strength = float((weight * free * free).sum())
    if len(votes) < 4 or scatter <= 0 or strength <= 0:
        return 0.0, float("inf"), float(-shares[0])
    return float(votes.sum()) / scatter, scatter / strength, float(-shares[0])


def _solve(
    x: Float[ndarray, "k"],
    shear: Float[ndarray, "k"],
    depth: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    start: Section,
    noise: float,
    *,
    symmetric: bool,
) -> tuple[Section, float]:
    """The section of least cost, symmetric or not, and that cost."""
    root = np.sqrt(weight) / max(noise, 1e-6)
    scale = np.array([1e-3, 1e-3, 1e-3, 0.2, 1e-3, 1e-3])
    prior = np.array([0.0, 0.0, 0.0, 0.25, 0.4 * start.width, 0.0])
    first = np.array([getattr(start, name) for name in NAMES])
    low = np.array([-0.02, 0.002, 1e-4, 0.0, -0.012, 0.0])
    high = np.array([0.02, 0.045, 0.1, 0.95, 0.012, 0.015])
    free = np.array([True, True, True, True, not symmetric, True])
    if symmetric:
        first[4] = 0.0

    def residuals(theta: ndarray) -> ndarray:
        full = first.copy()
        full[free] = theta * scale[free]
        section = Section(**dict(zip(NAMES, full.tolist(), strict=True)))
        data = (section.depth_at(x, shear) - depth) * root
        return np.concatenate([data, [(full[3]) / prior[3], full[4] / prior[4]]])

    bounds = (low[free] / scale[free], high[free] / scale[free])
    guess = np.clip(first[free] / scale[free], bounds[0] + 1e-6, bounds[1] - 1e-6)
    solution = least_squares(residuals, guess, bounds=bounds, loss="soft_l1", f_scale=3.0, max_nfev=20, xtol=1e-4, ftol=1e-4)
    full = first.copy()
    full[free] = solution.x * scale[free]
    return Section(**dict(zip(NAMES, full.tolist(), strict=True))), float(solution.cost)
