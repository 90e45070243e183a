"""The report's page: a still picture where a browser draws no 3D, and panels that are named for what they hold."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.unit.report.test_pictures import CLOUD, FOUND, INSIDE, KNOWN, LOG, PATH, REPORT, SEAM
from weldsim.kinematics import JOINT_NAMES
from weldsim.records import PointCloud, SeamFindings
from weldsim.report import figures
from weldsim.report.html import write_html
from weldsim.report.limits import ReportConfig
from weldsim.report.png import png
from weldsim.report.view import ErrorLine

STILL = png(REPORT, CLOUD, FOUND, (PATH,), log=LOG, known=(KNOWN,))
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def headings(text: str) -> list[str]:
    return re.findall("<h2>(.*?)</h2>", text)


def test_a_panel_is_named_for_what_the_seam_has(tmp_path: Path) -> None:
    """A path file tells the standard deviation along its seam and no lips: there is no width along it to show."""
    for change, title in (
        ({}, "Standard deviation and width along the seam"),
        ({"left_B": None, "right_B": None}, "Standard deviation along the seam"),
        ({"sigma": None}, "Width along the seam"),
        ({"sigma": None, "left_B": None, "right_B": None}, None),
    ):
        seam = replace(SEAM, **change)
        found = SeamFindings(seams=(seam,), region=FOUND.region)
        text = write_html(tmp_path / "a.html", REPORT, CLOUD, found, (PATH,)).read_text()
        assert [head for head in headings(text) if head.endswith("along the seam")] == ([title] if title else [])


def test_a_panel_without_widths_has_no_scale_for_them() -> None:
    bare = figures.uncertainty(replace(SEAM, left_B=None, right_B=None))["layout"]
    assert "yaxis2" not in bare
    full = figures.uncertainty(SEAM)["layout"]
    assert full["yaxis2"]["title"]["text"] == "width [mm]"
    assert full["margin"]["r"] > bare["margin"]["r"]


def test_the_scene_is_named_for_what_it_shows(tmp_path: Path) -> None:
    bare = PointCloud(points=SEAM.points_B, frame="B")
    nothing = SeamFindings(seams=(), region=0 * FOUND.region)
    two = SeamFindings(seams=(SEAM, SEAM), region=FOUND.region)
    for cloud, found, paths, title in (
        (CLOUD, FOUND, (PATH,), "Cloud, seam and torch path in the robot base"),
        (bare, FOUND, (PATH,), "Seam and torch path in the robot base"),
        (CLOUD, FOUND, (None,), "Cloud and seam in the robot base"),
        (CLOUD, two, (PATH, None), "Cloud, seams and torch path in the robot base"),
        (CLOUD, nothing, (), "Cloud in the robot base"),
    ):
        text = write_html(tmp_path / "a.html", REPORT, cloud, found, paths).read_text()
        assert headings(text)[1 if "Figures and limits" in headings(text) else 0] == title
    assert INSIDE.any()


def test_the_titles_of_the_axes_are_short() -> None:
    """A long title is cut off at the edge of a narrow page, or of a flat cloud: the heading says which frame it is."""
    scene = figures.scene(CLOUD, FOUND, (PATH,), (), ())["layout"]["scene"]
    assert [scene[f"{name}axis"]["title"]["text"] for name in "xyz"] == ["x [mm]", "y [mm]", "z [mm]"]


def test_the_still_picture_is_on_the_page(tmp_path: Path) -> None:
    text = write_html(tmp_path / "a.html", REPORT, CLOUD, FOUND, (PATH,), still=STILL).read_text().split("<script>")[0]
    (found,) = re.findall(r'src="data:image/png;base64,([^"]+)"', text)
    assert base64.b64decode(found) == STILL
    assert re.search(r'data-still="figure-1"><p>This browser draws no 3D figure', text)
    without = write_html(tmp_path / "b.html", REPORT, CLOUD, FOUND, (PATH,)).read_text().split("<script>")[0]
    assert "This browser draws no 3D figure" in without
    assert "data:image/png" not in without


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
@pytest.mark.parametrize(
    ("flags", "hidden"), [(["--disable-gpu", "--disable-3d-apis"], "place"), (["--enable-unsafe-swiftshader"], "still")]
)
def test_a_browser_shows_either_the_figure_or_the_still_picture(tmp_path: Path, flags: list[str], hidden: str) -> None:
    page = write_html(tmp_path / "a.html", REPORT, CLOUD, FOUND, (PATH,), log=LOG, still=STILL)
    command = [str(BROWSER), "--headless=new", "--no-sandbox", f"--user-data-dir={tmp_path / 'profile'}", *flags]
    done = subprocess.run(
        [*command, "--virtual-time-budget=10000", "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    body = done.stdout[: done.stdout.rindex("<script>")]
    (still,) = re.findall(r"<div [^>]*data-still=[^>]*>", body)
    (place,) = re.findall(r'<div id="figure-1"[^>]*>', body)
    assert ("hidden" in still) == (hidden == "still")
    assert ("hidden" in place) == (hidden == "place")
    assert 'class="js-plotly-plot"' in re.findall(r'<div id="figure-2"[^>]*>', body)[0], "other figures are drawn all the same"


def test_seams_of_a_file_were_found_by_no_method(tmp_path: Path) -> None:
    for method, said in (("profile", "; method profile"), ("path file", "; seams from a path file")):
        text = write_html(tmp_path / "a.html", replace(REPORT, method=method), CLOUD, FOUND, (PATH,)).read_text()
        assert said in text
        assert "method path file" not in text
    assert "seam in the path file" in text
    assert "seam found" not in text
    assert "Candidates refused" not in headings(text), "nothing was looked for"


def test_joints_have_the_names_that_the_dry_run_gives_them(tmp_path: Path) -> None:
    text = write_html(tmp_path / "a.html", REPORT, CLOUD, FOUND, (PATH,), log=LOG).read_text()
    drawn, _ = json.JSONDecoder().raw_decode(text, text.rindex("const FIGURES=") + 14)
    (angles,) = [
        figure for figure in drawn if figure["layout"].get("yaxis", {}).get("title", {}).get("text") == "joint angle [deg]"
    ]
    assert [line["name"] for line in angles["data"]] == [name.replace("_", " ") for name in JOINT_NAMES]


@pytest.mark.parametrize("worst", [0.1e-3, 3e-3, 30e-3])
def test_the_limits_of_the_distance_are_in_view_and_their_labels_apart(worst: float) -> None:
    """Beside a line that is far off, the limits lie close together."""
    s = np.linspace(0.0, 0.2, 50)
    line = ErrorLine(s=s, across=0 * s, distance=worst * s / s[-1])
    config = ReportConfig()
    layout = figures.errors_distance({"plan": line}, config)["layout"]
    low, high = layout["yaxis"]["range"]
    assert low == 0
    assert high > 1e3 * max(worst, config.max)
    levels = [shape["y0"] for shape in layout["shapes"]]
    assert levels == pytest.approx([0.4, 0.8, 1.2])
    assert [label["text"] for label in layout["annotations"]] == ["limit of<br>mean", "limit of<br>p95", "limit of<br>max"]
    pixels = np.array([label["y"] for label in layout["annotations"]]) * 220 / high  # of the plot's 220
    assert np.diff(pixels).min() >= 2 * 10 * 1.2, "two lines of 10 px"
    assert pixels.max() <= 220
    if worst < 1e-3:
        assert [label["y"] for label in layout["annotations"]] == levels
