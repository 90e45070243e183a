"""What the seam finder makes of surfaces without any groove, seen by the measured cameras: every seam found is a phantom.

`table`: a plain table as a D435 sees it from (0, -0.75, 0.75) m, pitched 45 degrees, cropped as the public scans of such a table
are (thillRobot/seam_detection, single scans: 19 phantom paths in 33 runs); each scan is planned with the true viewpoint, with
a wrong one and with none. `plates`: plain, bolted, clamped and drilled plates under the D415 at 0.40 and 0.60 m. Each with the
driver's spatial filter off and on. Prints a row for each, with the phantoms; `--out` writes them as JSON too.

    python experiments/24_bare_surfaces.py [--parts table plates] [--seeds 11] [--filters off on] [--noise measured random fitted]
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from numpy import ndarray

from weldsim.cloud.deproject import deproject
from weldsim.config import CellConfig
from weldsim.errors import WeldsimError
from weldsim.frames import Transform
from weldsim.mounts import D415_640X480
from weldsim.pipeline import plan
from weldsim.records import CameraIntrinsics, DepthFrame, PointCloud
from weldsim.scene.config import FixtureConfig, SceneConfig, ViewConfig
from weldsim.scene.world import AWAY, build_world
from weldsim.sensor.base import View
from weldsim.sensor.d415 import D435_848X480, FILTERED_NOISE, D415Config, D435Config, d415, unit_intrinsics
from weldsim.sensor.exact import ExactSensor, twin_scene

SCAN_EYE = np.array([0.0, -0.75, 0.75])  # [m] in B
TABLE = (-0.058, 0.022, 0.1555)  # height [m] of the scanned table is a x + b y + c
CROP_LOW, CROP_HIGH = np.array([-0.345, -0.20, 0.12]), np.array([0.50, 0.18, 0.40])  # [m]
VIEWPOINTS = {"true": tuple(SCAN_EYE), "wrong": (0.0, 0.0, 0.6), "none": None}
DISTANCES = (0.40, 0.60)  # [m]
TILT = np.radians(8)  # of the D415 above a plate, so that pixel steps and the plate's face do not lie alike
PLATES = {
    "plain": FixtureConfig(clamps=0),
    "bolted": FixtureConfig(clamps=0, bolts=6),
    "clamped": FixtureConfig(clamps=4),
}
HOLE_RADIUS, HOLE_PITCH, THICKNESS = 0.006, 0.030, 0.015  # [m] of the drilled plate
KINDS = (*PLATES, "drilled")


@dataclass(frozen=True)
class Bare:
    """A cloud without a groove. Attributes: surface, as rows are called; case, which of several; cloud."""

    surface: str
    case: str
    cloud: PointCloud


def unit(base: D415Config, noise: str, seed: int, filtered: bool) -> D415Config:
    """The camera of that seed: as measured, drawn from the spread between units, or with what is left after a driver's filter."""
    if noise == "random":
        base = type(base).randomised(seed, base)
    return replace(base, noise=FILTERED_NOISE if noise == "fitted" else base.noise, spatial_filter=filtered)


def looking(eye: ndarray, pitch: float) -> Transform:
    """X_BC of a camera at `eye` [m] that looks along B's y and `pitch` down [rad]."""
    c, s = np.cos(pitch), np.sin(pitch)
    return Transform("BC", np.array([[1.0, 0.0, 0.0], [0.0, -s, c], [0.0, -c, -s]]), eye)


def plane_depth(camera: CameraIntrinsics, X_BC: Transform, plane: tuple[float, float, float]) -> ndarray:
    """z-depth (h, w) [m] of the plane of height a x + b y + c in B; NaN where a pixel does not meet it."""
    normal = np.array([-plane[0], -plane[1], 1.0])
    with np.errstate(divide="ignore"):
        depth = (plane[2] - normal @ X_BC.p) / (camera.rays() @ X_BC.R.T @ normal)
    return np.where((depth > 0) & (depth < 10), depth, np.nan).astype(np.float32)


def seen(exact: ndarray, camera: CameraIntrinsics, X_BC: Transform, config: D415Config, seed: int) -> PointCloud:
    """The cloud in B of exact depth as that unit shows it."""
    return deproject(DepthFrame(depth=d415(exact, camera, config, seed=[seed]), intrinsics=camera, X_BC=X_BC))


def tables(seeds: int, noise: str, filtered: bool) -> Iterator[Bare]:
    """A plain table from the scanner's pose, cropped; every scan once for each viewpoint given."""
    X_BC = looking(SCAN_EYE, np.pi / 4)
    for seed in range(seeds):
        config = unit(D435Config(), noise, seed, filtered)
        camera = unit_intrinsics(D435_848X480, config)
        points = seen(plane_depth(camera, X_BC, TABLE), camera, X_BC, config, seed).points
        points = points[((points > CROP_LOW) & (points < CROP_HIGH)).all(axis=1)]
        for name, viewpoint in VIEWPOINTS.items():
            at = np.zeros((0, 3)) if viewpoint is None else np.array([viewpoint])
            yield Bare(f"table, viewpoint {name}", str(seed), PointCloud(points=points, frame="B", viewpoints=at))


