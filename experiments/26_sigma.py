"""Whether the sigma that a seam is told with is right: how many of its points lie within one and two of it.

Every scene with a groove is scanned and planned over a number of seeds; each point of a seam found counts with its error
across the known seam, over its own sigma. Of normal errors 68 % lie within 1 and 95 % within 2; 55 to 80 % and 90 % or more
are asked for. Exits 1 where a scene has fewer or more. Writes Markdown and JSON.

    python experiments/26_sigma.py [--seeds 20] [--scenes curve y] [--jobs 2]
"""

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np

from weldsim.pipeline import look, plan
from weldsim.report.metrics import match_seams, sigma_coverage

RESULTS = Path(__file__).parent / "results"
SCENES = ("straight", "curve", "cylinder", "cuboid", "y", "y_branches")
WITHIN_ONE, WITHIN_TWO = (0.55, 0.80), 0.90


def shares(job: tuple[str, int]) -> list[tuple[int, float, float, float]]:
    """Of each seam of a scene that was found: its points, their shares within 1 and 2 sigma, and its median sigma [m]."""
    scene, seed = job
    seen = look(scene, seed=seed)
    seams, known = plan(seen.cloud).findings.seams, seen.world.known_seams
    out = []
    for i, j in match_seams(seams, known).pairs:
        seam = seams[i]
        if seam.sigma is not None:
            within = sigma_coverage(seam.points_B, seam.sigma, known[j], seam.reference)
            out.append((len(seam.s), *within, float(np.median(seam.sigma))))
    return out


def measure(scene: str, seeds: int, pool: ProcessPoolExecutor) -> dict[str, Any]:
    """A scene's row: shares over all points of all seeds."""
    found = [one for some in pool.map(shares, [(scene, seed) for seed in range(seeds)]) for one in some]
    points, one, two, sigma = np.array(found).T
    return {
        "scene": scene,
        "seams": len(found),
        "within_one": float(points @ one / points.sum()),
        "within_two": float(points @ two / points.sum()),
        "sigma": float(np.median(sigma)),
    }


def holds(row: dict[str, Any]) -> bool:
    """Whether a scene's shares are those that were asked for."""
    return WITHIN_ONE[0] <= row["within_one"] <= WITHIN_ONE[1] and row["within_two"] >= WITHIN_TWO


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--scenes", nargs="*", choices=SCENES, default=list(SCENES))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    lines = [
        f"Points of the seams found whose error across the known seam is within their own sigma, {options.seeds} seeds.",
        "",
        "| scene | seams | within 1 sigma (55 to 80 %) | within 2 sigma (>= 90 %) | median sigma mm |",
        "|---|---|---|---|---|",
    ]
    print("\n".join(lines), flush=True)
    rows = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for scene in options.scenes:
            row = measure(scene, options.seeds, pool)
            rows.append(row)
            shown = f"{100 * row['within_one']:.0f} % | {100 * row['within_two']:.0f} % | {1e3 * row['sigma']:.2f}"
            lines.append(f"| {scene} | {row['seams']} | {shown} |")
            print(lines[-1], flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "26_sigma.md").write_text("\n".join(lines) + "\n")
    (options.out / "26_sigma.json").write_text(json.dumps({"seeds": options.seeds, "units": {"sigma": "m"}, "scenes": rows}) + "\n")
    return 0 if all(holds(row) for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
