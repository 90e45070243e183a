"""One picture of a job for a page or a mail: plan view of the cloud with the seam, cross-section, errors along the seam.

Imports matplotlib: import this module where a picture is asked for, not before.
"""

import io
import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy import ndarray

from weldsim import units
from weldsim.counted import counted
from weldsim.output import write_whole
from weldsim.records import ExecutionLog, KnownSeam, PointCloud, Seam, SeamFindings, TorchPath, WeldReport
from weldsim.report.limits import ReportConfig
from weldsim.report.plane import Plane, Seen, plane_of
from weldsim.report.style import AMBER, BAD, GOOD, GRID, INK, LINES, LIPS, SEAM, SOFT, WIDTHS, WIRE
from weldsim.report.tracking import speed_error
from weldsim.report.verdict import found_by, look, stopped_place, verdict
from weldsim.report.view import (
    MARGIN,
    CrossSection,
    cross_section,
    error_lines,
    height_range,
    heights,
    shows_surface,
    torch_axes,
)

EMPTY = "#eef1f4"
OBLIQUE = np.array([[0.25, 0.55], [0.0, 0.6], [-0.25, 0.55]])  # how a millimetre of height is drawn; tried in order
ASLANT = 0.3  # sine of the angle to the seams from which on a wire stands out from them
LAYER = 0.03  # [m] points this far below another in their pixel are hidden by it
RATIO = 0.72  # height of the plan view over its width
PIXEL = 1e-3  # [m] of the plan view
APART = 40  # [px] between the two texts under the headline
REFUSED = 58  # characters in a line of the list of candidates refused: those fit beside the plan view


def write_png(
    path: Path | str,
    report: WeldReport,
    cloud: PointCloud,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    *,
    log: ExecutionLog | None = None,
    known: tuple[KnownSeam, ...] = (),
    welded: int = 0,
    config: ReportConfig | None = None,
) -> Path:
    """The picture written, 1600 x 900 pixels. Raises OutputError."""
    return write_whole(path, png(report, cloud, findings, paths, log=log, known=known, welded=welded, config=config))


def png(
    report: WeldReport,
    cloud: PointCloud,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    *,
    log: ExecutionLog | None = None,
    known: tuple[KnownSeam, ...] = (),
    welded: int = 0,
    config: ReportConfig | None = None,
) -> bytes:
    """The picture as a PNG of 1600 x 900 pixels."""
    figure = Figure(figsize=(16, 9), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, left=0.05, right=0.97, top=0.86, bottom=0.08, width_ratios=(1.75, 1), hspace=0.34, wspace=0.16)
    welded = welded if welded < len(findings.seams) else 0
    _headline(figure, report, findings, welded, config or ReportConfig())
    surface = shows_surface(cloud, findings.seams)
    plane = plane_of(cloud, findings.seams, welded)
    plan = figure.add_subplot(grid[:, 0])
    _plan_view(figure, plan, plane, cloud, findings, paths, surface=surface)
    if (place := stopped_place(report)) is not None and report.progress is not None:
        _stop(plan, plane, np.array(place), report.progress.s_to)
    upper, lower = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    if findings.seams:
        if surface:
            _section(upper, cross_section(cloud, findings.seams[welded]))
        else:
            _speed(upper, log, paths[welded], config or ReportConfig())
        _along(lower, findings, paths, log, known, welded)
        if len(findings.seams) > 1:
            for axes in (upper, lower):
                axes.set_title(f"{axes.get_title(loc='left')}, seam {welded + 1}", loc="left", fontsize=13, color=INK)
    else:
        _refused(upper, findings)
        lower.set_axis_off()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": "weldsim"})
    return buffer.getvalue()


