"""How long planning takes, stage by stage and by both methods: python experiments/bench/plan.py [--json] [--record].

The cloud is one 640 x 480 depth frame of the straight groove by the D415 model of the twin, written and read as
`weldsim plan` reads it; pixels without a return are given their nearest neighbour's depth, for 307,200 points. Where
WELDSIM_DATA is set, the captured scan of a curved groove too. Stage times are medians after one run to warm up, both
methods in turn in one process; then the command itself, as a process of its own.

What does not depend on the machine: the time from cloud to path over that of one pass of a KD-tree over the same points
(built, then asked for 8 neighbours of each, 2 workers), the two in turn. For the depth frame, for the curve scene as it is
scanned, and for the latter as 300,000 points without order, viewpoint or pixels. With `--tree` that alone is measured.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

sys.path.insert(0, str(Path(__file__).parents[1]))
from figures import record

from weldsim.cloud.deproject import deproject
from weldsim.cloud.depth_files import read_depth_frame
from weldsim.cloud.depth_output import write_depth_frame
from weldsim.cloud.files import read_cloud
from weldsim.config import CellConfig
from weldsim.pipeline import Clock, plan
from weldsim.records import PointCloud

COMMAND = "python experiments/bench/plan.py --record"
STAGES = ("read", "cloud", "seam", "path")
NEIGHBOURS, WORKERS = 8, 2  # of the pass over a KD-tree
TREE_AIM, TREE_LIMIT = 0.5, 1.0  # of cloud to path over such a pass
PLAIN = 300_000  # points of the cloud without order
SCAN = Path("real") / "curved_groove_scan.ply"
SCAN_VIEWPOINT = (0.0, -0.45, 0.5)

# Peak memory of a process counts what its parent held when it was started, so a small one starts it.
LAUNCH = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
seconds = time.perf_counter() - start
print(json.dumps([code, seconds, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024]))
"""


def depth_files(folder: Path) -> None:
    """Writes a depth image of the straight and of the curved groove, each with its intrinsics and its pose."""
    from weldsim.config import load_scene
    from weldsim.pipeline import scan
    from weldsim.scene.world import build_world

    for name in ("straight", "curve"):
        frame = scan(build_world(load_scene(name)), CellConfig(), seed=0)[0].frame
        if name == "straight":
            depth = np.asarray(frame.depth)
            _, nearest = distance_transform_edt(~np.isfinite(depth), return_indices=True)
            frame = replace(frame, depth=depth[tuple(nearest)])
        write_depth_frame(folder / f"{name}.png", frame)


def read_depth(folder: Path, name: str) -> PointCloud:
    """The cloud of a depth image that `depth_files` wrote."""
    image, intrinsics, pose = (folder / f"{name}.{end}" for end in ("png", "intrinsics.json", "pose.json"))
    return deproject(read_depth_frame(image, intrinsics, pose=pose))


def plain_cloud(cloud: PointCloud) -> PointCloud:
    """PLAIN points of a cloud, some of them twice with 0.1 mm of noise where it has fewer, in no order and nothing else known."""
    rng = np.random.default_rng(0)
    rows = rng.permutation(len(cloud))[:PLAIN]
    more = rng.choice(len(cloud), PLAIN - len(rows))
    points = np.concatenate([cloud.points[rows], cloud.points[more] + rng.normal(0.0, 1e-4, (len(more), 3))])
    return PointCloud(points=rng.permutation(points))


def beside_tree(cloud: PointCloud, repeats: int) -> dict[str, float]:
    """Medians [s] of cloud to path and of a pass of a KD-tree over the cloud's points, in turn, and the ratio of the two."""
    plans, passes, seams = [], [], 0
    for turn in range(repeats + 1):
        start = time.perf_counter()
        seams = len(plan(cloud).findings.seams)
        between = time.perf_counter()
        KDTree(cloud.points).query(cloud.points, k=NEIGHBOURS, workers=WORKERS)
        if turn > 0:
            plans.append(between - start)
            passes.append(time.perf_counter() - between)
    out = {"points": len(cloud), "seams": seams, "plan": median(plans), "tree": median(passes)}
    return out | {"ratio": out["plan"] / out["tree"]}


def stages(read: Callable[[], PointCloud], config: CellConfig) -> tuple[dict[str, float], int, int]:
    """Seconds a stage of one plan, how many points it had, and how many seams it found."""
    clock = Clock()
    with clock.stage("read"):
        cloud = read()
    result = plan(cloud, config, clock=clock)
    return clock.seconds, len(cloud), len(result.findings.seams)


