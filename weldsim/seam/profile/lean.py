"""The cross-section of a groove with what is known of its lean: estimated where the data tell, doubted where not.

Under blur and noise a lean is nearly exchangeable with the lips' middle. So the section is fitted for each of a range
of leans, and the middle is averaged over them, each as likely as it fits: its scatter is the doubt.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.profile.section import Section
from weldsim.seam.profile.shape import BLUR, HIGH, LEAN, LOW, UNIT, Solution, predict, section_of, solve, terms, twin, unknowns
from weldsim.seam.profile.views import Blocks, Views, gather

LEANS = (-1.0, -0.7, -0.4, -0.15, 0.15, 0.4, 0.7, 1.0)  # of the most that leaves no wall overhanging
FIRST_LEANS = (0.0, -0.8, 0.8)
FEW_LEANS = (0.0, -0.6, 0.6)  # looked at first
WORTH_A_LOOK = 2.0  # log likelihood ratio of the best lean there from which all are looked at
LEAN_SCORE = 4.5  # standard deviations by which a lean must stand out: most grooves are symmetric; a single bevel shows 6 to 40
FIRST_STARTS = ((4e-4, 0.1), (5e-3, 0.1), (4e-4, 0.7), (8e-3, 0.3))  # blur [m], floor: one may stand in for the other
POOR = 2.0  # half the sum of squares for each cell, from which on a fit is poor: 0.5 is what noise leaves
FAR_TURNS = 40
FAR, DEEPER = (-0.3, -0.15, 0.0, 0.15, 0.3), (0.7, 1.0)  # of its width aside, and how much deeper, another section then begins
STOCKY, FLOORS = (0.8, 1.0, 1.3), (0.05, 0.5)  # how much wider and less deep, and with which floor, another section begins
# A stereo matcher follows the wall that faces it rather than the other one: the reference camera shows the bottom of a
# symmetric V displaced twice as far as the sight lines do that.
SLANT = 1.5  # of that displacement, within which a lean the same way has to stand out by
TWIN_GAIN = 3.0  # log likelihood
SLANT_SCORE = 9.0  # standard deviations; until then it counts in the doubt, though not in full:
MADE_UP_ODDS = 5.0  # how much likelier such a lean was made up than not, before: no groove leans after the way it is seen
SYMMETRIC_ODDS = 8.0  # how much likelier a groove is symmetric than leaning, for the doubt: it weighs leans that go unseen
LIKELIER = 0.5  # probability of a lean from which on it counts in the doubt as well told as it seems
UNNOTICED = 0.02  # of the width: the lean of a groove that counts as symmetric
BIN = 0.0035  # [m] across the seam, over which what no section can fit is alike
MOST_DOUBT = 0.15  # of the width


@dataclass(frozen=True)
class Doubt:
    """How far off the middle of a section may be.

    Attributes:
        lean: standard deviation for want of knowing the groove's lean [m].  data: at a known lean, by the scatter of the data.
    """

    lean: float
    data: float

    @property
    def deviation(self) -> float:
        """Standard deviation of the middle [m]."""
        return float(np.hypot(self.lean, self.data))

    def beyond(self, variance: float) -> float:
        """What is left of it [m] where the data's scatter has been counted as a `variance` [m^2] already."""
        return float(np.sqrt(self.lean**2 + max(self.data**2 - variance, 0.0)))


CERTAIN = Doubt(0.0, 0.0)


def follow_section(blocks: Blocks, start: Section, noise: float) -> Section:
    """The section that fits blocks of a strip, begun at `start` and with its lean.

    Args:
        noise: the least standard deviation of a cell [m].
    """
    views = gather(blocks, start.depth, noise)
    return section_of(solve(unknowns(start)[None], _all_but_lean(), views, start.step)[0].theta, start.step)


def first_section(blocks: Blocks, start: Section, noise: float) -> Section:
    """The section that fits blocks of a strip, begun at sharp, blurred, V, square and leaning ones of `start`'s size."""
    views, base = gather(blocks, start.depth, noise), unknowns(start)
    starts = [_leaning(base, lean, *other) for lean in FIRST_LEANS for other in FIRST_STARTS]
    rough = _calm(np.array(starts), views, blocks, start.step)
    found = solve(_picked(rough, len(FIRST_STARTS), 2), _all_but_lean(), views, start.step)
    symmetric, leaning = (min(part, key=lambda each: each.cost) for part in (found[:2], found[2:]))
    free = _searched(solve(leaning.theta[None], np.ones(7, bool), views, start.step)[0], symmetric, base, views, start.step)
    insists = _insists(_gain(symmetric, free, views, blocks, start.step), free, blocks)
    return section_of((free if insists else symmetric).theta, start.step)