def _headline(figure: Figure, report: WeldReport, findings: SeamFindings, welded: int, config: ReportConfig) -> None:
    """Scene, verdict and what decided it, over the whole width; of several seams, the figures of the one that was welded."""
    word, why = verdict(report, len(findings.seams), config)
    figure.text(0.05, 0.945, f"{report.scene}", fontsize=20, weight="bold", color=INK, va="center")
    figure.text(
        0.97,
        0.945,
        word,
        fontsize=20,
        weight="bold",
        color={"good": GOOD, "amber": AMBER, "bad": BAD, "plain": WIRE}[look(word)],
        va="center",
        ha="right",
    )
    count = len(findings.seams)
    facts = [counted(count, "seam"), found_by(report)]
    if count:
        seam = findings.seams[welded]
        facts.append(f"{'' if count == 1 else f'seam {welded + 1}: '}{units.to_mm(seam.length):.1f} mm long")
        facts += [f"{units.to_mm(seam.width):.1f} mm wide"] if seam.width > 0 else []  # 0: the method measures none
        facts += [f"confidence {seam.confidence:.2f}"] if seam.confidence > 0 else []
    left = figure.text(0.05, 0.905, "   |   ".join(facts), fontsize=12, color=SOFT, va="center")
    right = figure.text(0.97, 0.905, "", fontsize=12, color=SOFT, va="center", ha="right")
    for most in range(90, 10, -4):  # characters, until it stands clear of the facts
        right.set_text(textwrap.shorten(why, most, placeholder=" ..."))
        if right.get_window_extent().x0 > left.get_window_extent().x1 + APART:
            break


def _plan_view(
    figure: Figure,
    axes: Axes,
    plane: Plane,
    cloud: PointCloud,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    *,
    surface: bool,
) -> None:
    """The cloud as heights over the parent surface, where it shows one; lips, centre line and wires."""
    points = plane.points(cloud.points)
    flat = isinstance(plane, Seen)
    window = _window(points, [plane.points(seam.points_B) for seam in findings.seams]) if flat else _strip(plane.seam)
    if surface:
        seen = ((points[:, :2] >= window[0]) & (points[:, :2] <= window[1])).all(axis=1)
        seen &= flat | (np.abs(points[:, 2]) < LAYER)  # what an unrolled view has over itself is another face
        above = heights(cloud.points[seen], findings.seams, plane.X_BS) if isinstance(plane, Seen) else points[seen, 2]
        _surface(figure, axes, points[seen], above, findings)
    else:
        axes.set_anchor("N")
    many = len(findings.seams) > 1
    oblique = _oblique(plane, findings)
    for i, (seam, path) in enumerate(zip(findings.seams, paths, strict=False)):
        for k, side in enumerate(side for side in (seam.left_B, seam.right_B) if side is not None):
            _trace(axes, plane, side, LIPS, 1.2, "--", "lips" if i == k == 0 else None)
        if path is None:
            _trace(axes, plane, seam.points_B, EMPTY, 1.6, ":", None)
            _number(axes, plane, seam.points_B, f"{i + 1}: no path" if many else "no path", oblique)
            continue
        # Seen along the normal a wire is a dot: its height is drawn obliquely, as in a cabinet projection.
        ends = 1e3 * plane.arrows(torch_axes(path))
        wires = ends[:, :, :2] + (ends[:, :, 2:] - ends[:, :1, 2:]) * oblique
        axes.add_collection(
            LineCollection(list(wires), colors=WIRE, linewidths=1.1, label="wire, drawn obliquely" if i == 0 else None)
        )
        axes.scatter(*wires[:, 0].T, s=9, color=WIRE, zorder=3)
        _trace(axes, plane, path.X_BT.p[path.weld], SEAM, 2.4, "-", "torch path" if i == 0 else None)
        tip = path.X_BT.p[path.weld]
        _ends(axes, plane, tip, legend=i == 0)
        if many:
            _number(axes, plane, tip, f"{i + 1}", oblique)
    axes.set_xlabel("along [mm]", color=INK)
    enlarged = "" if flat else f", {RATIO * np.ptp(window[:, 0]) / np.ptp(window[:, 1]):.0f} x as large"
    axes.set_ylabel(f"across{enlarged} [mm]", color=INK)
    axes.set_aspect("equal" if flat else "auto")
    axes.set_facecolor(EMPTY)
    axes.set_xlim(*(1e3 * window[:, 0]))
    axes.set_ylim(*(1e3 * window[:, 1]))
    if findings.seams:
        # Beside the title, over the drawing: there is no corner that a part or its seam may not lie in.
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, frameon=False, fontsize=9, borderaxespad=0.1)
    _plain(axes, grid=False)
    axes.set_title(plane.title, loc="left", fontsize=13, color=INK)


