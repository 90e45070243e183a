"""What the pictures show, in closed form: a straight seam on a plate that is tilted and turned."""

from dataclasses import replace

import numpy as np
import pytest

from tests.seams import findings, found_seam, left_of, sine_seam, torch_path, weld_log
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import KnownSeam, PointCloud, Seam, Segment
from weldsim.report.view import (
    CrossSection,
    cross_section,
    error_lines,
    height_range,
    heights,
    shown,
    shows_surface,
    torch_axes,
    view_frame,
)

X_BP = Transform("BP", matrix_from_rotation_vector(np.array([0.2, -0.1, 0.7])), np.array([0.1, -0.5, 0.05]))
LENGTH, WIDTH, DEPTH, STEP = 0.1, 0.012, 0.006, 0.002  # [m]


def seam(start: float = -LENGTH / 2, aside: float = 0.0) -> Seam:
    """A line along x of P, LENGTH long, its left lip STEP higher than the right one; left is y of P, up is z."""
    n = 51
    line = np.stack([np.linspace(start, start + LENGTH, n), np.full(n, aside), np.zeros(n)], axis=1)
    lip = np.array([0.0, WIDTH / 2, STEP / 2])
    return Seam(
        points_B=X_BP.points(line),
        s=np.linspace(0.0, LENGTH, n),
        tangents_B=X_BP.vectors(np.tile([1.0, 0.0, 0.0], (n, 1))),
        normals_B=X_BP.vectors(np.tile([0.0, 0.0, 1.0], (n, 1))),
        left_B=X_BP.points(line + lip),
        right_B=X_BP.points(line - lip),
        depth=DEPTH,
    )


def plate(spacing: float = 0.001, reach: float = 0.1) -> PointCloud:
    """A V-groove along x of P, WIDTH wide and DEPTH deep, in a plate that is high by y / 10; seen from above."""
    x, y = np.meshgrid(np.arange(-reach, reach, spacing), np.arange(-reach, reach, spacing))
    z = 0.1 * y - DEPTH * np.maximum(1 - np.abs(y) / (WIDTH / 2), 0.0)
    return PointCloud(
        points=X_BP.points(np.stack([x, y, z], axis=-1).reshape(-1, 3)), viewpoints=X_BP.points(np.array([[0, 0, 0.5]]))
    )


def test_the_view_has_its_origin_amid_the_seams_x_along_the_first_and_z_out_of_the_part() -> None:
    X_BS = view_frame(plate(0.01), (seam(), seam(0.0, 0.02)))
    np.testing.assert_allclose(X_BS.R, X_BP.R, atol=1e-12)
    np.testing.assert_allclose(X_BP.inverse().points(X_BS.p[None])[0], [0.025, 0.01, 0.0], atol=1e-12)
    assert X_BS.names == "BS"


def test_a_ring_is_seen_with_x_across_it() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 101)
    ring = 0.05 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    s = 0.05 * angle
    tangents = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    one = Seam(points_B=ring, s=s, tangents_B=tangents, normals_B=np.tile([0.0, 0.0, 1.0], (101, 1)), closed=True)
    np.testing.assert_allclose(view_frame(plate(0.01), (one,)).R[:, 0], [-1.0, 0.0, 0.0], atol=1e-12)


def test_a_bent_seam_is_seen_along_its_chord() -> None:
    """A quarter of a ring: its chord is 0.9 of its length, and its first half leads another way."""
    angle = np.linspace(0.0, np.pi / 2, 101)
    quarter = 0.05 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    tangents = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    one = Seam(points_B=quarter, s=0.05 * angle, tangents_B=tangents, normals_B=np.tile([0.0, 0.0, 1.0], (101, 1)))
    np.testing.assert_allclose(view_frame(plate(0.01), (one,)).R[:, 0], np.array([-1.0, 1.0, 0.0]) / np.sqrt(2), atol=1e-12)


@pytest.mark.parametrize("above", [True, False, None])
def test_without_a_seam_the_view_is_the_clouds_own_plane_from_the_sensors_side(above: bool | None) -> None:
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, 41), np.linspace(-0.1, 0.1, 21))
    points = X_BP.points(np.stack([x, y, 0.001 * (-1.0) ** np.arange(21)[:, None] * np.ones_like(x)], axis=-1).reshape(-1, 3))
    eye = X_BP.points(np.array([[0.0, 0.0, 0.5 if above else -0.5]]))
    cloud = PointCloud(points=points) if above is None else PointCloud(points=points, viewpoints=eye)
    X_BS = view_frame(cloud, ())
    z = X_BP.R[:, 2]
    np.testing.assert_allclose(X_BS.R[:, 2], -z if above is False else z, atol=1e-3)  # B's own up without a sensor
    assert abs(X_BS.R[:, 0] @ X_BP.R[:, 0]) > 0.9999
    np.testing.assert_allclose(X_BS.p, np.median(points, axis=0), atol=1e-12)


