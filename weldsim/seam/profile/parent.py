"""The parent surface under a strip: a robust smooth fit to what lies beside the groove, carried across it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.seam.profile.rail import Rail, Strip

CELL = 0.002  # [m] side of the cells that points are averaged in before fitting
TOLERANCE = 0.003  # [m] a cell farther than this from the parent surface is never part of it
LEAST_SUPPORT = 0.25  # share of a side's parent surface from which on a station has that side
WINDOW = 0.020  # [m] along the seam, over which the two sides are compared
STIFFNESSES = (0.02, 0.5, 10.0, 200.0, 4000.0)  # of the penalty on roughness, relative to the data between two knots
FOLD = 0.030  # [m] along the seam, left out together to choose the stiffness
LEVER = 0.020  # [m] that turns twist into height
# The first turns look at so much of the rail, from its middle: past the end of a thin plate the table would bend the surface.
GROWING = (0.6, 0.75, 0.9)
TURNS, CHOOSING = 10, 4  # of the fit at most, and the one that chooses the stiffness
AT_REST = 1e-7  # [m] a surface that moves no more, under a scale that stays the same, is fitted
HILO_SCORE = 4.0  # standard deviations
ALIKE = 15.0  # cells
HILO_LEAST = 2.5e-4  # [m] misalignment in height that is worth a term of its own
KNOT = 0.025  # [m] spacing of the knots of the surface's height along the seam


@dataclass(frozen=True, eq=False)
class Parent:
    """h(s, x) = a(s) + b(s) x + c x^2 + hilo sign(x) / 2 in a rail's coordinates.

    Attributes:
        a, b: (m,) at each station [m], [1].  c: curvature term [1/m].
        hilo: how much higher the plate on the left lies than the one on the right [m]; 0 unless the data insist.
        noise: robust standard deviation of the cells about it [m].
        rms: root mean square of the cells about it [m]; unlike `noise` not blind to data that jump between whole steps.
        sigma: standard deviation of its height at the groove [m], with the noise's own correlation.
        step, angle: (m,) height difference [m] and angle [rad] between the surfaces left and right of each station, each
        carried to its middle; infinity where either is missing.
        support: (m, 2) share of parent surface left and right.  cells: (k, 2) (s, x) of what lies within TOLERANCE of it [m].
    """

    a: Float[ndarray, "m"]
    b: Float[ndarray, "m"]
    c: float
    hilo: float
    noise: float
    rms: float
    sigma: float
    step: Float[ndarray, "m"]
    angle: Float[ndarray, "m"]
    support: Float[ndarray, "m 2"]
    cells: Float[ndarray, "k 2"]


def fit_parent(rail: Rail, strip: Strip, inner: float, outer: float, reach: float | None = None) -> Parent:
    """The parent surface from points with inner < |x| < outer [m], no higher or lower than `reach` [m] on the rail.

    Reweighted least squares (Tukey) from a wide to a narrow scale, so that clamps and the table fall out.
    """
    m = len(rail)
    band = (np.abs(strip.x) > inner) & (np.abs(strip.x) < outer) & (np.abs(strip.h) < (reach or 0.5 * outer + inner))
    s, x, h, _ = _cells(strip, band, m * rail.step, outer)
    length = m * rail.step
    knots = max(3, round(length / KNOT) + 1)
    design = _design(s, x, length, knots)
    penalty, target = _roughness(rail, knots)
    penalty, target = penalty * len(s) / knots, target * len(s) / knots
    fold = np.floor(s / FOLD).astype(int)
    from_middle = np.abs(2 * s / length - 1)
    theta, weight, scale = _robust(design, h, penalty, target, fold, from_middle)
    hilo = 0.0
    side = np.sign(x) / 2
    if _insists(design, h - design @ theta, weight, side, fold):
        wider = np.concatenate([design, side[:, None]], axis=1)
        theta, weight, scale = _robust(wider, h, np.pad(penalty, (0, 1)), np.pad(target, (0, 1)), fold, from_middle)
        theta, hilo = theta[:-1], float(theta[-1])
    residual = h - design @ theta - hilo * side
    good = np.abs(residual) < min(3 * scale, TOLERANCE)
    # Where a plate ends, a camera is at its noisiest: what lies within the tolerance still shows that it goes on.
    plate = np.abs(residual) < TOLERANCE
    noise = 1.4826 * float(np.median(np.abs(residual[good]))) if good.any() else scale
    at = np.arange(m) * rail.step
    basis, size = _basis(at, length, knots), knots + 2
    # Curvature across the seam is part of the angle between the sides, as far as neither side bends by itself: it could
    # pass a fold off as a bend.
    folded = theta[-1] - _own_curvature(s, x, residual, good, float(theta[-1]))
    apart = residual + folded * x**2 + hilo * side
    step, angle = _side_difference(s, x, apart, np.abs(residual) < 2 * TOLERANCE, m, rail.step)
    return Parent(
        a=basis @ theta[:size],
        b=basis @ theta[size : 2 * size],
        c=float(theta[-1]),
        hilo=hilo,
        noise=noise,
        rms=float(np.sqrt(np.mean(residual[good] ** 2))) if good.any() else scale,
        sigma=_height_sigma(s[good], x[good], residual[good]),
        step=step,
        angle=angle,
        support=_support(s, x, plate, m, rail.step, outer - inner),
        cells=np.stack([s[plate], x[plate]], axis=1),
    )


def _robust(
    design: Float[ndarray, "k p"],
    h: Float[ndarray, "k"],
    penalty: Float[ndarray, "p p"],
    target: Float[ndarray, "p"],
    fold: Int[ndarray, "k"],
    far: Float[ndarray, "k"],
) -> tuple[Float[ndarray, "p"], Float[ndarray, "k"], float]:
    """Coefficients, weights and scale [m] of the reweighted fit; the stiffness is chosen on the way.

    Args:
        far: from the middle of the rail, over half its length: the fit begins there and grows towards the ends.
    """
    from weldsim.seam.profile import native

    stiffness, scale = STIFFNESSES[2], 0.003
    weight = (far < GROWING[0]).astype(float)
    theta, residual = np.zeros(design.shape[1]), h
    held = np.empty((len(design), int(np.count_nonzero(design, axis=1).max(initial=0))), np.int64)
    native.held_columns(design, held)
    for turn in range(TURNS):
        if turn == CHOOSING:
            stiffness = _choose_stiffness(design, held, h, weight, penalty, target, fold % 4)
        theta = _solve(design, held, h, weight, stiffness * penalty, stiffness * target)
        before, residual = residual, h - design @ theta
        spread = 1.4826 * float(np.median(np.abs(residual)[weight > 0.05])) if (weight > 0.05).any() else scale
        last, scale = scale, max(0.6 * scale, 1.5 * spread, 1e-5)
        weight = np.maximum(1 - (residual / (3 * scale)) ** 2, 0.0) ** 2
        if turn + 1 < len(GROWING):
            weight *= far < GROWING[turn + 1]
        if turn > CHOOSING and abs(scale - last) < AT_REST and float(np.abs(residual - before).max(initial=0.0)) < AT_REST:
            break
    return theta, weight, scale


def _insists(
    design: Float[ndarray, "k p"],
    residual: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    side: Float[ndarray, "k"],
    fold: Int[ndarray, "k"],
) -> bool:
    """Whether the residuals ask for a height step between the plates: by HILO_SCORE standard deviations, and HILO_LEAST.

    The step's column is made orthogonal to the surface's; the deviation is taken from stretch to stretch of the seam.
    """
    weighted = design * weight[:, None]
    gram = design.T @ weighted
    gram[np.diag_indices_from(gram)] += 1e-9 * (np.diag(gram) + 1e-6)
    free = side - design @ np.linalg.solve(gram, weighted.T @ side)
    strength = float(weight @ (free * free))
    if strength <= 0:
        return False
    step = float((weight * free) @ residual) / strength
    left = residual - step * free
    votes = np.bincount(fold, weights=weight * free * left)
    # Few stretches may agree by chance: no less than from patches over which a stereo camera's noise is alike.
    patches = ALIKE * float((weight * free**2) @ left**2)
    return abs(step) > max(HILO_SCORE * float(np.sqrt(max((votes**2).sum(), patches))) / strength, HILO_LEAST)


def _cells(strip: Strip, band: Bool[ndarray, "k"], length: float, outer: float) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Mean (s, x, h) of the points in each cell that holds any, and their count."""
    width = int(np.ceil(2 * outer / CELL))
    row = np.floor(strip.s[band] / CELL).astype(int)
    column = np.floor((strip.x[band] + outer) / CELL).astype(int)
    rows = int(np.ceil(length / CELL)) + 1
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < width)
    index = row[inside] * width + column[inside]
    count = np.bincount(index, minlength=rows * width)
    held = np.nonzero(count)[0]
    means = [
        np.bincount(index, weights=v[band][inside], minlength=rows * width)[held] / count[held] for v in (strip.s, strip.x, strip.h)
    ]
    return means[0], means[1], means[2], count[held]


