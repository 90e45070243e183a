"""Random paths, of which some are infeasible, given to the simulated arm: each is executed within every limit or refused for the
true reason, and none moves before it is refused. An independent judge (random_paths.py) decides.

Exits 1 where one fault is found. Writes Markdown.

    python experiments/20_random_paths.py [--count 200] [--first 0] [--out FOLDER]
"""

import argparse
import collections
import sys
import time
from pathlib import Path

from weldsim.dryrun.cell import empty_cell

sys.path.insert(0, str(Path(__file__).parent))
from figures import record
from random_paths import KINDS, START, Outcome, attempt, random_case

RESULTS = Path(__file__).parent / "results"
FIGURES = {"joint speed": "rad/s", "joint acceleration": "rad/s2", "joint jerk": "rad/s3", "torch speed": "m/s", "tip p95": "m"}
LIMITS = {"joint speed": 3.0, "joint acceleration": 10.0, "joint jerk": 350.0, "torch speed": 0.25, "tip p95": 0.3e-3}


def markdown(outcomes: list[Outcome]) -> str:
    """Kinds by what became of them, the worst figures of what was executed, and every fault."""
    lines = ["| kind of job | jobs | executed | refused for | faults |", "|---|---|---|---|---|"]
    for kind in KINDS:
        mine = [each for each in outcomes if each.kind == kind]
        reasons = collections.Counter(each.reason for each in mine if not each.done)
        said = ", ".join(f"{reason} {count}" for reason, count in reasons.most_common())
        lines.append(
            f"| {kind} | {len(mine)} | {sum(each.done for each in mine)} | {said} | {sum(bool(each.faults) for each in mine)} |"
        )
    done = [each for each in outcomes if each.done and each.figures]
    lines += ["", "| figure of what was executed | worst | limit |", "|---|---|---|"]
    for name, unit in FIGURES.items():
        if done:
            lines.append(f"| {name} | {max(each.figures[name] for each in done):.4g} {unit} | {LIMITS[name]:g} {unit} |")
    refused = [each for each in outcomes if not each.done]
    unsure = [each for each in refused if not each.confirmed]
    lines += [
        "",
        f"{len(outcomes)} jobs: {sum(each.done for each in outcomes)} executed, {len(refused)} refused, of these"
        f" {sum(each.moved for each in refused)} after a movement; {len(unsure)} refusals that brute force could not confirm"
        + (f" ({', '.join(f'{each.seed}: {each.reason}' for each in unsure)})." if unsure else "."),
    ]
    lines += [f"* seed {each.seed}, {each.kind}: {'; '.join(each.faults)}" for each in outcomes if each.faults]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    options = parser.parse_args()
    cell, outcomes = empty_cell(START), []
    for seed in range(options.first, options.first + options.count):
        began = time.perf_counter()
        outcome = attempt(random_case(seed), cell)
        outcomes.append(outcome)
        word = "executed" if outcome.done else f"refused: {outcome.reason}"
        faults = "; ".join(outcome.faults)
        print(f"{seed:4d}  {outcome.kind:20}  {word:28}  {time.perf_counter() - began:5.1f} s  {faults}", flush=True)
    text = markdown(outcomes)
    print(text)
    options.out.mkdir(exist_ok=True)
    (options.out / "20_random_paths.md").write_text(text)
    if options.record and options.count >= 200:
        record("random_jobs", "python experiments/20_random_paths.py --record", count=sum(bool(each.faults) for each in outcomes))
    return 1 if any(outcome.faults for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
