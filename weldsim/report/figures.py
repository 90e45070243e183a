"""The interactive figures of the report page, as plain plotly figure dictionaries ({"data", "layout"}), lengths in millimetres.

Plain dictionaries, so that writing a page needs plotly's script alone; the tests check each with plotly's own classes.
"""

import base64
from typing import Any

import numpy as np
from numpy import ndarray

from weldsim import units
from weldsim.frames import unit
from weldsim.records import ExecutionLog, KnownSeam, PointCloud, Seam, SeamFindings, TorchPath
from weldsim.report.limits import ReportConfig
from weldsim.report.style import BAD, CENTRE, GRID, INK, JOINTS, KNOWN, LINES, LIPS, REGION, SEAM, SOFT, WIDTHS, WIRE
from weldsim.report.tracking import speed_error
from weldsim.report.view import CrossSection, ErrorLine, height_range, heights, shown, shows_surface, torch_axes, view_frame

Figure = dict[str, Any]
CLOUD_LIMIT = 60_000  # points drawn
LONGEST = 1.0  # side of the scene, in units of plotly's camera
SEEN = 0.68 * np.tan(np.pi / 8)  # half the height that plotly's camera sees at distance 1, without the room that labels take
WIDER = 1.6  # how much wider than high a scene is on a wide page
NARROW = 1.3  # on a narrower one than this the eye stands back, chosen: titles of the axes are whole at 800 and at 1280 pixels
POLE = 0.05  # [m] height of the mark where a weld was stopped, over the seam
TICKS = 10  # on the longest side of the scene, fewer on shorter ones: they have to stand apart
LABEL = 28  # [px] height of a label of two lines
LINE_LIMIT = 3000  # samples drawn of one line


def scene(
    cloud: PointCloud,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    logs: tuple[ExecutionLog, ...],
    known: tuple[KnownSeam, ...],
    stopped_B: tuple[float, float, float] | None = None,
) -> Figure:
    """Cloud, groove region, lips, centre lines, torch path and wires in the robot base; where a weld was stopped [m]."""
    X_BS = view_frame(cloud, findings.seams)
    index = shown(cloud, findings.seams, CLOUD_LIMIT)
    inside = findings.region[index] > 0 if len(findings.region) == len(cloud) else np.zeros(len(index), bool)
    points, groove = cloud.points[index[~inside]], cloud.points[index[inside]]
    height = heights(points, findings.seams, X_BS)
    low, high = height_range(height, findings.seams)
    colour = {"color": _array(1e3 * height), "colorscale": "Cividis", "cmin": 1e3 * low, "cmax": 1e3 * high}
    bar = {"title": {"text": "height [mm]", "side": "right"}, "thickness": 12, "len": 0.6, "x": 1.0, "outlinewidth": 0}
    data = [_dots("cloud", points, {"size": 2.2, **colour, "colorbar": bar})] if shows_surface(cloud, findings.seams) else []
    if len(groove):
        data.append(_dots("groove region", groove, {"size": 2.4, "color": REGION}))
    for i, seam in enumerate(findings.seams):
        sides = [side for side in (seam.left_B, seam.right_B) if side is not None]
        data += [_line("lips", side, LIPS, 4, legend=i == k == 0) for k, side in enumerate(sides)]
        data.append(_line("centre line", seam.points_B, CENTRE, 3, legend=i == 0))
    for i, path in enumerate(path for path in paths if path is not None):
        data.append(_line("torch path", path.X_BT.p[path.weld], SEAM, 7, legend=i == 0))
        for name, end, symbol in (("start", 0, "circle"), ("end", -1, "square-open")):
            place = path.X_BT.p[path.weld][[end]]
            data.append(_dots(name, place, {"size": 7 + (end < 0) * 3, "color": SEAM, "symbol": symbol}) | {"showlegend": i == 0})
        wires = np.full((len(torch_axes(path)), 3, 3), np.nan)
        wires[:, :2] = torch_axes(path)
        data.append(_line("wire", wires.reshape(-1, 3), WIRE, 4, legend=i == 0))
    data += [_line("known seam", k.opening_B, KNOWN, 4, legend=i == 0) for i, k in enumerate(known)]
    for i, log in enumerate(log for log in logs if log.arc_on.any()):
        data.append(_line("executed tip", _thin(log.X_BT_act.p[log.arc_on]), LINES["executed"], 3, legend=i == 0))
    flag = np.empty((0, 3))
    if stopped_B is not None:  # on a pole: on the seam itself the lines would hide it
        flag = np.array(stopped_B) + np.array([[0.0], [POLE]]) * X_BS.R[:, 2]
        data.append(_line("stopped here", flag, BAD, 8, legend=False))
        mark = _dots("stopped here", flag[1:], {"size": 7, "color": BAD, "symbol": "diamond"})
        data.append(mark | {"mode": "markers+text", "text": ["stopped"], "textposition": "top center", "textfont": {"color": BAD}})
    box = np.concatenate([points, groove, flag, *(torch_axes(path).reshape(-1, 3) for path in paths if path is not None)])
    shape, eye = _fitted(box, unit(0.9 * X_BS.R[:, 2] - 0.75 * X_BS.R[:, 1]), X_BS.R[:, 2])
    axis = {"backgroundcolor": "#f7f9fa", "gridcolor": GRID, "showbackground": True, "color": SOFT, "tickfont": {"size": 10}}
    axis |= {"zeroline": False, "showspikes": False}
    layout = _layout("", "", height=620)
    del layout["xaxis"], layout["yaxis"]
    layout |= {
        "scene": {
            **{
                f"{name}axis": {**axis, "title": {"text": f"{name} [mm]"}, "nticks": max(3, round(TICKS * side / LONGEST))}
                for name, side in zip("xyz", shape, strict=True)
            },
            "aspectmode": "manual",
            "aspectratio": _xyz(shape),
            "camera": {"eye": _xyz(eye), "up": _xyz(X_BS.R[:, 2])},
        },
        "margin": {"l": 0, "r": 90, "t": 8, "b": 0},
        "legend": {"orientation": "h", "y": 0.01, "x": 0.01, "bgcolor": "rgba(255,255,255,0.8)", "itemsizing": "constant"},
    }
    return {"data": data, "layout": layout}


