"""The report as one self-contained page: verdict, figures beside their limits, pictures. It asks nothing of any network."""

import base64
import importlib.resources
import json
from collections.abc import Mapping
from html import escape
from pathlib import Path

from weldsim import units
from weldsim.counted import counted
from weldsim.kinematics import JOINT_NAMES
from weldsim.output import write_whole
from weldsim.records import ExecutionLog, KnownSeam, PointCloud, SeamFindings, Threshold, TorchPath, WeldReport
from weldsim.report import figures
from weldsim.report.limits import Check, ReportConfig, checks
from weldsim.report.verdict import PATH_FILE, found_by, look, stopped_place, verdict
from weldsim.report.view import cross_section, error_lines, shows_surface

STYLE = """
:root{--ink:#1c2733;--soft:#66727f;--line:#e3e7eb;--good:#1b7f4b;--bad:#b3261e;--amber:#a85b00;--plain:#12355b}
*{box-sizing:border-box}
body{margin:0;background:#f3f5f7;color:var(--ink);font:15px/1.45 system-ui,"Segoe UI",Roboto,"Liberation Sans",sans-serif}
main{max-width:1280px;margin:0 auto;padding:24px}
header{display:flex;justify-content:space-between;align-items:center;gap:24px;margin-bottom:16px}
h1{font-size:26px;margin:0}h2{font-size:17px;margin:0 0 10px}p{margin:4px 0;color:var(--soft)}
.verdict{padding:10px 20px;border-radius:8px;color:#fff;font-weight:700;font-size:20px;white-space:nowrap}
.good{background:var(--good)}.amber{background:var(--amber)}.bad{background:var(--bad)}.plain{background:var(--plain)}
.reasons{border-left:4px solid var(--bad);margin:0 0 16px;padding:10px 16px 10px 32px;background:#fff}
.reasons.look{border-left-color:var(--amber)}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(132px,1fr));gap:12px;margin-bottom:16px}
.card,section{background:#fff;border:1px solid var(--line);border-radius:8px;padding:14px 16px}
.card b{display:block;font-size:18px;white-space:nowrap}.card span{color:var(--soft);font-size:13px}
section{margin-bottom:16px;overflow-x:auto}
.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(520px,100%),1fr));gap:16px}
.two{margin-bottom:16px}.two>section,section>.two{margin-bottom:0}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th{text-align:left;color:var(--soft);font-weight:600;font-size:13px}
th,td{padding:5px 10px 5px 0;border-bottom:1px solid var(--line);vertical-align:top}
tr:last-child td{border-bottom:0}.num{white-space:nowrap}
.checks{align-items:start}.checks table{table-layout:fixed}.checks .num{white-space:normal}
.checks th:first-child{width:42%}.checks th:last-child{width:14%}
.mark{white-space:nowrap;font-weight:600}.mark.ok{color:var(--good)}.mark.no{color:var(--bad)}.mark.look{color:var(--amber)}
.bar{height:10px;background:#7d9bb8;border-radius:3px;min-width:2px}
main>p{margin:0 0 16px}
.still img{width:100%;height:auto;display:block}
footer{color:var(--soft);font-size:13px;overflow-wrap:anywhere}
"""
# No address may be loaded, whatever a file name or a library slips in; plotly's shaders need eval and blobs.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:"
)
# A scene needs WebGL: where there is none its still picture stays. On a narrow page the eye stands back, or the titles of the axes
# would be cut off.
DRAW = """
const GL = (() => {
  const canvas = document.createElement("canvas");
  try { return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl")); } catch { return false; }
})();
for (const f of FIGURES) {
  const place = document.getElementById(f.id);
  if ("scene" in f.layout) {
    if (!GL) { place.hidden = true; continue; }
    for (const still of document.querySelectorAll(`[data-still="${f.id}"]`)) { still.hidden = true; }
    const margin = f.layout.margin, width = place.clientWidth - margin.l - margin.r;
    const back = Math.max(1, f.narrow * (f.layout.height - margin.t - margin.b) / Math.max(width, 1));
    for (const [axis, value] of Object.entries(f.layout.scene.camera.eye)) { f.layout.scene.camera.eye[axis] = back * value; }
  }
  Plotly.newPlot(f.id, f.data, f.layout, {responsive: true, displaylogo: false, displayModeBar: "scene" in f.layout});
}
"""