def settled_section(blocks: Blocks, start: Section, noise: float) -> tuple[Section, Doubt]:
    """The section that fits blocks of a strip, near `start` but for its lean, and how far off its middle may be."""
    views = gather(blocks, start.depth, noise)
    found, insists = _over_leans(unknowns(start), views, blocks, start.step)
    lean = np.array([each.theta[LEAN] for each in found])
    middle = np.array([each.theta[0] for each in found])
    mass = _likelihood(found, lean, views, blocks, start.step, whitened=True)
    chosen = float(mass @ lean) if insists else 0.0
    theta = found[int(np.argmin(np.abs(lean - chosen)))].theta.copy()
    theta[LEAN] = chosen
    last = _either(theta, views, start.step)
    between = float(mass @ (middle - last.theta[0]) ** 2)
    if not insists:  # leans may be less well told apart than they seem: the doubt errs on the wide side
        leaning = float(mass[lean != 0.0].sum())
        mass = _likelihood(found, lean, views, blocks, start.step, whitened=False)
        wide = float(mass @ (middle - last.theta[0]) ** 2)
        between = max(between, wide) if leaning > LIKELIER else wide
    exchange = abs(float(np.polyfit(lean, middle, 1)[0]))
    unnoticed = float(mass[lean == 0.0].sum()) * (2 * UNNOTICED * exchange) ** 2
    most = MOST_DOUBT * float(last.theta[1])
    by_lean = min(float(np.sqrt(between + unnoticed)), most)
    by_data = min(float(np.sqrt(_variance(last, views, blocks, start.step))), most)
    return section_of(last.theta, start.step), Doubt(by_lean, by_data)


def section_at_blur(blocks: Blocks, start: Section, noise: float, blur: float) -> Section:
    """The section of `start`'s lean that fits blocks of a strip under a window `blur` [m] wide.

    Args:
        noise: the least standard deviation of a cell [m].
    """
    views, base = gather(blocks, start.depth, noise), unknowns(start)
    base[BLUR] = blur
    starts = np.repeat(base[None], len(STOCKY) * len(FLOORS), axis=0)
    wider = np.repeat(STOCKY, len(FLOORS))
    starts[:, 1] *= wider
    starts[:, 2] /= wider
    starts[:, 3] = np.tile(FLOORS, len(STOCKY))
    free = _all_but_lean()
    free[BLUR] = False
    return section_of(min(solve(starts, free, views, start.step), key=lambda each: each.cost).theta, start.step)


def _either(theta: Float[ndarray, "7"], views: Views, step: float) -> Solution:
    """The best section near a start; or, of a symmetric one, near its twin where data without noise say that it is clearly
    likelier: under noise little but the priors is between the two."""
    starts = np.stack([theta, twin(theta)]) if views.quiet and theta[LEAN] == 0 else theta[None]
    found = solve(starts, _all_but_lean(), views, step)
    return found[-1] if found[-1].cost < found[0].cost - TWIN_GAIN else found[0]


def _all_but_lean() -> Bool[ndarray, "7"]:
    free = np.ones(7, bool)
    free[LEAN] = False
    return free


def _leaning(base: Float[ndarray, "7"], lean: float, blur: float, floor: float) -> Float[ndarray, "7"]:
    """A start with another lean: the lips go the other way by a third of the bottom's shift, as the centroid stays."""
    theta = base.copy()
    theta[0] += (base[LEAN] - lean) * base[1] / 6
    theta[3:6] = floor, lean, blur
    return theta


def _calm(starts: Float[ndarray, "s 7"], views: Views, blocks: Blocks, step: float) -> list[Solution]:
    """Solutions with cells taken as independent: what hangs together makes the cost rugged far from its minimum."""
    plain = replace(views, weight=views.weight * 0.1, white=np.empty((0, 0)))
    return solve(starts, _all_but_lean(), plain, step, most=10)


def _picked(found: list[Solution], group: int, best: int) -> Float[ndarray, "s 7"]:
    """The best few solutions of every group."""
    groups = [sorted(found[k : k + group], key=lambda each: each.cost)[:best] for k in range(0, len(found), group)]
    return np.array([each.theta for some in groups for each in some])