def _fitted(points_B: ndarray, towards: ndarray, up: ndarray) -> tuple[ndarray, ndarray]:
    """Sides of the box about the points, in true proportions and plotly's units, and the nearest eye from which all of it is seen.

    Args:
        towards: direction of the eye from the middle of the box.  up: what is up in the picture.
    """
    span = np.maximum(np.ptp(points_B, axis=0), 1e-4)
    shape = np.maximum(LONGEST * span / span.max(), 0.02)
    right = unit(np.cross(up, towards))
    axes = np.stack([right, np.cross(towards, right), towards])
    corners = axes @ (np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape / 2).T
    # A corner at height h and depth d under the eye is seen below the angle atan(h / (far - d)).
    aside, above, depth = np.abs(corners[0]) / (WIDER * SEEN), np.abs(corners[1]) / SEEN, corners[2]
    return shape, float((np.maximum(aside, above) + depth).max()) * towards


def uncertainty(seam: Seam) -> Figure:
    """Standard deviation across the seam, and the width between the lips, along it; each where it was measured."""
    s = 1e3 * seam.s
    data, top = [], {"yaxis": 0.0, "yaxis2": 0.0}
    if seam.sigma is not None:
        top["yaxis"] = 1.3e3 * float(seam.sigma.max())
        data.append(_trace("sigma", s, 1e3 * seam.sigma, SEAM, fill="tozeroy", fillcolor="rgba(228,87,46,0.10)"))
    if seam.left_B is not None and seam.right_B is not None:
        width = 1e3 * np.linalg.norm(seam.left_B - seam.right_B, axis=1)
        top["yaxis2"] = 1.15 * float(width.max())
        data.append(_trace("width, right scale", s, width, WIRE, dash="dot", yaxis="y2"))
    layout = _layout("along the seam [mm]", "sigma [mm]")
    if top["yaxis2"] > 0:
        layout["yaxis2"] = {
            "overlaying": "y",
            "side": "right",
            "title": {"text": "width [mm]"},
            "showgrid": False,
            "tickmode": "auto",
            "linecolor": GRID,
        }
        layout["margin"]["r"] = 56
    for axis, value in top.items():
        if axis in layout:
            layout[axis] |= {"range": [0.0, value]} if value > 0 else {"visible": False}
    layout["shapes"] = [  # what was not measured
        {"type": "rect", "xref": "x", "yref": "paper", "x0": 1e3 * s0, "x1": 1e3 * s1, "y0": 0, "y1": 1}
        | {"line": {"width": 0}, "fillcolor": "rgba(120,120,120,0.18)", "layer": "below"}
        for s0, s1 in seam.gaps
    ]
    return {"data": data, "layout": layout}


def section(cut: CrossSection) -> Figure:
    """The mean cross-section with the opening."""
    x = 1e3 * cut.across
    data = [
        _trace("", x, 1e3 * cut.low, "rgba(0,0,0,0)", legend=False),
        _trace("cloud, 16 to 84 %", x, 1e3 * cut.high, "rgba(0,0,0,0)", fill="tonexty", fillcolor="rgba(125,155,184,0.5)"),
        _trace("cloud, median", x, 1e3 * cut.median, WIRE),
    ]
    if cut.lips is not None:
        lips = 1e3 * cut.lips
        data.append(_trace("opening, as fitted", lips[:, 0], lips[:, 1], LIPS, dash="dash", mode="lines+markers"))
    data.append(_trace("reference line", np.zeros(1), np.zeros(1), SEAM, mode="markers"))
    layout = _layout("across, seen along travel [mm]", "height [mm]")
    layout["xaxis"]["autorange"] = "reversed"
    return {"data": data, "layout": layout}


