"""CONVENTIONS.md and its tests name one another, one to one."""

import ast
import re
from pathlib import Path

FOLDER = Path(__file__).parent
PAGE = FOLDER.parents[1] / "CONVENTIONS.md"
NAMED_TEST = re.compile(r"`(test_\w+\.py::test_\w+)`$")


def lines() -> list[str]:
    return [line for line in PAGE.read_text().splitlines() if line.startswith(("-", "*", "|", " "))]


def existing_tests() -> set[str]:
    return {
        f"{file.name}::{node.name}"
        for file in FOLDER.glob("test_*.py")
        if file != Path(__file__)
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }


def test_every_line_names_a_test_that_exists():
    existing = existing_tests()
    assert len(lines()) > 30
    for line in lines():
        named = NAMED_TEST.search(line)
        assert named, f"names no test: {line}"
        assert named[1] in existing, f"names a test that is not there: {line}"


def test_every_test_is_named_by_exactly_one_line():
    named = [match[1] for line in lines() if (match := NAMED_TEST.search(line))]
    assert sorted(named) == sorted(existing_tests())
