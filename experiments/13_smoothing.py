"""What smoothing does to a groove: moving least squares as published, and the default method's section fit and curve.

Grooves of known shape are scanned in the twin: V, 6 to 25 mm wide, straight and S-shaped; exact depth, the same with independent
noise of 0.3 mm along each sight line, and the D415 model. Then three smoothers are judged against the known surface:

* `mls`: voxels of 1 mm, then moving least squares of one radius (0 = none). Read off the smoothed points: how much of the root's
  depth is lost, how far the lips have sunk below the plate, how much wider the groove is at half of its depth, and where the
  centroid of each 5 mm of groove lies across the seam: mean (bias) and 95th percentile.
* `section`: the default's fit, which does not smooth points but blurs a sharp section until it looks like them: its opening, depth,
  blur, and where its line lies.
* `curve`: the default's smoothing of a lateral track, on sines of a least radius of 100 mm and an arc, 240 stations of 1 mm, noise
  correlated over 3.5 mm: strength chosen, crest lost, and bias against scatter for each strength.

The published method with each radius is run to its end besides, on the 14 mm groove. Writes a figure, Markdown and JSON.

    python experiments/13_smoothing.py [--seeds 3] [--quick]
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.config import CellConfig, load_scene
from weldsim.curves import arc_length, interpolate
from weldsim.pipeline import look
from weldsim.records import KnownSeam, PointCloud
from weldsim.report.metrics import across, known_offsets
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.refine import Fit, refine
from weldsim.seam.profile.smooth import smooth
from weldsim.seam.profile.strength import STRENGTHS, choose
from weldsim.seam.profile.track import CAMERA_REACHES, LATERAL_REACH
from weldsim.seam.thesis import mls
from weldsim.seam.thesis.config import ThesisConfig
from weldsim.seam.thesis.find import find_seams_thesis
from weldsim.seam.thesis.voxel import voxel_centroids

RESULTS = Path(__file__).parent / "results"
WIDTHS = (0.006, 0.010, 0.014, 0.020, 0.025)
DEPTH_OF_WIDTH = 8 / 14
SCENES = {"straight": "straight", "curve": "S, least radius 100 mm"}
NOISES = {"none": "exact depth", "iid": "independent noise 0.3 mm", "d415": "D415 model"}
RADII = (0.0, 0.0025, 0.005, 0.010)
VOXEL = 0.001
SIGMA = 0.3e-3  # [m] of the independent noise
AROUND = 0.042  # [m] points within this of the seam take part
ENDS = 0.020  # [m] at each end left out of the comparison
BLOCK = 0.005  # [m] of groove whose centroid is taken
BIN = 0.0005  # [m] across
LEVEL = 0.3  # of the depth, above which the centroid counts
WAVELENGTHS = (0.060, 0.100, 0.150, 0.300)
RADIUS = 0.100  # [m] the least of the sines, and the arc's
TRACK_NOISE = (0.1e-3, 0.3e-3, 0.6e-3)
CORRELATION, STATIONS, STEP = 3.5, 240, 0.001
SHOWN = STRENGTHS[STRENGTHS <= 1e8]  # beyond, a line of this length is a parabola already
Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Scan:
    """A groove as it was seen. Attributes: cloud, near the seam; known seam; width, depth [m]."""

    cloud: PointCloud
    known: KnownSeam
    width: float
    depth: float


@lru_cache(maxsize=4)
def scan(name: str, width: float, noise: str, seed: int) -> Scan:
    """A groove of that width [m] on the plate of a scene, seen under that kind of noise."""
    scene, depth = load_scene(name), DEPTH_OF_WIDTH * width
    groove = replace(scene.groove, width=width, depth=depth, angle=None)
    seen = look(replace(scene, groove=groove), CellConfig(), seed=seed, sensor="d415" if noise == "d415" else "exact")
    cloud, known = seen.cloud, seen.world.known_seams[0]
    cloud = cloud.select(known_offsets(cloud.points, known).distance < AROUND)
    if noise == "iid":
        sight = cloud.points - cloud.viewpoints[0]
        off = np.random.default_rng(seed).normal(0.0, SIGMA, len(cloud))
        moved = cloud.points + sight * (off / np.linalg.norm(sight, axis=1))[:, None]
        cloud = replace(cloud, points=moved, pixel=None)
    return Scan(cloud, known, width, depth)


def surface(points: Float[ndarray, "n 3"], seen: Scan) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"], Float[ndarray, "k"]]:
    """Place along the seam, across it to the left, and depth below the plate [m] of the points away from its ends."""
    known = seen.known
    found = known_offsets(points, known)
    inward = interpolate(arc_length(known.opening_B), known.bisectors_B, np.clip(found.s, 0.0, known.length))
    x, down = across(found, known), np.einsum("ij,ij->i", found.vectors, inward)
    use = (found.s > ENDS) & (found.s < known.length - ENDS) & (np.abs(x) < seen.width / 2 + 0.010) & (down > -0.01)
    return found.s[use], x[use], down[use]


def true_depth(x: Float[ndarray, "k"], seen: Scan) -> Float[ndarray, "k"]:
    """Depth of the V at x [m]."""
    return seen.depth * np.maximum(0.0, 1 - 2 * np.abs(x) / seen.width)


def binned(x: Float[ndarray, "k"], values: Float[ndarray, "k"], half: float) -> tuple[Float[ndarray, "w"], Float[ndarray, "w"]]:
    """Centres of bins across the seam, and the mean of the values in each, bridged where empty."""
    count = int(np.ceil(half / BIN))
    centres = np.arange(-count, count + 1) * BIN
    place = np.rint(x / BIN).astype(int) + count
    inside = (place >= 0) & (place < len(centres))
    number = np.bincount(place[inside], minlength=len(centres))
    total = np.bincount(place[inside], weights=values[inside], minlength=len(centres))
    known = number > 0
    return centres, np.interp(centres, centres[known], total[known] / number[known])


def shape(points: Float[ndarray, "n 3"], seen: Scan) -> Row:
    """What is left of the groove in points: root lost, lips sunk, wider by at half depth, centroid's bias and p95 [m]; profile."""
    s, x, down = surface(points, seen)
    half = seen.width / 2
    left_over = down - true_depth(x, seen)
    level = float(np.median(left_over[np.abs(x) > half + 0.004]))  # a view as a whole may be too near or far
    at_root, at_lips = np.abs(x) < BIN, np.abs(np.abs(x) - half) < BIN
    # What is left over the truth is binned, not the depth: pixels are wider than bins, and would alias on the walls.
    centres, profile = binned(x, left_over - level, half + 0.008)
    profile = profile + true_depth(centres, seen)
    off = []
    for k in np.unique(np.floor(s / BLOCK)):
        part = np.floor(s / BLOCK) == k
        place, block = binned(x[part], left_over[part] - level, half + 0.003)
        mass = np.maximum(block + true_depth(place, seen) - LEVEL * seen.depth, 0.0)
        off.append(float(mass @ place / mass.sum()) if mass.sum() > 0 else np.nan)
    offs = np.array(off)
    return {
        "root_lost": level - float(left_over[at_root].mean()),
        "lips_sunk": float(left_over[at_lips].mean()) - level,
        "wider": None if (width := _width_at(centres, profile, seen.depth / 2)) is None else width - half,
        "bias": float(np.nanmean(offs)),
        "p95": float(np.nanpercentile(np.abs(offs), 95)),
        "profile": [centres.tolist(), profile.tolist()],
    }


