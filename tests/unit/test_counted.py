"""Numbers with what they count: one of a thing is one thing, in every message and on every page."""

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

import weldsim
from weldsim.counted import counted

NOUNS = (
    "pose|seam|waypoint|view|point|place|column|value|clamp|gap|warning|seed|scene|candidate|facet|limit|entrie|number|name|plan"
)
SEVERAL = {  # what stands there is never one
    "camera_files.py": ("finite numbers",),  # four of a quaternion, nine of a matrix
    "raw.py": ("points (limit",),  # millions
    "visible.py": ("points",),  # of a cloud, which has a hundred
    "read.py": ("poses are in one place",),  # a path has two
    "files.py": ("poses are in one place",),
    "plan.py": ("seams: ", "camera poses"),  # one has a text of its own
    "shells.py": ("facets",),  # of a closed body, which has four
}


@pytest.mark.parametrize(
    ("count", "word", "text"),
    [
        (0, "pose", "0 poses"),
        (1, "pose", "1 pose"),
        (2, "pose", "2 poses"),
        (1, "torch path", "1 torch path"),
        (3, "torch path", "3 torch paths"),
        (1, "process", "1 process"),
        (2, "process", "2 processes"),
        (1, "entry", "1 entry"),
        (2, "entry", "2 entries"),
    ],
)
def test_one_is_singular(count: int, word: str, text: str) -> None:
    assert counted(count, word) == text


def test_no_count_is_put_before_a_plural_that_is_always_there() -> None:
    """A length before a fixed plural, `{len(x)} poses` say, is wrong where there is one: `counted` writes such text."""
    fixed = re.compile(rf"^ (?:[a-z]+ )?(?:{NOUNS})s\b|^ (?:{NOUNS})\(s\)")
    number = re.compile(r"^(len\(|int\(|n$|count$|total$|width$)")
    found = []
    for file in sorted(Path(weldsim.__path__[0]).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            parts = node.values if isinstance(node, ast.JoinedStr) else []
            for value, after in pairwise(parts):
                if not (isinstance(value, ast.FormattedValue) and isinstance(after, ast.Constant)):
                    continue
                text = str(after.value)
                excused = any(text.startswith(f" {words}") for words in SEVERAL.get(file.name, ()))
                if number.match(ast.unparse(value.value)) and fixed.match(text) and not excused:
                    found.append(f"{file.name}:{node.lineno}: {ast.unparse(node)}")
    assert not found, "\n".join(found)
