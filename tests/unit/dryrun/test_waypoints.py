"""Waypoints of other programs: noisy or coarse ones are followed as they allow, and all that is wrong with a path is told."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.torch_paths import START, torch_path
from weldsim.cli import main
from weldsim.curves import arc_length, project
from weldsim.dryrun.cell import Cell, empty_cell
from weldsim.dryrun.path_faults import turns_back
from weldsim.dryrun.read import read_program
from weldsim.dryrun.run import dry_run
from weldsim.dryrun.scatter import is_even, nearest_in_order, refit, scatter_of
from weldsim.dryrun.verdict import Trial
from weldsim.dryrun.waypoints import try_waypoints
from weldsim.frames import Transform
from weldsim.motion.config import MotionConfig
from weldsim.records import TorchPath

CONFIG = MotionConfig()
DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def empty() -> Cell:
    return empty_cell(START)


def waypoints(n: int = 40, length: float = 0.3, bend: float = 0.05, seed: int = 0, position=0.0, rotation=0.0) -> TorchPath:
    """A gentle arc over the table, its waypoints scattered by standard deviations [m], [rad] of each axis."""
    rng = np.random.default_rng(seed)
    u = np.linspace(-0.5, 0.5, n)
    points = np.stack([u * length, -0.45 + bend * 4 * u**2, np.full(n, 0.1)], axis=1)
    exact = torch_path(points, DOWN)
    turns = Transform.from_rotation_vector("TT", rotation * rng.normal(size=(n, 3)), np.zeros((n, 3)))
    p = points + position * rng.normal(size=(n, 3))
    return replace(exact, X_BT=Transform("BT", exact.X_BT.R @ turns.R, p), s=arc_length(p), roll_free=False)


def kinds(trial: Trial) -> dict[int, str]:
    return {verdict.index: verdict.why for verdict in trial.verdicts if verdict.why not in ("ok", "not reached")}


@pytest.mark.parametrize(("position", "rotation"), [(1e-4, 2e-3), (5e-4, 1e-2), (1e-4, 2e-2)])
def test_scatter_is_told_as_it_is(position, rotation) -> None:
    found = [scatter_of(waypoints(60, seed=seed, position=position, rotation=rotation)) for seed in range(20)]
    assert np.median([one.position for one in found]) == pytest.approx(position, rel=0.2)
    assert np.median([one.rotation for one in found]) == pytest.approx(rotation, rel=0.2)
    assert all(0.6 * position < one.position < 1.6 * position for one in found)


def test_waypoints_recorded_while_the_arm_stood_still_are_one_place() -> None:
    """Three readings of each waypoint, microns apart: their scatter about the path is that of the waypoints read once."""
    path = waypoints(60, seed=4, position=2e-4, rotation=5e-3)
    index = np.repeat(np.arange(60), 3)
    p = path.X_BT.p[index] + np.random.default_rng(1).normal(0, 2e-6, (180, 3))
    still = replace(
        path,
        X_BT=Transform("BT", path.X_BT.R[index], p),
        s=arc_length(p),
        speed=path.speed[index],
        arc_on=path.arc_on[index],
        segments=tuple(path.segments[i] for i in index),
    )
    once, thrice = scatter_of(path), scatter_of(still)
    assert thrice.position == pytest.approx(once.position, rel=0.05)
    assert thrice.rotation == pytest.approx(once.rotation, rel=0.05)
    assert refit(still, thrice).position_off == pytest.approx(refit(path, once).position_off, rel=0.1)


def test_exact_waypoints_have_no_scatter_and_a_jump_is_none() -> None:
    path = waypoints()
    assert scatter_of(path).position < 2e-5
    p = np.array(path.X_BT.p)
    p[20:, 1] += 0.003
    assert scatter_of(replace(path, X_BT=Transform("BT", path.X_BT.R, p), s=arc_length(p))).position < 2e-5


def test_a_curve_leaves_the_waypoints_by_their_scatter_and_comes_nearer_to_the_truth() -> None:
    ratios = []
    for seed in range(10):
        path, truth = waypoints(60, seed=seed, position=5e-4, rotation=1e-2), waypoints(600).X_BT.p
        fitted = refit(path, scatter_of(path))
        at = fitted.path.X_BT.p[fitted.nearest]
        off = at - path.X_BT.p
        assert np.sqrt(np.mean(off[:, 1:] ** 2)) == pytest.approx(5e-4, rel=0.4)
        before, after = (np.sqrt(np.mean(project(p, truth)[0] ** 2)) for p in (path.X_BT.p, fitted.path.X_BT.p))
        ratios.append(after / before)
        assert fitted.position_off >= np.linalg.norm(off, axis=1).max() - 6e-4
    assert np.mean(ratios) < 0.75
    assert max(ratios) < 0.95


@pytest.mark.parametrize("count", [200, 1000, 5000])
@pytest.mark.parametrize("scatter", [3e-4, 1e-3])
def test_waypoints_closer_than_they_scatter_do_not_lead_the_curve_forth_and_back(count, scatter) -> None:
    path, truth = waypoints(count, seed=5, position=scatter), waypoints(600)
    found = scatter_of(path)
    assert found.position == pytest.approx(scatter, rel=0.2)
    fitted = refit(path, found)
    assert fitted.path.s[-1] == pytest.approx(truth.s[-1], rel=0.02)
    off = project(fitted.path.X_BT.p, truth.X_BT.p)[0]
    assert np.sqrt(np.mean(off**2)) < 0.9 * scatter  # of each axis; the waypoints lie 1.4 times that off
    travel = np.diff(fitted.path.X_BT.p[:, 0])
    assert travel.min() > 0


@pytest.mark.parametrize("values", [np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.5, 0.5, 2.0])])
def test_the_nearest_of_rising_values_is_that_of_all(values) -> None:
    at = np.linspace(-0.3, 3.4, 38)
    found = nearest_in_order(values, at)
    assert np.abs(values[found] - at) == pytest.approx(np.abs(values[:, None] - at).min(axis=0))


def test_noisy_waypoints_that_the_arm_can_weld_pass_and_the_scatter_is_told(empty: Cell) -> None:
    """At the speed at which they are followed as they are, nothing is fitted; at a higher one the motion is a smooth curve."""
    slow = waypoints(40, seed=3, position=1.5e-4, rotation=1.5e-2)
    followed, trial = try_waypoints(slow, "noisy", empty, CONFIG)
    assert followed is slow
    assert trial.slowest > 0.99
    assert trial.notes == ()
    path = replace(slow, speed=np.full(40, 0.02))
    followed, trial = try_waypoints(path, "noisy", empty, CONFIG)
    assert trial.passed, trial.failure
    assert [verdict.index for verdict in trial.verdicts] == list(range(40))
    told = re.search(r"scatter by ([\d.]+) mm and ([\d.]+) deg .* leaves them by up to ([\d.]+) mm", trial.notes[0])
    assert told is not None
    assert float(told[1]) == pytest.approx(0.15, rel=0.5)
    assert float(told[2]) == pytest.approx(0.86, rel=0.5)
    assert "would fail at pose" in trial.notes[1]
    nearest = np.linalg.norm(followed.X_BT.p[:, None] - path.X_BT.p[None], axis=2).min(axis=0)
    assert nearest.max() < 1e-3 * float(told[3]) + 1e-3
    assert trial.slowest > 0.99


def test_coarse_waypoints_are_joined_by_a_curve(empty: Cell) -> None:
    angle = np.linspace(0, 2.2, 16)
    points = np.stack([0.04 * np.sin(angle), -0.45 + 0.04 * np.cos(angle), np.full(16, 0.1)], axis=1)
    path = torch_path(points, DOWN, speed=0.05)
    _, trial = try_waypoints(path, "coarse", empty, CONFIG)
    assert trial.passed, trial.failure
    if trial.notes and "apart" in trial.notes[0]:
        off = float(re.findall(r"up to ([\d.]+) mm off", trial.notes[0])[0])
        assert off == pytest.approx(1e3 * 0.04 * (1 - np.cos(angle[1] / 2)), rel=0.3)


def test_what_no_curve_within_the_scatter_mends_is_told(empty: Cell) -> None:
    path = waypoints(40, seed=1, position=1e-4, rotation=3e-3)
    R = np.array(path.X_BT.R)
    R[25:] = R[25:] @ Transform.from_rotation_vector("TT", np.array([0, 0, np.deg2rad(60)]), np.zeros(3)).R
    jumped = replace(path, X_BT=Transform("BT", R, path.X_BT.p))
    _, trial = try_waypoints(jumped, "jump", empty, CONFIG)
    assert kinds(trial) == {25: "orientation jump"}
    assert any("scatter by" in note for note in trial.notes)


def test_every_jump_is_told_and_every_pose_out_of_reach_between_them(empty: Cell) -> None:
    path = waypoints(120, length=0.24, bend=0.0)
    R, p = np.array(path.X_BT.R), np.array(path.X_BT.p)
    lean = Transform.from_rotation_vector("TT", np.array([np.deg2rad(20), 0, 0]), np.zeros(3)).R
    R[20:] = R[20:] @ lean
    R[90:] = R[90:] @ lean.T
    p[30:75, 1] -= 1.0 * np.sin(np.linspace(0, np.pi, 45)) ** 0.5
    _, trial = try_waypoints(replace(path, X_BT=Transform("BT", R, p), s=arc_length(p)), "jumps", empty, CONFIG)
    found = kinds(trial)
    assert found[20] == "orientation jump"
    assert found[90] == "orientation jump"
    assert sum(why in ("unreachable", "collision", "singular") for why in found.values()) > 20
    assert all(verdict.why != "ok" for verdict in trial.verdicts[21:])


def shuffled(path: TorchPath, order: list[int]) -> TorchPath:
    p = path.X_BT.p[order]
    return replace(path, X_BT=Transform("BT", path.X_BT.R[order], p), s=arc_length(p))


@pytest.mark.parametrize("scatter", [0.0, 1e-4])
def test_travel_that_turns_back_is_called_that_each_time(empty: Cell, scatter) -> None:
    path = waypoints(30, position=scatter, rotation=scatter)
    order = [*range(8), 10, 9, 8, *range(11, 20), 22, 21, 20, *range(23, 30)]
    result = try_waypoints(shuffled(path, order), "back", empty, CONFIG)[1]
    assert kinds(result) == dict.fromkeys((8, 10, 20, 22), "turns back")
    assert result.failure is not None
    assert "put the waypoints in the order of travel" in result.failure.text
    # The advice, followed.
    assert not turns_back(path)
    assert try_waypoints(shuffled(path, list(range(30))), "in order", empty, CONFIG)[1].passed


@pytest.mark.parametrize("legs", [1, 2, 3, 8])
@pytest.mark.parametrize("wide", [5e-4, 3e-3])
def test_a_weave_is_no_scatter_and_is_not_flattened(empty: Cell, legs, wide) -> None:
    """Waypoints at its corners, or some on each leg."""
    u = np.arange(80 * legs + 1) / legs
    across = wide * (2 * np.abs((u + (0.5 if legs > 1 else 0.0)) % 2 - 1) - 1)
    points = np.stack([0.002 * u - 0.08, -0.45 + across, np.full(len(u), 0.1)], axis=1)
    straight = torch_path(points * [1.0, 0.0, 1.0] + [0.0, -0.45, 0.0], DOWN, speed=0.002)
    weave = replace(straight, X_BT=Transform("BT", straight.X_BT.R, points), s=arc_length(points), roll_free=False)
    assert scatter_of(weave).position < 0.15 * wide
    assert not is_even(weave)
    if legs == 1:
        followed, _ = try_waypoints(weave, "weave", empty, CONFIG)
        assert project(points, followed.X_BT.p)[0].max() < 0.1 * wide


@pytest.mark.parametrize(("count", "legs"), [(8, 1), (12, 1), (12, 2), (16, 3), (20, 2), (27, 3), (30, 1), (45, 4)])
def test_a_weave_of_few_waypoints_is_no_scatter(count, legs) -> None:
    u = np.arange(count) / legs
    across = 0.0025 * (2 * np.abs((u + (0.5 if legs > 1 else 0.0)) % 2 - 1) - 1)
    points = np.stack([0.004 * u - 0.08, -0.45 + across, np.full(count, 0.1)], axis=1).round(4)
    straight = torch_path(points, DOWN, speed=0.002)
    assert scatter_of(straight).position == 0.0


@pytest.mark.parametrize("count", [8, 12, 16, 23, 30, 36, 45, 60, 90, 120])
@pytest.mark.parametrize("flat", [False, True])
def test_scatter_of_few_waypoints_is_no_weave(count, flat) -> None:
    """White noise comes again, or has one frequency, in less than one path of ten."""
    rng, found = np.random.default_rng(count), []
    for _ in range(60):
        points = np.stack([0.004 * np.arange(count), *rng.normal(0, 3e-4, (2, count)) * [[1], [0 if flat else 1]]], axis=1)
        found.append(scatter_of(torch_path(points, DOWN, speed=0.002)).position > 0)
    assert np.mean(found) > 0.9


@pytest.mark.parametrize("count", [200, 1000, 5000])
@pytest.mark.parametrize("scatter", [0.0, 2e-5, 1e-4, 3e-4, 1e-3])
def test_travel_back_among_waypoints_that_scatter_is_called_that_and_scatter_alone_is_not(count, scatter) -> None:
    """38 mm back over itself, found where it is to the length that tells the direction of travel."""
    rng, middle, back = np.random.default_rng(count), count // 2, count // 8
    order = [*range(middle), *range(middle, middle - back, -1), *range(middle - back, count)]
    exact = waypoints(count)
    points, step = exact.X_BT.p, float(exact.s[1])

    def scattered(order: list[int]) -> TorchPath:
        p = points[order] + scatter * rng.normal(size=(len(order), 3))
        return replace(
            exact,
            X_BT=Transform("BT", exact.X_BT.R[order], p),
            s=arc_length(p),
            speed=exact.speed[order],
            arc_on=exact.arc_on[order],
            segments=tuple(exact.segments[i] for i in order),
        )

    path = scattered(order)
    found = turns_back(path)
    assert len(found) == 2
    for fault, place in zip(found, (middle, middle - back), strict=True):
        assert np.linalg.norm(path.X_BT.p[fault.index] - points[place]) < 14 * scatter + step
    assert turns_back(scattered([*range(count)])) == []


@pytest.mark.parametrize("angle", [60, 120, 160])
def test_a_corner_and_a_weave_do_not_turn_back(angle) -> None:
    turn = np.deg2rad(angle)
    corner = np.array([[0.0, 0, 0], [0.05, 0, 0], [0.05 + 0.05 * np.cos(turn), 0.05 * np.sin(turn), 0]])
    u = np.linspace(0, 1, 61)
    weave = np.stack([0.03 * u, 0.003 * (np.arange(61) % 2), 0 * u], axis=1)
    for points in (corner, weave):
        assert not turns_back(torch_path(points + np.array([0, -0.45, 0.1]), DOWN))


def test_every_failing_motion_of_a_program_is_told(empty: Cell, tmp_path) -> None:
    file = tmp_path / "job.script"
    home = "[-1.57, -1.3, -1.9, -1.5, 1.57, 0]"
    lines = [f"movej({home})", "movej([-1.57, 0.3, 0, -1.5, 1.57, 0])", f"movej({home})", f"movej({home}, v=1)"]
    lines += ["movel(p[0.0, -1.5, 0.3, 3.1, 0, 0])", "movel(p[0.0, -0.45, 0.3, 3.1, 0, 0])", f"movej({home})"]
    lines += ["movej([-1.57, -1.3, -1.9, -1.5, 1.57, 6.5])", f"movej({home})"]
    file.write_text("\n".join(lines))
    trial = dry_run(read_program(file), empty, fix=False).trials[0]
    found = kinds(trial)
    assert {k: found.get(k) for k in (1, 4, 7)} == {1: "collision", 4: "unreachable", 7: "joint limit"}
    assert trial.verdicts[3].why == "not reached"
    assert trial.cycle == 0.0


def test_paths_that_others_planned(real_data, empty: Cell) -> None:
    """One is weldable, its waypoints noisy; one has its waypoints in no order."""
    folder = real_data / "welding_robot_paths"
    good = dry_run(read_program(folder / "straight.csv"), empty_cell(), CONFIG, fix=False).trials[0]
    assert good.passed
    assert good.slowest > 0.99
    assert good.notes == ()  # their noise asks for less than the joints can do
    quick = dry_run(read_program(folder / "straight.csv", speed=0.05), empty_cell(), CONFIG, fix=False).trials[0]
    assert quick.passed
    assert quick.slowest > 0.99
    assert "scatter by 0.13 mm" in quick.notes[0]
    bad = dry_run(read_program(folder / "reversal.csv"), empty_cell(), CONFIG, fix=False).trials[0]
    assert set(kinds(bad).values()) == {"turns back"}


def test_the_table_names_every_failure_once(tmp_path, capsys) -> None:
    path = waypoints(30)
    order = [*range(8), 10, 9, 8, *range(11, 20), 22, 21, 20, *range(23, 30)]
    X = shuffled(path, order).X_BT
    file = tmp_path / "back.csv"
    np.savetxt(file, np.column_stack([X.p, X.rotation_vector]), delimiter=",")
    assert main(["dry-run", str(file), "--tool", "torch", "--no-fix"]) == 1
    out = capsys.readouterr().out
    assert out.count("travel turns back by") == 4
    assert out.count("not reached") == 1


@pytest.mark.parametrize("welding", [("movep", False), ("movel", True), ("movel", False)])
def test_a_program_that_welds_back_over_itself_is_told(empty: Cell, tmp_path, welding) -> None:
    command, arc = welding
    rows = [f"  {command}(p[{x}, -0.45, 0.2, 0.0, 3.14, 0.0], a=0.5, v=0.02)" for x in (0.0, 0.05, 0.02, 0.06)]
    lines = ["def job():", "  movej([-1.57, -1.3, -1.9, -1.5, 1.57, 0])", f"  set_digital_out(1, {arc})", *rows, "end"]
    file = tmp_path / "job.script"
    file.write_text("\n".join(lines))
    notes = dry_run(read_program(file), empty, fix=False).trials[0].notes
    told = [f"line {line} {command}: travel turns back by 180 deg" for line in (6, 7)]
    assert notes == (() if welding == ("movel", False) else tuple(told))
