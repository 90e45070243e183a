"""Ends of grooves: which of them are the banks of one gap or of one corner, and the line across."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.frames import matrix_from_rotation_vector, unit
from weldsim.seam.profile.meet import End, alike, faces, lead_across, meeting_point, round_corner

MAX_GAP = 0.045


def arc_ends(radius: float, gap: float, rng: np.random.Generator) -> tuple[End, End, Float[ndarray, "3"]]:
    """The two banks of a gap [m] in a circle's groove, moved at random, and the circle's centre."""
    half = gap / 2 / radius
    R, p = matrix_from_rotation_vector(rng.normal(size=3)), rng.uniform(-0.3, 0.3, 3)
    made = []
    for way in (-1, 1):
        angle = way * half
        point = radius * np.array([np.sin(angle), np.cos(angle), 0.0])
        made.append(
            End(
                point=R @ point + p,
                direction=R @ (-way * np.array([np.cos(angle), -np.sin(angle), 0.0])),
                normal=R @ np.array([0.0, 0.0, 1.0]),
                bend=R @ (-point / radius**2),
                sigma=2e-4,
                turn=0.02,
                width=0.012,
                depth=0.006,
            )
        )
    return made[0], made[1], p


@pytest.mark.parametrize("seed", range(6))
def test_the_banks_of_a_gap_in_a_circle_face_each_other_and_the_line_across_follows_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    radius, gap = rng.uniform(0.08, 0.5), rng.uniform(0.008, 0.040)
    a, b, centre = arc_ends(radius, gap, rng)
    assert faces(a, b, MAX_GAP)
    assert faces(b, a, MAX_GAP)
    line, normals = lead_across(a, b, 0.001)
    assert np.abs(np.linalg.norm(line - centre, axis=1) - radius).max() < 2e-4
    assert np.abs(normals @ a.normal - 1).max() < 1e-9
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).max() < 0.0012


@pytest.mark.parametrize("seed", range(6))
def test_ends_that_miss_turn_lean_or_lie_too_far_apart_do_not_face(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gap = rng.uniform(0.010, 0.040)
    a, b, _ = arc_ends(10.0, gap, rng)
    side = np.cross(a.normal, a.direction)
    assert not faces(a, replace(b, point=b.point + 0.007 * side), MAX_GAP), "a groove beside it"
    assert not faces(a, replace(b, point=b.point + 0.007 * b.normal), MAX_GAP), "a groove above it"
    turned = matrix_from_rotation_vector(0.7 * a.normal)
    assert not faces(a, replace(b, direction=turned @ b.direction), MAX_GAP)
    leaned = matrix_from_rotation_vector(0.5 * a.direction)
    assert not faces(a, replace(b, normal=leaned @ b.normal), MAX_GAP), "another face"
    assert not faces(a, replace(b, direction=-b.direction), MAX_GAP), "looks the same way"
    assert not faces(a, b, 0.9 * gap)
    assert not faces(replace(a, direction=-a.direction), replace(b, direction=-b.direction), MAX_GAP), "back to back"


def test_what_is_known_less_well_may_miss_by_more() -> None:
    a, b, _ = arc_ends(10.0, 0.010, np.random.default_rng(0))
    off = replace(b, point=b.point + 0.0025 * np.cross(a.normal, a.direction))
    assert not faces(a, off, MAX_GAP)
    assert faces(replace(a, sigma=8e-4), replace(off, sigma=8e-4), MAX_GAP)


def test_sections_of_one_groove_are_alike() -> None:
    a, b, _ = arc_ends(1.0, 0.02, np.random.default_rng(1))
    assert alike(a, replace(b, width=0.0135, depth=0.005))
    assert not alike(a, replace(b, width=0.018))
    assert not alike(a, replace(b, depth=0.0025))


def corner_ends(angle: float, out: tuple[float, float], rng: np.random.Generator) -> tuple[End, End, Float[ndarray, "3"]]:
    """Ends on two faces that meet at a convex edge, the second turned down by `angle` [rad]; and where their lines meet."""
    R, corner = matrix_from_rotation_vector(rng.normal(size=3)), rng.uniform(-0.3, 0.3, 3)
    onward = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    down = np.array([np.sin(angle), 0.0, np.cos(angle)])
    zero, x, z = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    a = End(corner - out[0] * (R @ x), R @ x, R @ z, zero, 2e-4, 0.01, 0.012, 0.006)
    b = End(corner + out[1] * (R @ onward), -(R @ onward), R @ down, zero, 3e-4, 0.01, 0.012, 0.006)
    return a, b, corner


@pytest.mark.parametrize("seed", range(8))
def test_a_corner_is_rounded_by_the_radius_told(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, radius = rng.uniform(0.3, 1.7), rng.uniform(0.002, 0.008)
    cut = radius * np.tan(angle / 2)
    a, b, corner = corner_ends(angle, (cut + rng.uniform(0.001, 0.02), cut + rng.uniform(0.001, 0.02)), rng)
    way = round_corner(a, b, radius, MAX_GAP, step=2e-4)
    assert way is not None
    assert np.linalg.norm(way.corner - corner) < 1e-9
    assert np.linalg.norm(way.points[0] - a.point) < 1e-9
    assert np.linalg.norm(way.points[-1] - b.point) < 1e-9
    s, t = arc_length(way.points), unit(np.diff(way.points, axis=0))
    assert np.arccos(np.clip((t[1:] * t[:-1]).sum(1), -1, 1)).max() < 1.2 * 2e-4 / radius, "no kink"
    total = np.arccos(np.clip(t[0] @ t[-1], -1, 1))
    assert total == pytest.approx(angle, abs=1e-6)
    straight = np.linalg.norm(a.point - corner) + np.linalg.norm(b.point - corner) - 2 * cut
    assert s[-1] == pytest.approx(straight + radius * angle, rel=1e-3)
    assert np.abs(np.linalg.norm(way.normals, axis=1) - 1).max() < 1e-9
    assert np.linalg.norm(way.normals[0] - a.normal) < 1e-9
    assert np.linalg.norm(way.normals[-1] - b.normal) < 1e-9
    assert np.abs((way.normals[1:-1] * unit(way.points[2:] - way.points[:-2])).sum(1)).max() < 0.06, "normal to the line"
    assert way.sigma[0] == pytest.approx(a.sigma)
    assert way.sigma[-1] == pytest.approx(b.sigma)
    assert way.sigma.max() > max(a.sigma, b.sigma)


def test_no_corner_where_lines_miss_the_edge_is_hollow_or_too_little_room_is_left() -> None:
    a, b, _ = corner_ends(1.0, (0.02, 0.02), np.random.default_rng(0))
    side = np.cross(a.normal, a.direction)
    assert round_corner(a, b, 0.004, MAX_GAP) is not None
    assert round_corner(a, replace(b, point=b.point + 0.01 * side), 0.004, MAX_GAP) is None
    assert round_corner(a, b, 0.05, MAX_GAP) is None, "an arc as wide leaves the faces"
    assert round_corner(a, b, 0.004, 0.015) is None, "too far from the edge"
    hollow = (replace(a, normal=-a.normal), replace(b, normal=-b.normal))
    assert round_corner(*hollow, 0.004, MAX_GAP) is None
    assert round_corner(a, replace(b, direction=-a.direction), 0.004, MAX_GAP) is None, "parallel"


def test_two_lines_at_a_right_angle_meet_as_surely_as_each_of_them_gets_there() -> None:
    """Each line tells the point across itself: by its own deviation, and by its direction's over the way to the point."""
    flat = End(
        point=np.array([-0.02, 0.0, 0.0]),
        direction=np.array([1.0, 0.0, 0.0]),
        normal=np.array([0.0, 0.0, 1.0]),
        bend=np.zeros(3),
        sigma=3e-4,
        turn=0.02,
        width=0.014,
        depth=0.008,
    )
    upright = replace(flat, point=np.array([0.001, -0.05, 0.0]), direction=np.array([0.0, 1.0, 0.0]), sigma=1e-4, turn=0.0)
    meeting = meeting_point([flat, upright])
    assert meeting is not None
    np.testing.assert_allclose(meeting.point, [0.001, 0.0, 0.0], atol=1e-12)
    assert meeting.sigma(flat.direction, flat.normal) == pytest.approx(np.hypot(3e-4, 0.021 * 0.02), rel=1e-6)
    assert meeting.sigma(upright.direction, upright.normal) == pytest.approx(1e-4, rel=1e-6)


def test_of_lines_that_miss_each_other_the_one_led_from_far_away_gives_in() -> None:
    """Three lines through one point; the third was read 0.1 m away, and its direction is a hundredth off."""
    near = [
        End(
            point=-0.02 * np.array([np.cos(a), np.sin(a), 0.0]),
            direction=np.array([np.cos(a), np.sin(a), 0.0]),
            normal=np.array([0.0, 0.0, 1.0]),
            bend=np.zeros(3),
            sigma=1e-4,
            turn=0.02,
            width=0.014,
            depth=0.008,
        )
        for a in (0.0, 2.0)
    ]
    far = replace(near[0], point=np.array([0.001, -0.1, 0.0]), direction=np.array([0.0, 1.0, 0.0]))
    meeting = meeting_point([*near, far])
    assert meeting is not None
    assert np.linalg.norm(meeting.point) < 1e-4