def compare(read: Callable[[], PointCloud], repeats: int, thesis_repeats: int) -> dict[str, Any]:
    """Medians [s] of each stage and of their total, for both methods, measured in turn."""
    runs: dict[str, list[dict[str, float]]] = {"profile": [], "thesis": []}
    out: dict[str, Any] = {}
    for turn in range(repeats + 1):
        for method, rows in runs.items():
            if method == "thesis" and turn > thesis_repeats:
                continue
            config = CellConfig()
            config = replace(config, seam=replace(config.seam, method=method))
            seconds, points, seams = stages(read, config)
            out["points"], out[f"{method}_seams"] = points, seams
            if turn > 0:
                rows.append(seconds)
    for method, rows in runs.items():
        out[method] = {stage: median(row[stage] for row in rows) for stage in STAGES}
        out[method]["total"] = median(sum(row.values()) for row in rows)
        out[method]["after_read"] = median(sum(row.values()) - row["read"] for row in rows)
        out[method]["runs"] = len(rows)
    out["ratio"] = out["thesis"]["after_read"] / out["profile"]["after_read"]
    return out


def process(arguments: list[str], repeats: int) -> dict[str, float]:
    """Median wall time [s] and greatest peak memory [bytes] of `weldsim plan` with these arguments.

    Raises:
        RuntimeError: the command fails.
    """
    command = [sys.executable, "-c", LAUNCH, str(Path(sys.executable).with_name("weldsim")), "plan", *arguments]
    rows = []
    for _ in range(repeats + 1):
        code, seconds, peak = json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)
        if code != 0:
            raise RuntimeError(f"weldsim plan {' '.join(arguments)} ended with {code}")
        rows.append((seconds, peak))
    return {"seconds": median(seconds for seconds, _ in rows[1:]), "peak_bytes": max(peak for _, peak in rows), "runs": repeats}


def measure(repeats: int, thesis_repeats: int, tree_alone: bool = False) -> dict[str, Any]:
    """Everything, by input; times beside those of a KD-tree under "tree"."""
    out: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # In a process of its own: the simulator's threads and memory end with it.
        subprocess.run([sys.executable, __file__, "--write-depth", name], check=True)
        curve = read_depth(folder, "curve")
        clouds = {"depth frame": read_depth(folder, "straight"), "curve scene": curve, "plain cloud": plain_cloud(curve)}
        out["tree"] = {name: beside_tree(cloud, repeats) for name, cloud in clouds.items()}
        if tree_alone:
            return out
        image, intrinsics, pose = (folder / f"straight.{end}" for end in ("png", "intrinsics.json", "pose.json"))
        arguments = [str(image), "--intrinsics", str(intrinsics), "--pose", str(pose), "--out", str(folder / "path.json")]
        out["depth frame"] = compare(lambda: read_depth(folder, "straight"), repeats, thesis_repeats)
        out["depth frame"]["process"] = process(arguments, repeats)
        data = os.environ.get("WELDSIM_DATA")
        if data:
            scan = Path(data) / SCAN
            arguments = [str(scan), "--viewpoint", *map(str, SCAN_VIEWPOINT), "--out", str(folder / "scan.json")]
            out["captured scan"] = compare(lambda: read_cloud(scan, viewpoint=SCAN_VIEWPOINT), repeats, thesis_repeats)
            out["captured scan"]["process"] = process(arguments, repeats)
    return out


def show(figures: dict[str, Any]) -> None:
    """Prints a table for each input."""
    for name, one in figures.items():
        if name == "tree":
            continue
        print(f"{name}, {one['points']:,} points; medians [s]")
        print(f"{'':10s}" + "".join(f"{stage:>9s}" for stage in (*STAGES, "total")) + f"{'seams':>7s}{'runs':>6s}")
        for method in ("profile", "thesis"):
            row = one[method]
            times = "".join(f"{row[stage]:9.3f}" for stage in (*STAGES, "total"))
            print(f"{method:10s}{times}{one[f'{method}_seams']:7d}{row['runs']:6d}")
        print(f"thesis takes {one['ratio']:.1f} times as long from cloud to path")
        whole = one["process"]
        print(f"weldsim plan, whole process: {whole['seconds']:.2f} s, peak memory {whole['peak_bytes'] / 1e6:.0f} MB\n")
    for name, one in figures["tree"].items():
        print(
            f"{name}, {one['points']:,} points, {one['seams']} seams: cloud to path {one['plan']:.3f} s,"
            f" a KD-tree pass {one['tree']:.3f} s: {one['ratio']:.2f} times (aim {TREE_AIM:g}, limit {TREE_LIMIT:g})"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--thesis-repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    parser.add_argument("--tree", action="store_true", help="measure cloud to path beside a KD-tree alone")
    parser.add_argument("--write-depth", metavar="FOLDER", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.write_depth:
        os.environ.setdefault("MUJOCO_GL", "egl")
        depth_files(options.write_depth)
        return
    figures = measure(options.repeats, options.thesis_repeats, options.tree)
    if options.record and not options.tree:
        frame = figures["depth frame"]
        record("plan_stages", COMMAND, seconds=frame["profile"]["after_read"])
        record("plan_process", COMMAND, seconds=frame["process"]["seconds"])
        record("thesis_ratio", COMMAND, ratio=frame["ratio"])
    if options.json:
        print(json.dumps(figures, indent=2))
    else:
        show(figures)


if __name__ == "__main__":
    main()