def _basis(s: Float[ndarray, "k"], length: float, knots: int) -> Float[ndarray, "k b"]:
    """Uniform cubic B-splines over [0, length], knots + 2 of them."""
    place = np.clip(s / length, 0.0, 1.0) * (knots - 1)
    before = np.minimum(place.astype(np.int64), knots - 2)
    u = place - before
    r = 1.0 - u
    out = np.zeros((len(s), knots + 2))
    index = np.arange(len(s)) * (knots + 2) + before
    flat = out.reshape(-1)  # only four splines are not zero at a place
    for k, value in enumerate((r * r * r / 6, 2 / 3 - u * u + u * u * u / 2, 2 / 3 - r * r + r * r * r / 2, u * u * u / 6)):
        flat[index + k] = value
    return out


def _design(s: Float[ndarray, "k"], x: Float[ndarray, "k"], length: float, knots: int) -> Float[ndarray, "k p"]:
    basis = _basis(s, length, knots)
    return np.concatenate([basis, basis * x[:, None], (x**2)[:, None]], axis=1)


def _roughness(rail: Rail, knots: int) -> tuple[Float[ndarray, "p p"], Float[ndarray, "p"]]:
    """Quadratic penalty on the surface's change of curvature along the seam and of twist, and its linear term.

    It is the surface in space that shall be smooth, not its height above a rail that wavers: the rail's own third
    differences along its normals, and second differences of its normals (with a lever of 20 mm), are counted in.
    Straight parts, arcs and steady twists are free; stretches without data are bridged.
    """
    size = knots + 2
    at = np.linspace(-1, knots, size) / (knots - 1) * (len(rail) - 1)
    inner = np.clip(at, 0, len(rail) - 1)
    whole = np.rint(inner).astype(int)
    points = rail.points[whole] + ((at - whole) * rail.step)[:, None] * rail.t[whole]
    third, second = np.diff(np.eye(size), n=3, axis=0), np.diff(np.eye(size), n=2, axis=0)
    bend = np.einsum("ij,ij->i", third @ points, rail.n[whole][1:-2])
    twist = np.einsum("ij,ij->i", second @ rail.n[whole], rail.e[whole][1:-1])
    penalty, target = np.zeros((2 * size + 1, 2 * size + 1)), np.zeros(2 * size + 1)
    penalty[:size, :size], target[:size] = third.T @ third, -third.T @ bend
    penalty[size : 2 * size, size : 2 * size] = second.T @ second * LEVER**2
    target[size : 2 * size] = second.T @ twist * LEVER**2
    return penalty, target


