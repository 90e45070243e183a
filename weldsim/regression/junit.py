"""JUnit XML, as continuous-integration systems read it: a suite a scene, a case a method and seed.

Methods whose record is a distribution have one more suite, with a case for each: what their seeds together came to.
"""

from pathlib import Path
from xml.etree import ElementTree

from weldsim.errors import InputError
from weldsim.output import write_whole
from weldsim.regression.golden import Deviation
from weldsim.regression.job import Row
from weldsim.regression.suite import Regression
from weldsim.regression.text import number, sentence, shift_sentence


def junit_xml(outcome: Regression) -> str:
    """The document: `testsuites` > `testsuite` (a scene) > `testcase` (method and seed), failures in words.

    A case without golden figures is skipped, saying so. Times are those of scan and plan together [s].
    """
    together = sorted({method for _, method in outcome.judgement.judged})
    worse = {method: [shift_sentence(shift) for shift in outcome.shifts if shift.method == method] for method in together}
    counts = _counts(list(outcome.rows))
    counts["tests"] = str(len(outcome.rows) + len(together))
    counts["failures"] = str(int(counts["failures"]) + sum(map(bool, worse.values())))
    root = ElementTree.Element("testsuites", {"name": "weldsim regress", **counts})
    for scene in outcome.scenes:
        rows = [row for row in outcome.rows if row.figures.scene == scene]
        suite = ElementTree.SubElement(root, "testsuite", {"name": scene, **_counts(rows)})
        for row in rows:
            _case(suite, row)
    if together:
        counts = {"tests": str(len(together)), "failures": str(sum(map(bool, worse.values()))), "errors": "0", "skipped": "0"}
        suite = ElementTree.SubElement(root, "testsuite", {"name": "all seeds together", **counts, "time": "0.000"})
        for method, said in worse.items():
            case = ElementTree.SubElement(suite, "testcase", classname=f"together.{method}", name="all seeds", time="0.000")
            if said:
                message = said[0] + (f" (and {len(said) - 1} more)" if len(said) > 1 else "")
                failure = ElementTree.SubElement(case, "failure", message=_clean(message), type="WorseThanGolden")
                failure.text = _clean("\n".join(said))
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def write_junit(path: Path | str, outcome: Regression) -> Path:
    """The file written. Raises OutputError, InputError for anything but a file name and what `weldsim.regress` returned."""
    if not isinstance(path, str | Path) or not isinstance(outcome, Regression):
        kinds = ", ".join(type(each).__name__ for each in (path, outcome))
        raise InputError(f"write_junit: a file name and what weldsim.regress returned, in this order, are wanted, not {kinds}")
    return write_whole(path, junit_xml(outcome))


def _case(suite: ElementTree.Element, row: Row) -> None:
    figures = row.figures
    case = ElementTree.SubElement(
        suite, "testcase", classname=f"{figures.scene}.{figures.method}", name=f"seed {figures.seed}", time=f"{_seconds(row):.3f}"
    )
    if row.deviations:
        first, *others = row.deviations
        message = sentence(first) + (f" (and {len(others)} more)" if others else "")
        failure = ElementTree.SubElement(case, "failure", message=_clean(message), type="WorseThanGolden")
        failure.text = _clean("\n".join(_lines(row.deviations, row.folder)))
    elif row.fault:
        ElementTree.SubElement(case, "failure", message=_clean(row.fault), type="FinderFailed")
    elif not row.judged:
        ElementTree.SubElement(case, "skipped", message="no golden figures; record them with --update --reason")
    out = ElementTree.SubElement(case, "system-out")
    said = [f"{name} {number(name, value)}" for name, value in figures.judged().items()]
    out.text = _clean("\n".join([*said, *([f"refused: {figures.refused}"] if figures.refused else [])]))


def _lines(deviations: tuple[Deviation, ...], folder: str | None) -> list[str]:
    return [*map(sentence, deviations), *([f"run directory: {folder}"] if folder else [])]


def _counts(rows: list[Row]) -> dict[str, str]:
    return {
        "tests": str(len(rows)),
        "failures": str(sum(not row.passed for row in rows)),
        "errors": "0",
        "skipped": str(sum(row.passed and not row.judged for row in rows)),
        "time": f"{sum(_seconds(row) for row in rows):.3f}",
    }


def _seconds(row: Row) -> float:
    return row.scan_seconds + (row.figures.seconds or 0.0)


def _clean(text: str) -> str:
    """The text without characters that XML 1.0 does not allow."""
    return "".join(c for c in text if c in "\t\n\r" or "\x20" <= c <= "\ud7ff" or "\ue000" <= c <= "\ufffd" or c >= "\U00010000")
