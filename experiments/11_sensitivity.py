"""Path error of both methods against noise level, groove width, tilt and distance of the camera: one figure, one JSON.

A straight V-groove in a clamped plate, D415 model on; one quantity is varied at a time, the others stay at the scene's
14 mm, 0 deg, 400 mm and the model's noise of 0.075 px, which is 0.35 mm of depth at that distance. The groove keeps its depth
over width. Crosses on the upper edge: no path found.

    python experiments/11_sensitivity.py [--seeds 3] [--jobs 2] [--quick] [--only width]
"""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from weldsim.config import CellConfig, load_toml, structure
from weldsim.regression import regress
from weldsim.scene.config import SceneConfig
from weldsim.scene.files import scene_path
from weldsim.sensor.d415 import D415_NOISE
from weldsim.sensor.noise import total_sigma

RESULTS = Path(__file__).parent / "results"
COLOURS = {"profile": "#12355b", "thesis": "#c4501b"}
NAMES = {"profile": "ours", "thesis": "thesis method"}
CEILING = 10.0  # [mm] of the figure


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One quantity. Attributes: name; label; values; scene and config made from a value."""

    name: str
    label: str
    values: tuple[float, ...]
    scene: Callable[[SceneConfig, float], SceneConfig] = lambda scene, value: scene
    config: Callable[[CellConfig, float], CellConfig] = lambda config, value: config


def with_groove(scene: SceneConfig, width: float) -> SceneConfig:
    """The scene with a groove of that width [m], depth over width as before."""
    ratio = scene.groove.depth / scene.groove.width
    return replace(scene, groove=replace(scene.groove, width=width, depth=ratio * width, angle=None))


def with_view(scene: SceneConfig, **changes: float) -> SceneConfig:
    """The scene seen from elsewhere."""
    return replace(scene, views=(replace(scene.views[0], **changes),))


SWEEPS = (
    Sweep(
        name="noise",
        label="disparity noise, standard deviation [px]",
        values=(0.02, 0.05, 0.075, 0.10, 0.15, 0.25),
        config=lambda config, value: replace(config, sensor=replace(config.sensor, noise_gain=value / total_sigma(D415_NOISE))),
    ),
    Sweep(
        name="width",
        label="groove width [mm]",
        values=(0.005, 0.007, 0.009, 0.012, 0.018, 0.025),
        scene=with_groove,
    ),
    Sweep(
        name="tilt",
        label="tilt of the camera across the groove [deg]",
        values=tuple(math.radians(value) for value in (0, 10, 20, 30, 40)),
        scene=lambda scene, value: with_view(scene, tilt=value, heading=math.pi / 2),
    ),
    Sweep(
        name="distance",
        label="distance of the camera [mm]",
        values=(0.30, 0.35, 0.40, 0.45, 0.50, 0.60),
        scene=lambda scene, value: with_view(scene, standoff=value),
    ),
)
SHOWN = {"noise": 1.0, "width": 1e3, "tilt": 180 / math.pi, "distance": 1e3}


def measure(sweep: Sweep, values: tuple[float, ...], seeds: int, jobs: int) -> list[dict[str, Any]]:
    """A row for each value, method and seed: mean, p95, max, coverage (SI; None where not found), refused."""
    base = structure(load_toml(scene_path("straight")), SceneConfig)
    config = CellConfig()
    groups: dict[CellConfig, dict[str, tuple[float, SceneConfig]]] = {}
    for k, value in enumerate(values):
        scene = replace(sweep.scene(base, value), name=f"{sweep.name}-{k}")
        groups.setdefault(sweep.config(config, value), {})[scene.name] = (value, scene)
    rows = []
    for settings, members in groups.items():
        outcome = regress([scene for _, scene in members.values()], seeds=seeds, jobs=jobs, config=settings)
        for row in outcome.rows:
            f = row.figures
            row = {"value": members[f.scene][0], "method": f.method, "seed": f.seed, "scanned": f.seconds is not None}
            rows.append(row | {name: getattr(f, name) for name in ("mean", "p95", "max", "coverage", "refused")})
    return rows


def draw(measured: dict[str, list[dict[str, Any]]], path: Path) -> None:
    """The figure: mean cross-track error, a dot a seed, a line through the medians."""
    import statistics

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 8.4), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2, sharey=True)
    figure.subplots_adjust(left=0.06, right=0.98, top=0.92, bottom=0.07, wspace=0.06, hspace=0.24)
    for place, sweep in zip(axes.flat, SWEEPS, strict=True):
        rows = measured.get(sweep.name, [])
        scanned = sorted({row["value"] for row in rows if row["scanned"]})
        if not scanned:
            place.set_axis_off()
            continue
        for shift, method in ((-0.006, "profile"), (0.006, "thesis")):
            colour = COLOURS[method]
            span = SHOWN[sweep.name] * (max(scanned) - min(scanned))
            mine = [row for row in rows if row["method"] == method and row["scanned"]]
            found = [row for row in mine if row["mean"] is not None]
            lost = [row for row in mine if row["mean"] is None]
            x = {value: SHOWN[sweep.name] * value + shift * span for value in scanned}
            place.plot([x[r["value"]] for r in found], [1e3 * r["mean"] for r in found], "o", color=colour, ms=5, alpha=0.45, mew=0)
            place.plot([x[r["value"]] for r in lost], [0.93 * CEILING] * len(lost), "x", color=colour, ms=7, clip_on=False)
            middles = [(v, statistics.median(m)) for v in scanned if (m := [1e3 * r["mean"] for r in found if r["value"] == v])]
            place.plot([x[v] for v, _ in middles], [m for _, m in middles], "-", color=colour, lw=2, label=NAMES[method])
        place.set_yscale("log")
        place.set_ylim(0.02, CEILING)
        place.set_yticks([0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10], labels=["0.05", "0.1", "0.2", "0.5", "1", "2", "5", "10"])
        place.set_xlabel(sweep.label)
        place.grid(color="#e3e7eb", lw=0.8)
        place.set_axisbelow(True)
        for side in ("top", "right"):
            place.spines[side].set_visible(False)
    for place in axes[:, 0]:
        place.set_ylabel("mean cross-track error [mm]")
    axes[0, 0].legend(frameon=False, loc="lower right")
    figure.suptitle("Planned path against the known opening: straight V-groove, D415 model; crosses: no path found", fontsize=13)
    figure.savefig(path, metadata={"Software": "weldsim"})


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two values of each quantity, one seed")
    parser.add_argument("--only", nargs="*", choices=[sweep.name for sweep in SWEEPS], default=[sweep.name for sweep in SWEEPS])
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "egl")
    seeds = 1 if options.quick else options.seeds
    measured = {}
    for sweep in (sweep for sweep in SWEEPS if sweep.name in options.only):
        values = (sweep.values[1], sweep.values[-2]) if options.quick else sweep.values
        measured[sweep.name] = measure(sweep, values, seeds, options.jobs)
        for value in values:
            for method in NAMES:
                rows = [r for r in measured[sweep.name] if (r["value"], r["method"]) == (value, method)]
                means = ", ".join("-" if r["mean"] is None else f"{1e3 * r['mean']:.2f}" for r in rows)
                print(f"{sweep.label} {SHOWN[sweep.name] * value:g}, {NAMES[method]}: mean {means} mm", flush=True)
    options.out.mkdir(exist_ok=True)
    draw(measured, options.out / "11_sensitivity.png")
    content = {"seeds": seeds, "units": {"length": "m", "angle": "rad"}, "sweeps": measured}
    (options.out / "11_sensitivity.json").write_text(json.dumps(content, indent=None, separators=(",", ":")) + "\n")
    print(f"wrote {options.out / '11_sensitivity.png'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