def test_points_shown_are_those_around_the_seams_evenly_thinned() -> None:
    cloud = plate(0.004)
    local = X_BP.inverse().points(cloud.points)
    near = np.flatnonzero((np.abs(local[:, 0]) < 0.05 + 0.013) & (np.abs(local[:, 1]) < 0.013))
    np.testing.assert_array_equal(shown(cloud, (seam(),), 10_000, margin=0.013), near)
    np.testing.assert_array_equal(shown(cloud, (seam(),), len(near), margin=0.013), near)
    np.testing.assert_array_equal(shown(cloud, (seam(),), len(near) - 1, margin=0.013), near[::2])
    np.testing.assert_array_equal(shown(cloud, (), 1000), np.arange(len(cloud))[::3])
    assert len(cloud) == 2500


@pytest.fixture(scope="module")
def section() -> CrossSection:
    return cross_section(plate(), seam())


def test_a_section_is_the_profile_of_the_groove_left_positive(section: CrossSection) -> None:
    wanted = 0.1 * section.across - DEPTH * np.maximum(1 - np.abs(section.across) / (WIDTH / 2), 0.0)
    # A millimetre of the plate lies in two bins at most.
    np.testing.assert_allclose(section.median, wanted, atol=DEPTH / (WIDTH / 2) * 0.55e-3)
    assert (section.low <= section.median).all()
    assert (section.median <= section.high).all()
    assert section.across[0] == pytest.approx(-0.02475, abs=1e-3)
    assert section.across[-1] == pytest.approx(0.02475, abs=1e-3)
    np.testing.assert_allclose((section.across / 0.5e-3) % 1.0, 0.5, atol=1e-6)


def test_a_section_has_its_lips_and_its_depth(section: CrossSection) -> None:
    assert section.lips is not None
    np.testing.assert_allclose(section.lips, [[WIDTH / 2, STEP / 2], [-WIDTH / 2, -STEP / 2]], atol=1e-12)
    assert section.depth == DEPTH
    assert cross_section(plate(0.004), replace(seam(), left_B=None)).lips is None
    assert cross_section(plate(0.004), replace(seam(), right_B=None)).lips is None


def test_a_section_is_taken_away_from_the_ends_and_near_the_surface() -> None:
    """What stands at the last 3 % of the seam, and what is more than the shown half width above it, is not in it."""
    cloud = plate()
    end = X_BP.points(np.random.default_rng(0).uniform([0.048, -0.02, 0.01], [0.06, 0.02, 0.02], (20_000, 3)))
    high = X_BP.points(np.random.default_rng(1).uniform([-0.04, -0.02, 0.0255], [0.04, 0.02, 0.03], (20_000, 3)))
    bare = cross_section(cloud, seam())
    for more in (end, high):
        found = cross_section(PointCloud(points=np.concatenate([cloud.points, more])), seam())
        np.testing.assert_array_equal(found.median, bare.median)
        np.testing.assert_array_equal(found.high, bare.high)


def test_percentiles_of_a_bin_with_five_points_or_more() -> None:
    """At 0.75 mm left lie heights 0 to 10 mm, at 5.25 mm four points."""
    height = np.arange(101) * 1e-4
    places = np.concatenate(
        [
            np.stack([np.zeros(101), np.full(101, 0.00075), height], axis=1),
            np.tile([0.0, 0.00525, 0.0], (4, 1)),
            np.tile([0.0, -0.00525, 0.001], (5, 1)),
        ]
    )
    found = cross_section(PointCloud(points=X_BP.points(places)), seam())
    np.testing.assert_allclose(found.across, [-0.00525, 0.00075], atol=1e-12)
    np.testing.assert_allclose([found.low[1], found.median[1], found.high[1]], [0.0016, 0.0050, 0.0084], atol=1e-12)
    np.testing.assert_allclose([found.low[0], found.median[0], found.high[0]], 0.001, atol=1e-12)


def test_a_seam_alone_shows_no_surface() -> None:
    line = np.stack([np.linspace(-0.04, 0.04, 900), np.zeros(900), np.zeros(900)], axis=1)
    bare = PointCloud(points=X_BP.points(line))
    assert not shows_surface(bare, (seam(),))
    assert shows_surface(bare, ())
    assert shows_surface(plate(0.002), (seam(),))
    assert shows_surface(plate(0.002), (seam(start=5.0), seam())), "one of them is enough"


def test_axes_are_drawn_back_along_the_wire_every_centimetre_of_weld() -> None:
    path = torch_path(seam())
    path = replace(
        path, segments=(Segment.APPROACH,) * 100 + (Segment.WELD,) * (len(path.s) - 100), arc_on=np.arange(len(path.s)) >= 100
    )
    lines = X_BP.inverse().points(torch_axes(path).reshape(-1, 3)).reshape(-1, 2, 3)
    x = np.arange(-0.04, 0.0501, 0.01)  # the first centimetre is the approach
    np.testing.assert_allclose(lines[:, 0], np.stack([x, 0 * x, 0 * x], axis=1), atol=1.1e-4)
    np.testing.assert_allclose(lines[:, 1] - lines[:, 0], np.tile([0.0, 0.0, 0.03], (len(x), 1)), atol=1e-12)


@pytest.fixture(scope="module")
def known() -> KnownSeam:
    return sine_seam(np.random.default_rng(5))


