"""scripts/mutants.py: the modules and tests that it names exist, and it knows faults that nobody need notice."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def mutants() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mutants", ROOT / "scripts" / "mutants.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_modules_and_tests_of_every_group_exist(mutants: ModuleType) -> None:
    for modules, tests in mutants.GROUPS.values():
        assert all(list((ROOT / "weldsim").glob(f"{module}.py")) for module in modules)
        assert all((ROOT / "tests" / test).exists() for test in tests)
    assert all((ROOT / name).exists() for name in mutants.COPIED)
    assert "[tool.mutmut]" in mutants.configuration("gate")


@pytest.mark.parametrize(
    ("was", "becomes", "prose"),
    [
        ('raise Error(f"{n} poses; two are needed")', 'raise Error(f"XX{n} poses; two are neededXX")', True),
        ('raise Error("No such file")', 'raise Error("no such file")', True),
        ('out["length"] = 1', 'out["LENGTH"] = 1', False),
        ('out["length"] = "in m"', 'out["XXlengthXX"] = "in m"', False),
        ("a = b + 1", "a = b - 1", False),
        ('raise Error("too long", a < b)', 'raise Error("too long", a <= b)', False),
    ],
)
def test_faults_in_words_alone_are_told_from_others(mutants: ModuleType, was: str, becomes: str, prose: bool) -> None:
    assert mutants.Mutant("m", "f", was, becomes).prose is prose


@pytest.mark.parametrize(
    ("was", "becomes", "harmless"),
    [
        ('np.einsum("ij,ij->i", a, b)', 'np.einsum("IJ,IJ->I", a, b)', True),
        ('np.einsum("ij,ij->i", a, b)', 'np.einsum("ij,ij->i", b, b)', False),
        ("zip(a, b, strict=True)", "zip(a, b, strict=False)", True),
        ("zip(a, b, strict=True)", "zip(a, b, )", True),
        ("zip(a, b, strict=True)", "zip(a, None, strict=True)", False),
        ('f(float("nan"), "a")', 'f(float("NAN"), "a")', True),
        ("json.dumps(a, allow_nan=False, indent=2)", "json.dumps(a, allow_nan=None, indent=2)", True),
        ("json.dumps(a, allow_nan=False, indent=2)", "json.dumps(a, allow_nan=True, indent=2)", False),
        ('f(float("nan"), "a")', 'f(float("nan"), "A")', False),
    ],
)
def test_faults_that_change_nothing_have_a_reason(mutants: ModuleType, was: str, becomes: str, harmless: bool) -> None:
    assert (mutants.reason(mutants.Mutant("m", "f", was, becomes), []) is not None) is harmless


def test_a_survivor_is_explained_by_its_own_lines_alone(mutants: ModuleType) -> None:
    known = {"function": "f", "was": "a < b", "becomes": "a <= b", "reason": "never equal"}
    assert mutants.reason(mutants.Mutant("m", "f", "a < b", "a <= b"), [known]) == "never equal"
    assert mutants.reason(mutants.Mutant("m", "g", "a < b", "a <= b"), [known]) is None
    assert mutants.reason(mutants.Mutant("m", "f", "a < b", "a > b"), [known]) is None