def _solve(
    design: Float[ndarray, "k p"],
    held: Int[ndarray, "k c"],
    h: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    penalty: Float[ndarray, "p p"],
    target: Float[ndarray, "p"],
) -> Float[ndarray, "p"]:
    grams, rights = _normal_equations(design, held, h, weight)
    gram, right = grams[0], rights[0]
    # Each unknown's own scale: a ridge as stiff as the penalty would hold down the curvature across the seam.
    ridge = np.diag(1e-9 * (np.diag(gram) + 1e-6))
    return np.linalg.solve(gram + penalty + ridge, right + target)


def _normal_equations(
    design: Float[ndarray, "k p"],
    held: Int[ndarray, "k c"],
    h: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    part: Int[ndarray, "k"] | None = None,
) -> tuple[Float[ndarray, "q p p"], Float[ndarray, "q p"]]:
    """Matrix and right side of weighted least squares, for each part of the rows, numbered from 0; None = one part.

    Args:
        held: the columns in which each row is not zero, then -1.
    """
    from weldsim.seam.profile import native

    each = np.zeros(len(h), np.int64) if part is None else part
    parts, size = 1 if part is None else int(part.max(initial=0)) + 1, design.shape[1]
    gram, right = np.zeros((parts, size, size)), np.zeros((parts, size))
    native.normal_equations(design, held, weight, h, each, gram, right)
    return gram, right


def _choose_stiffness(
    design: Float[ndarray, "k p"],
    held: Int[ndarray, "k c"],
    h: Float[ndarray, "k"],
    weight: Float[ndarray, "k"],
    penalty: Float[ndarray, "p p"],
    target: Float[ndarray, "p"],
    fold: Int[ndarray, "k"],
) -> float:
    """The stiffness that best predicts stretches left out."""
    grams, rights = _normal_equations(design, held, h, weight, fold)
    whole, right = grams.sum(axis=0), rights.sum(axis=0)
    ridge = 1e-9 * (1 + np.trace(whole) / len(whole)) * np.eye(len(whole))
    errors = []
    for stiffness in STIFFNESSES:
        systems = whole - grams + stiffness * penalty + ridge
        sides = right - rights + stiffness * target
        theta = np.linalg.solve(systems, sides[..., None])[..., 0]
        errors.append(float(weight @ (h - np.einsum("ij,ij->i", design, theta[fold])) ** 2))
    best = min(errors)
    return max(stiffness for stiffness, error in zip(STIFFNESSES, errors, strict=True) if error <= 1.02 * best)


