"""The figures of one plan against the known seams, with the one definition of each, and how far each may worsen.

Offsets are those of `weldsim.report.metrics`: perpendicular, from the *opening* of the groove, sampled every 0.5 mm.
Where a part has several seams, `mean` is over all of them by length, the other errors are those of the worst one, and
coverage is the covered share of their total length, a missed seam covering nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from weldsim.config import CellConfig
from weldsim.path.asked import leaned, wire_tip
from weldsim.pipeline import PlanResult
from weldsim.records import KnownSeam, LineError, Seam, TorchPath, WeldReport
from weldsim.report.metrics import match_seams, region_overlap
from weldsim.report.weld import path_error

Kind = Literal["length", "angle", "share", "count", "time"]
Judge = Literal["seed", "distribution"]
"""How a method's figures are held against their record: each seed against the same seed, or all seeds as one sample."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One figure of merit.

    Attributes:
        name: as in JSON.  label: for people.  kind: length [m], angle [rad], share, count or time [s].
        tolerance: how much worse than recorded it may be when first recorded; None = shown and never judged.
        larger_is_better: which way is worse.
    """

    name: str
    label: str
    kind: Kind
    tolerance: float | None
    larger_is_better: bool = False


DEGREE = float(np.pi / 180)
FIGURES: dict[str, Figure] = {
    figure.name: figure
    for figure in (
        Figure(name="missed", label="known seams missed", kind="count", tolerance=0.0),
        Figure(name="phantoms", label="phantom seams", kind="count", tolerance=0.0),
        Figure(name="phantom_length", label="phantom length", kind="length", tolerance=0.0),
        Figure(name="mean", label="cross-track mean", kind="length", tolerance=0.05e-3),
        Figure(name="p95", label="cross-track p95", kind="length", tolerance=0.10e-3),
        Figure(name="max", label="cross-track max", kind="length", tolerance=0.20e-3),
        Figure(name="coverage", label="coverage", kind="share", tolerance=0.02, larger_is_better=True),
        Figure(name="axis_median", label="wire axis median", kind="angle", tolerance=0.1 * DEGREE),
        Figure(name="axis_p95", label="wire axis p95", kind="angle", tolerance=0.3 * DEGREE),
        Figure(name="iou", label="groove overlap (IoU)", kind="share", tolerance=0.03, larger_is_better=True),
        Figure(name="executed_mean", label="executed, cross-track mean", kind="length", tolerance=0.05e-3),
        Figure(name="executed_p95", label="executed, cross-track p95", kind="length", tolerance=0.10e-3),
        Figure(name="tracking_p95", label="executed tip from plan, p95", kind="length", tolerance=0.05e-3),
        Figure(name="seconds", label="plan, seconds", kind="time", tolerance=None),
    )
}
"""Every figure. The tolerances of lengths and shares are several times what ray casting instead of OpenGL changes by the default
method (mean 0.003 mm, max 0.04 mm, IoU 0.006); counts of seams have none. Times depend on the machine."""

CHAOTIC = frozenset({"thesis"})
"""Methods whose figures of one seed are a draw: the published one's clusters hang on single points, so that a rounding in the last
bit gives and takes whole seams. See `weldsim.regression.distribution`."""


def judge_of(method: str) -> Judge:
    """How a method's figures are recorded and judged."""
    return "distribution" if method in CHAOTIC else "seed"


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What one scene, method and seed came to. None where a figure has no meaning: no known seam, none found, not executed.

    Attributes:
        scene, method, seed: of what.  known, found: how many seams there are, how many were found.
        missed: known seams without a path.  phantoms: seams found that are none; phantom_length: theirs [m];
            None where the scene's seams are not known.
        mean, p95, max: cross-track distance of the planned tip from the opening [m].
        coverage: share of the known length.  axis_median, axis_p95: wire axis from the known inward bisector [rad].
        iou: points of the cloud in both the groove region found and the true one, over points in either; a point is truly
            in the groove where the exact image shows the groove's own surface at its pixel.
        executed_mean, executed_p95: of the simulated arm's tip from the opening [m].  tracking_p95: from the plan [m].
        seconds: cloud, seam and path stages together [s].  timing: seconds a stage.
        refused: why there is no plan, or none along some of the seams found.
    """

    scene: str
    method: str
    seed: int
    known: int
    found: int = 0
    missed: int = 0
    phantoms: int | None = 0
    phantom_length: float | None = 0.0
    mean: float | None = None
    p95: float | None = None
    max: float | None = None
    coverage: float | None = None
    axis_median: float | None = None
    axis_p95: float | None = None
    iou: float | None = None
    executed_mean: float | None = None
    executed_p95: float | None = None
    tracking_p95: float | None = None
    seconds: float | None = None
    timing: dict[str, float] = field(default_factory=dict)
    refused: str = ""

    def judged(self) -> dict[str, float | None]:
        """The figures that have a meaning here, None for one that has and could not be measured (no seam found)."""
        out: dict[str, float | None] = {"missed": self.missed}
        if self.phantoms is not None:
            out |= {"phantoms": self.phantoms, "phantom_length": self.phantom_length}
        if self.known:
            out |= {name: getattr(self, name) for name in ("mean", "p95", "max", "coverage", "axis_median", "axis_p95")}
        for name in ("iou", "executed_mean", "executed_p95", "tracking_p95", "seconds"):
            if getattr(self, name) is not None and (self.known or name == "seconds"):
                out[name] = getattr(self, name)
        return {name: out[name] for name in FIGURES if name in out}


def figures_of(
    scene: str,
    method: str,
    seed: int,
    result: PlanResult,
    known: Sequence[KnownSeam],
    config: CellConfig,
    *,
    true_region: Bool[ndarray, "n"] | None = None,
    report: WeldReport | None = None,
    has_axes: bool = True,
) -> Figures:
    """The figures of a plan.

    Args:
        scene, method, seed: how to name it.  result: the plan.  known: the true seams.  config: as planned with.
        true_region: for each point of `result.cloud`, whether it lies in a groove.
        report: of the executed weld, where it was executed.  has_axes: whether the known bisectors mean anything.
    """
    match = match_seams(result.findings.seams, tuple(known))
    paths = dict(enumerate(result.paths))
    pairs = [(i, j, path) for i, j in match.pairs if (path := paths.get(i)) is not None]
    errors = {j: _error(path, result.findings.seams[i], known[j], config) for i, j, path in pairs}
    out = Figures(
        scene=scene,
        method=method,
        seed=seed,
        known=len(known),
        found=len(result.findings.seams),
        missed=len(known) - len(pairs),
        phantoms=len(match.phantoms),
        phantom_length=match.phantom_length,
        coverage=0.0 if known else None,
        iou=None if true_region is None else region_overlap(result.findings.region > 0, true_region),
        seconds=sum(result.timing.get(stage, 0.0) for stage in ("cloud", "seam", "path")),
        timing=dict(result.timing),
    )
    if errors:
        out = _with_errors(out, errors, {j: i for i, j, _ in pairs}, result, known, has_axes)
    if report is not None and report.executed is not None:
        executed = report.executed
        out = replace(out, executed_mean=executed.mean, executed_p95=executed.p95, tracking_p95=report.tracking_p95)
    return out


def _error(path: TorchPath, seam: Seam, known: KnownSeam, config: CellConfig) -> LineError:
    """Of one path, with the angles and the stick-out that the config asks for taken off."""
    tip = replace(path, X_BT=wire_tip(path.X_BT, config.path))
    return path_error(tip, leaned(known, path, config.path), seam)


def _with_errors(
    out: Figures,
    errors: dict[int, LineError],
    found: dict[int, int],
    result: PlanResult,
    known: Sequence[KnownSeam],
    has_axes: bool,
) -> Figures:
    lengths = np.array([result.findings.seams[found[j]].length for j in errors])
    total = sum(seam.length for seam in known)
    return replace(
        out,
        mean=float(np.array([error.mean for error in errors.values()]) @ lengths / lengths.sum()),
        p95=max(error.p95 for error in errors.values()),
        max=max(error.max for error in errors.values()),
        coverage=sum(error.coverage * known[j].length for j, error in errors.items()) / total,
        axis_median=max(error.axis_median for error in errors.values()) if has_axes else None,
        axis_p95=max(error.axis_p95 for error in errors.values()) if has_axes else None,
    )
