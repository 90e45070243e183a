"""Error budget: what each source alone adds to the weld, in millimetres, for each scene.

One source is switched on at a time, over several units and seeds, in a cell that is otherwise perfect: exact camera, right
calibration. What is left without any (the finder's own error, exact depth) is the first column; then the sensor's noise, its
other faults (blur, steps, locking), an offset of the whole view, the hand-eye calibration, the arm's geometry, the controller.
The model's noise is greater where its window sees relief: that product of noise and window shows under "all" alone.
The figure is the mean cross-track distance of the executed tip from the known opening; the controller's is that of the tip
from the plan (p95). Sizes: offset 3.5 mm rms (thesis table 6.2), hand-eye 1 mm and 0.1 deg (three calibrations of the thesis
author's agree within 1 mm), arm 0.1 mm and 0.01 deg a joint (an assumption: the remainder after a factory calibration).

    python experiments/12_error_budget.py [--scenes straight curve] [--seeds 2] [--jobs 2]
"""

import argparse
import json
import math
import os
import statistics
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from weldsim.config import CellConfig
from weldsim.pipeline import SensorName
from weldsim.regression import regress
from weldsim.scene.files import scene_names
from weldsim.scene.miscalibration import TwinConfig
from weldsim.sensor.d415 import D415Config

RESULTS = Path(__file__).parent / "results"
DEGREE = math.pi / 180
QUIET = replace(
    D415Config(), noise_gain=0.0, pixel_locking=0.0, disparity_step=0.0, depth_unit=0.0, edge_jitter=0.0, mixed_pixels=0.0, window=1
)
ARM = {"kinematic_position": 0.1e-3, "kinematic_rotation": 0.01 * DEGREE}
HAND_EYE = {"hand_eye_position": 1e-3, "hand_eye_rotation": 0.1 * DEGREE}


def sources(seed: int) -> dict[str, tuple[SensorName, CellConfig]]:
    """{source: sensor and config} of one unit."""
    perfect = CellConfig()
    blurred = replace(D415Config(), noise_gain=0.0)
    return {
        "none": ("exact", perfect),
        "sensor noise": ("d415", replace(perfect, sensor=replace(QUIET, noise_gain=1.0))),
        "blur, steps, locking": ("d415", replace(perfect, sensor=blurred)),
        "view offset": ("d415", replace(perfect, sensor=replace(QUIET, offset_sigma=3.5e-3))),
        "hand-eye": ("exact", replace(perfect, twin=TwinConfig(**HAND_EYE, seed=seed))),
        "arm": ("exact", replace(perfect, twin=TwinConfig(**ARM, seed=seed))),
        "all": (
            "d415",
            CellConfig(sensor=replace(D415Config(), offset_sigma=3.5e-3), twin=TwinConfig(**HAND_EYE, **ARM, seed=seed)),
        ),
    }


def measure(scenes: list[str], seeds: int, jobs: int) -> list[dict[str, Any]]:
    """A row for each source, scene and unit: planned and executed mean, tip from plan [m]."""
    rows = []
    for source, (sensor, first) in sources(0).items():
        alike = first.twin.perfect  # then the units differ in the camera's noise alone
        configs = [first] if alike else [sources(unit)[source][1] for unit in range(seeds)]
        for unit, config in enumerate(configs):
            count = 1 if sensor == "exact" else seeds if alike else unit + 1
            outcome = regress(scenes, methods=("profile",), seeds=count, jobs=jobs, config=config, sensor=sensor, execute=True)
            for scene in scenes:
                found = outcome.of(scene, "profile")
                for row in found if alike else found[-1:]:
                    f = row.figures
                    figures = {"planned": f.mean, "executed": f.executed_mean, "tracking": f.tracking_p95, "refused": f.refused}
                    rows.append({"source": source, "scene": scene, "unit": f.seed if alike else unit, **figures})
                    print(rows[-1], flush=True)
    return rows


def markdown(rows: list[dict[str, Any]], scenes: list[str], seeds: int) -> str:
    """Mean over the units, planned / executed, in millimetres."""
    names = [*sources(0)]
    lines = [
        f"Error of the weld by source, each alone, mean over {seeds} units: planned / executed, mean cross-track distance from the",
        "known opening [mm]; controller: executed tip from the plan, p95 [mm].",
        "",
        f"| scene | {' | '.join(names)} | controller |",
        f"|---|{'---|' * (len(names) + 1)}",
    ]
    for scene in scenes:
        mine = [row for row in rows if row["scene"] == scene]
        cells = []
        for name in names:
            pairs = [
                [row[key] for row in mine if row["source"] == name and row[key] is not None] for key in ("planned", "executed")
            ]
            cells.append(" / ".join(f"{1e3 * statistics.mean(values):.2f}" if values else "-" for values in pairs))
        controller = [row["tracking"] for row in mine if row["source"] == "none" and row["tracking"] is not None]
        cells.append(f"{1e3 * statistics.mean(controller):.2f}" if controller else "-")
        lines.append(f"| {scene} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="*", default=[name for name in scene_names() if name not in ("plain", "bolted")])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "egl")
    rows = measure(options.scenes, options.seeds, options.jobs)
    text = markdown(rows, options.scenes, options.seeds)
    print(text)
    options.out.mkdir(exist_ok=True)
    (options.out / "12_error_budget.md").write_text(text)
    content = {"seeds": options.seeds, "units": {"length": "m"}, "rows": rows}
    (options.out / "12_error_budget.json").write_text(json.dumps(content, separators=(",", ":")) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
