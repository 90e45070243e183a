"""The regression as one self-contained page: what is worse, the table, a picture of every scene and method."""

import base64
from html import escape
from pathlib import Path

from weldsim import __version__
from weldsim.counted import counted
from weldsim.output import write_whole
from weldsim.regression.figures import FIGURES
from weldsim.regression.job import Row
from weldsim.regression.suite import Regression
from weldsim.regression.text import HEAD, number, rows_of_text, sentence, shift_sentence, unjudged
from weldsim.report.html import STYLE

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
MORE = """
.worse{color:var(--bad);font-weight:600}.ok{color:var(--good)}.new{color:var(--soft)}
figure{margin:0}img{width:100%;height:auto;display:block}figcaption{color:var(--soft);font-size:13px;margin:6px 0 0}
main{max-width:1600px}
table{font-size:13px}th{font-size:12px;vertical-align:bottom}
td,th{padding-right:6px;overflow-wrap:normal}td.num,td.worse{white-space:nowrap}td.name{min-width:7.5em;overflow-wrap:anywhere}
.seeds table{font-size:12px}.seeds th{font-size:11px}
@media(max-width:1100px){.seeds table,.seeds th{font-size:10px}.seeds td.name{min-width:4em}}
td.why{color:var(--soft);padding-left:16px;border-top:0}
"""


def page(outcome: Regression) -> str:
    """The HTML text; it asks nothing of any network."""
    word, look = ("NOT WORSE", "good") if outcome.passed else ("WORSE", "bad")
    facts = (
        f"{counted(len(outcome.scenes), 'scene')}, {counted(len(outcome.methods), 'method')}, {counted(outcome.seeds, 'seed')},"
        f" {counted(outcome.jobs, 'process')}, {outcome.seconds:.0f} s; weldsim {__version__}"
    )
    said = [*map(sentence, outcome.deviations), *map(shift_sentence, outcome.shifts), *filter(None, [unjudged(outcome)])]
    listed = "".join(f"<li>{escape(text)}</li>" for text in said)
    body = (
        f"<header><div><h1>Regression against known seams</h1><p>{escape(facts)}</p></div>"
        f'<div class="verdict {look}">{word}</div></header>'
        + (f'<ul class="reasons">{listed}</ul>' if listed else "")
        + _table(outcome)
        + _pictures(outcome)
        + _seeds(outcome)
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>weldsim regress</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1"><style>{STYLE}{MORE}</style></head>'
        f"<body><main>{body}</main></body></html>\n"
    )


def write_page(path: Path, outcome: Regression) -> Path:
    """The file written. Raises OutputError."""
    return write_whole(path, page(outcome))


def _table(outcome: Regression) -> str:
    """Median / worst of the seeds."""
    head = "".join(f"<th>{escape(name)}</th>" for name in HEAD)
    rows = []
    for cells in rows_of_text(outcome):
        plain = "".join(f'<td class="num">{escape(cell)}</td>' for cell in cells[:-1])
        rows.append(f'<tr>{plain}<td class="{cells[-1].lower()}">{cells[-1]}</td></tr>')
    note = "Median / worst of the seeds; cross-track error of the planned torch tip from the opening of the known seam."
    return f"<section><h2>Figures</h2><p>{note}</p><table><tr>{head}</tr>{''.join(rows)}</table></section>"


def _pictures(outcome: Regression) -> str:
    shown = [row for row in outcome.rows if row.picture is not None]
    if not shown:
        return ""
    return f'<div class="two">{"".join(map(_figure, shown))}</div>'


def _figure(row: Row) -> str:
    f = row.figures
    data = base64.b64encode(row.picture or b"").decode()
    caption = f"{f.scene}, {f.method}, seed {f.seed}" + (f": {f.refused}" if f.refused else "")
    alt = f"Scan of {f.scene} with the seam that {f.method} found"
    return (
        f'<section><figure><img alt="{escape(alt)}" src="data:image/jpeg;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure></section>"
    )


def _seeds(outcome: Regression) -> str:
    """Every row, every figure."""
    names = [name for name in FIGURES if any(name in row.figures.judged() for row in outcome.rows)]
    head = "".join(f"<th>{escape(text)}</th>" for text in ("scene", "method", "seed", *map(_labelled, names)))
    rows = []
    for row in outcome.rows:
        figures, worse = row.figures.judged(), {deviation.figure for deviation in row.deviations}
        cells = "".join(
            f'<td class="{"worse" if name in worse else "num"}">{escape(text)}</td>'
            for name, text in ((name, number(name, figures[name], unit=False) if name in figures else "") for name in names)
        )
        scene = f'<td class="name">{escape(row.figures.scene)}</td>'
        start = f"{scene}<td>{escape(row.figures.method)}</td><td>{row.figures.seed}</td>"
        rows.append(f"<tr>{start}{cells}</tr>")
        why = "; ".join(filter(None, (row.figures.refused, f"run directory {row.folder}" if row.folder else "")))
        if why:  # in a line of its own: beside the figures there is no room
            rows.append(f'<tr><td class="why" colspan="{3 + len(names)}">{escape(why)}</td></tr>')
    return f'<section class="seeds"><h2>Every seed</h2><table><tr>{head}</tr>{"".join(rows)}</table></section>'


def _labelled(name: str) -> str:
    """A figure's name over its column, with the unit that its numbers are in."""
    figure = FIGURES[name]
    unit = {"length": "mm", "angle": "deg", "time": "s"}.get(figure.kind)
    return figure.label.removesuffix(", seconds") + ("" if unit is None else f" [{unit}]")