def write_html(
    path: Path | str,
    report: WeldReport,
    cloud: PointCloud,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    *,
    log: ExecutionLog | None = None,
    known: tuple[KnownSeam, ...] = (),
    welded: int = 0,
    others: Mapping[int, ExecutionLog] | None = None,
    joint_names: tuple[str, ...] = tuple(name.replace("_", " ") for name in JOINT_NAMES),
    config: ReportConfig | None = None,
    still: bytes | None = None,
) -> Path:
    """The page written, about 5 MB of it plotly.js. Raises OutputError.

    Args:
        path: the file to write.  report: figures and verdict.
        cloud, findings, paths: what was seen, found and planned.
        log: what the arm did along `paths[welded]`; adds speed and joints.
        known: the true seams; adds the errors along the seam.
        others: what the arm did along other paths of the job, by their index.
        joint_names: in the order of the log's columns.
        config: the limits the verdict was made with.
        still: the job's picture, a PNG, shown in place of the 3D figure by a browser that cannot draw that.
    """
    config = config or ReportConfig()
    drawn: list[figures.Figure] = []
    body = [_header(report, findings, config), _cards(report, findings, welded), _checks(checks(report, config))]
    driven = tuple(each for each in (log, *(others or {}).values()) if each is not None)
    scene = figures.scene(cloud, findings, paths, driven, known, stopped_place(report))
    body.append(_scene(drawn, _shown(cloud, findings, paths), scene, still))
    stopped = None if report.stopped is None or report.progress is None else report.progress.s_to
    logs = {welded: log, **(others or {})}
    for index, each in logs.items():
        here = stopped if index == list(logs)[-1] else None  # the job ended there
        plots = _plots(drawn, cloud, findings, paths, each, known, index, joint_names, config, here)
        title = f"<h2>Seam {index + 1}</h2>" if len(findings.seams) > 1 else ""
        body.append(f'{title}<div class="two">{"".join(plots)}</div>' if plots else "")
    body.append(
        f'<div class="two">{_seams(findings)}{_refused(report, findings)}{_threshold(findings.threshold)}{_timing(report)}</div>'
    )
    body.append(_footer(report))
    return write_whole(path, _page(report.scene, "".join(body), drawn))


