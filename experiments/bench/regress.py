"""`weldsim regress` as a whole process with one job and with two: wall times, their ratio, and whether the figures agree.

Each is repeated, turn by turn, and the least time of each counts, for other work on the machine only ever adds to it.

    python experiments/bench/regress.py [--scenes ...] [--seeds 3] [--repeats 1] [--record]
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
from figures import record

COMMAND = "python experiments/bench/regress.py --record"
LIMIT, RATIO = 240.0, 1.6  # [s] with two jobs; how much faster than with one


def once(words: list[str], jobs: int) -> tuple[float, list[Any]]:
    """Wall time [s], and every figure that is no time."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "weldsim", "regress", "--json", "--jobs", str(jobs), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    rows = json.loads(done.stdout)["rows"]
    return seconds, [[row["scene"], row["method"], row["seed"], row["figures"] | {"seconds": None}] for row in rows]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="*", default=[])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    options = parser.parse_args()
    words = ["--seeds", str(options.seeds), *(["--scenes", *options.scenes] if options.scenes else [])]
    best, figures = {1: float("inf"), 2: float("inf")}, {}
    for _ in range(options.repeats):
        for jobs in best:
            seconds, figures[jobs] = once(words, jobs)
            best[jobs] = min(best[jobs], seconds)
    ratio, same = best[1] / best[2], figures[1] == figures[2]
    plans = len(figures[1])
    print(f"weldsim regress, {plans} plans: {best[1]:.1f} s with one job, {best[2]:.1f} s with two (limit {LIMIT:.0f} s)")
    print(f"two jobs are {ratio:.2f} times as fast as one (wanted {RATIO}); figures {'agree' if same else 'DIFFER'}")
    if options.record and same and not options.scenes and options.seeds == 3:
        record("regress", COMMAND, seconds=best[2])
        record("regress_ratio", COMMAND, ratio=ratio)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
