"""Page and picture: valid figures, nothing fetched from a network, the same bytes each time, with a seam or without."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tests.seams import findings, found_seam, plate_cloud, sine_seam, torch_path, weld_log
from weldsim.errors import OutputError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import PointCloud, Rejection, Seam, SeamFindings, Threshold
from weldsim.report import figures
from weldsim.report.html import write_html
from weldsim.report.limits import ReportConfig
from weldsim.report.plane import Seen, Unrolled, plane_of
from weldsim.report.png import OBLIQUE, _headline, _oblique, _plan_view, _window, write_png
from weldsim.report.view import cross_section, error_lines, heights, shown, shows_surface, torch_axes, view_frame
from weldsim.report.weld import weld_report

RNG = np.random.default_rng(7)
KNOWN = sine_seam(RNG)
CLOUD, INSIDE = plate_cloud(KNOWN, RNG, n=15_000)
SEAM = found_seam(KNOWN, 2e-4 * np.sin(KNOWN.s / 0.02))
PATH = torch_path(SEAM)
LOG = weld_log(PATH, RNG, jitter=1e-6)
FOUND = SeamFindings(
    seams=(SEAM,),
    region=INSIDE.astype(np.int32),
    rejected=(Rejection(position_B=(0.1, -0.5, 0.2), length=0.09, reason="material on <one> side only"),),
    threshold=Threshold(name="depth", value=1e-3, unit="m", noise=3e-4, stability={"0.5": 1e-5, "2": float("inf")}),
)
REPORT = weld_report(FOUND, (PATH,), scene="sine <script>", log=LOG, known=(KNOWN,), true_region=INSIDE, timing={"seam": 0.1})
NONE = weld_report(findings((), INSIDE), (), scene="plate", known=())


def all_figures() -> dict[str, figures.Figure]:
    lines = error_lines(FOUND, (PATH,), LOG, (KNOWN,), 0)
    speed = figures.torch_speed(LOG, PATH, ReportConfig())
    assert speed is not None
    return {
        "scene": figures.scene(CLOUD, FOUND, (PATH,), (LOG,), (KNOWN,)),
        "empty scene": figures.scene(CLOUD, findings((), INSIDE), (), (), ()),
        "uncertainty": figures.uncertainty(SEAM),
        "section": figures.section(cross_section(CLOUD, SEAM)),
        "across": figures.errors_across(lines),
        "distance": figures.errors_distance(lines, ReportConfig()),
        "speed": speed,
        "q": figures.joints(LOG, "q", ("a", "b", "c", "d", "e", "f")),
        "qd": figures.joints(LOG, "qd", ("a", "b", "c", "d", "e", "f")),
    }


def test_a_path_file_has_no_surface_to_show(tmp_path: Path) -> None:
    """Its cloud is the seam itself: no height map, no section of one point, and the whole of it in view."""
    bare = PointCloud(points=SEAM.points_B, frame="B")
    found = SeamFindings(seams=(SEAM,), region=np.zeros(len(SEAM.points_B), np.int32), method="path file")
    assert shows_surface(CLOUD, (SEAM,))
    assert not shows_surface(bare, (SEAM,))
    drawn = figures.scene(bare, found, (PATH,), (LOG,), ())
    assert "cloud" not in [trace["name"] for trace in drawn["data"]]
    assert max(drawn["layout"]["scene"]["aspectratio"].values()) <= figures.LONGEST + 1e-9
    text = write_html(tmp_path / "r.html", REPORT, bare, found, (PATH,), log=LOG).read_text()
    assert "<h2>Torch speed</h2>" in text
    assert "<h2>Mean cross-section</h2>" not in text
    assert write_png(tmp_path / "r.png", REPORT, bare, found, (PATH,), log=LOG).stat().st_size > 10_000


def test_every_figure_is_one_that_plotly_accepts() -> None:
    for name, figure in all_figures().items():
        checked = go.Figure(figure)  # raises on a property that plotly does not know
        assert len(checked.data) >= 1, name


def test_page_holds_everything_and_asks_no_network(tmp_path: Path) -> None:
    text = write_html(tmp_path / "r.html", REPORT, CLOUD, FOUND, (PATH,), log=LOG, known=(KNOWN,)).read_text()
    assert "default-src 'none'" in text
    # One copy of the library; outside of it there is no address at all.
    library = max(re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL), key=len)
    assert len(library) > 3_000_000
    rest = text.replace(library, "")
    assert len(rest) < 2_000_000
    assert not re.search(r"https?://|//cdn|src=|@import|url\(", rest)
    assert "sine &lt;script&gt;" in rest
    assert "sine <script>" not in rest
    assert "material on &lt;one&gt; side only" in rest
    assert "seam lost" in rest
    for reason in ("plan, cross-track mean", "executed tip from plan, p95", "PASSED"):
        assert reason in rest


@pytest.mark.parametrize("write", [write_html, write_png])
def test_the_same_job_gives_the_same_bytes(tmp_path: Path, write) -> None:
    first = write(tmp_path / "a", REPORT, CLOUD, FOUND, (PATH,), log=LOG, known=(KNOWN,)).read_bytes()
    assert write(tmp_path / "b", REPORT, CLOUD, FOUND, (PATH,), log=LOG, known=(KNOWN,)).read_bytes() == first
    plan_only = write(tmp_path / "c", REPORT, CLOUD, FOUND, (PATH,)).read_bytes()
    assert plan_only != first
    write(tmp_path / "d", NONE, CLOUD, findings((), INSIDE), ())
    with pytest.raises(OutputError):
        write(tmp_path / "none" / "a", NONE, CLOUD, findings((), INSIDE), ())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b", "c", "d"]


def test_picture_has_the_size_of_a_slide(tmp_path: Path) -> None:
    data = write_png(tmp_path / "p.png", REPORT, CLOUD, FOUND, (PATH,)).read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert (int.from_bytes(data[16:20]), int.from_bytes(data[20:24])) == (1600, 900)


def test_cross_section_is_the_groove_that_was_cut() -> None:
    cut = cross_section(CLOUD, SEAM)
    true = np.where(np.abs(cut.across) < 0.007, -0.008 * (1 - np.abs(cut.across) / 0.007), 0.0)
    assert np.abs(cut.median - true).max() < 1.5e-3
    assert np.abs(cut.median - true)[np.abs(cut.across) > 0.01].max() < 4e-4
    assert (cut.low <= cut.median).all()
    assert (cut.median <= cut.high).all()
    assert cut.lips is not None
    assert np.allclose(cut.lips, [[0.007, 0.0], [-0.007, 0.0]], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_view_follows_the_part(seed: int) -> None:
    """Heights and thinning do not depend on where the part stands."""
    rng = np.random.default_rng(seed)
    X = Transform("BP", matrix_from_rotation_vector(rng.normal(size=3)), rng.uniform(-0.3, 0.3, 3))
    frame = view_frame(CLOUD, (SEAM,))
    assert abs(np.linalg.det(frame.R) - 1) < 1e-9
    assert np.allclose(frame.R[:, 2], SEAM.normals_B[0], atol=1e-9)
    height = heights(CLOUD.points, (SEAM,), frame)
    assert np.abs(height[~INSIDE]).max() < 3e-3
    moved = type(SEAM)(
        points_B=X.points(SEAM.points_B),
        s=SEAM.s,
        tangents_B=X.vectors(SEAM.tangents_B),
        normals_B=X.vectors(SEAM.normals_B),
    )
    cloud = type(CLOUD)(points=X.points(CLOUD.points))
    assert np.allclose(heights(cloud.points, (moved,), view_frame(cloud, (moved,))), height, atol=1e-9)
    index = shown(cloud, (moved,), 1000)
    assert 0 < len(index) <= 1000
    assert np.array_equal(index, shown(CLOUD, (SEAM,), 1000))


def test_torch_axes_start_at_the_tip_and_go_back_along_the_wire() -> None:
    axes = torch_axes(PATH, every=0.01, length=0.03)
    assert len(axes) == int(PATH.s[-1] / 0.01) + 1
    wire = (axes[:, 0] - axes[:, 1]) / 0.03
    assert np.allclose(wire, -SEAM.normals_B[0], atol=1e-6)
    assert np.linalg.norm(axes[:, 0] - PATH.X_BT.p[0], axis=1)[0] < 1e-12


def test_all_of_the_scene_is_in_view_with_room_for_its_labels() -> None:
    """Corners of the drawn box as plotly's camera sees them: 45 deg high, on a page half as wide again as high."""
    for seams in ((SEAM,), ()):
        found = SeamFindings(seams=seams, region=np.zeros(len(CLOUD), np.int32), method="profile")
        layout = figures.scene(CLOUD, found, (PATH,) * len(seams), (), ())["layout"]["scene"]
        shape, eye, up = (
            np.array([box[name] for name in "xyz"])
            for box in (layout["aspectratio"], layout["camera"]["eye"], layout["camera"]["up"])
        )
        back = eye / np.linalg.norm(eye)
        right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape / 2
        ahead = (eye - corners) @ back
        half = ahead * np.tan(np.pi / 8)
        high, wide = np.abs(corners @ np.cross(back, right)) / half, np.abs(corners @ right) / half / figures.WIDER
        assert ahead.min() > 0.1
        assert 0.6 < max(high.max(), wide.max()) < 0.9


