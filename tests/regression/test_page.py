"""The regression's page fits the width of a screen, whatever was measured."""

import html
import re

from weldsim.regression.figures import FIGURES, Figures
from weldsim.regression.job import Row
from weldsim.regression.page import page
from weldsim.regression.suite import Regression

SCREEN = 1280 - 2 * 24 - 2 * 17  # [px] without the page's and the section's edges
LETTER, GAP = 7.0, 6  # [px] of a letter of the table of seeds at the most, and between columns


def outcome() -> Regression:
    """Every figure measured, and a long reason beside them."""
    x = 0.1234567
    rows = tuple(
        Row(
            figures=Figures(
                scene="y_branches",
                method="thesis",
                seed=seed,
                known=3,
                found=3,
                refused="no path: " + 30 * "why ",
                phantom_length=x,
                mean=x,
                p95=x,
                max=x,
                coverage=x,
                axis_median=x,
                axis_p95=x,
                iou=x,
                executed_mean=x,
                executed_p95=x,
                tracking_p95=x,
                seconds=x,
            )
        )
        for seed in range(3)
    )
    return Regression(rows=rows, scenes=("y_branches",), methods=("thesis",), seeds=3, jobs=2, seconds=60.0)


def test_every_figure_is_measured_here() -> None:
    assert all(set(row.figures.judged()) == set(FIGURES) for row in outcome().rows)


def test_no_table_is_wider_than_the_screen() -> None:
    text = page(outcome())
    for table in re.findall(r"<table>(.*?)</table>", text, flags=re.DOTALL):
        widths: list[int] = []
        for row in re.findall(r"<tr>(.*?)</tr>", table, flags=re.DOTALL):
            cells = re.findall(r"<t([dh])(?: class=\"(\w+)\")?( colspan=\"\d+\")?>(.*?)</t[dh]>", row)
            if any(span for _, _, span, _ in cells):
                continue  # a line over the whole width, which breaks at words
            for i, (kind, _, _, content) in enumerate(cells):
                words = re.split(r"[ -]", html.unescape(content)) if kind == "h" else [html.unescape(content)]
                widths += [0] * (i + 1 - len(widths))
                widths[i] = max(widths[i], *map(len, words))
        assert sum(widths) * LETTER + len(widths) * GAP < SCREEN
    assert not re.search(r"th\{[^}]*anywhere", text), "headings break between words, never within one"


def test_reasons_stand_under_their_figures_and_units_over_them() -> None:
    text = page(outcome())
    assert text.count("no path: why why") == 3
    assert "<th>cross-track mean [mm]</th>" in text
    assert "<th>wire axis p95 [deg]</th>" in text
    assert "123.457" in text
    assert "123.457 mm" not in text