def _width_at(x: Float[ndarray, "w"], depth: Float[ndarray, "w"], level: float) -> float | None:
    """Distance between the outermost crossings of a level [m]; None where the profile never reaches it."""
    deep = np.flatnonzero(depth > level)
    if len(deep) == 0:
        return None
    i, j = int(deep[0]), int(deep[-1])
    left = np.interp(level, depth[i - 1 : i + 1], x[i - 1 : i + 1])
    right = np.interp(-level, -depth[j : j + 2], x[j : j + 2])
    return float(right - left)


def fitted(seen: Scan) -> Row | None:
    """What the default's fit says of a groove, begun from a line 1.5 mm off; None where it finds none."""
    known = seen.known
    s = arc_length(known.opening_B)
    left = np.cross(-known.bisectors_B, known.tangents_B)
    start = known.opening_B + (1.5e-3 * np.sin(s / 0.013))[:, None] * left
    fit: Fit | None = refine(start, -known.bisectors_B.mean(axis=0), seen.cloud.points, seen.cloud.sight_origins(), ProfileConfig())
    if fit is None:
        return None
    found = known_offsets(fit.rail.points[fit.core], known)
    inside = (found.s > ENDS) & (found.s < known.length - ENDS)
    x = across(found, known)[inside]
    section = fit.section
    return {
        "root_lost": seen.depth - fit.depth,
        "wider": section.width - seen.width,
        "blur": section.blur,
        "floor": section.floor,
        "bias": float(x.mean()),
        "p95": float(np.percentile(np.abs(x), 95)),
        "sigma": float(np.median(fit.sigma[fit.core])),
    }


