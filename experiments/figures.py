"""The table of measured figures in README.md, made from experiments/results/readme.json.

A script that measures a figure calls `record`; `python experiments/figures.py` (`make figures`) then writes the table.
Values in the JSON are SI; a row without an entry shows a dash.
"""

import json
import os
import sys
from dataclasses import dataclass
from math import pi, radians
from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "experiments" / "results" / "readme.json"
README = ROOT / "README.md"
BEGIN, END = "<!-- figures: made by `make figures` -->", "<!-- end of figures -->"

SCALES = {"mm": 1e3, "deg": 180 / pi, "%": 1e2, "s": 1.0, "GB": 1e-9, "": 1.0}


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes:
        what: was measured.  names: of the values, in order.  unit: they are shown in, a key of SCALES.
        limits: of each value [SI], or None for none.  least: whether a limit is the least allowed, not the most.
        decimals: shown.
    """

    what: str
    names: tuple[str, ...]
    unit: str
    limits: tuple[float | None, ...]
    least: bool = False
    decimals: int = 2


ROWS = {
    "real_scan": Row(
        "the thesis author's scan of a curved groove: planned line from the groove's valley, mean / p95",
        ("mean", "p95"),
        "mm",
        (1.0e-3, 2.5e-3),
    ),
    "plan_straight": Row(
        "planned path from the true seam, straight, worst of 20 seeds: mean / p95 / max",
        ("mean", "p95", "max"),
        "mm",
        (0.4e-3, 0.8e-3, 1.2e-3),
    ),
    "plan_curve": Row(
        "planned path from the true seam, curve, worst of 20 seeds: mean / p95 / max",
        ("mean", "p95", "max"),
        "mm",
        (0.4e-3, 0.8e-3, 1.2e-3),
    ),
    "thesis_straight": Row(
        "the same by the published method, worst of the seeds where it gives a path, straight: mean / p95 / max",
        ("mean", "p95", "max"),
        "mm",
        (None,) * 3,
    ),
    "thesis_curve": Row(
        "the same by the published method, worst of the seeds where it gives a path, curve: mean / p95 / max",
        ("mean", "p95", "max"),
        "mm",
        (None,) * 3,
    ),
    "coverage": Row("share of the true seam that the path covers, least of all seeds", ("least",), "%", (0.95,), True, 1),
    "wire_axis": Row("wire axis from the true bisector: median / p95", ("median", "p95"), "deg", (radians(1.5), radians(4))),
    "phantoms": Row("seams found in a plain clamped plate, 20 seeds", ("count",), "", (0,), decimals=0),
    **{
        f"plan_{scene}": Row(
            f"planned path from the true seam, {name}, worst of 10 seeds, bare and clamped: mean / max",
            ("mean", "max"),
            "mm",
            limits,
        )
        for scene, name, limits in (
            ("cylinder", "cylinder", (0.5e-3, 1.5e-3)),
            ("cuboid", "cuboid over three faces", (0.7e-3, 2.0e-3)),
            ("y", "Y, stem alone", (0.7e-3, 2.0e-3)),
            ("y_branches", "Y, three branches", (0.7e-3, 2.0e-3)),
        )
    },
    "five_coverage": Row("share of the true seam covered, all six scenes, least of 10 seeds", ("least",), "%", (0.95,), True, 1),
    "five_iou": Row("overlap of the groove region found with the true one (IoU), least", ("least",), "", (0.85,), True),
    "five_phantoms": Row("seams found in those scenes where there is none", ("count",), "", (0,), decimals=0),
    "five_stereo": Row(
        "the six scenes by the reference D415, one seed: largest error over the limit that the default model has",
        ("share",),
        "",
        (1.5,),
    ),
    "five_offset": Row("cuboid, each of five views off by 3.5 mm rms, worst of 10 seeds: mean", ("mean",), "mm", (2.0e-3,)),
    "tracking": Row("executed torch tip from the plan, p95", ("p95",), "mm", (0.3e-3,)),
    "speed": Row("torch speed from the one asked for, on the weld, max", ("max",), "%", (0.02,)),
    "exported": Row(
        "exported URScript on the virtual controller, both profiles, five scenes and the thesis's program: tip from path, max",
        ("max",),
        "mm",
        (0.2e-3,),
    ),
    **{
        f"execute_{key}": Row(f"five scenes welded through {name}: tip from the planned path, worst p95", ("p95",), "mm", (0.3e-3,))
        for key, name in (
            ("sim", "the simulated arm"),
            ("cb3", "ur_rtde and a virtual CB3 controller"),
            ("e", "ur_rtde and a virtual e-Series controller"),
        )
    },
    **{
        f"drill_{key}": Row(
            f"a short weld struck at random instants, both virtual controllers, {name}: until arc off / arm at rest, worst",
            ("arc", "rest"),
            "s",
            (limit, limit),
        )
        for key, name, limit in (
            ("faults", "link, protective and emergency stop, stall, foreign program, local control, two at once", 0.3),
            ("killed", "client process, its owner or both killed or held", 0.5),
        )
    },
    "random_jobs": Row(
        "200 random jobs, some infeasible: moved before being refused, broke a limit, or wrongly judged",
        ("count",),
        "",
        (0,),
        decimals=0,
    ),
    "plan_stages": Row("cloud to path, 307,200 points, stages alone, 2 cores", ("seconds",), "s", (0.4,)),
    "plan_process": Row("`weldsim plan` on that cloud, whole process", ("seconds",), "s", (3.0,)),
    "thesis_ratio": Row(
        "how many times longer the published method takes on the same machine", ("ratio",), "", (None,), decimals=0
    ),
    "dry_run_times": Row(
        "feasibility and motion plan of a 0.3 m seam, and the search over postures alone, worst of 12",
        ("check", "ladder"),
        "s",
        (5.0, 2.0),
    ),
    "run_straight": Row("`weldsim run straight`, whole process", ("seconds",), "s", (20.0,), decimals=1),
    "memory": Row("peak memory of `weldsim run straight`", ("bytes",), "GB", (1.5e9,)),
    "run_cuboid": Row("`weldsim run cuboid`, whole process", ("seconds",), "s", (60.0,), decimals=1),
    "regress": Row("`weldsim regress`, 3 seeds, every scene by both methods, two jobs", ("seconds",), "s", (240.0,), decimals=0),
    "regress_ratio": Row("how many times as fast as with one job", ("ratio",), "", (1.6,), True),
}


def record(key: str, command: str, **values: float) -> None:
    """Nothing; stores one row's values [SI] and the command that measured them.

    Raises:
        ValueError: a key or a value's name that the table does not have.
    """
    if key not in ROWS:
        raise ValueError(f"figure {key!r}: not one of {', '.join(ROWS)}")
    if set(values) != set(ROWS[key].names):
        raise ValueError(f"figure {key!r}: values {', '.join(values)}; the row has {', '.join(ROWS[key].names)}")
    entries = read_entries()
    entries[key] = {"values": {name: float(values[name]) for name in ROWS[key].names}, "command": command}
    ordered = {name: entries[name] for name in ROWS if name in entries}
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    _write_whole(RESULTS, json.dumps(ordered, indent=2) + "\n")


def read_entries() -> dict[str, dict]:
    """What has been recorded: {key: {"values": {name: SI}, "command": text}}."""
    return json.loads(RESULTS.read_text()) if RESULTS.exists() else {}


def table(entries: dict[str, dict]) -> str:
    """The table as Markdown, one row a figure."""
    lines = ["| figure | measured | limit | by |", "|---|---|---|---|"]
    for key, row in ROWS.items():
        entry = entries.get(key)
        measured = _measured(row, entry["values"]) if entry else "-"
        command = f"`{entry['command']}`" if entry else "-"
        lines.append(f"| {row.what} | {measured} | {_limit(row)} | {command} |")
    return "\n".join(lines)


def readme_with(text: str, entries: dict[str, dict]) -> str:
    """README's text with the table between its two marks replaced."""
    head, _, rest = text.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return f"{head}{BEGIN}\n{table(entries)}\n{END}{tail}"


def _measured(row: Row, values: dict[str, float]) -> str:
    shown = _with_unit([f"{values[name] * SCALES[row.unit]:.{row.decimals}f}" for name in row.names], row.unit)
    over = any(
        limit is not None and (values[name] < limit if row.least else values[name] > limit)
        for name, limit in zip(row.names, row.limits, strict=True)
    )
    return f"{shown} (misses)" if over else shown


def _limit(row: Row) -> str:
    if None in row.limits:
        return "-"
    limits = [f"{round(limit * SCALES[row.unit], 6):g}" for limit in row.limits if limit is not None]
    return f"{'>=' if row.least else '<='} {_with_unit(limits, row.unit)}"


def _with_unit(numbers: list[str], unit: str) -> str:
    return " / ".join(numbers) + (f" {unit}" if unit else "")


def _write_whole(path: Path, text: str) -> None:
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(text)
    os.replace(temporary, path)


def main() -> int:
    _write_whole(README, readme_with(README.read_text(), read_entries()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