def errors_across(lines: dict[str, ErrorLine]) -> Figure:
    """Error across the known seam of plan and executed tip, in the band of 2 sigma that was claimed."""
    data = []
    plan = lines["plan"]
    if plan.sigma is not None:
        x, edge = 1e3 * _thin(plan.s), 2e3 * _thin(plan.sigma)
        data.append(_trace("", x, -edge, "rgba(0,0,0,0)", legend=False))
        data.append(_trace("2 sigma, as reported", x, edge, "rgba(0,0,0,0)", fill="tonexty", fillcolor="rgba(228,87,46,0.12)"))
    for name, line in lines.items():
        data.append(_trace(name, 1e3 * _thin(line.s), 1e3 * _thin(line.across), LINES[name], width=WIDTHS[name]))
    return {"data": data, "layout": _layout("along the seam [mm]", "left of the seam [mm]")}


def errors_distance(lines: dict[str, ErrorLine], config: ReportConfig) -> Figure:
    """Cross-track distance in space of plan and executed tip, below its limits."""
    data = [
        _trace(name, 1e3 * _thin(line.s), 1e3 * _thin(line.distance), LINES[name], width=WIDTHS[name])
        for name, line in lines.items()
    ]
    layout = _layout("along the seam [mm]", "cross-track distance [mm]")
    limits = {"mean": config.mean, "p95": config.p95, "max": config.max}
    levels = {name: units.to_mm(value) for name, value in sorted(limits.items(), key=lambda limit: limit[1])}
    top = 1.06 * max(*levels.values(), *(1e3 * float(line.distance.max()) for line in lines.values()))
    layout["yaxis"]["range"] = [0.0, top]
    layout["shapes"] = [_level(level) for level in levels.values()]
    height = layout["height"] - layout["margin"]["t"] - layout["margin"]["b"]
    places = _spread(list(levels.values()), LABEL * top / height)
    layout["annotations"] = [
        {"x": 1.01, "xref": "paper", "xanchor": "left", "y": place, "yanchor": "middle", "showarrow": False}
        | {"text": f"limit of<br>{name}", "align": "left", "font": {"size": 10, "color": SOFT}}
        for name, place in zip(levels, places, strict=True)
    ]
    layout["margin"]["r"] = 56  # beside the plot: in it a line would run through the words
    return {"data": data, "layout": layout}


def _spread(places: list[float], apart: float) -> list[float]:
    """The places of labels, in order, each moved up until it stands `apart` from the one below."""
    out: list[float] = []
    for place in places:
        out.append(place if not out else max(place, out[-1] + apart))
    return out


def torch_speed(log: ExecutionLog, path: TorchPath, config: ReportConfig, stopped: float | None = None) -> Figure | None:
    """Measured torch speed along the weld beside the planned one with its tolerance; None for a weld too short to judge.

    A weld that was stopped has a mark at the arc length where [m], and the rest of its path in sight.
    """
    speed = speed_error(log, path)
    if speed is None:
        return None
    s, planned = 1e3 * _thin(speed.s), 1e3 * _thin(speed.planned)
    data = [
        _trace("", s, planned * (1 - config.speed), "rgba(0,0,0,0)", legend=False),
        _trace(f"planned +-{100 * config.speed:g} %", s, planned * (1 + config.speed), "rgba(0,0,0,0)")
        | {"fill": "tonexty", "fillcolor": "rgba(27,127,75,0.14)"},
        _trace("measured", s, 1e3 * _thin(speed.speed), LINES["executed"]),
    ]
    layout = _layout("along the path [mm]", "torch speed [mm/s]")
    layout["yaxis"]["rangemode"] = "tozero"
    if stopped is not None:
        x = units.to_mm(stopped)
        mark = {"type": "line", "xref": "x", "yref": "paper", "x0": x, "x1": x, "y0": 0, "y1": 1}
        layout["shapes"] = [{**mark, "line": {"color": BAD, "width": 2, "dash": "dash"}}]
        first, last = units.to_mm(float(path.s[0])), units.to_mm(float(path.s[-1]))
        side = "left" if x < (first + last) / 2 else "right"  # where there is room for the words
        layout["annotations"] = [
            {"x": x, "y": 0.5, "yref": "paper", "xanchor": side, "yanchor": "middle", "showarrow": False}
            | {"text": f"stopped at {x:.1f} mm", "font": {"size": 12, "color": BAD}}
        ]
        layout["xaxis"]["range"] = [first, last]
    return {"data": data, "layout": layout}


