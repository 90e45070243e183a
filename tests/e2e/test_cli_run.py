"""`weldsim run`, `scan` and `scenes` as their users start them, and the run directory they leave."""

import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.path_files import advice, stopped_at
from weldsim.cli import main
from weldsim.cli.run import Run
from weldsim.cloud.files import read_cloud
from weldsim.config import CellConfig, load_config, load_scene, structure, to_json
from weldsim.path.files import path_text, read_path_json
from weldsim.pipeline import finish, look, plan
from weldsim.records import WeldReport
from weldsim.report.limits import ReportConfig, checks
from weldsim.scene.config import SceneConfig, make_workpiece
from weldsim.scene.files import scene_names

pytestmark = pytest.mark.render

ONE_VIEW = ("--set", 'scene.views=[{standoff="400 mm"}]')
FILES = {
    *("config.json", "path.json", "path.csv", "cloud.ply", "depth.png", "depth.intrinsics.json", "depth.pose.json"),
    *("scan.npz", "report.json", "report.html", "report.png", "run.json"),
}


@pytest.fixture(scope="module")
def welded(tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The folder in which `weldsim run straight --seed 1 --json` was started, and the finished process."""
    folder = tmp_path_factory.mktemp("welded")
    command = [sys.executable, "-c", "import sys; from weldsim.cli import main; sys.exit(main())"]
    words = ["run", "straight", "--seed", "1", "--json"]
    return folder, subprocess.run([*command, *words], cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def test_a_run_says_its_verdict_and_leaves_one_folder(welded):
    folder, done = welded
    report = json.loads(done.stdout)
    assert done.stderr == ""
    assert done.returncode == (0 if report["passed"] else 1)
    assert [path.name for path in folder.iterdir()] == ["runs"]  # no MUJOCO_LOG.TXT, no temporary files
    assert [path.name for path in (folder / "runs").iterdir()] == ["straight-1"]
    assert report["written"] == ["runs/straight-1"]
    made = folder / "runs" / "straight-1"
    views = {f"depth_{view}{path[5:]}" for view in (0, 1) for path in FILES if path.startswith("depth")}
    assert {path.name for path in made.iterdir()} == {path for path in FILES if not path.startswith("depth")} | views | {
        "log.npz",
        "views.json",
    }
    assert json.loads((made / "report.json").read_text())["executed"] == report["executed"]
    manifest = json.loads((made / "run.json").read_text())
    assert (manifest["schema"], manifest["scene"], manifest["seed"]) == ("weldsim.run/1", "straight", 1)
    assert set(manifest["files"]) == {path.name for path in made.iterdir()} - {"run.json"}


def test_a_platform_that_is_not_there_is_ray_cast(tmp_path):
    """MuJoCo cannot be imported where MUJOCO_GL names a platform without its library."""
    command = [sys.executable, "-c", "import sys; from weldsim.cli import main; sys.exit(main())"]
    words = ["scan", "straight", "--sensor", "exact", "--out", str(tmp_path / "cloud.ply")]
    env = {**os.environ, "MUJOCO_GL": "osmesa"}
    done = subprocess.run([*command, *words], capture_output=True, text=True, timeout=300, check=False, env=env)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_weld_follows_the_plan_and_the_plan_the_seam(welded):
    report = json.loads(welded[1].stdout)
    assert report["plan"]["mean"] < 0.6e-3
    assert report["executed"]["mean"] < 0.6e-3
    assert report["tracking_p95"] < 0.3e-3
    assert report["speed_error_p95"] < 0.02
    assert report["phantom_seams"] == 0
    assert report["iou"] > 0.8
    assert list(report["timing"]) == ["scene", "sensor", "cloud", "seam", "path", "motion", "execution", "report"]


def test_the_log_is_what_the_arm_did(welded):
    with np.load(welded[0] / "runs/straight-1/log.npz") as log:
        arc, tip = log["arc_on"], log["position_B"]
        assert len(arc) == len(tip) == len(log["t"]) == len(log["q_act"]) == len(log["segments"])
        assert set(log["segments"][arc]) == {"weld"}
        assert np.abs(log["q_act"] - log["q_cmd"]).max() < 0.01
        document = read_path_json(welded[0] / "runs/straight-1/path.json")
        start, end = (np.array(document["seams"][0]["poses"][k]["position"]) for k in (0, -1))
        assert np.linalg.norm(tip[arc][0] - start) < 1e-3
        assert np.linalg.norm(tip[arc][-1] - end) < 1e-3


def test_the_resolved_config_can_be_read_back(welded):
    resolved = json.loads((welded[0] / "runs/straight-1/config.json").read_text())
    config = load_config()
    assert structure(resolved["cell"], type(config)) == config
    assert to_json(structure(resolved["scene"], SceneConfig)) == resolved["scene"]


def test_the_same_seed_gives_the_same_bytes_in_another_process_and_the_earlier_run_is_kept(welded, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    old = tmp_path / "again"
    old.mkdir()
    (old / "run.json").write_text('{"schema": "weldsim.run/1"}')
    (old / "left.txt").write_text("from an earlier run")
    code = main(["run", "straight", "--seed", "1", "--out", "again"])
    out, err = capsys.readouterr()
    assert (code, err) == (welded[1].returncode, "")
    assert ("PASSED" if code == 0 else "FAILED") in out.splitlines()[0]
    paths = [read_path_json(folder / "path.json") for folder in (old, welded[0] / "runs/straight-1")]
    assert path_text(paths[0], timing=False) == path_text(paths[1], timing=False)
    assert (old / "depth_0.png").read_bytes() == (welded[0] / "runs/straight-1/depth_0.png").read_bytes()
    assert "the run that was in again is now again.1" in out
    assert not (old / "left.txt").exists()
    assert (tmp_path / "again.1" / "left.txt").read_text() == "from an earlier run"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again", "again.1"]


def test_a_failed_verdict_exits_1_and_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["--sensor", "exact", "--set", "report.mean=1 um", "--set", "scene.plate.length=120 mm", "--out", "out"]
    assert main(["run", "straight", *words]) == 1
    assert "FAILED" in capsys.readouterr().out.splitlines()[0]
    assert json.loads((tmp_path / "out" / "report.json").read_text())["passed"] is False


def test_a_run_that_finds_nothing_says_why_and_names_the_setting(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["run", "straight", "--sensor", "exact", "--set", "scene.groove.width=30 mm", "--set", "scene.groove.depth=12 mm"]
    assert main([*words, "--out", "out"]) == 1
    told = capsys.readouterr().out
    assert re.search(r"no seam was found: refused \d+ mm long: opening 30\.\d mm, over the 28 mm of seam\.profile\.max_width", told)
    main([*words, "--set", "seam.profile.max_width=32 mm", "--out", "out"])
    assert "no seam was found" not in capsys.readouterr().out


def test_a_plate_without_a_seam_passes_when_none_is_found(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "plain", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["phantom_seams"] == 0
    assert {path.name for path in (tmp_path / "runs" / "plain-0").iterdir()} == FILES


def test_what_the_twin_scans_can_be_planned(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["scan", "curve", *ONE_VIEW, "--seed", "4", "--out", "scan.ply", "--depth", "depth.png", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["written"] == ["scan.ply", "depth.png", "depth.intrinsics.json", "depth.pose.json"]
    cloud = read_cloud("scan.ply")
    assert said["points"] == len(cloud)
    np.testing.assert_allclose(cloud.viewpoints, said["viewpoints"], atol=1e-9)
    assert main(["plan", "scan.ply", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert main(["plan", "depth.png", "--intrinsics", "depth.intrinsics.json", "--pose", "depth.pose.json", "--json"]) == 0
    second = json.loads(capsys.readouterr().out)
    assert first["input"]["points"] == second["input"]["points"]
    assert first["seams"][0]["length"] == pytest.approx(second["seams"][0]["length"], abs=0.01)


def test_scenes_are_listed_and_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["scenes"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(scene_names())
    assert main(["scenes", "show", "curve", "-o", "curve.png"]) == 0
    picture = cv2.imread("curve.png")
    assert picture.shape[0] == 960
    assert picture.shape[1] > 1800
    assert picture.std() > 20


@pytest.mark.parametrize(
    "words",
    [
        ["run", "no-such-scene"],
        ["run", "missing.toml"],
        ["run", "straight", "--seed", "-1"],
        ["run", "straight", "--out", "mine"],
        ["run", "straight", "--out", "mine/notes.txt"],
        ["run", "straight", "--out", "."],
        ["run", "straight", "--video", "weld.avi"],
        ["run", "straight", "--video", "no/folder/weld.mp4"],
        ["run", "straight", "--seam", "0"],
        ["run", "straight", "--set", "scene.groove.wdth=10 mm"],
        ["run", "straight", "--set", "scene.groove.width=300 mm"],
        ["run", "straight", "--set", "motion.period=0 s"],
        ["scan", "straight", "--out", "scan.stl"],
        ["scan", "straight", "--depth", "depth.jpg"],
        ["scan", "straight", "--view", "2"],
        ["scan", "straight", "--out", "no/scan.ply"],
        ["scenes", "show"],
        ["scenes", "export"],
        ["scenes", "export", "straight", "-o", "cell.txt"],
        ["scenes", "export", "straight", "-o", "no/cell.xml"],
        ["scenes", "show", "nothing", "-o", "x.png"],
        ["scenes", "show", "straight", "-o", "x.jpg"],
        ["scenes", "list", "straight"],
    ],
    ids=" ".join,
)
def test_bad_input_is_one_line_and_leaves_everything_as_it_was(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "notes.txt").write_text("keep me")
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    assert [path.name for path in mine.iterdir()] == ["notes.txt"]


def test_a_run_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    old = tmp_path / "old"
    old.mkdir()
    (old / "run.json").write_text('{"schema": "weldsim.run/1"}')

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("weldsim.run_folder.png", fail)
    assert main(["run", "plain", "--out", "old"]) == 2
    assert "No space left" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    assert [path.name for path in old.iterdir()] == ["run.json"]


def test_all_seams_are_welded_in_one_job_with_one_report(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = main(["run", "y_branches", "--seam", "all", "--sensor", "exact", "--set", "path.speed=16 mm/s", "--out", "all"])
    said = capsys.readouterr().out
    report = json.loads((tmp_path / "all" / "report.json").read_text())
    assert code == (0 if report["passed"] else 1)
    assert (report["welded"], report["seams"], len(report["others"])) == (3, 3, 2)
    assert "3 of 3 seams welded" in said.splitlines()[0]
    assert "--seam all" not in said
    assert report["phantom_seams"] == 0
    for one in (report, *report["others"]):
        assert one["executed"]["mean"] < 0.5e-3
        assert one["tracking_p95"] < 0.3e-3
        assert one["progress"]["welded"] == pytest.approx(one["progress"]["length"], abs=1e-3)
    assert {check["figure"].partition(":")[0] for check in report["checks"]} >= {"seam 2", "seam 3"}
    with np.load(tmp_path / "all" / "log.npz") as log:
        assert [int(log["seam"][0]), *np.unique(log["seam"])] == [1, 1, 2, 3]
        assert set(log["segments"][log["arc_on"]]) == {"weld"}
        assert (np.diff(log["t"]) > 0).all()
        assert np.abs(np.diff(log["q_act"], axis=0)).max() < 0.02  # no jump from one to the next
    page = (tmp_path / "all" / "report.html").read_text()
    for text in ("3 of 3 seams welded", "<h2>Seam 1</h2>", "<h2>Seam 3</h2>"):
        assert text in page


def test_one_of_several_seams_names_the_way_to_all_of_them(capsys):
    """Which the test above follows."""
    report = WeldReport(passed=True, reasons=(), scene="y", method="profile", welded=1, seams=3, warnings=("1 of 3 seams welded",))
    report = replace(report, tracking_p95=1e-5)
    Run(scene="y_branches")._print(report, ReportConfig(), 3, ())
    said = capsys.readouterr().out
    assert "PASSED WITH WARNINGS, 1 of 3 seams welded; the one limit kept" in said.splitlines()[0]
    assert "--seam all welds every one" in said
    assert main(["run", "y_branches", "--seam", "al"]) == 2
    assert "all" in capsys.readouterr().err


def test_a_run_that_is_stopped_is_reported_and_gone_on_with(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with stopped_at(0.1):
        assert main(["run", "straight", "--sensor", "exact", "--out", "job"]) == 1
    said = capsys.readouterr().out
    assert re.search(r"STOPPED, at s = 99\.9 mm: welded 100 of 24[01] mm", said.splitlines()[0])
    report = json.loads((tmp_path / "job" / "report.json").read_text())
    assert report["stopped"] == "protective stop"
    assert report["way_on"] in said
    page = (tmp_path / "job" / "report.html").read_text()
    assert ">STOPPED<" in page
    assert "stopped at 99.9 mm" in page
    words = advice(said)
    assert words[words.index("--from") + 1] == "99.9 mm"
    assert main(words) == 0
    assert re.search(r"welded 14[56] of 24[01] mm from s = 95 mm on", capsys.readouterr().out)


@pytest.fixture
def own_part(tmp_path, monkeypatch):
    """Writes `mine.toml`, a straight part from files with the lines of a seam file, or without one."""
    monkeypatch.chdir(tmp_path)
    part = make_workpiece(load_scene("straight"))
    curve = part.seam_curves()[0]

    def write(points=None, *, seam=True, width=None):
        line = 1e3 * (curve.opening if points is None else getattr(curve, points))
        rows = line if width is None else np.column_stack([line, np.full(len(line), width)])
        np.savetxt(tmp_path / "seam.csv", rows, delimiter=",", header="x,y,z" + (",width" if width else ""), comments="")
        text = 'workpiece = "mesh"\n[mesh]\nfile = "part.stl"\nunits = "mm"\n' + ('seam = "seam.csv"\n' if seam else "")
        (tmp_path / "mine.toml").write_text(text + '[pose]\ny = "-450 mm"\n')
        mesh = part.build_mesh().to_trimesh()
        mesh.vertices = mesh.vertices * 1e3
        mesh.export(tmp_path / "part.stl")
        return ["run", "mine.toml", "--sensor", "exact", "--set", "scene.views=[{standoff = '400 mm'}]"]

    return write


def test_a_part_without_a_seam_file_is_not_judged_by_one(own_part, capsys):
    assert main(own_part(seam=False)) == 0
    said = capsys.readouterr().out
    assert "NOT JUDGED, no known seam to compare with; 1 found" in said.splitlines()[0]
    assert "not judged: no seam is known" in said
    rows = {line.split("  ")[1]: line for line in said.splitlines() if "not judged: " in line}
    assert all(" - " in line for line in rows.values())
    assert set(rows) == {"distance from the known seam", "phantom seams", "groove region overlap (IoU)"}


def judged(scene):
    """The report of a plan on a scene's exact cloud, nothing welded."""
    seen = look(scene, CellConfig(), sensor="exact")
    return finish(seen, plan(seen.cloud, CellConfig()), CellConfig(), execute=False).report


def test_a_seam_without_width_has_no_overlap_of_regions(own_part):
    own_part()
    report = judged(load_scene("mine.toml"))
    assert report.plan is not None
    assert report.iou is None
    assert report.unjudged == (("groove region overlap (IoU)", "not judged: the seam file has no width"),)
    assert [check.value for check in checks(report, ReportConfig()) if "IoU" in check.figure] == ["-"]
    own_part(width=14.0)
    report = judged(load_scene("mine.toml"))
    assert report.iou > 0.8
    assert report.unjudged == ()


def test_a_root_given_as_opening_is_told_and_shuffled_points_are_refused(own_part, capsys, tmp_path):
    words = own_part("root")
    reasons = judged(load_scene("mine.toml")).reasons
    assert any("a seam was found 8.0 mm above it: is the known line the groove's root?" in reason for reason in reasons)
    lines = (tmp_path / "seam.csv").read_text().splitlines()
    (tmp_path / "seam.csv").write_text("\n".join([lines[0], *lines[40:], *lines[1:40]]))
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "not in order along the seam: point " in error
    assert error.count("\n") == 1


def test_a_narrow_part_is_told_with_settings_that_find_its_groove(tmp_path, monkeypatch, capsys):
    """18 mm of plate beside the groove, on a table 20 mm below."""
    monkeypatch.chdir(tmp_path)
    words = ["run", "straight", "--set", "scene.plate.width=50 mm", "--set", "scene.fixture.clamps=0"]
    assert main(words) == 1
    out = capsys.readouterr().out
    options = re.search(r"a groove is found with ((?:--set \S+=\"[^\"]+\" ?)+)", out.replace('":', '" '))
    assert options is not None, out
    main([*words, *shlex.split(options[1])])
    assert "no seam was found" not in capsys.readouterr().out
    assert json.loads((tmp_path / "runs" / "straight-0" / "report.json").read_text())["plan"]["mean"] < 0.4e-3


def test_a_part_without_a_seam_file_has_no_phantom_seams_in_regress_either(own_part, capsys):
    own_part(seam=False)
    words = ["regress", "--scenes", "mine.toml", "--methods", "profile", "--seeds", "1", "--jobs", "1", "--sensor", "exact"]
    assert main([*words, "--html", "page.html", "--junit", "out.xml"]) == 0
    head, row = (re.split("  +", line.strip()) for line in capsys.readouterr().out.splitlines()[:2])
    figures = dict(zip(head, row, strict=True))
    assert (figures["scene"], figures["mean mm"], figures["phantom mm"], figures["IoU"]) == ("mine", "-", "-", "-")
    assert main([*words, "--json"]) == 0
    assert "phantom" not in json.dumps(json.loads(capsys.readouterr().out)["rows"][0]["figures"])