def published(seen: Scan, radius: float) -> Row:
    """Mean and p95 distance [m] of the published method's first seam from the opening (None without), and its share of it."""
    findings = find_seams_thesis(seen.cloud, replace(ThesisConfig(), mls_radius=radius))
    if not findings.seams:
        return {"mean": None, "p95": None, "share": 0.0}
    seam = findings.seams[0]
    distance = known_offsets(seam.points_B, seen.known).distance
    share = seam.length / seen.known.length
    return {"mean": float(distance.mean()), "p95": float(np.percentile(distance, 95)), "share": share}


def curves() -> dict[str, Float[ndarray, "n"]]:
    """Lateral tracks [m] of a least radius of 100 mm: sines by wavelength, and an arc."""
    s = (np.arange(STATIONS) - STATIONS / 2) * STEP
    sines = {
        f"sine {1e3 * length:.0f} mm": (length / (2 * np.pi)) ** 2 / RADIUS * np.sin(2 * np.pi * s / length)
        for length in WAVELENGTHS
    }
    return sines | {"arc": s**2 / (2 * RADIUS)}


def track_noise(rng: np.random.Generator, count: int) -> Float[ndarray, "n d"]:
    """Columns of unit noise over the stations, with correlation exp(-(lag / CORRELATION)^2)."""
    lag = np.arange(STATIONS)
    covariance = np.exp(-(((lag[:, None] - lag) / CORRELATION) ** 2)) + 1e-9 * np.eye(STATIONS)
    return np.linalg.cholesky(covariance) @ rng.standard_normal((STATIONS, count))


def smoothed_curves(draws: int) -> list[Row]:
    """For each track and noise: strengths chosen, crest lost, rms bias, scatter and error [m]; both for every strength too."""
    rng, rows = np.random.default_rng(0), []
    weights, inner = np.ones(STATIONS), slice(20, -20)
    columns = track_noise(rng, draws)
    lengths = np.hypot((2 * LATERAL_REACH + 1) / np.sqrt(3), np.array(CAMERA_REACHES) / STEP)  # as the finder has them
    for name, track in curves().items():
        crest = np.argmax(np.abs(track[inner])) + 20
        biases = {k: smooth(track[:, None], weights, k)[:, 0] - track for k in SHOWN}
        scatters = {k: smooth(columns, weights, k) for k in SHOWN}
        for sigma in TRACK_NOISE:
            chosen, errors, lost, left = [], [], [], []
            for column in columns.T:
                seen = track + sigma * column
                strength = choose(seen, weights, lengths, LATERAL_REACH + 1).strength
                found = smooth(seen[:, None], weights, strength)[:, 0]
                bias = smooth(track[:, None], weights, strength)[:, 0] - track
                chosen.append(strength)
                errors.append(rms((found - track)[inner]))
                lost.append(-float(bias[crest] * np.sign(track[crest])))
                left.append(rms(bias[inner]))
            rows.append(
                {
                    "track": name,
                    "sigma": sigma,
                    "strength": float(np.exp(np.median(np.log(chosen)))),
                    "crest": float(abs(track[crest])),
                    "crest_lost": float(np.mean(lost)),
                    "bias": float(np.mean(left)),
                    "error": float(np.mean(errors)),
                    "raw": sigma * rms(columns[inner]),
                    "by_strength": [[k, rms(biases[k][inner]), sigma * rms(scatters[k][inner])] for k in SHOWN],
                }
            )
    return rows