def _over_leans(base: Float[ndarray, "7"], views: Views, blocks: Blocks, step: float) -> tuple[list[Solution], bool]:
    """The best section for each of a few leans, or of LEANS where a lean may be better, and the best of all.

    And whether the data insist on a lean.
    """
    found = _at_leans(base, FEW_LEANS, views, blocks, step)
    # Where it came from may be better than what independent cells led to.
    upright = base.copy()
    upright[LEAN] = 0.0
    symmetric = found[0] = min((_either(theta, views, step) for theta in (found[0].theta, upright)), key=lambda each: each.cost)
    free = _searched(_freed(found, views, blocks, step), symmetric, base, views, step)
    gain = _gain(symmetric, free, views, blocks, step)
    if gain > WORTH_A_LOOK:
        found = [symmetric, *_at_leans(base, LEANS, views, blocks, step)]
        free = _freed([min([*found, free], key=lambda each: each.cost)], views, blocks, step)
        gain = _gain(symmetric, free, views, blocks, step)
    if abs(free.theta[LEAN]) > 1e-3:
        found.append(free)
    return found, _insists(gain, free, blocks)


def _searched(found: Solution, symmetric: Solution, begun: Float[ndarray, "7"], views: Views, step: float) -> Solution:
    """The best section of any lean: `found`, or where that one fits poorly, as the symmetric one does, one from where the fit
    began or from far away.

    A bevel seen along its ramp has its lips elsewhere than where a section of its looks would have them.
    """
    if min(found.cost, symmetric.cost) < POOR * views.depth.size:
        return found
    base = (found if found.cost < symmetric.cost else symmetric).theta
    starts = np.array(
        [
            [base[0] + aside * base[1], base[1] * wider, base[2] * deeper, 0.05, lean, 4e-4, 0.5]
            for lean in FIRST_LEANS
            for aside in FAR
            for wider in STOCKY
            for deeper in DEEPER
        ]
    )
    starts = np.concatenate([begun[None], starts])
    return min([found, *solve(starts, np.ones(7, bool), views, step, most=FAR_TURNS)], key=lambda each: each.cost)


def _insists(gain: float, leaning: Solution, blocks: Blocks) -> bool:
    """Whether the data insist on a lean, the more so on one that a slanted look at a symmetric groove may have made up."""
    score = SLANT_SCORE if _made_up(leaning, blocks) else LEAN_SCORE
    return gain > score**2 / 2


def _made_up(leaning: Solution, blocks: Blocks) -> bool:
    """Whether a lean is one that a stereo matcher would make up, as it looks at a symmetric groove from a slant."""
    shape, drift = section_of(leaning.theta, 0.0), float(np.median(blocks.shear))
    return shape.lean * drift < 0 and abs(shape.lean) < SLANT * shape.depth * abs(drift)


def _freed(found: list[Solution], views: Views, blocks: Blocks, step: float) -> Solution:
    """The best section of any lean near one of some solutions."""
    near = np.stack([found[0].theta, *(each.theta for each in found)])
    near[:2, LEAN] += (0.08, -0.08)
    return min(solve(near, np.ones(7, bool), views, step), key=lambda each: each.cost)


def _at_leans(base: Float[ndarray, "7"], leans: tuple[float, ...], views: Views, blocks: Blocks, step: float) -> list[Solution]:
    """The best section for each of some leans."""
    others = ((base[5], base[3]), (max(base[5] - 0.003, 4e-4), 0.1), (base[5] + 0.002, 0.3))
    starts = [_leaning(base, lean, *other) for lean in leans for other in others]
    return solve(_picked(_calm(np.array(starts), views, blocks, step), len(others), 1), _all_but_lean(), views, step)


def _gain(symmetric: Solution, free: Solution, views: Views, blocks: Blocks, step: float) -> float:
    """Log likelihood ratio of a leaning solution to the symmetric one, no better known than the data's scatter allows."""
    return (symmetric.cost - free.cost) / max(1.0, _excess(symmetric, free, views, blocks, step, whitened=True))


