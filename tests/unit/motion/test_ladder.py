"""The ladder of joint solutions: branches, climbs within limits, cuts; welds that no constant rotation about the wire sweeps."""

import numpy as np
import pytest

from weldsim.arm import UR5
from weldsim.config import load_scene
from weldsim.curves import arc_length, interpolate, tangents
from weldsim.frames import Transform, unit
from weldsim.kinematics import flange_pose, inverse, link_frames, torch_pose
from weldsim.motion.arm import jacobian
from weldsim.motion.collision import CellCollision
from weldsim.motion.config import MotionConfig
from weldsim.motion.ladder import climb, cuts
from weldsim.motion.plan import plan_motion
from weldsim.motion.rail import make_rail
from weldsim.motion.rungs import Rungs, branch_of, make_rungs
from weldsim.motion.sweep import LEVERS, STEP_LENGTH, STEP_TURN, first_touch, steps, touched
from weldsim.path.config import PathConfig
from weldsim.path.plan import plan_path
from weldsim.records import KnownSeam, Seam, TorchPath
from weldsim.scene.world import World, build_world

LIMIT, EVERYWHERE = 2 * np.pi - 0.1, (-1.0, 1.0)  # [rad], [m]
ROUNDED = 0.008  # [m] to either side, over which the seam's corners are averaged


def path_along(known: KnownSeam) -> TorchPath:
    s = np.linspace(0, known.length, int(known.length / 0.002))
    window = np.linspace(-ROUNDED, ROUNDED, 9)

    def averaged(values: np.ndarray) -> np.ndarray:
        return np.mean([interpolate(known.s, values, np.clip(s + d, 0, known.length)) for d in window], axis=0)

    points = averaged(known.opening_B)
    along, out = tangents(points), averaged(-known.bisectors_B)
    out = unit(out - np.einsum("ij,ij->i", out, along)[:, None] * along)
    return plan_path(Seam(points_B=points, s=arc_length(points), tangents_B=along, normals_B=out), PathConfig())


@pytest.fixture(scope="module")
def world() -> World:
    return build_world(load_scene("cuboid"))


def test_the_cuboid_is_welded_over_its_three_faces(world: World) -> None:
    path, blocked, config = path_along(world.known_seams[0]), CellCollision(world.model), MotionConfig()
    q_start = world.view_joints(len(world.views) - 1)
    # With one rotation about the wire there is no way.
    rungs = make_rungs(make_rail(path, config), UR5, config, blocked)
    for k in range(config.rolls):
        only = np.ones(rungs.cost.shape, bool)
        only[:, k] = False
        assert climb(rungs, q_start, UR5, config, blocked, banned=only) is None
    plan = plan_motion(path, q_start, config, blocked=blocked)
    assert plan.position_error < 0.1e-3
    assert plan.axis_error < np.deg2rad(0.1)
    assert first_touch(plan.trajectory.q, blocked) is None
    welding = plan.trajectory.arc_on
    tip = torch_pose(plan.trajectory.q[welding]).p
    assert np.abs(plan.rail.at(plan.trajectory.s[welding]).p - tip).max() < 0.1e-3
    assert np.ptp(tip[:, 2]) > 0.31  # up one side, over the top, down the other
    assert np.ptp(tip[:, 0]) > 0.40


@pytest.mark.parametrize("seed", range(20))
def test_every_solution_has_a_branch_of_its_own_and_the_jacobian_changes_sign_between_them(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, 6)
    solutions = inverse(flange_pose(q))
    branches = branch_of(solutions)
    assert len(set(branches.tolist())) == len(solutions)
    assert branch_of(q[None])[0] in branches
    # The three signs multiply to the sign of the determinant.
    bare = Transform("FT", np.eye(3), np.zeros(3))
    signs = [(-1) ** bin(int(branch)).count("1") for branch in branches]
    assert len(set((np.sign(np.linalg.det(jacobian(solutions, bare))) * signs).tolist())) == 1


def _ladder(angles: np.ndarray, cost: np.ndarray) -> Rungs:
    """Rungs whose last joint stands at `angles` (w, r), all others at 0, in branch 0 alone; the torch's pose means nothing."""
    w, r = angles.shape
    q, full = np.full((w, r, 8, 6), np.nan), np.full((w, r, 8), np.inf)
    q[:, :, 0] = 0.0
    q[:, :, 0, 5] = (angles + np.pi) % (2 * np.pi) - np.pi
    full[:, :, 0] = cost
    s = 0.01 * np.arange(w)
    refusals = (None,) * w
    frames, p = np.tile(np.eye(3), (w, 1, 1)), np.zeros((w, 3))
    return Rungs(s=s, frames=frames, p=p, rolls=2 * np.pi * np.arange(r) / r, q=q, cost=full, refusals=refusals)


