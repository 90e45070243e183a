"""A dry run as one self-contained page: verdict, waypoints, fixes, joint plots, the first failure; it loads nothing."""

import base64
import importlib.resources
import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from weldsim import units
from weldsim.counted import counted
from weldsim.dryrun.margin import Margin
from weldsim.dryrun.margins import joint_speeds
from weldsim.dryrun.verdict import DryRun, Fix, Trial, Verdict, runs, span
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES, SPEED_LIMIT
from weldsim.output import write_whole
from weldsim.report.figures import shade_arc
from weldsim.report.html import DRAW, POLICY, STYLE
from weldsim.report.style import BAD, GRID, INK, JOINTS

SAMPLES = 3000  # drawn of one line
ROWS = 200  # of the table of waypoints


def write_page(
    path: Path | str, result: DryRun, pictures: tuple[bytes | None, ...] = (), *, speed_limit: float = SPEED_LIMIT
) -> Path:
    """The page written, about 5 MB of it plotly.js. Raises OutputError.

    Args:
        pictures: a PNG for each trial, None where there is none.
        speed_limit: of the joints [rad/s], as the motion was planned with.
    """
    drawn: list[dict[str, Any]] = []
    word, look = ("WOULD PASS", "good") if result.passed else ("WOULD FAIL", "bad")
    facts = f"in the cell {result.cell}; cycle time {result.cycle:.1f} s" if result.passed else f"in the cell {result.cell}"
    body = [
        f"<header><div><h1>Dry run of {escape(result.source)}</h1><p>{escape(facts)}</p></div>"
        f'<div class="verdict {look}">{word}</div></header>'
    ]
    body += [f"<p>{escape(note)}</p>" for note in result.notes]
    for trial, fixes, png in zip(result.trials, result.fixes, pictures or (None,) * len(result.trials), strict=True):
        body.append(_trial(trial, fixes, png, drawn, speed_limit))
    return write_whole(path, _page(f"dry run of {result.source}", "".join(body), drawn))


def _broken(fix: Fix) -> str:
    return f"; {escape(', '.join(fix.breaks))} would fail with it" if fix.breaks else ""


def _trial(trial: Trial, fixes: tuple[Fix, ...], png: bytes | None, drawn: list[dict[str, Any]], speed_limit: float) -> str:
    failure = trial.failure
    what = "motion" if trial.verdicts[0].line else "waypoint"
    said = f"{units.to_mm(trial.length):.0f} mm long, {counted(len(trial.verdicts), what)}"
    parts = [f"<section><h2>{escape(trial.name)}: {'would pass' if failure is None else 'would fail'}</h2><p>{escape(said)}</p>"]
    if failure is not None:
        parts.append(f'<ul class="reasons"><li>{escape(place(failure))}: {escape(failure.why)}: {escape(failure.text)}</li></ul>')
        listed = "".join(
            f"<li>{escape(fix.text)} (applied and checked: passes{_broken(fix)})<br><code>{escape(fix.how)}</code></li>"
            for fix in fixes
        )
        parts.append(f"<h2>What would help</h2><ul>{listed}</ul>" if fixes else "<p>No change that was tried would help.</p>")
    parts += [f"<p>{escape(note)}</p>" for note in trial.notes]
    parts.append("</section>")
    if png is not None:
        image = base64.b64encode(png).decode()
        title = "First failure" if failure is not None else "Halfway"
        alt = escape(f"{trial.name}: the arm {'where it fails first' if failure is not None else 'halfway'}")
        parts.append(
            f'<section><h2>{title}</h2><img style="max-width:100%" alt="{alt}" src="data:image/png;base64,{image}"></section>'
        )
    if trial.margins:
        parts.append(f"<section><h2>Clearance and margins</h2>{_margins(trial.margins)}</section>")
    parts.append(f"<section><h2>{what.capitalize()}s</h2>{_waypoints(trial, what)}</section>")
    if len(trial.q) > 1:
        plots = [("Joint angles", trial.t, np.rad2deg(trial.q), "joint angle [deg]", np.rad2deg(JOINT_LIMIT))]
        plots.append(("Joint speeds", trial.t[1:], np.rad2deg(joint_speeds(trial)), "joint speed [deg/s]", np.rad2deg(speed_limit)))
        sections = "".join(_plot(drawn, *plot, trial) for plot in plots)
        parts.append(f'<div class="two">{sections}</div>')
    return "".join(parts)