def folded(angle: float) -> tuple[Seam, PointCloud]:
    """A seam along x that goes over an edge bent down by `angle` [rad] at 100 mm of its 200 mm, and its two faces."""
    s = np.linspace(0.0, 0.2, 201)
    down = np.where(s > 0.1, angle, 0.0)
    along = np.stack([np.cos(down), np.zeros_like(s), -np.sin(down)], axis=1)
    normal = np.stack([np.sin(down), np.zeros_like(s), np.cos(down)], axis=1)
    corner = np.array([0.1, 0.0, 0.0])
    line = np.where((s > 0.1)[:, None], corner + (s - 0.1)[:, None] * along, s[:, None] * along)
    across = np.array([0.0, 1.0, 0.0])
    faces = np.concatenate([line + y * across for y in np.linspace(-0.03, 0.03, 61)])
    seam = Seam(points_B=line, s=s, tangents_B=along, normals_B=normal, left_B=line + 0.005 * across, right_B=line - 0.005 * across)
    return seam, PointCloud(points=faces, frame="B")


def test_a_seam_over_edges_is_unrolled_and_no_other() -> None:
    seam, cloud = folded(np.pi / 2 * 1.2)
    plane = plane_of(cloud, (seam,))
    assert isinstance(plane, Unrolled)
    flat = plane.points(cloud.points)
    y, s = np.repeat(np.linspace(-0.03, 0.03, 61), 201), np.tile(seam.s, 61)
    clear = np.abs(s - 0.1) > 0.035  # beside the edge a point may be nearest to the other face
    assert np.abs(flat - np.stack([s, y, np.zeros_like(s)], axis=1))[clear].max() < 1e-9
    before = plane.points(seam.points_B[:1] - 0.02 * seam.tangents_B[:1])
    assert before[0] == pytest.approx([-0.02, 0.0, 0.0], abs=1e-9)
    wire = np.stack([seam.points_B, seam.points_B + 0.03 * seam.normals_B], axis=1)
    assert plane.arrows(wire)[:, 1] - plane.arrows(wire)[:, 0] == pytest.approx(np.tile([0.0, 0.0, 0.03], (201, 1)), abs=1e-9)
    slight, bend = folded(0.6)
    assert isinstance(plane_of(bend, (slight,)), Seen)
    assert isinstance(plane_of(CLOUD, (SEAM,)), Seen)
    assert isinstance(plane_of(CLOUD, ()), Seen)