def drilled_depth(camera: CameraIntrinsics, X_BC: Transform, top: float) -> ndarray:
    """z-depth (h, w) [m] of a wide plate in B with holes through it on a square grid, its upper face at height `top` [m]."""
    rays = camera.rays() @ X_BC.R.T
    depth = (top - X_BC.p[2]) / rays[..., 2]
    x, y = (X_BC.p[i] + depth * rays[..., i] for i in (0, 1))
    x -= HOLE_PITCH * np.rint(x / HOLE_PITCH)  # from the nearest hole's axis
    y -= HOLE_PITCH * np.rint(y / HOLE_PITCH)
    # Inside a hole the ray goes on to its wall, |(x, y) + t (u, v)| = radius, or through it to the table.
    u, v = rays[..., 0], rays[..., 1]
    a, b, c = u**2 + v**2, x * u + y * v, x**2 + y**2 - HOLE_RADIUS**2
    wall = (-b + np.sqrt(np.maximum(b**2 - a * c, 0))) / np.maximum(a, 1e-12)
    inside = np.minimum(wall, THICKNESS / -rays[..., 2])
    return np.where(c < 0, depth + inside, depth).astype(np.float32)


@lru_cache
def plate_view(kind: str, distance: float) -> tuple[ndarray, Transform, CameraIntrinsics]:
    """Exact depth of that plate from `distance` [m], X_BC, and the camera."""
    if kind == "drilled":
        X_BC = Transform("BC", looking(SCAN_EYE, np.pi / 2 - TILT).R, np.array([0.0, -0.45, distance + THICKNESS]))
        return drilled_depth(D415_640X480, X_BC, THICKNESS), X_BC, D415_640X480
    view = ViewConfig(standoff=distance, tilt=TILT)
    world = build_world(SceneConfig(workpiece="plain_plate", fixture=PLATES[kind], views=(view,)))
    sensor = ExactSensor(twin_scene(world, world.new_data(AWAY)), D415_640X480, colour=False)  # the arm reaches not every view
    try:
        capture = sensor.capture(View(X_BC=world.views[0]))
    finally:
        sensor.close()
    return np.asarray(capture.frame.depth), capture.frame.X_BC, capture.frame.intrinsics


def plates(seeds: int, noise: str, filtered: bool) -> Iterator[Bare]:
    """Plates without a groove; a unit's own focal length is left out, since the view is rendered once."""
    for kind in KINDS:
        for distance in DISTANCES:
            exact, X_BC, camera = plate_view(kind, distance)
            for seed in range(seeds):
                config = replace(unit(D415Config(), noise, seed, filtered), focal_scale=1.0)
                yield Bare(f"{kind} plate at {distance:.2f} m", str(seed), seen(exact, camera, X_BC, config, seed))


PARTS = {"table": tables, "plates": plates}


def phantoms(cloud: PointCloud, config: CellConfig) -> list[dict[str, Any]]:
    """Length, width and depth [m] and confidence of every seam that the finder returns; a refused cloud has none."""
    try:
        found = plan(cloud, config).findings.seams
    except WeldsimError:
        return []
    return [
        {
            "length": float(seam.s[-1]),
            "width": seam.width,
            "depth": seam.depth,
            "confidence": seam.confidence,
            "middle": seam.points_B[len(seam.points_B) // 2].round(4).tolist(),
        }
        for seam in found
    ]


def measure(options: argparse.Namespace, config: CellConfig) -> list[dict[str, Any]]:
    """A row for each surface, noise and state of the filter, printed as it is done."""
    rows = []
    print(
        "| surface | noise | filter | runs with a phantom | phantoms: length mm (confidence) | s a run |\n|---|---|---|---|---|---|"
    )
    for part in options.parts:
        for noise in options.noise:
            for switch in options.filters:
                groups: dict[str, list[Bare]] = {}
                for bare in PARTS[part](options.seeds or (11 if part == "table" else 20), noise, switch == "on"):
                    groups.setdefault(bare.surface, []).append(bare)
                for surface, bares in groups.items():
                    start = time.perf_counter()
                    found = {bare.case: phantoms(bare.cloud, config) for bare in bares}
                    seconds = (time.perf_counter() - start) / len(bares)
                    rows.append({"surface": surface, "noise": noise, "filter": switch, "seconds": seconds, "found": found})
                    hits = {case: seams for case, seams in found.items() if seams}
                    shown = "; ".join(
                        f"{case}: " + ", ".join(f"{1e3 * seam['length']:.0f} ({seam['confidence']:.2f})" for seam in seams)
                        for case, seams in hits.items()
                    )
                    print(f"| {surface} | {noise} | {switch} | {len(hits)}/{len(found)} | {shown} | {seconds:.2f} |", flush=True)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--seeds", type=int, default=0, help="scans of each surface; 11 of the table, 20 of plates by default")
    parser.add_argument("--filters", nargs="+", choices=["off", "on"], default=["off", "on"])
    parser.add_argument(
        "--noise",
        nargs="+",
        choices=["measured", "random", "fitted"],
        default=["measured"],
        help="the model's defaults, units drawn from its spread, or what is left after a driver's filter (filter off)",
    )
    parser.add_argument("--out", type=Path, help="where to write the rows as JSON")
    options = parser.parse_args()
    rows = measure(options, CellConfig())
    if options.out is not None:
        options.out.write_text(json.dumps(rows, indent=1) + "\n")
    print(f"{sum(bool(seams) for row in rows for seams in row['found'].values())} run(s) with a phantom")
    return 0


if __name__ == "__main__":
    sys.exit(main())