def _margins(found: tuple[Margin, ...]) -> str:
    """The table of what the motion has to spare."""
    rows = []
    for margin in found:
        value, limit = margin.said
        cells = f'<td>{escape(margin.figure)}</td><td class="num">{escape(value)}</td><td class="num">{escape(limit)}</td>'
        rows.append(f'<tr>{cells}<td class="num">{margin.when}</td><td>{escape(margin.of)}</td></tr>')
    head = "".join(f"<th>{name}</th>" for name in ("figure", "worst", "limit", "at", "of"))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def place(verdict: Verdict) -> str:
    """Where a verdict is, in words."""
    return verdict.label if verdict.s is None else f"{verdict.label}, s = {units.to_mm(verdict.s):.1f} mm"


def _waypoints(trial: Trial, what: str) -> str:
    rows = []
    found = runs(trial.verdicts)
    for first, last in found[:ROWS]:
        s = _span(first.s, last.s)
        mark = '<td class="mark ok">ok</td>' if first.ok else f'<td class="mark no">{escape(first.why)}</td>'
        rows.append(
            f'<tr><td class="num">{escape(span(first, last))}</td><td class="num">{s}</td>{mark}<td>{escape(first.text)}</td></tr>'
        )
    more = f"<p>and {len(found) - ROWS} more</p>" if len(found) > ROWS else ""
    head = f"<tr><th>{what}</th><th>s</th><th>verdict</th><th>reason</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>{more}"


def _span(first: float | None, last: float | None) -> str:
    """Arc lengths [m] of the first and last waypoint of a row, in words."""
    if first is None:
        return ""
    if last is None or last == first:
        return f"{units.to_mm(first):.1f} mm"
    return f"{units.to_mm(first):.1f} to {units.to_mm(last):.1f} mm"


def _plot(drawn: list[dict[str, Any]], title: str, t: ndarray, values: ndarray, label: str, limit: float, trial: Trial) -> str:
    stride = max(1, len(t) // SAMPLES)
    name = f"figure-{len(drawn) + 1}"
    axis = {"gridcolor": GRID, "zerolinecolor": "#c5ccd3", "linecolor": GRID, "automargin": True}
    layout: dict[str, Any] = {
        "height": 320,
        "margin": {"l": 56, "r": 16, "t": 34, "b": 46},
        "font": {"family": "system-ui, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif", "size": 12, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "xaxis": {**axis, "title": {"text": "time [s]"}},
        "yaxis": {**axis, "title": {"text": label}, "range": [-1.12 * limit, 1.12 * limit]},
    }
    unit = label[label.index("[") + 1 : label.index("]")]
    line = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "line": {"color": BAD, "width": 1, "dash": "dot"}}
    layout["shapes"] = [{**line, "y0": edge, "y1": edge} for edge in (-limit, limit)]
    word = {"x": 1, "xref": "paper", "xanchor": "right", "showarrow": False, "font": {"size": 10, "color": BAD}}
    layout["annotations"] = [
        {**word, "y": edge, "yanchor": anchor, "text": f"limit {edge:+.0f} {unit}"}
        for edge, anchor in ((limit, "top"), (-limit, "bottom"))
    ]
    shade_arc(layout, trial.t, trial.arc_on)
    data = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": joint.replace("_", " "),
            "x": np.round(t[::stride], 4).tolist(),
            "y": np.round(column[::stride], 3).tolist(),
            "line": {"color": colour, "width": 1.5},
        }
        for joint, column, colour in zip(JOINT_NAMES, values.T, JOINTS, strict=True)
    ]
    drawn.append({"id": name, "data": data, "layout": layout})
    return f'<section><h2>{escape(title)}</h2><div id="{name}" style="height:320px"></div></section>'


def _page(title: str, body: str, drawn: list[dict[str, Any]]) -> str:
    plotly = (importlib.resources.files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    data = json.dumps(drawn, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>weldsim: {escape(title)}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1"><style>{STYLE}</style></head>'
        f"<body><main>{body}</main><script>{plotly}</script><script>const FIGURES={data};{DRAW}</script></body></html>\n"
    )
