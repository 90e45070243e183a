"""How long planning takes, stage by stage and by both methods: python experiments/bench/plan.py [--json] [--record].

The cloud is one 640 x 480 depth frame of the straight groove by the D415 model of the twin, written and read as
`weldsim plan` reads it; pixels without a return are given their nearest neighbour's depth, for 307,200 points. Where
WELDSIM_DATA is set, the captured scan of a curved groove too. Stage times are medians after one run to warm up, both
methods in turn in one process; then the command itself, as a process of its own.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

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


def depth_files(folder: Path) -> tuple[Path, Path, Path]:
    """A depth image of the straight groove, its intrinsics and its pose."""
    from weldsim.config import load_toml, structure
    from weldsim.pipeline import scan
    from weldsim.scene.config import SceneConfig
    from weldsim.scene.files import scene_path
    from weldsim.scene.world import build_world

    world = build_world(structure(load_toml(scene_path("straight")), SceneConfig))
    capture = scan(world, CellConfig(), seed=0)[0]
    depth = np.asarray(capture.frame.depth)
    _, nearest = distance_transform_edt(~np.isfinite(depth), return_indices=True)
    return write_depth_frame(folder / "straight.png", replace(capture.frame, depth=depth[tuple(nearest)]))


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


def measure(repeats: int, thesis_repeats: int) -> dict[str, Any]:
    """Everything, by input."""
    out: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # In a process of its own: the simulator's threads and memory end with it.
        subprocess.run([sys.executable, __file__, "--write-depth", name], check=True)
        image, intrinsics, pose = (folder / f"straight.{end}" for end in ("png", "intrinsics.json", "pose.json"))
        arguments = [str(image), "--intrinsics", str(intrinsics), "--pose", str(pose), "--out", str(folder / "path.json")]
        out["depth frame"] = compare(lambda: deproject(read_depth_frame(image, intrinsics, pose=pose)), repeats, thesis_repeats)
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
        print(f"{name}, {one['points']:,} points; medians [s]")
        print(f"{'':10s}" + "".join(f"{stage:>9s}" for stage in (*STAGES, "total")) + f"{'seams':>7s}{'runs':>6s}")
        for method in ("profile", "thesis"):
            row = one[method]
            times = "".join(f"{row[stage]:9.3f}" for stage in (*STAGES, "total"))
            print(f"{method:10s}{times}{one[f'{method}_seams']:7d}{row['runs']:6d}")
        print(f"thesis takes {one['ratio']:.1f} times as long from cloud to path")
        whole = one["process"]
        print(f"weldsim plan, whole process: {whole['seconds']:.2f} s, peak memory {whole['peak_bytes'] / 1e6:.0f} MB\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--thesis-repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    parser.add_argument("--write-depth", metavar="FOLDER", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.write_depth:
        os.environ.setdefault("MUJOCO_GL", "egl")
        depth_files(options.write_depth)
        return
    figures = measure(options.repeats, options.thesis_repeats)
    if options.record:
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