def _likelihood(
    found: list[Solution], lean: Float[ndarray, "s"], views: Views, blocks: Blocks, step: float, whitened: bool
) -> Float[ndarray, "s"]:
    """How likely each solution is: a symmetric groove, or one of any lean alike that is not made up, before; as well as it
    fits, after.
    """
    best = min(found, key=lambda each: each.cost)
    worse = np.array([(e.cost - best.cost) / max(1.0, _excess(e, best, views, blocks, step, whitened)) for e in found])
    order = np.argsort(lean)
    between = 0.5 * (lean[order][1:] + lean[order][:-1])
    span = np.empty(len(lean))
    span[order] = np.diff(np.concatenate([[-1.0], between, [1.0]]))
    for k in range(len(lean)):  # a peak may be narrower than the leans are apart
        apart = np.abs(np.delete(lean, k) - lean[k])
        rise = np.sqrt(2 * np.maximum(np.delete(worse, k) - worse[k], 0.0) + 1e-12) / np.maximum(apart, 1e-3)
        span[k] = min(span[k], 2.5 / float(rise[np.argsort(apart)[:2]].min()))
    suspect = np.array([_made_up(each, blocks) for each in found])
    prior = np.where(lean == 0.0, SYMMETRIC_ODDS, span / np.where(suspect, 2 * MADE_UP_ODDS, 2.0))
    mass = prior * np.exp(-worse)
    return mass / mass.sum()


def _scores(
    pull: Float[ndarray, "p g w"], depth: Float[ndarray, "g w"], views: Views, blocks: Blocks, whitened: bool = False
) -> Float[ndarray, "p b n"]:
    """What each block's cells in each bin across the seam add to the whitened products of `pull` with the residual.

    The sum over bins is the same either way. `whitened` products are those of numbers that are independent where the noise is
    as it was taken to be. Otherwise each cell's residual is weighted by all the cells it hangs together with: neighbours' signs
    alternate then where the noise is smooth, and bins that cancel look like scatter.
    """
    root = np.sqrt(views.weight)
    residual = np.where(views.each > 0, depth[views.of] - blocks.depth, 0.0) * views.each / np.maximum(root, 1e-12)[views.of]
    reach = (pull * root) @ views.white.T
    pulls, residuals = (reach, residual @ views.white.T) if whitened else (reach @ views.white, residual)
    score = pulls[:, views.of] * residuals
    number = np.floor(blocks.x / BIN).astype(int)
    return np.stack([score[:, :, number == k].sum(axis=2) for k in np.unique(number)], axis=2)


def _excess(one: Solution, best: Solution, views: Views, blocks: Blocks, step: float, whitened: bool) -> float:
    """Variance of the data's vote between two solutions, over what the noise's correlation lets one expect.

    From block to block along the seam and from bin to bin across it: clusters both ways (Cameron, Gelbach and Miller 2011).
    """
    if one is best:
        return 1.0
    depth, _ = predict(np.stack([one.theta, best.theta]), step, views.at, views.shear)
    apart = ((depth[1] - depth[0]) * np.sqrt(views.weight)) @ views.white.T
    votes = _scores((depth[1] - depth[0])[None], depth[1], views, blocks, whitened)[0]
    n = len(votes)
    along = float((votes.sum(axis=1) ** 2).sum()) * n / max(n - 5, 0.4 * n)
    across = float((votes.sum(axis=0) ** 2).sum()) - float((votes**2).sum())
    return (along + max(across, 0.0)) / max(float((apart**2).sum()), 1e-12)


def _variance(found: Solution, views: Views, blocks: Blocks, step: float) -> float:
    """Variance of a solution's middle [m^2] at its lean, from the scatter of its scores, clustered as in `_excess`."""
    depth, jacobian = predict(found.theta[None], step, views.at, views.shear)
    free = found.free & (found.theta > LOW) & (found.theta < HIGH)
    free[:3] = True
    slopes = terms(found.theta, views, step)[1][free]
    inverse = np.linalg.pinv(slopes @ slopes.T + 1e-9 * np.eye(len(slopes)), rcond=1e-10, hermitian=True)
    score = np.einsum("p,pbn->bn", inverse[0], _scores(jacobian[0][free], depth[0], views, blocks))
    n, p = len(score), len(slopes)
    along = float((score.sum(axis=1) ** 2).sum()) * n / max(n - p, 0.4 * n)
    bins = score.shape[1]
    across = float((score.sum(axis=0) ** 2).sum()) * bins / max(bins - p, 0.4 * bins) - float((score**2).sum())
    return (along + max(across, 0.0)) * UNIT[0] ** 2
