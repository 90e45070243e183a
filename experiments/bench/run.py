"""The main job as a whole process: `weldsim run straight` and `run cuboid` without a video, wall time and peak memory, medians.

python experiments/bench/run.py [--repeats 3] [--record]
"""

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from figures import record

COMMAND = "python experiments/bench/run.py --record"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    options = parser.parse_args()
    median = {scene: whole_process(scene, options.repeats) for scene in ("straight", "cuboid")}
    for scene, (seconds, peak) in median.items():
        print(f"weldsim run {scene}, whole process: median {seconds:.1f} s of {options.repeats}, peak memory {peak * 1e-9:.2f} GB")
    if options.record:
        record("run_straight", COMMAND, seconds=median["straight"][0])
        record("memory", COMMAND, bytes=median["straight"][1])
        record("run_cuboid", COMMAND, seconds=median["cuboid"][0])
    return 0


def whole_process(scene: str, repeats: int) -> tuple[float, float]:
    """Median wall time [s] and, of the runs so far, the greatest peak memory [byte]."""
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(repeats):
            words = [sys.executable, "-m", "weldsim", "run", scene, "--seed", str(seed), "--out", f"{folder}/{seed}"]
            start = time.perf_counter()
            subprocess.run(words, check=True, capture_output=True)
            seconds.append(time.perf_counter() - start)
    return statistics.median(seconds), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024.0


if __name__ == "__main__":
    sys.exit(main())