def joints(log: ExecutionLog, which: str, names: tuple[str, ...]) -> Figure:
    """Joint angles ("q", deg), speeds ("qd", deg/s) or torques ("torque", Nm) over time; the weld is shaded."""
    values = {"q": np.rad2deg(log.q_act), "qd": np.rad2deg(log.qd_act), "torque": log.torque}[which]
    label = {"q": "joint angle [deg]", "qd": "joint speed [deg/s]", "torque": "joint torque [Nm]"}[which]
    layout = _layout("time [s]", label)
    shade_arc(layout, log.t, log.arc_on)
    t = _thin(log.t)
    columns = () if values is None else values.T
    data = [_trace(name, t, _thin(column), colour, width=1.5) for name, column, colour in zip(names, columns, JOINTS, strict=False)]
    return {"data": data, "layout": layout}


def shade_arc(layout: Figure, t: ndarray, arc_on: ndarray) -> None:
    """Every spell of a burning arc shaded in the layout of a plot over time, and its axis says so.

    Args:
        layout: changed in place.  t: (n,) instants [s].  arc_on: (n,) whether the arc burns.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], arc_on, [False]]).astype(int)))
    for first, past in edges.reshape(-1, 2):
        band = {"type": "rect", "xref": "x", "yref": "paper", "x0": float(t[first]), "x1": float(t[past - 1]), "y0": 0, "y1": 1}
        style = {"fillcolor": "rgba(228,87,46,0.07)", "line": {"width": 0}, "layer": "below"}
        layout.setdefault("shapes", []).append({**band, **style})
    if len(edges):
        layout["xaxis"]["title"] = {"text": "time [s]; arc on where shaded"}


def _layout(x: str, y: str, height: int = 300) -> Figure:
    axis = {"gridcolor": GRID, "zerolinecolor": "#c5ccd3", "linecolor": GRID, "automargin": True}
    return {
        "height": height,
        "margin": {"l": 56, "r": 16, "t": 34, "b": 46},
        "font": {"family": "system-ui, 'Segoe UI', Roboto, 'Liberation Sans', sans-serif", "size": 12, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "traceorder": "normal"},
        "xaxis": {**axis, "title": {"text": x}},
        "yaxis": {**axis, "title": {"text": y}},
    }


def _trace(
    name: str,
    x: ndarray,
    y: ndarray,
    colour: str,
    *,
    width: float = 2.0,
    dash: str = "solid",
    mode: str = "lines",
    fill: str = "none",
    fillcolor: str = "rgba(0,0,0,0)",
    yaxis: str = "y",
    legend: bool = True,
) -> Figure:
    return {
        "type": "scatter",
        "mode": mode,
        "name": name,
        "x": _array(x),
        "y": _array(y),
        "line": {"color": colour, "width": width, "dash": dash},
        "marker": {"color": colour, "size": 8},
        "fill": fill,
        "fillcolor": fillcolor,
        "yaxis": yaxis,
        "showlegend": legend,
        "hoverinfo": "x+y+name" if legend else "skip",
    }


def _dots(name: str, points_B: ndarray, marker: Figure) -> Figure:
    x, y, z = 1e3 * points_B.T
    return {"type": "scatter3d", "mode": "markers", "name": name, "hoverinfo": "skip", "marker": marker} | {
        "x": _array(x),
        "y": _array(y),
        "z": _array(z),
    }


def _line(name: str, points_B: ndarray, colour: str, width: float, *, legend: bool = True) -> Figure:
    x, y, z = 1e3 * _thin(points_B).T
    style = {"color": colour, "width": width}
    return {"type": "scatter3d", "mode": "lines", "name": name, "line": style, "legendgroup": name, "showlegend": legend} | {
        "x": _array(x),
        "y": _array(y),
        "z": _array(z),
        "hoverinfo": "name",
    }


def _level(y: float) -> Figure:
    return {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y, "line": {"color": SOFT, "width": 1, "dash": "dot"}}


def _xyz(v: ndarray) -> dict[str, float]:
    return {name: round(float(value), 6) for name, value in zip("xyz", v, strict=True)}


def _thin(values: ndarray) -> ndarray:
    """Every k-th sample, so that no line has over `LINE_LIMIT` of them; the last is kept."""
    step = -(-len(values) // LINE_LIMIT)
    return values if step <= 1 else np.concatenate([values[:-1:step], values[-1:]])


def _array(values: ndarray) -> dict[str, str]:
    """A typed array as plotly.js reads it: float32, a micrometre in 10 m."""
    return {"dtype": "f4", "bdata": base64.b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode()}
