"""Two lines that each lead through one junction: neither is lost for the stretch that they share."""

import pytest

from weldsim import pipeline
from weldsim.config import CellConfig, load_scene


@pytest.mark.parametrize("seed", [2, 5])
def test_a_line_through_a_junction_does_not_cost_the_branch_beside_it(seed: int) -> None:
    """In these, one coarse line leads from branch to branch, the other from the stem into one of them."""
    seen = pipeline.look(load_scene("y_branches", ["fixture.clamps=0"]), CellConfig(), seed=seed)
    assert len(pipeline.plan(seen.cloud).findings.seams) == 3
