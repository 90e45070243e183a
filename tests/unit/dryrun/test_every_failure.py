"""Every failure of a path is listed, wherever the first one is: each is where it was put, and nothing else is called one."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.curves import arc_length
from weldsim.dryrun.cell import Cell, empty_cell
from weldsim.dryrun.program import Program
from weldsim.dryrun.run import dry_run
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.verdict import Trial, dry_run_json, runs
from weldsim.dryrun.waypoints import try_waypoints
from weldsim.frames import Transform
from weldsim.kinematics import torch_pose
from weldsim.motion.collision import NEAR, CellCollision, Touch
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import make_rail
from weldsim.motion.rungs import places
from weldsim.records import TorchPath

CONFIG = MotionConfig(rolls=12, candidates=3)
DOWN = np.array([0.0, 0.0, -1.0])
STEP = 0.0007  # [m] between the poses of a line


class Walls(CellCollision):
    """A collision check by the torch's pose alone."""

    def __init__(self, model: Any, name_of: Callable[[Transform], str]) -> None:
        super().__init__(model)
        self.name_of = name_of

    def touch(self, q: np.ndarray) -> Touch | None:
        name = self.name_of(torch_pose(q))
        return Touch(first="torch", second=name, depth=0.001) if name else None

    def gap(self, q: np.ndarray) -> float:
        return NEAR


def walled(name_of: Callable[[Transform], str]) -> Cell:
    cell = empty_cell(START)
    return replace(cell, collision=Walls(cell.model, name_of))


def thin(*walls: tuple[float, float], low: float = 0.12) -> Callable[[Transform], str]:
    """Walls across the way from x to x [m], no higher than the lead-in begins."""

    def name_of(X_BT: Transform) -> str:
        x, y, z = X_BT.p
        return next((f"wall {k}" for k, (a, b) in enumerate(walls) if a < x < b and z < low and y < -0.4), "")

    return name_of


def line(length: float = 0.1) -> TorchPath:
    return torch_path(flat_curve("line", length, STEP) + np.array([0.0, -0.45, 0.1]), DOWN)


def between_places(path: TorchPath, x: float) -> tuple[float, float]:
    """A wall of 4 mm near x [m] that no place of the path's rungs lies in."""
    rail = make_rail(path, CONFIG)
    there = rail.at(places(rail)).p[:, 0]
    k = int(np.searchsorted(there, x))
    middle = (there[k - 1] + there[k]) / 2
    assert there[k] - there[k - 1] > 0.005
    return middle - 0.002, middle + 0.002


def stretches(trial: Trial) -> list[tuple[str, int, int]]:
    return [(a.why, a.index, b.index) for a, b in runs(trial.verdicts) if a.why not in ("ok", "not reached")]


def assert_covers(found: tuple[str, int, int], path: TorchPath, wall: tuple[float, float], within: float = 0.0028) -> None:
    """The poses of a stretch are those in the wall, to `within`: a look of the sweep (2 mm) and a pose."""
    assert found[0] == "collision"
    assert path.X_BT.p[found[1], 0] == pytest.approx(wall[0], abs=within)
    assert path.X_BT.p[found[2], 0] == pytest.approx(wall[1], abs=within)
    assert found[2] > found[1]


def test_two_walls_between_the_places_looked_at_are_two_stretches() -> None:
    path = line()
    walls = between_places(path, -0.02), between_places(path, 0.02)
    cell = walled(thin(*walls))
    followed, trial = try_waypoints(path, "seam", cell, CONFIG)
    found = stretches(trial)
    assert len(found) == 2
    for one, wall in zip(found, walls, strict=True):
        assert_covers(one, path, wall)
    assert trial.failure is not None
    assert trial.failure.index == found[0][1]
    assert trial.s_worst == pytest.approx(walls[0][0] + 0.05, abs=0.0021)
    assert [verdict.second for verdict in trial.verdicts if verdict.index in (found[0][1], found[1][2])] == ["wall 0", "wall 1"]
    # What comes after the first is not reached, unless it fails itself.
    assert {verdict.why for verdict in trial.verdicts[found[0][1] :]} == {"collision", "not reached"}
    assert all(verdict.ok for verdict in trial.verdicts[: found[0][1]])
    told = dry_run_json(dry_run(Program(source="t", kind="path", paths=(followed,), names=("seam",)), cell, CONFIG, fix=False))
    assert [one["bodies"][1] for one in told["trials"][0]["waypoints"] if one["verdict"] == "collision"] == ["wall 0", "wall 1"]


def test_the_borders_of_every_stretch_without_a_posture_are_true_to_a_millimetre() -> None:
    path = line()
    walls = ((-0.0413, -0.0207), (-0.0049, 0.0151), (0.0283, 0.0447))
    found = stretches(try_waypoints(path, "seam", walled(thin(*walls)), CONFIG)[1])
    assert len(found) == 3
    for one, wall in zip(found, walls, strict=True):
        assert_covers(one, path, wall, within=0.001 + STEP)