def _strip(seam: Seam) -> ndarray:
    """Lowest and highest corner of the unrolled view [m]: the seam with a margin at its ends and sides."""
    return np.array([[-MARGIN, -MARGIN], [seam.length + MARGIN, MARGIN]])


def _surface(figure: Figure, axes: Axes, points: ndarray, height: ndarray, findings: SeamFindings) -> None:
    """Heights [m] of the points as an image, and what its colours mean."""
    image, extent = _height_image(points, height)
    low, high = height_range(height, findings.seams)
    drawn = axes.imshow(
        1e3 * image, extent=extent, origin="lower", cmap="cividis", vmin=1e3 * low, vmax=1e3 * high, interpolation="nearest"
    )
    bar = figure.colorbar(drawn, ax=axes, orientation="horizontal", fraction=0.035, pad=0.085, aspect=50)
    bar.set_label(f"height over the {'parent surface' if findings.seams else 'middle of the cloud'} [mm]", color=INK)
    bar.outline.set_visible(False)


def _window(points_S: ndarray, seams_S: list[ndarray]) -> ndarray:
    """Lowest and highest corner of the plan view [m]: around the seams, or the cloud, in the shape of the page."""
    ours = np.concatenate(seams_S)[:, :2] if seams_S else points_S[:, :2]
    low, high = (ours.min(axis=0), ours.max(axis=0)) if seams_S else np.percentile(ours, [10, 90], axis=0)
    # Of a cloud without a seam most: a floor far behind the part would leave it a corner.
    size = high - low + 2 * MARGIN if seams_S else 1.5 * (high - low)
    width = max(size[0], size[1] / RATIO)
    half = np.array([width, RATIO * width]) / 2
    return np.stack([(low + high) / 2 - half, (low + high) / 2 + half])


def _stop(axes: Axes, plane: Plane, place_B: ndarray, s: float) -> None:
    """A cross where a weld was stopped, with its arc length [m]."""
    x, y, _ = 1e3 * plane.points(place_B[None])[0]
    axes.plot([x], [y], "x", color=BAD, ms=15, mew=4, zorder=6)
    text = f"stopped at {units.to_mm(s):.1f} mm"
    style = {"boxstyle": "round,pad=0.25", "fc": "white", "ec": BAD}
    leader = {"arrowstyle": "-", "color": BAD, "lw": 1.2}
    words = {"color": BAD, "weight": "bold", "fontsize": 12, "ha": "center", "bbox": style, "arrowprops": leader, "zorder": 8}
    axes.annotate(text, (x, y), xytext=(0, -80), textcoords="offset points", **words)  # below seam and wires


def _oblique(plane: Plane, findings: SeamFindings) -> ndarray:
    """The direction that heights are drawn in, (2,): the first that no seam runs along, or the one farthest from all of them."""
    lines = [np.diff(plane.points(seam.points_B[[0, -1]])[:, :2], axis=0)[0] for seam in findings.seams]
    along = np.array([line / np.hypot(*line) for line in lines if np.hypot(*line) > 1e-6]).reshape(-1, 2)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sines = (np.abs(across @ OBLIQUE.T) / np.linalg.norm(OBLIQUE, axis=1)).min(axis=0, initial=1.0)
    return OBLIQUE[int(np.argmax(sines >= min(ASLANT, sines.max())))]


def _number(axes: Axes, plane: Plane, points_B: ndarray, text: str, oblique: ndarray) -> None:
    """`text` beside the middle of a line, where its wires are not: seams that meet have their ends in one place."""
    middle = len(points_B) // 2
    here, there = 1e3 * plane.points(points_B[[middle, min(middle + 1, len(points_B) - 1)]])[:, :2]
    ahead = there - here
    aside = np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-9)
    aside = aside if aside @ oblique < 0 else -aside
    halo = [withStroke(linewidth=3, foreground="white")]
    look = {"color": SEAM, "weight": "bold", "fontsize": 14, "path_effects": halo, "zorder": 7, "ha": "center", "va": "center"}
    axes.annotate(text, here, xytext=tuple(20 * aside), textcoords="offset points", **look)


