"""Regression against known seams: every scene, every method, several seeds, beside recorded figures.

    from weldsim.regression import read_golden, regress

    outcome = regress(["straight", "my_part.toml"], finders={"mine": find_my_seams}, seeds=3, jobs=2)
    for row in outcome.rows:
        print(row.figures.scene, row.figures.method, row.figures.seed, row.figures.judged())

A finder is a function from `PointCloud` to `SeamFindings`; with `jobs` above 1 it must be importable by other processes.
A recorded cloud with a line that is known to be its seam is judged by the same definitions: see `weldsim.regression.recorded`.
"""

from weldsim.regression.distribution import Judgement, Shift, judge
from weldsim.regression.figures import FIGURES, Figure, Figures, figures_of
from weldsim.regression.golden import Deviation, Golden, compare, default_golden, read_golden, updated, write_golden
from weldsim.regression.junit import write_junit
from weldsim.regression.suite import Regression, Row, regress

__all__ = [
    "FIGURES",
    "Deviation",
    "Figure",
    "Figures",
    "Golden",
    "Judgement",
    "Regression",
    "Row",
    "Shift",
    "compare",
    "default_golden",
    "figures_of",
    "judge",
    "read_golden",
    "regress",
    "updated",
    "write_golden",
    "write_junit",
]