def test_a_wall_before_and_one_behind_poses_out_of_reach_are_told() -> None:
    """An arc that leads out of reach and back; the first failure is the wall before, and the place told is that wall's."""
    angle = np.linspace(np.pi - 0.5, 2 * np.pi + 0.5, 900)
    points = np.stack([0.2 * np.cos(angle), -0.95 + 0.2 * np.sin(angle), np.full(len(angle), 0.1)], axis=1)
    path = torch_path(points, DOWN)
    rail = make_rail(path, CONFIG)
    there = rail.at(places(rail)[places(rail) > 0.015]).p[:2, 1]  # the arc and its places are the same from both ends
    middle = there.mean()
    assert abs(there[0] - there[1]) > 0.005

    def name_of(X_BT: Transform) -> str:
        x, y, z = X_BT.p
        return ("left wall" if x < 0 else "right wall") if abs(y - middle) < 0.002 and z < 0.12 else ""

    trial = try_waypoints(path, "seam", walled(name_of), CONFIG)[1]
    found = stretches(trial)
    assert [found[0][0], found[-1][0]] == ["collision", "collision"]
    assert {why for why, _, _ in found[1:-1]} <= {"unreachable", "singular"}
    for _, first, last in (found[0], found[-1]):
        ends = sorted(points[[first, last], 1])
        assert ends == pytest.approx([middle - 0.002, middle + 0.002], abs=0.003)
    assert trial.verdicts[found[0][1]].second == "left wall"
    assert trial.verdicts[found[-1][1]].second == "right wall"
    far = [i for _, a, b in found[1:-1] for i in range(a, b + 1)]
    assert set(np.flatnonzero(points[:, 1] < -1.13)) <= set(far)
    assert trial.p_worst is not None
    assert trial.p_worst[0] < 0
    assert trial.p_worst[1] == pytest.approx(middle, abs=0.003)


def test_each_place_where_the_arm_would_have_to_look_the_other_way_is_told() -> None:
    """Three zones, in which the torch may look one way only: no sweep leads over either border."""

    def name_of(X_BT: Transform) -> str:
        towards, x = float(X_BT.R[0, 0]), float(X_BT.p[0])
        middle = abs(x) < 0.03
        return "middle wall" if middle and towards < 0.5 else "outer wall" if not middle and towards > -0.5 else ""

    path = line(0.15)
    # Straight above the zones it may look as it likes, else it would not get there.
    cell = walled(lambda X_BT: name_of(X_BT) if X_BT.p[2] < 0.12 and abs(X_BT.p[0]) < 0.08 else "")
    trial = try_waypoints(path, "seam", cell, CONFIG)[1]
    found = stretches(trial)
    assert [why for why, _, _ in found] == ["collision", "collision"]
    assert [path.X_BT.p[first, 0] for _, first, _ in found] == pytest.approx([-0.03, 0.03], abs=0.0021)


def test_walls_about_a_jump_are_told_with_it() -> None:
    path = line(0.12)
    jump = int(np.argmin(np.abs(path.X_BT.p[:, 0])))
    R = np.array(path.X_BT.R)
    R[jump:] = R[jump:] @ Transform.from_rotation_vector("TT", np.array([np.deg2rad(20), 0, 0]), np.zeros(3)).R
    jumping = replace(path, X_BT=Transform("BT", R, path.X_BT.p))
    walls = between_places(jumping, -0.03), between_places(jumping, 0.035)
    trial = try_waypoints(jumping, "seam", walled(thin(*walls)), CONFIG)[1]
    found = stretches(trial)
    assert [why for why, _, _ in found] == ["collision", "orientation jump", "collision"]
    assert found[1] == ("orientation jump", jump, jump)
    assert_covers(found[0], path, walls[0])
    assert_covers(found[2], path, walls[1])


def test_a_start_that_is_stale_hides_no_wall() -> None:
    path = line()
    wall = between_places(path, 0.02)
    there = torch_pose(START).p
    blocks = thin(wall)
    cell = walled(lambda X_BT: "post" if np.linalg.norm(X_BT.p - there) < 0.01 else blocks(X_BT))
    found = stretches(try_waypoints(path, "seam", cell, CONFIG)[1])
    assert found[0] == ("stale start", 0, 0)
    assert len(found) == 2
    assert_covers(found[1], path, wall)


def test_waypoints_that_scatter_hide_no_wall_and_their_scatter_is_no_failure() -> None:
    rng = np.random.default_rng(4)
    points = np.array(line(0.15).X_BT.p)[::3]
    points[:, 1:] += 1.5e-4 * rng.normal(size=(len(points), 2))
    path = replace(torch_path(points, DOWN), s=arc_length(points))
    order = [*range(20), 22, 21, 20, *range(23, len(points))]
    back = replace(path, X_BT=Transform("BT", path.X_BT.R[order], points[order]), s=arc_length(points[order]))
    wall = (0.045, 0.055)
    trial = try_waypoints(back, "seam", walled(thin(wall)), CONFIG)[1]
    found = stretches(trial)
    assert [why for why, _, _ in found] == ["turns back", "turns back", "collision"]
    assert_covers(found[2], back, wall, within=0.007)  # between places


@pytest.mark.parametrize("wall", [None, (0.01, 0.013)])
def test_the_first_failure_stays_what_it_was(wall: tuple[float, float] | None) -> None:
    path, cell = line(), walled(thin(*([] if wall is None else [wall])))
    alone, trial = try_path(path, "seam", cell, CONFIG), try_waypoints(path, "seam", cell, CONFIG)[1]
    assert trial.passed == (wall is None)
    assert (trial.failure, trial.s_worst) == (alone.failure, alone.s_worst)
    assert [one.why for one in trial.verdicts] == [one.why for one in alone.verdicts]
