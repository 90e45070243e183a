"""`weldsim regress` and the call behind it: figures do not depend on how they were made, what is worse is said."""

import base64
import json
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import weldsim
from tests.clouds import groove_cloud
from weldsim.cli import main
from weldsim.cloud.files import read_cloud
from weldsim.config import CellConfig
from weldsim.errors import InputError
from weldsim.records import PointCloud, SeamFindings
from weldsim.regression import Golden, Regression, default_golden, read_golden, regress, updated, write_golden
from weldsim.regression.golden import Entry
from weldsim.regression.recorded import figures_of_cloud, read_known_seam
from weldsim.regression.text import refusals
from weldsim.seam.find import find_seams

pytestmark = pytest.mark.render


def finds_nothing(cloud: PointCloud) -> SeamFindings:
    """A finder of the user's own that never finds anything."""
    return SeamFindings(seams=(), region=np.zeros(len(cloud), np.int32), method="nothing")


def finds_as_ours(cloud: PointCloud) -> SeamFindings:
    """A finder of the user's own that is weldsim's."""
    return find_seams(cloud, CellConfig().seam)


def timeless(outcome: Regression) -> list[dict[str, object]]:
    """Every figure that is not a time."""
    return [{k: v for k, v in row.figures.judged().items() if k != "seconds"} for row in outcome.rows]


@pytest.fixture(scope="module")
def outcome() -> Regression:
    """Straight and plain by the default method and by the two finders above, one seed."""
    finders = {"nothing": finds_nothing, "ours": finds_as_ours}
    return regress(["straight", "plain"], methods=("profile",), finders=finders, seeds=1)


def test_rows_come_in_the_order_asked_for(outcome):
    asked = [(scene, method, 0) for scene in ("straight", "plain") for method in ("profile", "nothing", "ours")]
    assert [(row.figures.scene, row.figures.method, row.figures.seed) for row in outcome.rows] == asked
    assert outcome.passed
    assert not any(row.judged for row in outcome.rows)


def test_figures_are_those_of_the_known_seam(outcome):
    ours, nothing = (outcome.of("straight", method)[0].figures for method in ("profile", "nothing"))
    assert (ours.known, ours.found, ours.missed, ours.phantoms) == (1, 1, 0, 0)
    assert 0 < ours.mean < ours.p95 < ours.max < 1.5e-3
    assert ours.coverage > 0.9
    assert ours.iou > 0.8
    assert (nothing.missed, nothing.coverage, nothing.mean, nothing.iou) == (1, 0.0, None, 0.0)
    plain = outcome.of("plain", "profile")[0].figures
    assert "mean" not in plain.judged()
    assert plain.judged()["phantoms"] == 0


def test_a_finder_of_ones_own_is_judged_as_ours(outcome):
    rows = timeless(outcome)
    assert rows[0] == rows[2]
    assert rows[3] == rows[5]


def test_why_a_finder_of_ones_own_gave_nothing_is_said_once_a_reason(outcome):
    said = "finder mine: raised ValueError: no luck"
    rows = [
        replace(row, figures=replace(row.figures, method=method, seed=seed, refused=said))
        for row in outcome.of("straight", "profile")
        for method, seed in (("mine", 0), ("mine", 2), ("thesis", 0))
    ]
    assert refusals(replace(outcome, rows=tuple(rows))) == [f"straight, mine, seeds 0, 2: {said}"]
    assert refusals(outcome) == []


