"""Each end of a groove is where it was made, on exact clouds of grooves whose two ends differ."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from weldsim.config import CellConfig, load_scene
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.pipeline import look
from weldsim.records import PointCloud
from weldsim.report.metrics import known_offsets
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import make_atlas
from weldsim.seam.profile.ends import seam_span
from weldsim.seam.profile.find import _search, find_seams_profile
from weldsim.seam.profile.parent import CELL
from weldsim.seam.profile.refine import Fit
from weldsim.seam.profile.section import Section
from weldsim.seam.profile.track import _meets_other

WIDTH, DEPTH, SPACING = 0.012, 0.007, 0.0008  # [m]
TURNS = (0.0, 2.5)  # [rad] about the vertical: the finder may walk a groove either way


def end_errors(
    start: float, stop: float, low: float, high: float, turn: float, *, taper: float = 0.0, unseen: float = 0.0
) -> tuple[float, float]:
    """How far the seam found runs on beyond either end of a groove along x [m]; less than 0 where it stops short.

    Args:
        start, stop: of the groove [m].  low, high: of the plate; a groove that reaches it runs out through its edge.
        turn: of the plate about the vertical [rad].
        taper: over which the groove loses its depth, half of it before its end and half after [m].
        unseen: of the groove, lips included, at either end of the plate, where only the plate beside it was seen [m].
    """
    x, y = np.meshgrid(np.arange(low + SPACING / 2, high, SPACING), np.arange(-0.06, 0.06, SPACING))
    seen = (np.abs(y) > WIDTH / 2 + SPACING / 2) | ((x > low + unseen) & (x < high - unseen))
    x, y = x[seen], y[seen]
    share = np.clip(np.minimum(x - start, stop - x) / max(taper, 1e-9) + 0.5, 0.0, 1.0)
    below = DEPTH * np.maximum(1 - np.abs(y) / (WIDTH / 2), 0.0) * share
    X_BP = Transform("BP", matrix_from_rotation_vector(np.array([0.0, 0.0, turn])), np.array([0.1, -0.5, 0.02]))
    points = X_BP.points(np.stack([x, y, -below], axis=-1).reshape(-1, 3))
    cloud = PointCloud(points=points, viewpoints=X_BP.p[None] + [0.0, 0.0, 0.45])
    (seam,) = find_seams_profile(cloud, ProfileConfig()).seams
    found = np.sort(X_BP.inverse().points(seam.points_B[[0, -1]])[:, 0])
    return start - found[0], found[1] - stop


def test_a_groove_that_fades_inside_its_plate_ends_where_it_fades() -> None:
    ends = [(-0.0603, 0.0437), (-0.0416, 0.0655)]
    errors = np.array([end_errors(start, stop, -0.1, 0.09, turn) for (start, stop), turn in product(ends, TURNS)])
    assert np.abs(errors).max() < 0.8e-3
    assert np.abs(errors.mean(axis=0)).max() < 0.5e-3, "neither end is drawn out or in"


@pytest.mark.parametrize("turn", TURNS)
def test_a_groove_that_runs_out_slowly_ends_where_its_depth_halves(turn: float) -> None:
    before, after = end_errors(-0.0603, 0.0437, -0.1, 0.09, turn, taper=0.016)
    assert abs(before) < 0.8e-3
    assert abs(after) < 0.8e-3


@pytest.mark.parametrize("turn", TURNS)
def test_an_end_that_was_not_seen_is_carried_to_the_plates_edge(turn: float) -> None:
    before, after = end_errors(-0.0750, 0.0601, -0.0750, 0.0601, turn, unseen=0.006)
    assert abs(before) < 1.3e-3
    assert abs(after) < 1.3e-3


def test_a_groove_that_leaves_its_plate_ends_at_the_plates_edge() -> None:
    ends = [(-0.0750, 0.0601), (-0.0517, 0.0833)]
    errors = np.array([end_errors(low, high, low, high, turn) for (low, high), turn in product(ends, TURNS)])
    assert np.abs(errors).max() < 1.3e-3, "a cell of the parent surface is 2 mm wide"
    assert np.abs(errors.mean(axis=0)).max() < 0.8e-3


@pytest.mark.parametrize(
    ("start", "stop", "low", "high", "turn"), [(-0.05, 0.0753, -0.09, 0.0753, 0.0), (-0.0817, 0.04, -0.0817, 0.09, 2.5)]
)
def test_a_groove_may_fade_at_one_end_and_leave_the_plate_at_the_other(
    start: float, stop: float, low: float, high: float, turn: float
) -> None:
    before, after = end_errors(start, stop, low, high, turn)
    assert abs(before) < (0.8e-3 if low < start else 1.3e-3)
    assert abs(after) < (0.8e-3 if stop < high else 1.3e-3)


@pytest.mark.parametrize("shorter", [0.04, -0.01])
@pytest.mark.parametrize("turn", TURNS)
def test_a_bevel_that_goes_on_past_its_partner_is_not_followed(turn: float, shorter: float) -> None:
    """Two bevelled plates, one of them shorter: the groove ends with it; 20 mm below lies a table."""
    x, y = np.meshgrid(np.arange(-0.1, 0.1, SPACING), np.arange(-0.08, 0.08, SPACING))
    below = DEPTH * np.maximum(1 - np.abs(y) / (WIDTH / 2), 0.0)
    below = np.where((y < 0) & (x > shorter), 0.020, below)
    X_BP = Transform("BP", matrix_from_rotation_vector(np.array([0.0, 0.0, turn])), np.array([0.1, -0.5, 0.02]))
    points = X_BP.points(np.stack([x, y, -below], axis=-1).reshape(-1, 3))
    (seam,) = find_seams_profile(PointCloud(points=points, viewpoints=X_BP.p[None] + [0.0, 0.0, 0.45]), ProfileConfig()).seams
    found = np.sort(X_BP.inverse().points(seam.points_B[[0, -1]])[:, 0])
    assert abs(found[0] + 0.1) < 2.5e-3
    assert abs(found[1] - shorter) < 2.5e-3  # a cell of the parent surface is 2 mm wide


@pytest.mark.parametrize("slant", [0.6, -0.7])
def test_a_groove_that_leaves_its_plate_at_a_slant_ends_at_the_edge(slant: float) -> None:
    """The plate's edges lie at an angle to the groove: its middle ends where they cross it, and its line stays on it."""
    x, y = np.meshgrid(np.arange(-0.16, 0.16, SPACING), np.arange(-0.09, 0.09, SPACING))
    along = x - np.tan(slant) * y
    inside = np.abs(along) < 0.08
    below = DEPTH * np.maximum(1 - np.abs(y) / (WIDTH / 2), 0.0)
    points = np.stack([x, y - 0.5, -below], axis=-1)[inside]
    (seam,) = find_seams_profile(PointCloud(points=points, viewpoints=np.array([[0.0, -0.5, 0.45]])), ProfileConfig()).seams
    ends = np.sort(seam.points_B[[0, -1], 0])
    assert np.abs(ends - [-0.08, 0.08]).max() < 3e-3
    assert np.abs(seam.points_B[:, 1] + 0.5).max() < 0.5e-3


