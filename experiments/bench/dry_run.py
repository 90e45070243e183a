"""How long it takes to say whether a seam of 0.3 m can be welded, and to plan its motion.

Seams of the twin's kinds, clamped to the table and in the empty cell, drawn from seeds: search over every posture and collision
(`ladder`: rungs and climb), and `weldsim dry-run`'s whole check with the planned motion (`check`). Prints medians and the worst.

    python experiments/bench/dry_run.py [--seeds 6] [--record]
"""

import argparse
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from weldsim.arm import UR5
from weldsim.config import load_scene
from weldsim.curves import arc_length, tangents
from weldsim.dryrun.cell import Cell, empty_cell, scene_cell
from weldsim.dryrun.try_path import try_path
from weldsim.frames import Transform, unit
from weldsim.motion.config import MotionConfig
from weldsim.motion.ladder import climb
from weldsim.motion.rail import make_rail
from weldsim.motion.rungs import make_rungs
from weldsim.records import Segment, TorchPath

sys.path.insert(0, str(Path(__file__).parents[1]))
from figures import record

LENGTH, STEP = 0.3, 1e-4  # [m] of the seam, between poses
LIMITS = {"ladder": 2.0, "check": 5.0}  # [s]


def seam(seed: int) -> TorchPath:
    """A wave of 0.3 m over the table, anyhow turned, the torch leaned by up to some 15 deg."""
    rng = np.random.default_rng(seed)
    u = np.linspace(-0.5, 0.5, round(LENGTH / STEP) + 1)
    flat = np.stack([LENGTH * u, rng.uniform(0, 0.02) * np.sin(2 * np.pi * u), 0 * u], axis=1)
    yaw = rng.uniform(-0.5, 0.5)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    points = flat @ turn.T + [rng.uniform(-0.05, 0.05), rng.uniform(-0.5, -0.42), 0.06]
    z = unit(np.broadcast_to(np.array([rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25), -1.0]), points.shape))
    along = tangents(points)
    x = unit(along - np.sum(along * z, axis=1)[:, None] * z)
    n = len(points)
    return TorchPath(
        X_BT=Transform("BT", np.stack([x, np.cross(z, x), z], axis=-1), points),
        s=arc_length(points),
        speed=np.full(n, 0.008),
        arc_on=np.ones(n, bool),
        segments=(Segment.WELD,) * n,
    )


def measure(path: TorchPath, cell: Cell, config: MotionConfig) -> dict[str, float]:
    """Times [s] of one seam, and whether it can be welded."""
    began = time.perf_counter()
    climb(make_rungs(make_rail(path, config), UR5, config, cell.collision), cell.q_start, UR5, config, cell.collision)
    searched = time.perf_counter()
    passed = try_path(path, "seam", cell, config).passed
    return {"ladder": searched - began, "check": time.perf_counter() - searched, "passed": float(passed)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--record", action="store_true", help="keep the figures for README.md")
    asked = parser.parse_args()
    config = MotionConfig()
    scene = load_scene("straight")
    cells = {"empty": empty_cell(), "clamped plate": scene_cell(replace(scene, fixture=replace(scene.fixture, clamps=4)))}
    measure(seam(0), cells["empty"], config)  # what is compiled or loaded at first use
    rows = {name: [measure(seam(seed), cell, config) for seed in range(asked.seeds)] for name, cell in cells.items()}
    worst = dict.fromkeys(LIMITS, 0.0)
    for name, mine in rows.items():
        for key in LIMITS:
            times = [row[key] for row in mine]
            worst[key] = max(worst[key], *times)
            print(f"{name:14} {key:7} median {statistics.median(times):.2f} s, worst {max(times):.2f} s (limit {LIMITS[key]:g} s)")
        print(f"{name:14} {sum(row['passed'] for row in mine):.0f} of {len(mine)} can be welded")
    if asked.record:
        record("dry_run_times", "python experiments/bench/dry_run.py --record", check=worst["check"], ladder=worst["ladder"])
    return int(any(worst[key] > limit for key, limit in LIMITS.items()))


if __name__ == "__main__":
    sys.exit(main())
