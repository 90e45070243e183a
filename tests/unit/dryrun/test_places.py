"""A part is never moved to where it cannot stand: not by --move, not by a fix, not on the map of places."""

import json
import re

import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.cli import main
from weldsim.dryrun.cell import empty_cell, scene_cell
from weldsim.dryrun.fix import moved_fix, passes
from weldsim.dryrun.reach import reach_json, reach_map
from weldsim.motion.config import MotionConfig
from weldsim.scene.config import FixtureConfig, SceneConfig
from weldsim.scene.workpieces.plate import PlateConfig

DOWN = np.array([0.0, 0.0, -1.0])
SMALL = SceneConfig(plate=PlateConfig(length=0.12, width=0.12), fixture=FixtureConfig(clamps=0))
ABOVE = torch_path(flat_curve("line", 0.03) + np.array([0.0, -0.45, 0.06]), DOWN)


@pytest.fixture
def job(tmp_path) -> str:
    file = tmp_path / "job.csv"
    X_BT = ABOVE.X_BT
    np.savetxt(file, np.concatenate([X_BT.p, X_BT.rotation_vector], axis=1), delimiter=",", header="torch", fmt="%.9f")
    return str(file)


@pytest.mark.parametrize(
    ("move", "reason"),
    [
        ("100 mm, 550 mm", "inside the arm's base"),
        ("0 mm, 300 mm", "inside the arm's base"),
        ("700 mm, 0 mm", "beyond the table's edge at x = 600 mm"),
        ("0 mm, -400 mm", "beyond the table's edge at y = -840 mm"),
    ],
)
def test_a_move_to_where_the_part_cannot_stand_is_refused_and_the_place_named_is_not(move, reason, job, capsys) -> None:
    assert main(["dry-run", job, "--scene", "straight", "--move", move]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert reason in said[0]
    instead = re.search(r'it can stand at "([^"]+)"', said[0])
    assert instead is not None
    assert main(["dry-run", job, "--scene", "straight", "--roll", "--no-fix", "--move", instead[1]]) in (0, 1)


def test_a_scene_whose_part_stands_in_the_base_is_refused(job, capsys) -> None:
    assert main(["dry-run", job, "--scene", "straight", "--set", 'scene.pose.y="50 mm"']) == 2
    assert "inside the arm's base" in capsys.readouterr().err


def test_a_seam_beside_the_table_is_told_where_nothing_is_known_to_hold_it(job, capsys) -> None:
    main(["dry-run", job, "--roll", "--no-fix", "--move", "0 mm, -420 mm"])
    assert "job goes 30 mm beyond the table's edge; what holds the part there is not known" in capsys.readouterr().out
    main(["dry-run", job, "--roll", "--no-fix"])
    assert "beyond the table's edge" not in capsys.readouterr().out


def test_a_part_that_hangs_in_the_air_is_told(job, capsys) -> None:
    hanging = ("--set", "scene.fixture.stand=false", "--set", 'scene.pose.clearance="10 mm"', "--set", "scene.fixture.clamps=0")
    main(["dry-run", job, "--scene", "straight", "--roll", "--no-fix", *hanging])
    assert "the part hangs in the air, 10 mm above the table" in capsys.readouterr().out


def test_the_map_tells_where_the_part_cannot_stand_from_where_it_cannot_be_welded() -> None:
    cell = scene_cell(SMALL)
    found = reach_map(ABOVE, cell, MotionConfig(), pitch=0.3)
    assert not (found.good & ~found.tried).any()
    assert found.good.any()
    for i, y in enumerate(found.y):
        for j, x in enumerate(found.x):
            near_base = max(abs(x), abs(y)) < 0.06 + 0.05
            over_edge = abs(x) > 0.60 - 0.055 or not -0.84 + 0.055 < y < 0.20 - 0.055
            assert not (found.tried[i, j] and (near_base or over_edge)), (x, y)
    assert found.tried[np.abs(found.y + 0.45).argmin(), np.abs(found.x).argmin()]
    document = json.loads(json.dumps(reach_json(found)))
    assert np.array(document["can_stand"]).sum() == found.tried.sum() < found.tried.size


def test_without_a_part_the_seam_stands_for_it() -> None:
    cell = empty_cell()
    points = ABOVE.X_BT.p
    assert cell.misplaced(np.zeros(3), points) is None
    assert cell.misplaced(np.array([0.0, 0.45, 0.0]), points) == "the seam lies over the arm's base"
    found = reach_map(ABOVE, cell, MotionConfig(), pitch=0.45)
    assert not found.tried[np.abs(found.y).argmin(), np.abs(found.x).argmin()]
    assert found.tried.sum() == found.tried.size - 1


def test_a_fix_is_no_place_where_the_part_cannot_stand() -> None:
    """The weld alone could be made there: the plate would stand in the base."""
    cell = scene_cell(SceneConfig(plate=PlateConfig(length=0.12, width=0.40), fixture=FixtureConfig(clamps=0)))
    move = np.array([0.0, 0.20, 0.0])
    assert passes(ABOVE, move, "seam", empty_cell(cell.q_start), MotionConfig())
    assert not passes(ABOVE, move, "seam", cell, MotionConfig())


def test_a_fix_after_a_move_is_told_from_where_the_scene_has_the_part() -> None:
    fix = moved_fix(np.array([0.03, -0.04, 0.0]), (0.05, -0.45), (0.05, 0.0))
    assert fix.how.startswith('--move "80.0 mm, -40.0 mm"; ')
    assert 'x = "80.0 mm", y = "-490.0 mm"' in fix.how
    moved = scene_cell(SMALL).moved(np.array([0.05, 0.0, 0.0]))
    assert (moved.place, moved.shift) == ((0.05, -0.45), (0.05, 0.0))