def test_errors_are_along_the_known_seam_whichever_way_the_line_runs(known: KnownSeam) -> None:
    one = found_seam(known, 1e-4 + 2e-3 * known.s)
    path = torch_path(one)
    path = replace(path, sigma=1e-3 * path.s)
    log = weld_log(torch_path(found_seam(known, np.full(len(known.s), -3e-4))), np.random.default_rng(0))
    lines = error_lines(findings((one,), np.zeros(3, bool)), (path,), log, (known,), 0)
    assert list(lines) == ["plan", "executed"]
    plan, executed = lines["plan"], lines["executed"]
    np.testing.assert_allclose(plan.across, 1e-4 + 2e-3 * plan.s, atol=3e-5)
    np.testing.assert_allclose(plan.distance, np.abs(plan.across), atol=1e-6)
    np.testing.assert_allclose(plan.sigma, 1e-3 * path.s)
    np.testing.assert_allclose(executed.across, -3e-4, atol=2e-5)
    assert executed.sigma is None
    back = replace(path, X_BT=path.X_BT[::-1], sigma=1e-3 * path.s[::-1])
    again = error_lines(findings((one,), np.zeros(3, bool)), (back,), None, (known,), 0)
    assert list(again) == ["plan"]
    assert (np.diff(again["plan"].s) >= 0).all()
    np.testing.assert_allclose(again["plan"].across, plan.across, atol=1e-9)
    np.testing.assert_allclose(again["plan"].sigma, plan.sigma, atol=1e-12)


def test_there_are_no_errors_without_a_known_seam_a_path_or_an_arc(known: KnownSeam) -> None:
    one = found_seam(known, np.zeros(len(known.s)))
    path, two = torch_path(one), findings((one,), np.zeros(3, bool))
    assert error_lines(two, (path,), None, (), 0) == {}
    assert error_lines(two, (None,), None, (known,), 0) == {}
    assert error_lines(two, (), None, (known,), 0) == {}
    dark = weld_log(path, np.random.default_rng(0))
    dark = replace(dark, arc_on=np.zeros(len(dark.t), bool))
    assert list(error_lines(two, (path,), dark, (known,), 0)) == ["plan"]
    far = found_seam(known, np.full(len(known.s), 0.03))
    both = findings((far, one), np.zeros(3, bool))
    assert error_lines(both, (torch_path(far), path), None, (known,), 0) == {}
    assert list(error_lines(both, (torch_path(far), path), None, (known,), 1)) == ["plan"]


def test_heights_are_over_the_surface_at_the_nearest_seam() -> None:
    places = np.array([[0.01, 0.004, 0.003], [0.02, 0.021, -0.002]])
    tilted = replace(seam(aside=0.025), normals_B=X_BP.vectors(np.tile([0.0, -0.6, 0.8], (51, 1))))
    found = heights(X_BP.points(places), (seam(), tilted), X_BP)
    np.testing.assert_allclose(found, [0.003, 0.6 * 0.004 - 0.8 * 0.002], atol=1e-12)
    np.testing.assert_allclose(heights(X_BP.points(places), (), Transform("BS", X_BP.R, X_BP.p)), [0.003, -0.002], atol=1e-12)


def test_colours_are_spread_over_the_groove_and_its_surface() -> None:
    values = np.linspace(-0.1, 0.1, 201)
    np.testing.assert_allclose(height_range(values, ()), (-0.098, 0.098))
    np.testing.assert_allclose(height_range(values, (seam(),)), (-1.2 * DEPTH, 0.4 * DEPTH))
    np.testing.assert_allclose(height_range(0.01 * values, (seam(),)), (-0.00098, 0.00098))
    deep = replace(seam(), depth=0.02)
    np.testing.assert_allclose(height_range(values, (seam(), deep)), (-0.024, 0.008))
    np.testing.assert_allclose(height_range(values, (replace(seam(), depth=None),)), (-0.0096, 0.0032))
    np.testing.assert_allclose(height_range(np.full(5, 0.3), ()), (0.299, 0.301))
    np.testing.assert_allclose(height_range(np.zeros(0), ()), (-1e-3, 1e-3))


def test_errors_left_of_travel_are_positive(known: KnownSeam) -> None:
    line = found_seam(known, np.full(len(known.s), 2e-4))
    aside = np.einsum("ij,ij->i", line.points_B - known.opening_B[::4], left_of(known)[::4])
    np.testing.assert_allclose(aside, 2e-4, atol=1e-12)
    found = error_lines(findings((line,), np.zeros(3, bool)), (torch_path(line),), None, (known,), 0)["plan"]
    assert (found.across > 0).all()


def test_a_weld_a_hair_shorter_than_so_many_torch_axes_has_its_last_at_its_end() -> None:
    path = torch_path(seam())
    short = replace(path, s=path.s * (1 - 5e-9), X_BT=Transform("BT", path.X_BT.R, path.X_BT.p))
    lines = torch_axes(short, every=LENGTH / 4, length=0.03)
    assert len(lines) == 5
    np.testing.assert_allclose(lines[-1, 0], path.X_BT.p[-1], atol=1e-12)