def _own_curvature(
    s: Float[ndarray, "k"], x: Float[ndarray, "k"], residual: Float[ndarray, "k"], good: Bool[ndarray, "k"], c: float
) -> float:
    """The part of the fitted curvature c [1/m] that each side shows within itself, twice its standard deviation off.

    A bend curves both sides; a fold is straight on either side, and all its curvature lies between them.
    """
    sign = 1.0 if c >= 0 else -1.0
    votes, strengths = [], []
    part = np.floor(s / FOLD).astype(int) * 2 + (x > 0)
    for label in np.unique(part[good]):
        here = good & (part == label)
        if np.count_nonzero(here) < 24:
            continue
        y = x[here]
        z, square = y - y.mean(), y**2
        shape = square - square.mean() - float(z @ square) / max(float(z @ z), 1e-18) * z  # less its own best line
        votes.append(float(shape @ (residual[here] + c * y**2)))
        strengths.append(float(shape @ shape))
    if len(votes) < 4:
        return 0.0
    strength, each = np.array(strengths), np.array(votes)
    own = each.sum() / strength.sum()
    sigma = float(np.sqrt(((each - own * strength) ** 2).sum())) / strength.sum()
    return sign * float(np.clip(sign * own - 2 * sigma, 0.0, abs(c)))


def _height_sigma(s: Float[ndarray, "k"], x: Float[ndarray, "k"], residual: Float[ndarray, "k"]) -> float:
    """Standard deviation [m] of the surface's height, from the scatter of block means: they carry the correlation."""
    side = 0.010
    label = np.floor(s / side).astype(int) * 1000 + np.floor(x / side).astype(int)
    _, which, count = np.unique(label, return_inverse=True, return_counts=True)
    full = count >= 8
    if np.count_nonzero(full) < 6:
        return float(residual.std()) if len(residual) else 0.0
    means = np.bincount(which, weights=residual)[full] / count[full]
    # About 11 such blocks, both sides of one knot interval together, carry the height there.
    return float(means.std()) / np.sqrt(11.0)


def _side_difference(
    s: Float[ndarray, "k"], x: Float[ndarray, "k"], residual: Float[ndarray, "k"], use: Bool[ndarray, "k"], m: int, step: float
) -> tuple[Float[ndarray, "m"], Float[ndarray, "m"]]:
    """Height step [m] and angle [rad] at each station between lines fitted left and right over WINDOW along the seam."""
    station = np.clip((s / step).astype(int), 0, m - 1)
    kernel = np.ones(round(WINDOW / step))
    height, slope, held = np.zeros((2, m)), np.zeros((2, m)), np.ones(m, bool)
    for k, side in enumerate((use & (x > 0), use & (x < 0))):
        moments = [np.ones(side.sum()), x[side], x[side] ** 2, residual[side], x[side] * residual[side]]
        n, sx, sxx, sh, sxh = (
            np.convolve(np.bincount(station[side], weights=w, minlength=m), kernel, mode="same") for w in moments
        )
        spread = np.maximum(n * sxx - sx * sx, 1e-18)
        slope[k] = (n * sxh - sx * sh) / spread
        height[k] = (sh - slope[k] * sx) / np.maximum(n, 1)
        held &= n >= 12
    difference = np.where(held, np.abs(height[0] - height[1]), np.inf)
    return difference, np.where(held, np.abs(np.arctan(slope[0]) - np.arctan(slope[1])), np.inf)


def _support(
    s: Float[ndarray, "k"], x: Float[ndarray, "k"], good: Bool[ndarray, "k"], m: int, step: float, band: float
) -> Float[ndarray, "m 2"]:
    """Share of each side's cells, within 3 mm along the seam, that hold parent surface; 1 where as many do as usual."""
    stations = np.clip((s / step).astype(int), 0, m - 1)
    out = np.zeros((m, 2))
    kernel = np.ones(max(1, round(0.006 / step)))
    full = band / CELL * (len(kernel) * step / CELL)
    for k, side in enumerate((good & (x > 0), good & (x < 0))):
        out[:, k] = np.convolve(np.bincount(stations[side], minlength=m), kernel, mode="same") / full
    usual = float(np.quantile(out, 0.8))
    return np.minimum(out / min(max(usual, 0.1), 1.0), 1.0)
