"""The figure of 13_smoothing.py: profiles, root and lips, centre line, and the curve smoother's bias against scatter."""

import math
import statistics
from pathlib import Path
from typing import Any

from weldsim.output import write_whole

Row = dict[str, Any]
COLOURS = {0.0: "#9aa5b1", 0.0025: "#e0a458", 0.005: "#c4501b", 0.010: "#6b1d12", None: "#12355b"}
NAMES = {0.0: "voxels alone", 0.0025: "MLS 2.5 mm", 0.005: "MLS 5 mm", 0.010: "MLS 10 mm", None: "default's section fit"}


def draw(rows: list[Row], tracks: list[Row], path: Path) -> None:
    """Nothing; the PNG written."""
    import io

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 9), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3)
    figure.subplots_adjust(left=0.055, right=0.985, top=0.92, bottom=0.07, wspace=0.22, hspace=0.3)
    widths = sorted({row["width"] for row in rows})
    _profile(axes[0, 0], rows, widths[0])
    _profile(axes[0, 1], rows, 0.014 if 0.014 in widths else widths[-1])
    _over_width(axes[0, 2], rows, "root_lost", "none", "root's depth lost [mm], exact depth", loss=True)
    _over_width(axes[1, 0], rows, "p95", "d415", "centre line, 95th percentile [mm], D415 model")
    _crests(axes[1, 1], tracks)
    _trade(axes[1, 2], tracks)
    for place in axes.flat:
        place.grid(color="#e3e7eb", lw=0.8)
        place.set_axisbelow(True)
        for side in ("top", "right"):
            place.spines[side].set_visible(False)
    figure.suptitle("What smoothing does to a groove and to its line", fontsize=14)
    target = io.BytesIO()
    figure.savefig(target, format="png", metadata={"Software": "weldsim"})
    write_whole(path, target.getvalue())


def _profile(place: Any, rows: list[Row], width: float) -> None:
    """The mean cross-section left by each radius, exact depth, and the default's fitted opening and depth."""
    mine = [row for row in rows if (row["scene"], row["width"], row["noise"], row["seed"]) == ("straight", width, "none", 0)]
    depth = width * 8 / 14
    reach = 500 * width + 8
    place.plot([-reach, -500 * width, 0, 500 * width, reach], [0, 0, -1e3 * depth, 0, 0], color="black", lw=1, label="truth")
    for row in mine:
        if "profile" in row:
            x, down = row["profile"]
            label, colour = NAMES[row["radius"]], COLOURS[row["radius"]]
            place.plot([1e3 * v for v in x], [-1e3 * v for v in down], color=colour, lw=1.8, label=label)
        elif "wider" in row:
            half, bottom = 500 * (width + row["wider"]), 1e3 * (depth - row["root_lost"])
            floor = row["floor"] * half
            line = ([-half, -floor, floor, half], [0, -bottom, -bottom, 0])
            place.plot(*line, "--", color=COLOURS[None], lw=1.8, label=NAMES[None])
    place.set_xlabel(f"across the seam [mm]; groove {1e3 * width:g} mm wide, exact depth")
    place.set_ylabel("height over the plate [mm]")
    place.legend(frameon=False, fontsize=9, loc="lower left")


def _over_width(place: Any, rows: list[Row], name: str, noise: str, label: str, *, loss: bool = False) -> None:
    """A figure against groove width, straight (solid) and S (dashed), a line a smoother."""
    widths = sorted({row["width"] for row in rows})
    for scene, style in (("straight", "-"), ("curve", "--")):
        for radius in NAMES:
            means = []
            for width in widths:
                key = (scene, width, noise, radius)
                found = [
                    row[name] for row in rows if (row["scene"], row["width"], row["noise"], row["radius"]) == key and name in row
                ]
                means.append(1e3 * statistics.mean(found) if found else math.nan)
            if not all(map(math.isnan, means)):
                shown = NAMES[radius] if style == "-" else None
                place.plot([1e3 * width for width in widths], means, style, marker="o", ms=4, color=COLOURS[radius], label=shown)
    if not loss:
        place.set_ylim(0)
    place.set_xlabel("groove width [mm]; dashed: S of least radius 100 mm")
    place.set_ylabel(label)
    place.legend(frameon=False, fontsize=9, loc="best")


def _crests(place: Any, tracks: list[Row]) -> None:
    """Crest lost of each sine, by noise."""
    for sigma, colour in zip(sorted({row["sigma"] for row in tracks}), ("#9aa5b1", "#3b7dd8", "#12355b"), strict=False):
        mine = [row for row in tracks if row["sigma"] == sigma and row["track"].startswith("sine")]
        x = [float(row["track"].split()[1]) for row in mine]
        place.plot(x, [1e3 * row["crest_lost"] for row in mine], "o-", color=colour, label=f"crest lost, noise {1e3 * sigma:g} mm")
        place.plot(x, [1e3 * row["error"] for row in mine], "s:", color=colour, label=f"error rms, noise {1e3 * sigma:g} mm")
    place.set_xlabel("wavelength of a sine with least radius 100 mm [mm]")
    place.set_ylabel("default's curve smoothing [mm]")
    place.legend(frameon=False, fontsize=8, loc="best")


def _trade(place: Any, tracks: list[Row]) -> None:
    """Bias and scatter against strength, noise 0.3 mm, and the strength chosen."""
    mine = [row for row in tracks if row["sigma"] == 0.3e-3 and row["track"] in ("sine 60 mm", "sine 100 mm", "sine 300 mm")]
    for row, colour in zip(mine, ("#c4501b", "#e0a458", "#3b7dd8"), strict=False):
        strengths, bias, _ = zip(*row["by_strength"], strict=True)
        place.plot(strengths, [1e3 * v for v in bias], color=colour, label=f"bias rms, {row['track']}")
        place.axvline(row["strength"], color=colour, lw=1, ls=":")
    if mine:
        strengths, _, scatter = zip(*mine[0]["by_strength"], strict=True)
        place.plot(strengths, [1e3 * v for v in scatter], color="black", label="scatter rms")
    place.set_xscale("log")
    place.set_yscale("log")
    place.set_ylim(1e-3, 3)
    place.set_xlabel("strength; dotted: the one chosen (median)")
    place.set_ylabel("noise 0.3 mm a station [mm]")
    place.legend(frameon=False, fontsize=8, loc="best")
