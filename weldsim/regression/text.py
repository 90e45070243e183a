"""Figures in words: the table that people read, and what is worse, where and by how much."""

import statistics

from weldsim import units
from weldsim.counted import counted
from weldsim.regression.distribution import EVERY_SCENE, FALSE_ALARMS, Shift
from weldsim.regression.figures import FIGURES, Figures
from weldsim.regression.finders import METHODS
from weldsim.regression.golden import Deviation
from weldsim.regression.suite import Regression

COLUMNS: tuple[tuple[str, str], ...] = (
    ("mean", "mean mm"),
    ("p95", "p95 mm"),
    ("max", "max mm"),
    ("coverage", "coverage"),
    ("phantom_length", "phantom mm"),
    ("axis_p95", "axis p95 deg"),
    ("iou", "IoU"),
    ("seconds", "seconds"),
)
HEAD = ("scene", "method", "found", *(head for _, head in COLUMNS), "golden")


def number(name: str, value: float | None, *, unit: bool = True) -> str:
    """A figure in the unit that people read it in."""
    if value is None:
        return "none" if unit else "-"
    kind = FIGURES[name].kind
    if kind == "length":
        return f"{units.to_mm(value):.3f}{' mm' if unit else ''}"
    if kind == "angle":
        return f"{units.to_deg(value):.2f}{' deg' if unit else ''}"
    return {"share": f"{value:.3f}", "count": f"{value:g}", "time": f"{value:.2f}{' s' if unit else ''}"}[kind]


def sentence(deviation: Deviation) -> str:
    """What is worse, where and by how much."""
    d, figure = deviation, FIGURES[deviation.figure]
    where = f"{d.scene}, {d.method}, seed {d.seed}: {figure.label}"
    if d.value is None:
        return f"{where} could not be measured, was {number(d.figure, d.golden)}"
    worse = d.golden - d.value if figure.larger_is_better else d.value - d.golden
    return (
        f"{where} {number(d.figure, d.value)}, was {number(d.figure, d.golden)}: worse by {number(d.figure, worse)}"
        f" (tolerance {number(d.figure, d.tolerance)})"
    )


def shift_sentence(shift: Shift) -> str:
    """What is worse over all seeds, where, and how often chance alone would make it so."""
    s, figure = shift, FIGURES[shift.figure]
    worse = f"{s.rank:.0%} of the recorded values are better than its seeds'"
    if s.scene != EVERY_SCENE:
        worse = f"median {number(s.figure, s.value)}, of those recorded {number(s.figure, s.golden)}: {worse}"
    chances = f"by chance once in {1 / max(s.chance, 1e-12):.3g} runs (limit once in {1 / s.limit:.3g})"
    return f"{s.scene}, {s.method}, {counted(s.seeds, 'seed')}: {figure.label} {worse}, {chances}"


def unjudged(outcome: Regression) -> str:
    """Why methods with recorded distributions were not judged; empty where all were."""
    few = {method for _, method in outcome.judgement.too_few}
    if not few:
        return ""
    return (
        f"{', '.join(sorted(few))}: too few seeds to tell worse from chance at {FALSE_ALARMS:.0%} false alarms a run;"
        f" 3 or more are needed (--seeds)"
    )


def worst(figures: list[Figures], name: str) -> float | None:
    """The worst of a figure over the seeds that have it; None where none has."""
    values = _values(figures, name)
    if not values:
        return None
    return min(values) if FIGURES[name].larger_is_better else max(values)


def median(figures: list[Figures], name: str) -> float | None:
    """The median of a figure over the seeds that have it; None where none has."""
    values = _values(figures, name)
    return statistics.median(values) if values else None


def _values(figures: list[Figures], name: str) -> list[float]:
    measured = [row.judged().get(name) for row in figures]
    return [value for value in measured if value is not None]


def standing(outcome: Regression, scene: str, method: str) -> str:
    """How a scene and method stand beside the golden figures: "ok", "WORSE" or "new"."""
    rows = outcome.of(scene, method)
    if any(row.deviations for row in rows) or any(s.method == method and s.scene in (scene, EVERY_SCENE) for s in outcome.shifts):
        return "WORSE"
    return "ok" if any(row.judged for row in rows) else "new"


def rows_of_text(outcome: Regression) -> list[list[str]]:
    """A line for each scene and method under `HEAD`: median and worst of the seeds."""
    out = []
    for scene in outcome.scenes:
        for method in outcome.methods:
            figures = [row.figures for row in outcome.of(scene, method)]
            hit, known = sum(f.known - f.missed for f in figures), sum(f.known for f in figures)
            cells = []
            for name, _ in COLUMNS:
                middle, most = median(figures, name), worst(figures, name)
                same = len(figures) == 1 or middle == most
                ends = (number(name, middle, unit=False), number(name, most, unit=False))
                cells.append(ends[0] if same else " / ".join(ends))
            out.append([scene, method, f"{hit}/{known}", *cells, standing(outcome, scene, method)])
    return out


def refusals(outcome: Regression) -> list[str]:
    """Why a finder of the user's own has no plan, or none along a seam; one line for each scene, method and reason."""
    seeds: dict[tuple[str, str, str], list[int]] = {}
    for row in outcome.rows:
        f = row.figures
        if f.refused and f.method not in METHODS:
            seeds.setdefault((f.scene, f.method, f.refused), []).append(f.seed)
    return [
        f"{scene}, {method}, seed{'s'[: len(found) > 1]} {', '.join(map(str, found))}: {reason}"
        for (scene, method, reason), found in seeds.items()
    ]