@pytest.mark.parametrize("radius", [0.185, 0.15])
def test_the_line_stays_on_a_bent_groove_up_to_an_edge_aslant(radius: float) -> None:
    """Past the edge on one side the groove is still followed by its other lip: straight on would be half a millimetre off."""
    x, y = np.meshgrid(np.arange(-0.1, 0.1, SPACING), np.arange(-0.09, 0.06, SPACING))
    off = np.hypot(x, y + radius) - radius
    below = DEPTH * np.maximum(1 - np.abs(off) / (WIDTH / 2), 0.0)
    points = np.stack([x, y - 0.5, -below], axis=-1).reshape(-1, 3)
    (seam,) = find_seams_profile(PointCloud(points=points, viewpoints=np.array([[0.0, -0.5, 0.45]])), ProfileConfig()).seams
    assert np.abs(np.sort(seam.points_B[[0, -1], 0]) - [-0.1, 0.1]).max() < 3e-3
    across = np.hypot(seam.points_B[:, 0], seam.points_B[:, 1] + 0.5 + radius) - radius
    assert np.abs(across).max() < 0.1e-3


def test_what_lies_beside_a_groove_tells_a_junction_from_a_plates_edge() -> None:
    """Past an edge nothing is seen, or something far below; at a junction the other groove, which is no plate either."""
    section = Section(middle=0.0, width=WIDTH, depth=DEPTH, floor=0.0, lean=0.0, blur=0.002)
    model = np.tile(np.r_[np.zeros(20), np.full(10, DEPTH), np.zeros(20)], (4, 1))
    depth = model.copy()
    depth[1, :20] = np.nan  # past the edge
    depth[2, 2:4] = 0.0035  # noise
    depth[3, 35:45] = 0.006  # another groove
    assert _meets_other(np.isfinite(depth), depth, model, section).tolist() == [False, False, False, True]


@pytest.mark.parametrize(("radius", "width", "depth"), [(185, 12, 6), (200, 14, 8)])
def test_an_end_aslant_as_a_depth_camera_sees_it(radius: int, width: int, depth: int, tmp_path: Path) -> None:
    """One view with the measured noise, the groove at 37 and 40 deg to the edge: each end within 3 mm, the last 10 mm within 1."""
    text = (Path(__file__).parents[3] / "scenes" / "straight.toml").read_text()
    (tmp_path / "one_view.toml").write_text("[[views]]".join(text.split("[[views]]")[:2]))
    sizes = [f'centre_line.radius="{radius} mm"', f'groove.width="{width} mm"', f'groove.depth="{depth} mm"']
    scene = load_scene(str(tmp_path / "one_view.toml"), ["centre_line.shape=arc", "fixture.clamps=0", *sizes])
    seen = look(scene, CellConfig(), seed=2)
    (seam,) = find_seams_profile(seen.cloud, ProfileConfig()).seams
    (known,) = seen.world.known_seams
    found = known_offsets(seam.points_B, known)
    assert np.abs(np.sort(found.s[[0, -1]]) - [0.0, known.length]).max() < 3e-3
    last = (seam.s < 0.010) | (seam.s > seam.length - 0.010)
    off = found.distance[last]
    assert np.percentile(off, 95) < 1e-3
    assert seam.sigma is not None
    assert (off < 2 * seam.sigma[last]).mean() > 0.9