@pytest.mark.parametrize(("returned", "code"), [("None", 0), ("1 / 0", 1), ("'line'", 1), ("cloud.points * 1e3", 1)])
def test_a_finder_that_fails_fails_the_run_and_one_that_finds_nothing_does_not(returned, code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(f"def find(cloud):\n    return {returned}\n")
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    words = ["regress", "--scenes", "plain", "--methods", "mine.py:find", "--seeds", "1", "--jobs", "1", "--junit", "out.xml"]
    assert main([*words, "--sensor", "exact"]) == code
    out = capsys.readouterr().out
    assert ("FAILED 1 plan, by a fault of the finder's own" in out) is bool(code)
    assert ('type="FinderFailed"' in (tmp_path / "out.xml").read_text()) is bool(code)


def test_figures_do_not_depend_on_processes(outcome):
    twice = regress(["straight", "plain"], methods=("profile",), finders={"nothing": finds_nothing}, seeds=1, jobs=2)
    assert timeless(twice) == [figures for k, figures in enumerate(timeless(outcome)) if k % 3 != 2]


def test_bad_arguments_are_refused():
    for arguments in ({"seeds": 0}, {"jobs": 0}, {"methods": ()}, {"methods": ("profile", "profile")}):
        with pytest.raises(InputError):
            regress(["straight"], **arguments)
    for scenes in ([], ["straight", "straight"], ["no-such-scene"]):
        with pytest.raises(InputError):
            regress(scenes)


def tightened(path: Path, by: float) -> Path:
    """The golden figures of straight by the default method, as if the mean had once been smaller by `by` [m]."""
    golden = read_golden(default_golden())
    entries = golden.entries("straight", "profile")
    mean = replace(entries["mean"], values=tuple(value - by for value in entries["mean"].values), tolerance=0.01e-3)
    return write_golden(path, Golden(reason="for a test", scenes={"straight": {"profile": entries | {"mean": mean}}}))


def test_the_command_passes_on_the_recorded_figures_and_fails_when_one_is_tightened(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["regress", "--scenes", "straight", "--methods", "profile", "--seeds", "1", "--jobs", "1"]
    assert main([*words, "--json"]) == 0, capsys.readouterr().out
    said = json.loads(capsys.readouterr().out)
    assert said["passed"]
    assert [row["judged"] for row in said["rows"]] == [True]
    assert list(tmp_path.iterdir()) == []

    tight = tightened(tmp_path / "tight.json", 0.1e-3)
    assert main([*words, "--golden", str(tight), "--junit", "out.xml", "--html", "out.html"]) == 1
    out, err = capsys.readouterr()
    assert err == ""
    assert "WORSE straight, profile, seed 0: cross-track mean" in out
    assert re.search(r"worse by 0\.\d{3} mm \(tolerance 0\.010 mm\)", out)
    assert "left runs/regress/straight-profile-0" in out
    check_junit(tmp_path / "out.xml")
    check_page((tmp_path / "out.html").read_text())
    left = {path.name for path in (tmp_path / "runs/regress/straight-profile-0").iterdir()}
    assert {"config.json", "cloud.ply", "path.json", "report.html", "report.png", "run.json"} <= left
    config = json.loads((tmp_path / "runs/regress/straight-profile-0/config.json").read_text())
    assert config["seed"] == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.html", "out.xml", "runs", "tight.json"]


def test_the_published_method_is_judged_over_its_seeds(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["regress", "--scenes", "plain", "--methods", "thesis", "--golden", "golden.json", "--jobs", "1"]

    def entry(values: list[float]) -> Entry:
        return Entry(values=tuple(values), tolerance=0.0, reason="for a test", judge="distribution")

    alike = {"missed": entry([0.0] * 40), "phantoms": entry([float(k % 12) for k in range(40)])}
    write_golden("golden.json", Golden(scenes={"plain": {"thesis": alike}}))
    assert main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [row["judged"] for row in said["rows"]] == [True] * 3
    assert said["over_all_seeds"] == {"false_alarm_rate": 0.01, "tests": 2, "worse": []}

    write_golden("golden.json", Golden(scenes={"plain": {"thesis": alike | {"phantoms": entry([0.0] * 40)}}}))
    assert main([*words, "--junit", "out.xml", "--html", "out.html"]) == 1
    out = capsys.readouterr().out
    assert "WORSE plain, thesis, 3 seeds: phantom seams median" in out
    assert "1 figure is worse than golden.json allows" in out
    suites = {suite.get("name"): suite for suite in ElementTree.parse("out.xml").getroot()}
    assert [suites[name].get("failures") for name in ("plain", "all seeds together")] == ["0", "1"]
    failure = suites["all seeds together"].find("testcase/failure")
    assert failure is not None
    assert "phantom seams" in (failure.get("message") or "")
    assert "phantom seams median" in Path("out.html").read_text()

    assert main([*words, "--seeds", "1"]) == 0
    assert "thesis: too few seeds to tell worse from chance" in capsys.readouterr().out


def check_junit(path: Path) -> None:
    """One suite with one failed case, counted as such, as continuous-integration systems read it."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == "testsuites"
    (suite,) = root
    (case,) = suite
    for element in (root, suite):
        counts = [element.get(name) for name in ("tests", "failures", "errors", "skipped")]
        assert counts == ["1", "1", "0", "0"]
        assert float(element.get("time", "")) > 0
    assert suite.get("name") == "straight"
    assert (case.tag, case.get("classname"), case.get("name")) == ("testcase", "straight.profile", "seed 0")
    failure = case.find("failure")
    assert failure is not None
    assert "cross-track mean" in (failure.get("message") or "")
    assert failure.get("type")
    assert "straight-profile-0" in (failure.text or "")
    assert "mean" in (case.findtext("system-out") or "")


def check_page(text: str) -> None:
    """The page names what is worse, carries its pictures and loads nothing."""
    assert "WORSE" in text
    assert "cross-track mean" in text
    assert not re.search(r"(src|href)=\"(?!data:)|url\(|https?:", text)
    _, _, rest = text.partition("data:image/jpeg;base64,")
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(rest.partition('"')[0]), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[1] == 1000
    assert picture.std() > 20


def test_an_update_rewrites_with_a_reason_and_then_nothing_is_worse(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["regress", "--scenes", "plain", "--methods", "profile", "--seeds", "1", "--jobs", "1", "--golden", "mine.json"]
    assert main([*words, "--update", "--reason", "a new scene"]) == 0
    golden = read_golden("mine.json")
    assert golden.reason == "a new scene"
    assert set(golden.scenes) == {"plain"}
    assert main(words) == 0
    assert "nothing is worse" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["mine.json"]


def test_recorded_figures_judge_the_sensor_they_were_recorded_with(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["regress", "--scenes", "straight", "--methods", "profile", "--seeds", "1", "--jobs", "1", "--sensor", "exact"]
    assert main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["sensor"], said["golden"]) == ("exact", None)
    (row,) = said["rows"]
    assert not row["judged"]
    assert row["figures"]["mean"] < 0.05e-3  # no noise
    tight = tightened(tmp_path / "tight.json", 1e-3)
    assert main([*words, "--golden", str(tight), "--keep", "kept"]) == 1
    assert "WORSE straight, profile, seed 0: cross-track mean" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["--scenes", "no-such-scene"],
        ["--scenes", "missing.toml"],
        ["--scenes", "straight", "straight"],
        ["--methods", "magic"],
        ["--seeds", "0"],
        ["--seeds", "-1"],
        ["--jobs", "0"],
        ["--golden", "broken.json"],
        ["--golden", "missing.json"],
        ["--junit", "no/folder/out.xml"],
        ["--junit", "out.txt"],
        ["--junit", "."],
        ["--html", "out.png"],
        ["--html", "no/folder/out.html"],
        ["--junit", "broken.json"],
        ["--keep", "broken.json/kept"],
        ["--update"],
        ["--update", "--reason", " "],
        ["--reason", "why"],
        ["--sensor", "sonar"],
        ["--update", "--reason", "why", "--sensor", "exact"],
        ["--update", "--reason", "why", "--set", "path.speed=6 mm/s", "--golden", "x.json"],
        ["--update", "--reason", "why", "--golden", "no/folder/x.json"],
        ["--set", "scene.groove.width=10 mm"],
        ["--set", "seam.methd=thesis"],
    ],
    ids=" ".join,
)
def test_bad_input_is_one_line_and_writes_nothing(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.json").write_text("{")
    assert main(["regress", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert [path.name for path in tmp_path.iterdir()] == ["broken.json"]


def test_a_view_out_of_reach_is_said_and_not_an_end(tmp_path):
    from weldsim.config import apply_overrides, load_toml, structure
    from weldsim.scene.config import SceneConfig
    from weldsim.scene.files import scene_path

    tables = apply_overrides(
        {"name": "far", **load_toml(scene_path("straight"))},
        ["pose.x=400 mm", "pose.y=-600 mm", "pose.clearance=700 mm", "fixture.clamps=0", "name=far"],
    )
    far = structure(tables, SceneConfig)
    seen = regress([far], methods=("profile",), seeds=1)
    assert "scan view" in seen.rows[0].figures.refused
    assert (seen.rows[0].figures.missed, seen.passed) == (1, True)
    near = regress([replace(far, pose=replace(far.pose, x=0.0, y=-0.45, clearance=0.0))], methods=("profile",), seeds=1)
    golden = updated(Golden(), [row.figures for row in near.rows], "where it was in reach")
    worse = regress([far], methods=("profile",), seeds=1, golden=golden, keep=tmp_path)
    assert "missed" in {deviation.figure for deviation in worse.deviations}
    assert json.loads((tmp_path / "far-profile-0" / "run.json").read_text())["refused"]


def test_a_recorded_cloud_is_judged_against_a_seam_in_a_csv(tmp_path):
    made = groove_cloud(np.random.default_rng(1), noise="iid", sigma=0.0002)
    rows = np.hstack([made.seam.opening_B, -made.seam.bisectors_B])
    np.savetxt(tmp_path / "seam.csv", rows, delimiter=",")
    known = read_known_seam(tmp_path / "seam.csv")
    assert known.length == pytest.approx(made.seam.length, rel=1e-6)
    figures = figures_of_cloud("mine", made.cloud, known, has_axes=True)
    assert (figures.missed, figures.phantoms) == (0, 0)
    assert figures.mean < 0.4e-3
    assert figures.axis_p95 < np.deg2rad(4)
    np.savetxt(tmp_path / "bare.csv", made.seam.opening_B, delimiter=",")
    bare = figures_of_cloud("mine", made.cloud, read_known_seam(tmp_path / "bare.csv"))
    assert bare.axis_p95 is None
    assert bare.mean == pytest.approx(figures.mean, abs=1e-6)
    assert len(read_cloud(tmp_path / "bare.csv")) == len(made.seam.opening_B)
    np.savetxt(tmp_path / "dot.csv", np.tile(made.seam.opening_B[:1], (5, 1)), delimiter=",")
    with pytest.raises(InputError):
        read_known_seam(tmp_path / "dot.csv")


def regress_and_press(after, tmp_path, *, background=False):
    """Exit code and output of a `regress` with two workers, all of which get Ctrl-C `after` their start [s].

    background: started as a shell starts what ends in `&`, with the key ignored.
    """
    words = ["regress", "--scenes", "straight", "curve", "--methods", "profile", "--seeds", "2", "--jobs", "2", "--html", "a.html"]
    command = subprocess.Popen(
        [sys.executable, "-m", "weldsim", *words],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(weldsim.__file__).parents[1])},
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN if background else signal.SIG_DFL),
    )
    children = Path(f"/proc/{command.pid}/task/{command.pid}/children")
    deadline = time.monotonic() + 60.0
    while len(children.read_text().split()) < 2 and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(after)
    os.killpg(command.pid, signal.SIGINT)
    said = command.communicate(timeout=120)
    return command.returncode, *said


@pytest.mark.parametrize("after", [0.0, 2.0])
def test_a_key_that_interrupts_leaves_one_line_and_no_file(after, tmp_path):
    """The workers get it too, as they begin, wait or work."""
    assert regress_and_press(after, tmp_path) == (130, "", "weldsim: interrupted\n")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_in_the_background_the_key_is_ignored_by_command_and_workers(tmp_path):
    code, _, _ = regress_and_press(1.0, tmp_path, background=True)
    assert code in (0, 1), "it goes on to its verdict"
    assert (tmp_path / "a.html").is_file()