def _page(title: str, body: str, drawn: list[figures.Figure]) -> str:
    plotly = (importlib.resources.files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    data = json.dumps(drawn, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>weldsim: {escape(title)}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1"><style>{STYLE}</style></head>'
        f"<body><main>{body}</main><script>{plotly}</script><script>const FIGURES={data};{DRAW}</script></body></html>\n"
    )


def _plots(
    drawn: list[figures.Figure],
    cloud: PointCloud,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    log: ExecutionLog | None,
    known: tuple[KnownSeam, ...],
    welded: int,
    joint_names: tuple[str, ...],
    config: ReportConfig,
    stopped: float | None,
) -> list[str]:
    """The two-column figures that there is data for. Args: stopped, at which arc length [m], None where it was not."""
    out = []
    lines = error_lines(findings, paths, log, known, welded)
    if lines:
        out.append(_figure(drawn, "Error across the known seam", figures.errors_across(lines)))
        out.append(_figure(drawn, "Cross-track distance", figures.errors_distance(lines, config)))
    if welded < len(findings.seams):
        seam = findings.seams[welded]
        if shows_surface(cloud, (seam,)):  # a path that came from a file has no cloud about it
            out.append(_figure(drawn, "Mean cross-section", figures.section(cross_section(cloud, seam))))
        measured = {"standard deviation": seam.sigma is not None, "width": seam.left_B is not None and seam.right_B is not None}
        named = [name for name, there in measured.items() if there]  # a path that came from a file has no lips
        if named:
            out.append(_figure(drawn, f"{' and '.join(named).capitalize()} along the seam", figures.uncertainty(seam)))
    path = paths[welded] if welded < len(paths) else None
    if log is not None and path is not None:
        speed = figures.torch_speed(log, path, config, stopped)
        if speed is not None:
            out.append(_figure(drawn, "Torch speed", speed))
        out.append(_figure(drawn, "Joint angles", figures.joints(log, "q", joint_names)))
        out.append(_figure(drawn, "Joint speeds", figures.joints(log, "qd", joint_names)))
        if log.torque is not None:
            out.append(_figure(drawn, "Joint torques", figures.joints(log, "torque", joint_names)))
    return out


def _shown(cloud: PointCloud, findings: SeamFindings, paths: tuple[TorchPath | None, ...]) -> str:
    """What the 3D figure shows, in words: "Cloud, seam and torch path in the robot base"."""
    parts = ["cloud"] if shows_surface(cloud, findings.seams) else []
    parts += ["seam" if len(findings.seams) == 1 else "seams"] if findings.seams else []
    driven = sum(path is not None for path in paths)
    parts += ["torch path" if driven == 1 else "torch paths"] if driven else []
    *others, last = parts
    return f"{', '.join(others)}{' and ' if others else ''}{last} in the robot base".capitalize()


def _scene(drawn: list[figures.Figure], title: str, figure: figures.Figure, still: bytes | None) -> str:
    """The section of the 3D figure, with what stays where a browser does not draw it."""
    name = f"figure-{len(drawn) + 1}"
    why = "This browser draws no 3D figure: WebGL or scripts are missing or switched off."
    if still is not None:
        image = base64.b64encode(still).decode()
        picture = f'<img alt="{escape(title)}" src="data:image/png;base64,{image}">'
        why = f"{why} The still picture:"
    else:
        picture = ""
    instead = f'<div class="still" data-still="{name}"><p>{why}</p>{picture}</div>'
    return _figure(drawn, title, {**figure, "narrow": figures.NARROW}).replace("</h2>", f"</h2>{instead}", 1)


def _figure(drawn: list[figures.Figure], title: str, figure: figures.Figure) -> str:
    """A section that the page's script draws `figure` into."""
    name = f"figure-{len(drawn) + 1}"
    drawn.append({"id": name, **figure})
    return f'<section><h2>{escape(title)}</h2><div id="{name}" style="height:{figure["layout"]["height"]}px"></div></section>'


def _header(report: WeldReport, findings: SeamFindings, config: ReportConfig) -> str:
    word, why = verdict(report, len(findings.seams), config)
    listed = "" if report.passed else "".join(f"<li>{escape(reason)}</li>" for reason in report.reasons)
    on = (report.way_on,) if report.way_on else ()
    listed += "".join(f"<li>{escape(clause)}</li>" for clause in (*on, *report.warnings, *report.unplanned))
    facts = f"{why}; {found_by(report)}" + ("" if report.seed is None else f", seed {report.seed}")
    return (
        f"<header><div><h1>{escape(report.scene)}</h1><p>{escape(facts)}</p></div>"
        f'<div class="verdict {look(word)}">{escape(word)}</div></header>'
        + (f'<ul class="reasons{" look" if report.passed else ""}">{listed}</ul>' if listed else "")
    )


def _cards(report: WeldReport, findings: SeamFindings, welded: int) -> str:
    """The handful of numbers that are read first; of several seams, those of the first that was welded."""
    count = len(findings.seams)
    told = "in the path file" if report.method == PATH_FILE else "found"
    cards: list[tuple[str, str]] = [(str(count), f"{'seam' if count == 1 else 'seams'} {told}")]
    if findings.seams:
        index = welded if welded < count else 0
        seam = findings.seams[index]
        cards.append((f"{units.to_mm(seam.length):.1f} mm", "length" if count == 1 else f"length of seam {index + 1}"))
        if seam.width > 0:  # a method that measures none leaves 0
            cards.append((f"{units.to_mm(seam.width):.1f} mm", "width of the opening"))
        if seam.step:
            cards.append((f"{units.to_mm(seam.step):+.1f} mm", "left lip above the right one"))
        if seam.confidence > 0:
            cards.append((f"{seam.confidence:.2f}", "confidence"))
        if seam.sigma is not None:
            cards.append((f"{units.to_mm(float(seam.sigma.mean())):.2f} mm", "sigma across, mean"))
        if seam.gaps:
            missing = sum(s1 - s0 for s0, s1 in seam.gaps)
            cards.append((f"{units.to_mm(missing):.1f} mm", f"not measured, in {counted(len(seam.gaps), 'gap')}"))
    for name, error in (("plan", report.plan), ("executed", report.executed)):
        if error is not None:
            cards.append((f"{units.to_mm(error.mean):.2f} mm", f"{name} from the known {error.reference}, mean"))
    if report.timing:
        cards.append((f"{sum(report.timing.values()):.2f} s", "all stages"))
    return (
        '<div class="cards">'
        + "".join(f'<div class="card"><b>{escape(a)}</b><span>{escape(b)}</span></div>' for a, b in cards)
        + "</div>"
    )


def _checks(listed: tuple[Check, ...]) -> str:
    if not listed:
        return ""
    marks = {True: '<td class="mark ok">kept</td>', False: '<td class="mark no">exceeded</td>', None: "<td></td>"}
    amber = '<td class="mark look">amber</td>'
    rows = []
    for c in listed:
        figure = f'<td>{escape(c.figure)}</td><td class="num">{escape(c.value)}</td><td class="num">{escape(c.limit)}</td>'
        rows.append(f"<tr>{figure}{amber if c.passed and c.amber else marks[c.passed]}</tr>")
    half = -(-len(rows) // 2)
    tables = "".join(_table(("figure", "value", "limit", ""), part) for part in (rows[:half], rows[half:]) if part)
    return f'<section><h2>Figures and limits</h2><div class="two checks">{tables}</div></section>'


def _seams(findings: SeamFindings) -> str:
    rows = [
        f"<tr><td>{i}</td><td>{escape(seam.joint)}, {escape(seam.reference)}</td>"
        + "".join(
            f'<td class="num">{text}</td>'
            for text in (
                f"{units.to_mm(seam.length):.1f} mm",
                f"{units.to_mm(seam.width):.1f} mm" if seam.width > 0 else "",
                "" if seam.depth is None else f"{units.to_mm(seam.depth):.1f} mm",
                f"{units.to_mm(seam.residual):.2f} mm" if seam.residual > 0 else "",
                f"{seam.confidence:.2f}" if seam.confidence > 0 else "",
            )
        )
        + "</tr>"
        for i, seam in enumerate(findings.seams, 1)
    ]
    return _section(
        "Seams", ("", "joint, reference", "length", "width", "depth", "residual", "confidence"), rows, "None was found."
    )


def _refused(report: WeldReport, findings: SeamFindings) -> str:
    if report.method == PATH_FILE:  # nothing was looked for
        return ""
    rows = []
    for r in findings.rejected:
        where = ", ".join(f"{units.to_mm(v):.0f}" for v in r.position_B)
        rows.append(
            f'<tr><td class="num">{units.to_mm(r.length):.0f} mm</td><td class="num">{where}</td><td>{escape(r.reason)}</td></tr>'
        )
    return _section("Candidates refused", ("length", "at x, y, z [mm]", "reason"), rows, "There were none.")


def _threshold(threshold: Threshold | None) -> str:
    """The detection threshold and how far the answer moves with it."""
    if threshold is None:
        return ""
    rows = []
    for factor, move in threshold.stability.items():
        text = f"{units.to_mm(move):.3f} mm" if move < float("inf") else "seam lost"
        rows.append(f'<tr><td class="num">x {escape(factor)}</td><td class="num">{text}</td></tr>')
    scale, unit = (1e3, "mm") if threshold.unit == "m" else (1.0, threshold.unit.removeprefix("1"))
    value, noise = (f"{scale * number:.3g} {unit}".strip() for number in (threshold.value, threshold.noise))
    note = escape(f"{threshold.name}: {value}, chosen from the cloud's own noise of {noise}.")
    return _section("Threshold", ("threshold", "greatest movement of the centre line"), rows, "", note)


def _timing(report: WeldReport) -> str:
    most = max(report.timing.values(), default=0.0)
    rows = [
        f'<tr><td>{escape(stage)}</td><td class="num">{1e3 * seconds:.0f} ms</td>'
        f'<td style="width:55%"><div class="bar" style="width:{100 * seconds / most if most else 0:.1f}%"></div></td></tr>'
        for stage, seconds in report.timing.items()
    ]
    return _section("Run times", ("stage", "time", ""), rows, "") if rows else ""


def _section(title: str, head: tuple[str, ...], rows: list[str], empty: str, note: str = "") -> str:
    body = _table(head, rows) if rows else f"<p>{escape(empty)}</p>"
    return f"<section><h2>{escape(title)}</h2>{f'<p>{note}</p>' if note else ''}{body}</section>"


def _table(head: tuple[str, ...], rows: list[str]) -> str:
    cells = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _footer(report: WeldReport) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in report.versions.items())
    digest = f"config {report.config_digest}. " if report.config_digest else ""
    return f"<footer>{escape(digest)}{escape(versions)}</footer>"