@pytest.fixture(scope="module")
def measured() -> Fit:
    """A groove 120 mm long, whose plates and depth the tests below write by hand."""
    x, y = np.meshgrid(np.arange(-0.06, 0.06, SPACING), np.arange(-0.06, 0.06, SPACING))
    below = DEPTH * np.maximum(1 - np.abs(y) / (WIDTH / 2), 0.0)
    points = np.stack([x, y - 0.5, -below], axis=-1).reshape(-1, 3)
    atlas = make_atlas(PointCloud(points=points, viewpoints=np.array([[0.0, -0.5, 0.45]])))
    ((only,), _) = _search(atlas, atlas.coarse_lines(ProfileConfig(), 1.0)[0], ProfileConfig())
    return only.fit


def by_hand(
    fit: Fit, seen: slice, left: tuple[float, float], right: tuple[float, float], beside: float, spread: float = 0.0
) -> Fit:
    """The groove of amplitude 1 at some stations and `beside` elsewhere, and plates between two arc lengths [m] on its sides."""
    m = len(fit.rail)
    cells = [
        (s, side * (fit.inner + k * CELL))
        for side, (low, high) in ((1, left), (-1, right))
        for k in range(1, 6)
        for s in np.linspace(low, high, round((high - low) / CELL) + 1)
    ]
    weight, amplitude = np.zeros(m), np.full(m, beside)
    weight[seen] = amplitude[seen] = 1.0
    track = replace(fit.track, weight=weight, amplitude=amplitude, usual=1.0, spread=spread, alike=1.0, run_out=0.0)
    return replace(fit, parent=replace(fit.parent, cells=np.array(cells), support=np.ones((m, 2))), track=track)


@pytest.mark.parametrize("left_is_shorter", [False, True])
def test_a_groove_of_two_plates_begins_with_the_second_and_ends_with_the_first(measured: Fit, left_is_shorter: bool) -> None:
    """A cell reaches half its side beyond its middle."""
    step = measured.rail.step
    seen = slice(round(0.040 / step), round(0.070 / step) + 1)
    plates = ((0.022, 0.090), (0.038, 0.072)) if left_is_shorter else ((0.038, 0.090), (0.022, 0.072))
    span = seam_span(by_hand(measured, seen, *plates, beside=np.nan), ProfileConfig())
    np.testing.assert_allclose(span, [0.038 - CELL / 2, 0.072 + CELL / 2], atol=1e-9)


@pytest.mark.parametrize("turned", [34, 40, 50])
@pytest.mark.parametrize("at_stop", [True, False])
def test_a_groove_that_leaves_its_plate_at_a_corner_ends_there(measured: Fit, turned: int, at_stop: bool) -> None:
    """The plate's two edges, at right angles, meet on the groove; a cell counts that reaches onto the plate."""
    slope, step, s = np.tan(np.radians(turned)), measured.rail.step, np.arange(0.0, 0.12, CELL)
    cells = []
    for k in range(1, 6):
        x = measured.inner + k * CELL
        near = x - CELL / 2
        for side, edge in ((1, near / slope), (-1, near * slope)):  # how far before the corner that column ends
            inside = s - CELL / 2 < 0.085 - edge if at_stop else s + CELL / 2 > 0.035 + edge
            cells += [(at, side * x) for at in s[inside]]
    seen = slice(round(0.052 / step), round(0.068 / step) + 1)
    fit = by_hand(measured, seen, (0.0, 0.12), (0.0, 0.12), beside=1.0)
    fit = replace(fit, parent=replace(fit.parent, cells=np.array(cells)))
    span = seam_span(fit, ProfileConfig())
    assert span[at_stop] == pytest.approx(0.085 if at_stop else 0.035, abs=2.5e-3)


@pytest.mark.parametrize("hidden", [True, False])
def test_noise_hides_an_end_up_to_the_plates_edge_and_a_clear_end_is_where_the_depth_halves(measured: Fit, hidden: bool) -> None:
    """From 1 to 0.2 of the depth in one station, half of it is left after 5 / 8 of the way. With noise of 1 in the depth,
    9 stations of 0.2 on the way to the edge speak against a groove by 9 (1 - 2 * 0.2) / 2 = 2.7 alone (limit 3)."""
    step = measured.rail.step
    seen = slice(round(0.040 / step), round(0.070 / step) + 1)
    plate = (0.034, 0.078)
    fit = by_hand(measured, seen, plate, plate, beside=0.2, spread=1.0 if hidden else 0.01)
    clear = [seen.start * step - 0.625 * step, (seen.stop - 1) * step + 0.625 * step]
    wanted = [0.034 - CELL / 2, 0.078 + CELL / 2] if hidden else clear
    np.testing.assert_allclose(seam_span(fit, ProfileConfig()), wanted, atol=1e-9)
