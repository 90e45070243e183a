"""Junctions in the twin: no branch is lost there, and none bends into another."""

import pytest

from weldsim import pipeline
from weldsim.config import CellConfig, load_scene
from weldsim.report.metrics import known_offsets, match_seams


@pytest.mark.parametrize("seed", [2, 5])
def test_a_line_through_a_junction_does_not_cost_the_branch_beside_it(seed: int) -> None:
    """In these, one coarse line leads from branch to branch, the other from the stem into one of them."""
    seen = pipeline.look(load_scene("y_branches", ["fixture.clamps=0"]), CellConfig(), seed=seed)
    assert len(pipeline.plan(seen.cloud).findings.seams) == 3


@pytest.mark.parametrize("seed", [3, 9])
def test_a_branch_that_was_seen_to_bend_into_another_ends_where_they_meet(seed: int) -> None:
    """In these the stem runs on into a branch for 10 mm, and was 2 to 4 mm off there."""
    seen = pipeline.look(load_scene("y_branches", ["fixture.clamps=0"]), CellConfig(), seed=seed)
    seams, known = pipeline.plan(seen.cloud).findings.seams, seen.world.known_seams
    pairs = match_seams(seams, known).pairs
    assert len(pairs) == 3
    for i, j in pairs:
        assert known_offsets(seams[i].points_B, known[j], "opening").distance.max() < 0.002
