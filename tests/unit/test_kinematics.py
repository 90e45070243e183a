"""The standard DH table that a controller tells is the same arm as our modified one, and no inverse branch is lost."""

import numpy as np
import pytest

from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import (
    D1,
    DH,
    JOINT_LIMIT,
    dh_frames,
    flange_pose,
    frames_jacobian,
    inverse,
    inverse_near,
    inverse_of_many,
    joints_at,
    torch_pose,
    torch_tip,
)


def test_standard_and_modified_dh_give_the_same_flange() -> None:
    rng = np.random.default_rng(0)
    for q in rng.uniform(-2 * np.pi, 2 * np.pi, (50, 6)):
        X = np.eye(4)
        for (offset, a, d, alpha), angle in zip(DH, q, strict=True):
            c, s = np.cos(angle + offset), np.sin(angle + offset)
            ca, sa = np.cos(alpha), np.sin(alpha)
            X = X @ np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
        assert np.abs(X - flange_pose(q).matrix).max() < 1e-12


@pytest.mark.parametrize(
    "wrist", [(-np.pi / 2, 0.0), (np.pi / 2, 0.0), (-np.pi / 2, np.pi), (np.pi / 2, np.pi / 2), (-np.pi / 4, 0.0)]
)
@pytest.mark.parametrize("down", [False, True])
def test_no_branch_is_lost_where_angles_are_round(wrist: tuple[float, float], down: bool) -> None:
    rng = np.random.default_rng(1)
    for _ in range(30):
        q = np.array([rng.uniform(-np.pi, np.pi), rng.uniform(-2.2, -0.8), rng.uniform(0.4, 2.2), rng.uniform(-2, 2), *wrist])
        if down:  # the tool points straight at the table
            q[3] = -np.pi / 2 - q[1] - q[2]
        if rng.random() < 0.5:
            q[0] = np.round(q[0] / (np.pi / 2)) * np.pi / 2
        found = inverse(flange_pose(q))
        off = np.remainder(found - q + np.pi, 2 * np.pi) - np.pi
        assert np.abs(off).max(axis=1).min() < 1e-6
        assert np.abs(flange_pose(found).matrix - flange_pose(q).matrix).max() < 1e-9
        assert np.abs(found).max() <= np.pi + 1e-12


Q = np.array([0.3, -1.2, 1.5, -0.8, 1.1, 0.4])


def test_eight_branches_each_of_its_pose() -> None:
    found, pose = inverse_of_many(np.stack([flange_pose(Q).matrix, flange_pose(-Q).matrix]))
    assert pose.tolist() == [0] * 8 + [1] * 8
    for q, of in zip(found, pose, strict=True):
        np.testing.assert_allclose(flange_pose(q).matrix, flange_pose((Q, -Q)[of]).matrix, atol=1e-9)
    assert inverse_of_many(np.zeros((0, 4, 4)))[0].shape == (0, 6)


@pytest.mark.parametrize("turns", [[0, 0, 0, 0, 0, 0], [-1, 1, -1, 1, -1, -1]])
def test_the_nearest_branch_is_unwrapped_to_where_the_arm_is(turns: list[int]) -> None:
    wanted = Q + 2 * np.pi * np.array(turns)
    near = wanted + np.array([0.1, -0.2, 0.2, 0.1, -0.1, 0.2])
    np.testing.assert_allclose(inverse_near(flange_pose(Q), near), wanted, atol=1e-9)


def test_nearest_is_by_the_joint_that_moves_most_within_the_limits() -> None:
    """A joint that would be nearer beyond its limit is taken as it is, between minus half a turn and half a turn."""
    X = flange_pose(Q)
    beyond = 0
    for near in np.random.default_rng(0).uniform(-7, 7, (60, 6)):
        best = []
        for solution in inverse(X):
            turned = solution + 2 * np.pi * np.rint((near - solution) / (2 * np.pi))
            beyond += np.any(np.abs(turned) > JOINT_LIMIT)
            best.append(np.array([b if abs(b) <= JOINT_LIMIT else a for a, b in zip(solution, turned, strict=True)]))
        moves = [np.abs(q - near).max() for q in best]
        np.testing.assert_allclose(inverse_near(X, near), best[int(np.argmin(moves))], atol=1e-12)
    assert beyond > 50