def test_whole_turns_are_chosen_so_that_the_stops_are_never_reached() -> None:
    # From -150 deg the joint turns on by 480 deg: it must start a whole turn lower, at -510 + 480, not at the nearest angle.
    angles = np.deg2rad(np.linspace(-150, 330, 25))[:, None]
    hold = climb(_ladder(angles, np.zeros(angles.shape)), np.zeros(6), UR5, MotionConfig())
    assert hold is not None
    assert np.abs(hold.q).max() <= 2 * np.pi - 0.1
    assert np.allclose(np.diff(hold.q[:, 5]), np.deg2rad(20), atol=1e-9)


@pytest.mark.parametrize(("start", "turns"), [(170.0, 0), (330.0, 0), (349.0, -1), (-349.0, 1)])
def test_a_weld_that_would_end_near_a_stop_is_begun_a_whole_turn_away(start: float, turns: int) -> None:
    # At 349 deg the stop is 11 deg off: where the arm stands, but a whole turn back leaves half a turn on either side.
    principal = (start + 180) % 360 - 180
    angles = np.deg2rad(np.full((25, 1), principal))
    q_start = np.zeros(6)
    q_start[5] = np.deg2rad(start)
    hold = climb(_ladder(angles, np.zeros(angles.shape)), q_start, UR5, MotionConfig())
    assert hold is not None
    assert np.allclose(hold.q[:, 5], np.deg2rad(start + 360 * turns), atol=1e-9)


def test_a_joint_that_would_run_into_its_stop_goes_another_way() -> None:
    # One rotation winds the joint up by two turns and a half, dear ones beside it stay where they are.
    w, r = 41, 12
    angles = np.zeros((w, r))
    angles[:] = np.linspace(0, 5 * np.pi, w)[:, None]
    cost = np.ones((w, r))
    cost[:, 0] = 0.0
    assert climb(_ladder(angles, cost), np.zeros(6), UR5, MotionConfig()) is None
    angles[:, 1:] = angles[0, 0] + 0.3 * np.sin(np.arange(w))[:, None]
    hold = climb(_ladder(angles, cost), np.zeros(6), UR5, MotionConfig())
    assert hold is not None
    assert np.abs(hold.q).max() <= 2 * np.pi - 0.1
    assert np.abs(np.diff(hold.q, axis=0)).max() < 0.6


@pytest.mark.parametrize("at", [10, 17, 25])
def test_a_weld_is_cut_where_its_pieces_are_cheapest(at: int) -> None:
    # Two ways that overlap between rungs 8 and 30 and are never joined; both are dear but at one rung.
    w, r = 40, 12
    angles = np.tile(np.arange(r) * 2 * np.pi / r, (w, 1))
    cost = np.full((w, r), np.inf)
    cost[:31, 0], cost[8:, 6] = 1.0, 1.0
    cost[at, 6] = cost[at, 0] = 0.0
    cost[8:at, 6] += 1.0
    cost[at + 1 : 31, 0] += 1.0
    rungs = _ladder(angles, cost)
    assert climb(rungs, np.zeros(6), UR5, MotionConfig()) is None
    assert cuts(rungs, LIMIT, EVERYWHERE) == [pytest.approx(0.01 * at)]


def test_one_climb_needs_no_cut_and_a_gap_cannot_be_cut() -> None:
    angles, cost = np.zeros((10, 1)), np.zeros((10, 1))
    assert cuts(_ladder(angles, cost), LIMIT, EVERYWHERE) == []
    jump = angles.copy()
    jump[5:] = 2.0
    assert cuts(_ladder(jump, cost), LIMIT, EVERYWHERE) is None  # no rung has both


@pytest.mark.parametrize("seed", range(10))
def test_no_point_of_the_arm_moves_further_than_a_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = rng.uniform(-2, 2, 6)
    b = a + rng.uniform(-0.5, 0.5, 6)
    n = int(steps(a[None], b[None])[0])
    q = a + np.linspace(0, 1, n + 1)[:, None] * (b - a)
    assert np.abs(np.diff(q, axis=0)).max() <= STEP_TURN + 1e-12
    frames = link_frames(q)
    points = [frames[:, 2, :3, 3], frames[:, 3, :3, 3], frames[:, 5, :3, 3], torch_pose(q).p]
    camera = np.array([0.03, -0.13, 0.08])
    points.append(frames[:, 5, :3, :3] @ camera + frames[:, 5, :3, 3])
    assert max(np.linalg.norm(np.diff(p, axis=0), axis=1).max() for p in points) <= STEP_LENGTH
    assert len(LEVERS) == 6


def test_a_thin_wall_on_the_way_is_met() -> None:
    def blocked(q: np.ndarray) -> str | None:
        return "wall" if abs(q[0] - 0.31) < 0.0009 else None

    a, b = np.zeros(6), np.eye(6)[0]
    assert touched(a, b, blocked) == "wall"
    found = first_touch(np.stack([a, b]), blocked)
    assert found is not None
    assert found[1] == "wall"
    assert abs(found[0] - 0.31) < 0.002