def rms(values: Float[ndarray, "..."]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def measure(widths: tuple[float, ...], scenes: tuple[str, ...], radii: tuple[float, ...], seeds: int) -> list[Row]:
    """A row for each smoother, scene, width, noise and seed."""
    rows = []
    for name in scenes:
        for width in widths:
            for noise in NOISES:
                for seed in range(1 if noise == "none" else seeds):
                    seen = scan(name, width, noise, seed)
                    where = {"scene": name, "width": width, "noise": noise, "seed": seed}
                    points = voxel_centroids(seen.cloud.points, VOXEL)[0]
                    for radius in radii:
                        moved = mls.smooth(points, radius) if radius > 0 else points
                        row: Row = {"smoother": "mls", "radius": radius, **where, **shape(moved, seen)}
                        if width == 0.014 and seed == 0:
                            row["published"] = published(seen, radius)
                        rows.append(row)
                    rows.append({"smoother": "section", "radius": None, **where, **(fitted(seen) or {"lost": True})})
            print(f"{name}, {1e3 * width:g} mm", flush=True)
    return rows


def mean_of(rows: list[Row], name: str, **where: Any) -> float:
    """Mean over the seeds [m]; NaN where there is none."""
    mine = [row[name] for row in rows if row.get(name) is not None and all(row[key] == value for key, value in where.items())]
    return float(np.mean(np.abs(mine) if name == "bias" else mine)) if mine else float("nan")


def markdown(rows: list[Row], tracks: list[Row]) -> str:
    """Three tables in millimetres: grooves under each smoother, the published method's line, curves."""
    lines = ["Millimetres; grooves: mean of the seeds, `bias` of its size; a groove that is nowhere half as deep has no width."]
    for noise, title in NOISES.items():
        lines += [
            "",
            f"**{title}**",
            "",
            "| groove | smoother | root lost | lips sunk | wider | bias | p95 | blur |",
            "|---" * 8 + "|",
        ]
        for scene in dict.fromkeys(row["scene"] for row in rows):
            for width in dict.fromkeys(row["width"] for row in rows):
                for smoother, radius in dict.fromkeys((row["smoother"], row["radius"]) for row in rows):
                    where = {"scene": scene, "width": width, "noise": noise, "smoother": smoother, "radius": radius}
                    names = ("root_lost", "lips_sunk", "wider", "bias", "p95", "blur")
                    cells = [f"{1e3 * mean_of(rows, name, **where):.2f}".replace("nan", "-") for name in names]
                    label = "section fit" if radius is None else f"MLS {1e3 * radius:g} mm" if radius else "voxels alone"
                    lines.append(f"| {scene}, {1e3 * width:g} mm | {label} | {' | '.join(cells)} |")
    lines += [
        "",
        "The published method to its end, 14 mm groove: distance of its line from the opening, share of the seam it has.",
        "",
    ]
    lines += ["| groove | noise | MLS | mean | p95 | share |", "|---" * 6 + "|"]
    for row in rows:
        if "published" in row:
            p = row["published"]
            cells = " | ".join("-" if p[k] is None else f"{1e3 * p[k]:.2f}" for k in ("mean", "p95"))
            lines.append(f"| {row['scene']} | {row['noise']} | {1e3 * row['radius']:g} mm | {cells} | {p['share']:.2f} |")
    lines += ["", "Curve smoothing, strength chosen by likelihood under correlated noise.", ""]
    lines += ["| track | noise | strength | crest | crest lost | bias rms | error rms | unsmoothed rms |", "|---" * 8 + "|"]
    for row in tracks:
        cells = [f"{1e3 * row[name]:.3f}" for name in ("crest", "crest_lost", "bias", "error", "raw")]
        lines.append(f"| {row['track']} | {1e3 * row['sigma']:g} | 1e{np.log10(row['strength']):.1f} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one groove, one seed, two radii, few draws")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "egl")
    sys.path.insert(0, str(Path(__file__).parent))
    from smoothing_figure import draw

    if options.quick:
        rows = measure((0.014,), ("straight",), (0.0, 0.005), 1)
    else:
        rows = measure(WIDTHS, tuple(SCENES), RADII, options.seeds)
    tracks = smoothed_curves(4 if options.quick else 40)
    text = markdown(rows, tracks)
    print(text)
    options.out.mkdir(exist_ok=True)
    draw(rows, tracks, options.out / "13_smoothing.png")
    (options.out / "13_smoothing.md").write_text(text)
    kept = [{key: value for key, value in row.items() if key != "profile"} for row in rows]
    content = {"units": {"length": "m"}, "rows": kept, "curves": tracks}
    (options.out / "13_smoothing.json").write_text(json.dumps(content, separators=(",", ":")) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
