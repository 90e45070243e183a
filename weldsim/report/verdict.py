"""The headline of a report: one word for the weld, and what decided it."""

from typing import Literal

from weldsim import units
from weldsim.counted import counted
from weldsim.records import Pace, WeldReport
from weldsim.report.limits import Check, ReportConfig, checks

Look = Literal["good", "amber", "bad", "plain"]
"""How a headline is coloured."""

PATH_FILE = "path file"  # the method of findings that a file told
PASSED, AMBER, FAILED, STOPPED, UNJUDGED = "PASSED", "PASSED WITH WARNINGS", "FAILED", "STOPPED", "NOT JUDGED"
LOOKS: dict[str, Look] = {PASSED: "good", AMBER: "amber", FAILED: "bad", STOPPED: "bad", UNJUDGED: "amber"}


def verdict(report: WeldReport, found: int, config: ReportConfig) -> tuple[str, str]:
    """A headline and what decided it: how a job ended that was judged, or else how many seams were found."""
    judged = sum(check.passed is not None for check in checks(report, config))
    part = f"{seams_welded(report)}; " if report.seams > 1 and (report.welded or report.stopped is not None) else ""
    if report.stopped is not None:
        return STOPPED, f"{part}{stopped_at(report)}"
    if not report.passed:
        first, *others = report.reasons
        return FAILED, part + first + (f" (and {len(others)} more)" if others else "")
    kept = "the one limit kept" if judged == 1 else f"all {judged} limits kept"
    if report.unjudged and report.plan is None:
        return UNJUDGED, f"no known seam to compare with; {found} found" + (f", {kept}" if judged else "")
    if not judged:
        return f"{found} SEAM{'' if found == 1 else 'S'} FOUND", "no known seam to compare with"
    if report.warnings:
        others = len(report.warnings) - (0 < report.welded < report.seams)
        return AMBER, part + kept + (f", {counted(others, 'warning')}" if others else "")
    return PASSED, part + kept


def found_by(report: WeldReport) -> str:
    """ "method profile", or that nothing was looked for."""
    return "seams from a path file" if report.method == PATH_FILE else f"method {report.method}"


def look(word: str) -> Look:
    """How a headline is coloured."""
    return LOOKS.get(word, "plain")


def seams_welded(report: WeldReport) -> str:
    """ "1 of 3 seams welded"."""
    lit = report.progress is None or report.progress.arc
    return f"{report.welded} of {report.seams} seams {'welded' if lit else 'travelled with the arc off'}"


def warnings(report: WeldReport, listed: tuple[Check, ...]) -> tuple[str, ...]:
    """What a welder has to know of a weld that failed nothing, a clause each."""
    out = []
    if 0 < report.welded < report.seams:
        out.append(seams_welded(report))
    out += [check.warning for check in listed if check.passed and check.amber]
    for each in (report, *report.others):
        name = f"seam {each.seam}: " if report.others else ""
        # The worst stretch stands beside its limit already.
        out += [f"{name}{uneven(pace)}" for pace in each.uneven if len(each.uneven) > 1]
    return tuple(out)


def uneven(pace: Pace) -> str:
    """A stretch that is off the asked speed, in words."""
    a, b = units.to_mm(pace.s_from), units.to_mm(pace.s_to)
    return f"torch speed {100 * pace.share:.0f} % of the one asked for at s = {a:.0f} to {b:.0f} mm"


def stopped_at(report: WeldReport) -> str:
    """Where a weld was stopped and how much of it is done, in words."""
    done = report.progress
    if done is None:
        return f"{report.stopped}"
    which = f"seam {report.others[-1].seam}, " if report.others else ""  # the one at which the job ended
    length, s = (units.to_mm(value) for value in (done.length, done.s_to))
    if done.welded <= 0:
        return f"{which}before the weld began: 0 of {length:.0f} mm {'welded' if done.arc else 'travelled'}"
    return f"{which}at s = {s:.1f} mm: {progress_text(report)}"


def stopped_place(report: WeldReport) -> tuple[float, float, float] | None:
    """Where on the seam the torch was stopped, in B [m]; None where it was not."""
    return None if report.stopped is None or report.progress is None else report.progress.position_B


def progress_text(report: WeldReport) -> str:
    """ "welded 69 of 251 mm"."""
    done = report.progress
    if done is None:
        return ""
    begun = f" from s = {units.to_mm(done.s_from):.0f} mm on" if done.s_from > 0 else ""
    word = "welded" if done.arc else "travelled with the arc off"
    return f"{word} {units.to_mm(done.welded):.0f} of {units.to_mm(done.length):.0f} mm{begun}"