def test_an_unrolled_view_can_be_drawn(tmp_path: Path) -> None:
    seam, cloud = folded(np.pi / 2)
    found = SeamFindings(seams=(seam,), region=np.zeros(len(cloud), np.int32), method="profile")
    path = torch_path(seam)
    report = weld_report(found, (path,), scene="edge")
    assert report.seed is None
    assert write_png(tmp_path / "p.png", report, cloud, found, (path,)).stat().st_size > 10_000


def test_the_legend_lies_beside_the_drawing() -> None:
    figure = Figure(figsize=(16, 9), dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _plan_view(figure, axes, plane_of(CLOUD, FOUND.seams), CLOUD, FOUND, (PATH,), surface=True)
    figure.canvas.draw()
    legend = axes.get_legend()
    assert legend is not None
    assert not legend.get_window_extent().overlaps(axes.get_window_extent().shrunk(1.0, 0.99))


def test_a_seed_is_told_where_there_is_one(tmp_path: Path) -> None:
    known = weld_report(FOUND, (PATH,), scene="sine", known=(KNOWN,), seed=0)
    assert ", seed 0</p>" in write_html(tmp_path / "a.html", known, CLOUD, FOUND, (PATH,)).read_text()
    assert ", seed " not in write_html(tmp_path / "b.html", replace(known, seed=None), CLOUD, FOUND, (PATH,)).read_text()


def test_what_was_said_in_amber_is_marked_in_amber(tmp_path: Path) -> None:
    amber = replace(REPORT, warnings=("torch speed 40 % of the one asked for",))
    assert amber.passed
    assert '<ul class="reasons look"><li>torch speed' in write_html(tmp_path / "a.html", amber, CLOUD, FOUND, (PATH,)).read_text()
    failed = replace(REPORT, passed=False, reasons=("too far",))
    assert '<ul class="reasons"><li>too far' in write_html(tmp_path / "b.html", failed, CLOUD, FOUND, (PATH,)).read_text()


def test_of_several_seams_the_figures_say_whose_they_are(tmp_path: Path) -> None:
    """Length and width at the top are those of the seam that was welded."""
    half = len(SEAM.s) // 2
    short = found_seam(KNOWN, np.zeros(len(KNOWN.s)))
    short = replace(
        short,
        points_B=short.points_B[:half],
        s=short.s[:half],
        tangents_B=short.tangents_B[:half],
        normals_B=short.normals_B[:half],
        left_B=None,
        right_B=None,
        sigma=None,
    )
    both = SeamFindings(seams=(SEAM, short), region=INSIDE.astype(np.int32))
    report = weld_report(both, (PATH, None), scene="sine")
    text = write_html(tmp_path / "a.html", report, CLOUD, both, (PATH, torch_path(short)), welded=1).read_text()
    assert f"<b>{1e3 * short.length:.1f} mm</b><span>length of seam 2</span>" in text
    assert "<span>length</span>" in write_html(tmp_path / "b.html", REPORT, CLOUD, FOUND, (PATH,)).read_text()
    assert write_png(tmp_path / "a.png", report, CLOUD, both, (PATH, torch_path(short)), welded=1).stat().st_size > 10_000


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_stop_is_marked_over_the_seam_and_its_words_are_inside(share: float) -> None:
    s = share * float(PATH.s[-1])
    place = PATH.X_BT.p[int(share * (len(PATH.s) - 1))]
    drawn = figures.scene(CLOUD, FOUND, (PATH,), (LOG,), (), (place[0], place[1], place[2]))
    go.Figure(drawn)
    pole, mark = [trace for trace in drawn["data"] if trace["name"] == "stopped here"]
    assert pole["type"] == mark["type"] == "scatter3d"
    assert mark["text"] == ["stopped"]
    speed = figures.torch_speed(LOG, PATH, ReportConfig(), s)
    assert speed is not None
    (words,) = speed["layout"]["annotations"]
    assert words["xanchor"] == ("left" if share < 0.5 else "right")
    assert words["text"] == f"stopped at {1e3 * s:.1f} mm"


def test_each_spell_of_the_arc_is_shaded() -> None:
    t, on = np.arange(10.0), np.array([0, 1, 1, 0, 0, 1, 0, 1, 1, 1], bool)
    layout = figures.joints(replace(LOG, arc_on=np.zeros(len(LOG.t), bool)), "q", ("a",) * 6)["layout"]
    assert "shapes" not in layout
    assert layout["xaxis"]["title"]["text"] == "time [s]"
    figures.shade_arc(layout, t, on)
    assert [(band["x0"], band["x1"]) for band in layout["shapes"]] == [(1.0, 2.0), (5.0, 5.0), (7.0, 9.0)]
    assert "arc on where shaded" in layout["xaxis"]["title"]["text"]


@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0, 66.0, 90.0, 114.0, 150.0])
def test_wires_are_not_drawn_along_a_seam(angle: float) -> None:
    """Wires of a level seam are drawn as ever; where another seam runs that way, another direction is taken."""
    turn = matrix_from_rotation_vector(np.array([0.0, 0.0, np.deg2rad(angle)]))
    line = np.stack([np.linspace(0, 0.1, 50), np.zeros(50), np.zeros(50)], axis=1)
    normals = np.tile([0.0, 0.0, 1.0], (50, 1))
    along = np.tile([1.0, 0.0, 0.0], (50, 1))
    seams = tuple(Seam(points_B=line @ R.T, s=line[:, 0], tangents_B=along @ R.T, normals_B=normals) for R in (np.eye(3), turn))
    plane = Seen(X_BS=Transform("BS", np.eye(3), np.zeros(3)))
    found = _oblique(plane, SeamFindings(seams=seams, region=np.zeros(0, np.int32)))
    for seam in seams:
        ahead = seam.points_B[-1, :2] / np.linalg.norm(seam.points_B[-1, :2])
        assert abs(ahead[0] * found[1] - ahead[1] * found[0]) / np.linalg.norm(found) > 0.25
    if angle < 40:
        np.testing.assert_array_equal(found, OBLIQUE[0])


