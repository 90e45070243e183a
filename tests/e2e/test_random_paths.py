"""Random jobs given to the simulated arm: executed within every limit, or refused for the true reason before anything moves."""

import pytest

from experiments.random_paths import KINDS, START, attempt, random_case
from weldsim.dryrun.cell import Cell, empty_cell


@pytest.fixture(scope="module")
def cell() -> Cell:
    return empty_cell(START)


SLOW = ("anywhere", "low", "far")  # which are executed, as a rule
FEW = {kind: [seed for seed in range(1000, 1200) if random_case(seed).kind == kind][: 1 if kind in SLOW else 3] for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS)
def test_each_is_executed_within_limits_or_refused_for_the_true_reason(kind: str, cell: Cell) -> None:
    assert FEW[kind]
    for seed in FEW[kind]:
        outcome = attempt(random_case(seed), cell)
        assert not outcome.faults, (seed, outcome.reason, outcome.faults)
        assert outcome.done == outcome.moved
