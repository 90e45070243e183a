"""The thesis author's own scan of the curved groove, planned from the command line, both methods.

The scan has no known seam; its valley is plain to see, so the planned line is held against it: at every 2 mm of path the
middle of the groove's two walls at half its depth, in slices of 3 mm, found without any help from the seam finder.

    WELDSIM_DATA=... python experiments/02_real_scan.py [--record]
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy import ndarray

sys.path.insert(0, str(Path(__file__).parent))
from figures import record


def planned_tip(scan: Path, method: str) -> ndarray:
    """Torch tips (n, 3) [m] that `weldsim plan` writes for a scan, best seam; empty where it finds none."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "path.json"
        words = [sys.executable, "-m", "weldsim", "plan", str(scan), "--method", method, "--out", str(out)]
        subprocess.run(words, check=False, capture_output=True)
        if not out.exists():
            return np.zeros((0, 3))
        seams = json.loads(out.read_text())["seams"]
    return np.array([pose["position"] for pose in seams[0]["poses"]]) if seams else np.zeros((0, 3))


def valley_offsets(tip: ndarray, points: ndarray) -> ndarray:
    """Distance [m] across the groove from the tip to the valley, about every 2 mm of path."""
    up = np.linalg.svd(points[::20] - points.mean(axis=0), full_matrices=False)[2][2]
    offsets = []
    for i in range(0, len(tip), max(1, len(tip) // 110)):
        before, after = tip[max(0, i - 20)], tip[min(len(tip) - 1, i + 20)]
        along = (after - before) / np.linalg.norm(after - before)
        local = (points - tip[i]) @ np.stack([along, np.cross(up, along), up], axis=1)
        near = local[(np.abs(local[:, 0]) < 1.5e-3) & (np.abs(local[:, 1]) < 0.02)]
        beside = near[np.abs(near[:, 1]) > 0.014]
        depth = np.abs(np.polyval(np.polyfit(beside[:, 1], beside[:, 2], 1), near[:, 1]) - near[:, 2])
        deep = near[depth > 0.5 * np.percentile(depth, 98), 1]
        offsets.append(abs(deep.min() + deep.max()) / 2)
    return np.array(offsets)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--record", action="store_true", help="write the figure of README.md too")
    options = parser.parse_args()
    if "WELDSIM_DATA" not in os.environ:
        print("WELDSIM_DATA is not set: captured data is not part of the project", file=sys.stderr)
        return 2
    from weldsim.cloud.files import read_cloud

    scan = Path(os.environ["WELDSIM_DATA"]) / "real" / "curved_groove_scan.ply"
    points = read_cloud(scan).points
    print("| method | length mm | mean mm | p95 mm | max mm |\n|---|---|---|---|---|")
    for method in ("profile", "thesis"):
        tip = planned_tip(scan, method)
        if len(tip) == 0:
            print(f"| {method} | no seam | - | - | - |")
            continue
        off = valley_offsets(tip, points)
        mean, p95, most = float(off.mean()), float(np.percentile(off, 95)), float(off.max())
        length = float(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum())
        print(f"| {method} | {length * 1e3:.1f} | {mean * 1e3:.2f} | {p95 * 1e3:.2f} | {most * 1e3:.2f} |")
        if options.record and method == "profile":
            record("real_scan", "python experiments/02_real_scan.py --record", mean=mean, p95=p95)
    return 0


if __name__ == "__main__":
    sys.exit(main())