def test_out_of_reach_is_told_with_place_and_distance() -> None:
    X = Transform("BF", np.eye(3), np.array([0.9, 0.3, D1 + 0.2]))
    told = r"^flange at \(0\.900, 0\.300, 0\.289\) m in base: no joint solution, 0\.970 m from the shoulder \(reach 0\.85 m\); move"
    with pytest.raises(UnreachableError, match=told) as caught:
        inverse_near(X, Q)
    assert caught.value.data["position"] == pytest.approx((0.9, 0.3, D1 + 0.2))
    assert caught.value.data["distance"] == pytest.approx(np.sqrt(0.94))
    assert caught.value.data["reach"] == 0.85
    assert inverse(X).shape == (0, 6)


def test_torch_by_pose_and_by_tip_with_any_mount() -> None:
    X_FT = Transform("FT", np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.2, 0.3]))
    q = np.stack([Q, -Q])
    np.testing.assert_allclose(torch_pose(q, X_FT).matrix, (flange_pose(q) @ X_FT).matrix, atol=1e-12)
    np.testing.assert_allclose(torch_tip(q, X_FT), torch_pose(q, X_FT).p, atol=1e-12)
    np.testing.assert_allclose(torch_tip(Q), torch_pose(Q).p, atol=1e-12)


def test_the_jacobian_is_how_a_point_moves() -> None:
    """Rows of velocity and of turning, one column a joint, by central differences; of a batch, each its own."""
    q, point_F, h = np.stack([Q, -Q]), np.array([0.1, -0.2, 0.3]), 1e-6

    def place(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        frames = dh_frames(DH, q)[:, 6]
        return frames[:, :3, :3] @ point_F + frames[:, :3, 3], frames[:, :3, :3]

    p, R = place(q)
    J = frames_jacobian(dh_frames(DH, q), p)
    for joint in range(6):
        step = h * np.eye(6)[joint]
        (ahead, R1), (behind, R0) = place(q + step), place(q - step)
        np.testing.assert_allclose(J[:, :3, joint], (ahead - behind) / (2 * h), atol=1e-8)
        turn = (R1 - R0) @ R.swapaxes(1, 2) / (2 * h)
        np.testing.assert_allclose(J[:, 3:, joint], turn[:, [2, 0, 1], [1, 2, 0]], atol=1e-8)


def test_own_figures_turn_about_their_own_offsets() -> None:
    """An offset of theta is an angle more; the first frame is the base itself."""
    offset = np.array([0.1, -0.2, 0.3, -0.4, 0.5, -0.6])
    dh = DH.copy()
    dh[:, 0] = offset
    found = dh_frames(dh, Q)
    np.testing.assert_array_equal(found[0], np.eye(4))
    np.testing.assert_allclose(found, dh_frames(DH, Q + offset), atol=1e-12)
    np.testing.assert_allclose(found[6], flange_pose(Q + offset).matrix, atol=1e-12)
    near = Q - offset + 0.1
    np.testing.assert_allclose(joints_at(dh, flange_pose(Q).matrix[None], near[None])[0], Q - offset, atol=1e-9)


def test_newtons_method_ends_where_it_is_exact_or_gives_up() -> None:
    """Started 0.2 rad off it converges to a billionth; started 0.6 rad off it would have to go farther than STRAY."""
    X = flange_pose(Q).matrix[None]
    off = np.array([0.2, -0.2, 0.2, -0.2, 0.2, -0.2])
    np.testing.assert_allclose(joints_at(DH, X, (Q + off)[None])[0], Q, atol=1e-9)
    mixed = joints_at(DH, np.repeat(X, 3, axis=0), np.stack([Q, Q + 3 * off, Q + off]))
    assert np.isnan(mixed).any(axis=1).tolist() == [False, True, False]
    np.testing.assert_array_equal(mixed[0], Q)
    np.testing.assert_allclose(mixed[2], Q, atol=1e-9)
