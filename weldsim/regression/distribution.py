"""Whether a method that hangs on single points has become worse: its figures over seeds against those recorded, as samples.

A rounding in the last bit, on another processor say, makes such a method's figure of one seed another one, drawn from the
same distribution. So its seeds are judged together, by exact rank tests (Mann and Whitney; ties share their mean rank):
each figure of each scene, and each figure over all scenes (van Elteren's sum of the scenes' rank sums). Every value may be
worse by the entry's tolerance; one that could not be measured is worse than any that could.

All tests of a run share FALSE_ALARMS by Bonferroni's inequality. Where nothing but rounding has changed, a run fails at
most that often; on the processor of the record, where its seeds come out as recorded, practically never.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.stats import rankdata

from weldsim.regression.figures import FIGURES, Figures
from weldsim.regression.golden import DIGITS, Entry, Golden

FALSE_ALARMS = 0.01  # of runs in which nothing has changed may fail, at most
RECORDED_SEEDS = 40  # with three new ones, the least chance of a test is 1 in 12341: enough for 120 tests
EVERY_SCENE = "all scenes"


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A figure that, over all seeds of a run, is worse than its record.

    Attributes:
        scene: where; EVERY_SCENE for all of the run together.  method, figure: of what.  seeds: how many were drawn.
        value, golden: medians of what was measured and of what was recorded; None = not measured, or of several scenes.
        rank: mean place of the new values among recorded ones, from 0 (better than all) by 0.5 (alike) to 1 (worse than all).
        chance: of such ranks where nothing has changed.  limit: on that chance.
    """

    scene: str
    method: str
    seeds: int
    figure: str
    value: float | None
    golden: float | None
    rank: float
    chance: float
    limit: float


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """What the rank tests of a run came to.

    Attributes:
        shifts: what is worse.  tests: how many were made.
        judged: scenes and methods with a test that could have failed.
        too_few: those with recorded distributions whose tests could not have: too few seeds were drawn.
    """

    shifts: tuple[Shift, ...] = ()
    tests: int = 0
    judged: frozenset[tuple[str, str]] = frozenset()
    too_few: frozenset[tuple[str, str]] = frozenset()


@dataclass(frozen=True, eq=False)
class _Test:
    """One figure of one scene and method. Attributes: scene, method, figure; entry; new: a value for each seed, None = none;
    counts: ways to each doubled sum of ranks; observed: that sum; rank: see Shift."""

    scene: str
    method: str
    figure: str
    entry: Entry
    new: tuple[float | None, ...]
    counts: Float[ndarray, "_"]
    observed: int
    rank: float


def judge(rows: Iterable[Figures], golden: Golden) -> Judgement:
    """The figures whose record is a distribution, judged over all seeds of a run. Better is never worse."""
    grouped: dict[tuple[str, str], list[Figures]] = {}
    for row in rows:
        grouped.setdefault((row.scene, row.method), []).append(row)
    tests = [
        _test(scene, method, figure, entry, members)
        for (scene, method), members in grouped.items()
        for figure, entry in golden.entries(scene, method).items()
        if entry.judge == "distribution" and entry.tolerance is not None and any(figure in row.judged() for row in members)
    ]
    pooled = _pooled(tests)
    groups = [[test] for test in tests] + pooled
    if not groups:
        return Judgement()
    limit = FALSE_ALARMS / len(groups)
    shifts = tuple(shift for shift in (_shift(group, limit) for group in groups) if shift is not None)
    able = {(test.scene, test.method) for group in groups if _least_chance(group) <= limit for test in group}
    every = {(test.scene, test.method) for test in tests}
    return Judgement(shifts=shifts, tests=len(groups), judged=frozenset(able), too_few=frozenset(every - able))


def rank_counts(new: Sequence[float], recorded: Sequence[float]) -> tuple[Float[ndarray, "_"], int, float]:
    """The exact distribution of a rank sum where both samples are of one distribution, ties and all, and where ours lies.

    Args:
        new, recorded: larger is worse; infinity = could not be measured.
    Returns:
        For each doubled rank sum of as many values as `new` has, in how many ways it can be drawn from all values; the doubled
        rank sum of `new`; and its mean place among the recorded ones, 0 to 1.
    """
    n, together = len(new), np.concatenate([new, recorded])
    ranks = np.rint(2 * rankdata(together)).astype(int)
    most = int(np.sort(ranks)[-n:].sum())
    ways = np.zeros((n + 1, most + 1))
    ways[0, 0] = 1.0
    for rank in ranks:
        ways[1:, rank:] += ways[:-1, : most + 1 - rank]
    observed = int(ranks[:n].sum())
    rank = (observed / 2 - n * (n + 1) / 2) / (n * len(recorded))
    return ways[n], observed, rank


def _test(scene: str, method: str, figure: str, entry: Entry, members: list[Figures]) -> _Test:
    new = tuple(row.judged().get(figure) for row in members)
    sign = -1.0 if FIGURES[figure].larger_is_better else 1.0
    slack = (entry.tolerance or 0.0) + 0.5 * 10.0**-DIGITS  # recorded values are rounded
    counts, observed, rank = rank_counts(
        [np.inf if value is None else sign * value - slack for value in new],
        [np.inf if value is None else sign * value for value in entry.values],
    )
    return _Test(scene, method, figure, entry, new, counts, observed, rank)


def _pooled(tests: list[_Test]) -> list[list[_Test]]:
    """The tests of each method and figure that there are several scenes of."""
    groups: dict[tuple[str, str], list[_Test]] = {}
    for test in tests:
        groups.setdefault((test.method, test.figure), []).append(test)
    return [group for group in groups.values() if len(group) > 1]


def _chance(group: list[_Test]) -> float:
    """Of a sum of rank sums as large as observed, where nothing has changed."""
    counts = _convolved(group)
    return float(counts[sum(test.observed for test in group) :].sum() / counts.sum())


def _least_chance(group: list[_Test]) -> float:
    """The chance of the worst ranks that there can be without ties: one way of all."""
    return float(np.prod([1.0 / comb(len(test.new) + len(test.entry.values), len(test.new)) for test in group]))


def _convolved(group: list[_Test]) -> Float[ndarray, "_"]:
    counts = np.ones(1)
    for test in group:
        counts = np.convolve(counts, test.counts / test.counts.sum())
    return counts


def _shift(group: list[_Test], limit: float) -> Shift | None:
    chance = _chance(group)
    if chance > limit:
        return None
    first, alone = group[0], len(group) == 1
    return Shift(
        scene=first.scene if alone else EVERY_SCENE,
        method=first.method,
        seeds=len(first.new),
        figure=first.figure,
        value=_median(first.new, first.figure) if alone else None,
        golden=_median(first.entry.values, first.figure) if alone else None,
        rank=float(np.mean([test.rank for test in group])),
        chance=chance,
        limit=limit,
    )


def _median(values: Sequence[float | None], figure: str) -> float | None:
    """Of values of which None is the worst; None where that is the median."""
    worst = -np.inf if FIGURES[figure].larger_is_better else np.inf
    middle = float(np.median([worst if value is None else value for value in values]))
    return middle if np.isfinite(middle) else None
