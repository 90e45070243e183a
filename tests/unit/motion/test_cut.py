"""Welds that no single sweep of the arm covers: cut into pieces, welded one after the other, or refused with the reason."""

from dataclasses import replace

import numpy as np
import pytest

from tests.torch_paths import START, torch_path
from weldsim.curves import project
from weldsim.dryrun.cell import Cell, empty_cell
from weldsim.errors import MotionError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import JOINT_LIMIT, torch_pose
from weldsim.motion.config import MotionConfig
from weldsim.motion.cut import cut_path
from weldsim.motion.plan import plan_motion
from weldsim.records import Segment, TorchPath


def spun(seed: int, turns: float | None = None) -> TorchPath:
    """A straight weld with a torch that may not turn about its wire as it likes: it turns evenly by up to one turn, or `turns`."""
    rng = np.random.default_rng(seed)
    length, middle = rng.uniform(0.3, 0.9), np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.6, -0.2), rng.uniform(0.1, 0.5)])
    heading, _, tilt, lean = rng.uniform(0, 2 * np.pi), rng.random(), rng.uniform(0, 1.5), rng.uniform(0, 2 * np.pi)
    u = np.linspace(-0.5, 0.5, 400)
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    wire = np.array([np.sin(tilt) * np.cos(lean), np.sin(tilt) * np.sin(lean), -np.cos(tilt)])
    spin = rng.uniform(-1, 1) * np.pi if turns is None else np.pi * turns
    angle = 2 * spin * u + rng.uniform(-3, 3)
    path = torch_path(middle + length * u[:, None] * along, wire, speed=0.01, roll_free=False)
    R = np.stack([path.X_BT.R[i] @ matrix_from_rotation_vector(np.array([0.0, 0.0, a])) for i, a in enumerate(angle)])
    return replace(path, X_BT=Transform("BT", R, path.X_BT.p))


@pytest.fixture(scope="module")
def cell() -> Cell:
    return empty_cell(START)


@pytest.mark.parametrize("seed", [7, 32, 36, 86])
def test_a_weld_without_a_sweep_is_welded_in_pieces(seed: int, cell: Cell) -> None:
    path, config = spun(seed), MotionConfig()
    plan = plan_motion(path, START, config, blocked=cell.collision)
    trajectory = plan.trajectory
    assert plan.cuts
    assert "cut into" in plan.notes[0]
    weld = np.array([segment == Segment.WELD for segment in trajectory.segments])
    tip = torch_pose(trajectory.q)
    # All of it is welded, and nothing else, with the torch turned as it was asked to be.
    assert project(tip.p[weld], path.X_BT.p)[0].max() < 0.05e-3
    assert project(path.X_BT.p, tip.p[weld])[0].max() < 0.05e-3
    asked = plan.rail.at(trajectory.s[weld])
    cosine = (np.einsum("nij,nij->n", asked.R, tip.R[weld]) - 1) / 2
    assert cosine.min() > np.cos(np.deg2rad(0.5))
    assert (trajectory.arc_on == weld).all()
    # The arc goes out at each cut with the arm at rest, and no joint jumps between.
    ends = np.flatnonzero(np.diff(weld.astype(int)) != 0)
    assert len(ends) == 2 * (len(plan.cuts) + 1)
    assert np.abs(trajectory.qd[ends]).max() < 0.02
    assert np.abs(np.diff(trajectory.q, axis=0)).max() <= config.joint_speed_limit * config.period
    assert np.abs(trajectory.q).max() <= JOINT_LIMIT - config.limit_margin + 1e-9
    assert np.allclose(trajectory.q[[0, -1]], START)


def test_it_is_not_cut_against_the_users_wish(cell: Cell) -> None:
    with pytest.raises(MotionError, match=r"in 2 pieces, cut at s = \d+ mm \(motion.pieces = 2\)") as caught:
        plan_motion(spun(32), START, MotionConfig(pieces=1), blocked=cell.collision)
    assert caught.value.data["why"] == "collision"  # of the arm with itself: without bodies there is a sweep
    assert not plan_motion(spun(32), START, MotionConfig(pieces=1)).cuts


@pytest.mark.parametrize("turns", [2.3, 5.0])
def test_a_torch_that_is_wound_up_is_told_how_far_it_gets(turns: float) -> None:
    # More turns of the torch about its wire than the last joint has, and no more than it can turn on 0.6 m.
    u = np.linspace(-0.5, 0.5, 600)
    path = torch_path(
        np.array([0.0, -0.45, 0.15]) + 0.6 * u[:, None] * [1.0, 0.0, 0.0], np.array([0.0, 0.0, -1.0]), roll_free=False
    )
    R = np.stack(
        [R @ matrix_from_rotation_vector(np.array([0.0, 0.0, 2 * np.pi * turns * a])) for R, a in zip(path.X_BT.R, u, strict=True)]
    )
    with pytest.raises(
        MotionError, match=r"end stop goes beyond s = \d+\.\d mm; (weld it|nor does it go) in \d pieces, cut at"
    ) as caught:
        plan_motion(replace(path, X_BT=Transform("BT", R, path.X_BT.p)), START, MotionConfig(pieces=1))
    s = float(str(caught.value.data["s"]))
    assert 0.6 / turns < s < 0.6 * 4 / turns  # two turns of the last joint, more or less by those of the others
    cuts = np.array(caught.value.data["split"])
    assert len(cuts) >= turns / 2 - 1
    assert ((cuts > 0) & (cuts < 0.6)).all()


@pytest.mark.parametrize("seed", range(3))
def test_pieces_of_a_path_meet_at_the_cuts(seed: int) -> None:
    path = spun(seed)
    rng = np.random.default_rng([5, seed])
    cuts = [*np.sort(rng.uniform(path.s[0], path.s[-1], 3)).tolist(), float(path.s[300])]
    cuts.sort()
    pieces = cut_path(path, cuts)
    assert len(pieces) == 5
    for piece, after, s in zip(pieces[:-1], pieces[1:], cuts, strict=True):
        assert piece.s[-1] == pytest.approx(s, abs=1e-9)
        assert after.s[0] == pytest.approx(s, abs=1e-9)
        assert np.allclose(piece.X_BT.p[-1], after.X_BT.p[0])
        assert project(piece.X_BT.p, path.X_BT.p)[0].max() < 1e-9
    assert sum(piece.s[-1] - piece.s[0] for piece in pieces) == pytest.approx(path.s[-1] - path.s[0])