def test_a_floor_far_behind_does_not_push_the_part_into_a_corner() -> None:
    rng = np.random.default_rng(3)
    part, floor = rng.uniform(-0.2, 0.2, (9500, 3)), rng.uniform(1.0, 2.0, (500, 3))
    low, high = _window(np.concatenate([part, floor]), [])
    assert (low < -0.15).all()
    assert (high > 0.15).all()
    assert (high - low < 0.8).all()  # of 2.2 m in all
    low, high = _window(part, [])
    assert (low < -0.2).all()
    assert (high > 0.2).all()


def test_what_decided_the_verdict_stands_clear_of_the_facts() -> None:
    """Both stand in one line under the headline, and either may be long."""
    reason = "executed, cross-track mean 12.345 mm (limit <= 0.4 mm), and a clause that goes on for as long as it can in one line"
    failed = replace(REPORT, passed=False, reasons=(reason,))
    both = replace(FOUND, seams=(SEAM, SEAM))
    for method, found in (("profile", FOUND), ("path file", both), ("a.long.module.of.my.own:and_a_function", both)):
        figure = Figure(figsize=(16, 9), dpi=100)
        FigureCanvasAgg(figure)
        _headline(figure, replace(failed, method=method), found, 0, ReportConfig())
        facts, why = [text for text in figure.texts if text.get_position()[1] == 0.905]
        assert "seam" in facts.get_text()
        assert why.get_text().startswith("executed")
        assert not facts.get_window_extent().padded(10).overlaps(why.get_window_extent())