def _ends(axes: Axes, plane: Plane, points_B: ndarray, *, legend: bool) -> None:
    """A disc where the torch starts and a square where it ends; around a ring the disc lies in the square."""
    ends = 1e3 * plane.points(points_B[[0, -1]])
    for name, place, mark, size, front in (("start", ends[0], "o", 26, 6), ("end", ends[1], "s", 64, 5)):
        look = {"facecolor": "white", "edgecolor": SEAM, "linewidth": 1.6, "zorder": front}
        axes.scatter(place[0], place[1], s=size, marker=mark, label=name if legend else None, **look)


def _trace(axes: Axes, plane: Plane, points_B: ndarray, colour: str, width: float, style: str, label: str | None) -> None:
    x, y, _ = 1e3 * plane.points(points_B).T
    axes.plot(x, y, style, color=colour, lw=width, label=label)


def _height_image(points: ndarray, height: ndarray) -> tuple[ndarray, tuple[float, float, float, float]]:
    """Mean height of the uppermost layer in each pixel [m], NaN where the cloud has none, and its extent [mm].

    Other views may have seen what lies below the surface drawn, a table under a box say: that is hidden here.
    """
    places = points[:, :2]
    low, high = places.min(axis=0), places.max(axis=0)
    # A sparse cloud gets larger pixels, so that it still covers the picture.
    pixel = max(PIXEL, float(np.sqrt(5 * np.prod(high - low) / len(places))))
    shape = np.maximum(1, np.ceil((high - low) / pixel).astype(int))
    column, row = np.minimum(((places - low) / pixel).astype(int), shape - 1).T
    flat = row * shape[0] + column
    top = np.full(shape.prod(), -np.inf)
    np.maximum.at(top, flat, points[:, 2])
    upper = points[:, 2] > top[flat] - LAYER
    flat, height = flat[upper], height[upper]
    count = np.bincount(flat, minlength=shape.prod())
    total = np.bincount(flat, height, minlength=shape.prod())
    image = np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape[1], shape[0])
    edge = low + shape * pixel
    return image, (1e3 * low[0], 1e3 * edge[0], 1e3 * low[1], 1e3 * edge[1])


def _speed(axes: Axes, log: ExecutionLog | None, path: TorchPath | None, config: ReportConfig) -> None:
    """Torch speed along the weld, in place of the cross-section of a path file, which has no cloud."""
    speed = None if log is None or path is None else speed_error(log, path)
    if speed is None:
        axes.set_axis_off()
        return
    s, planned = 1e3 * speed.s, 1e3 * speed.planned
    limits = planned * (1 - config.speed), planned * (1 + config.speed)
    axes.fill_between(s, *limits, color=GOOD, alpha=0.2, lw=0, label=f"planned +-{100 * config.speed:g} %")
    axes.plot(s, 1e3 * speed.speed, color=LINES["executed"], lw=1.2, label="measured")
    axes.set_title("Torch speed", loc="left", fontsize=13, color=INK)
    axes.set_xlabel("along the path [mm]")
    axes.set_ylabel("torch speed [mm/s]")
    axes.set_ylim(0, 1.35e3 * max(float(speed.planned.max()), float(speed.speed.max())))
    axes.legend(frameon=False, fontsize=9, loc="lower left", ncols=2)
    _plain(axes)


