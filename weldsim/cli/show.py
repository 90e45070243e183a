"""What people see: aligned tables, and progress on stderr when a command takes over a second."""

import json
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from weldsim import units
from weldsim.rounded import DECIMALS, rounded

if TYPE_CHECKING:
    from weldsim.records import SeamFindings
    from weldsim.report.limits import Check
    from weldsim.seam.config import ProfileConfig

TOLD_REASONS = 3
PATIENCE = 1.0  # [s] before progress is shown

Tell = Callable[[str, float | None], None]


def table(rows: Sequence[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Rows as text with columns aligned to the left, two spaces apart, indented by two."""
    lines = [list(head), *map(list, rows)] if head else list(map(list, rows))
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))] if lines else []
    return "\n".join(
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
    )


def check_rows(checks: "Iterable[Check]") -> list[list[str]]:
    """Lines of a table of figures beside their limits."""
    marks = {True: "ok", False: "FAIL", None: ""}
    return [[c.figure, c.value, c.limit, "amber" if c.passed and c.amber else marks[c.passed]] for c in checks]


def reasons_refused(findings: "SeamFindings", config: "ProfileConfig") -> str:
    """Why the longest candidates were refused, in one clause each.

    Args:
        config: with which they were looked for.
    """
    refused = sorted(findings.rejected, key=lambda rejection: -rejection.length)
    if not refused:
        length, depth = (f"{units.to_mm(value):g} mm" for value in (config.min_length, config.min_depth))
        return f"no groove shows that is {length} long (seam.profile.min_length) and {depth} deep (seam.profile.min_depth)"
    told = "; ".join(f"{units.to_mm(one.length):.0f} mm long: {one.reason}" for one in refused[:TOLD_REASONS])
    more = len(refused) - TOLD_REASONS
    return f"refused {told}" + (f"; and {more} more" if more > 0 else "")


def times(seconds: dict[str, float]) -> str:
    """Seconds a stage in one line, with their sum."""
    stages = ", ".join(f"{stage} {value:.2f}" for stage, value in seconds.items())
    return f"  seconds: {stages}; {sum(seconds.values()):.2f} in all"


def print_json(content: dict[str, Any], decimals: int = DECIMALS) -> None:
    """One object on stdout, floats rounded."""
    print(json.dumps(rounded(content, decimals), indent=2, ensure_ascii=False, allow_nan=False))


def print_written(written: Sequence[Path], kept: Path | None = None) -> None:
    """A line for each file or folder that was written, the run directory first, and for the earlier run that stood there."""
    for path in written:
        print(f"  wrote {path}")
    if kept is not None:
        print(f"  the run that was in {written[0]} is now {kept}")


def written_json(written: Sequence[Path], kept: Path | None) -> dict[str, Any]:
    """The same as JSON values."""
    return {"written": [str(path) for path in written], "kept": None if kept is None else str(kept)}


@contextmanager
def progress() -> Iterator[Tell]:
    """A function to be told stage and fraction done; shown on a terminal once PATIENCE has passed, never elsewhere."""
    if not sys.stderr.isatty():
        yield lambda stage, done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        TextColumn("{task.description:<10}"), BarColumn(), TimeElapsedColumn(), console=Console(stderr=True), transient=True
    )
    task = bar.add_task("starting", total=None)

    def tell(stage: str, done: float | None) -> None:
        bar.update(task, description=stage, total=None if done is None else 1.0, completed=done or 0.0)

    timer = threading.Timer(PATIENCE, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield tell
    finally:
        timer.cancel()
        timer.join()
        bar.stop()