def _section(axes: Axes, section: CrossSection) -> None:
    x = 1e3 * section.across
    if not len(x):
        axes.text(0.5, 0.5, "no cloud about the seam", transform=axes.transAxes, ha="center", color=SOFT, fontsize=11)
        axes.set_axis_off()
        return
    axes.fill_between(x, 1e3 * section.low, 1e3 * section.high, color="#9db4c9", alpha=0.6, lw=0, label="cloud, 16 to 84 %")
    axes.plot(x, 1e3 * section.median, color=WIRE, lw=1.8, label="cloud, median")
    if section.lips is not None:
        left, right = 1e3 * section.lips
        axes.plot([left[0], right[0]], [left[1], right[1]], "--", color=LIPS, lw=1.2, label="opening, as fitted")
        axes.plot([left[0], right[0]], [left[1], right[1]], "o", color=LIPS, ms=6)
    axes.plot(0, 0, "o", color=SEAM, ms=9, label="reference line", zorder=5)
    axes.set_title("Mean cross-section", loc="left", fontsize=13, color=INK)
    axes.set_xlabel("across, seen along travel [mm]")
    axes.set_ylabel("height [mm]")
    axes.set_xlim(1e3 * 0.025, -1e3 * 0.025)
    axes.legend(frameon=False, fontsize=9, loc="lower left", ncols=2)
    low = float(1e3 * section.median.min()) if len(section.median) else -1.0
    axes.set_ylim(1.6 * low - 3, 0.25 * abs(low) + 2)
    _plain(axes)


def _along(
    axes: Axes,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    log: ExecutionLog | None,
    known: tuple[KnownSeam, ...],
    welded: int,
) -> None:
    """Error across the seam against the known one, in its band of sigma; without a known seam, sigma and width."""
    seam = findings.seams[welded]
    s = 1e3 * seam.s
    lines = error_lines(findings, paths, log, known, welded)
    if lines:
        axes.axhline(0, color=SOFT, lw=0.8)
        for name, line in lines.items():
            axes.plot(1e3 * line.s, 1e3 * line.across, color=LINES[name], lw=WIDTHS[name], alpha=0.85, label=name)
            if line.sigma is not None:
                edge = 1e3 * line.sigma
                axes.fill_between(1e3 * line.s, -2 * edge, 2 * edge, color=SEAM, alpha=0.13, lw=0, label="2 sigma, as reported")
        axes.set_title("Error across the known seam", loc="left", fontsize=13, color=INK)
        axes.set_ylabel("left of the seam [mm]")
        far = max(0.5, *(1e3 * float(np.abs(line.across).max()) for line in lines.values()))
        band = max((2e3 * float(line.sigma.max()) for line in lines.values() if line.sigma is not None), default=0.0)
        # The whole band, where the lines are still to be told apart beside it; and room for the legend.
        reach = 1.15 * max(far, min(band, 6 * far))
        axes.set_ylim(-reach, 1.3 * reach)
    elif seam.sigma is not None:
        axes.plot(s, 1e3 * seam.sigma, color=SEAM, lw=1.8, label="sigma across the seam")
        axes.set_ylim(0, 1.35e3 * float(seam.sigma.max()) + 1e-3)
        axes.set_title("Standard deviation along the seam", loc="left", fontsize=13, color=INK)
        axes.set_ylabel("sigma [mm]")
    else:
        axes.set_title("No standard deviation is known along the seam", loc="left", fontsize=13, color=SOFT)
        axes.set_axis_off()
        return
    axes.set_xlabel("along the seam [mm]")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=9, loc="upper right", ncols=3)
    _plain(axes)


def _refused(axes: Axes, findings: SeamFindings) -> None:
    """Why nothing in view is a seam, in place of a cross-section."""
    listed = [textwrap.fill(f"{units.to_mm(r.length):.0f} mm long: {r.reason}", REFUSED) for r in findings.rejected[:14]]
    axes.set_axis_off()
    axes.set_title("Candidates refused", loc="left", fontsize=13, color=INK)
    axes.text(0, 0.95, "\n".join(listed) or "There were none.", va="top", color=INK, fontsize=11, transform=axes.transAxes)


def _plain(axes: Axes, *, grid: bool = True) -> None:
    """Light axes: no box, a faint grid."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#b8c0c8")
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_color(INK)
    axes.tick_params(colors=SOFT, labelsize=10)
    if grid:
        axes.grid(color=GRID, lw=0.8)
        axes.set_axisbelow(True)
