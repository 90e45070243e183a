"""`weldsim plan` as its users start it: one process a command, files in, files out."""

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.clouds import groove_cloud, two_grooves
from weldsim.cli import main
from weldsim.cloud.depth_output import write_depth_frame
from weldsim.cloud.files import read_cloud, write_cloud
from weldsim.curves import project
from weldsim.frames import matrix_from_quaternion
from weldsim.path.files import check_document, path_text, read_path_json
from weldsim.records import DepthFrame

Command = Callable[..., subprocess.CompletedProcess[str]]
HEAVY = {"open3d", "mujoco", "mink", "ruckig", "trimesh", "manifold3d", "matplotlib", "plotly", "rich"}


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    """A folder with cloud.ply, the same cloud in millimetres, a plain plate, and a depth image with its files."""
    folder = tmp_path_factory.mktemp("scan")
    made = groove_cloud(np.random.default_rng(3), noise="iid", sigma=0.0003, curve="arc", clamps=2)
    write_cloud(folder / "cloud.ply", made.cloud)
    np.savetxt(folder / "mm.xyz", made.cloud.points * 1e3, fmt="%.4f")
    np.save(folder / "truth.npy", made.seam.opening_B)
    plain = groove_cloud(np.random.default_rng(3), width=0.0, noise="iid", sigma=0.0003)
    write_cloud(folder / "plain.ply", plain.cloud)
    camera, z = made.cloud.intrinsics, np.full(480 * 640, np.nan, np.float32)
    z[made.cloud.pixel] = made.cloud.X_BC.inverse().points(made.cloud.points)[:, 2]
    frame = DepthFrame(depth=z.reshape(480, 640), intrinsics=camera, X_BC=made.cloud.X_BC)
    write_depth_frame(folder / "depth.npy", frame)
    return folder


@pytest.fixture
def weldsim(tmp_path) -> Command:
    """Runs the command in an empty folder."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", "import sys; from weldsim.cli import main; sys.exit(main())", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)

    return run


def test_summary_is_printed_and_nothing_written(weldsim, scan, tmp_path):
    done = weldsim("plan", scan / "cloud.ply")
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 seam" in done.stdout
    assert "seconds: read" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_path_files_hold_the_seam_in_the_base(weldsim, scan, tmp_path):
    done = weldsim("plan", scan / "cloud.ply", "--out", "path.json", "--csv", "path.csv", "--set", "path.speed=6 mm/s")
    assert (done.returncode, done.stderr) == (0, "")
    document = read_path_json(tmp_path / "path.json")
    (seam,) = document["seams"]
    poses = seam["poses"]
    tip = np.array([pose["position"] for pose in poses])
    distance, _, _ = project(tip, np.load(scan / "truth.npy"))
    assert distance.mean() < 0.4e-3
    assert distance.max() < 1.2e-3
    wire = matrix_from_quaternion(np.array([pose["quaternion_wxyz"] for pose in poses]))[:, :, 2]
    assert (wire[:, 2] < -0.99).all()  # the plate is level
    assert seam["speed"] == 0.006
    assert 0.23 < seam["length"] < 0.26
    rows = np.loadtxt(tmp_path / "path.csv", delimiter=",", comments=["#", "seam,"], usecols=range(1, 8))
    np.testing.assert_allclose(rows[:, 1:4], tip, atol=2e-9)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["path.csv", "path.json"]


def test_seams_without_a_path_are_named_and_the_others_planned(weldsim, tmp_path):
    write_cloud(tmp_path / "two.ply", two_grooves())
    trims = ("--set", "path.start_trim=60 mm", "--set", "path.end_trim=60 mm")
    done = weldsim("plan", "two.ply", *trims, "--out", "path.json", "--csv", "path.csv", "--report", "report.html")
    assert (done.returncode, done.stderr) == (0, "")
    assert "seam 2 has no path: trims of 60 and 60 mm leave" in done.stdout
    document = read_path_json(tmp_path / "path.json")
    assert [seam["id"] for seam in document["seams"]] == ["seam-1"]
    (refused,) = document["refused"]
    assert refused["id"] == "seam-2"
    assert 0.1 < refused["length"] < 0.12
    assert "mm leave" in refused["reason"]
    assert "seam 2 has no path" in (tmp_path / "report.html").read_text()
    answer = json.loads(weldsim("plan", "two.ply", *trims, "--json").stdout)
    assert answer["refused"] == document["refused"]
    asked = weldsim("plan", "two.ply", *trims, "--seam", 2, "--out", "second.json")
    assert (asked.returncode, asked.stdout) == (1, "")
    assert asked.stderr.startswith("weldsim: two.ply: seam 2: trims")
    assert asked.stderr.count("\n") == 1
    assert not (tmp_path / "second.json").exists()


def test_the_same_inputs_give_the_same_bytes_in_two_processes(weldsim, scan, tmp_path):
    for name in ("a.json", "b.json"):
        assert weldsim("plan", scan / "cloud.ply", "--out", name).returncode == 0
    a, b = (json.loads((tmp_path / name).read_text()) for name in ("a.json", "b.json"))
    assert path_text(a, timing=False) == path_text(b, timing=False)
    other = weldsim("plan", scan / "cloud.ply", "--set", "path.step=0.5 mm", "--json")
    assert json.loads(other.stdout)["config_digest"] != a["config_digest"]


def test_json_is_one_object_and_the_path_itself(weldsim, scan, tmp_path):
    done = weldsim("plan", scan / "cloud.ply", "--json")
    document = json.loads(done.stdout)
    check_document(document)
    assert document["threshold"]["value"] > 0
    assert isinstance(document["rejected"], list)
    assert document["input"]["file"] == "cloud.ply"
    assert set(document["timing"]) == {"read", "cloud", "seam", "path"}
    assert list(tmp_path.iterdir()) == []


def test_millimetres_are_accepted_when_said(weldsim, scan):
    refused = weldsim("plan", scan / "mm.xyz")
    assert refused.returncode == 2
    assert "--units mm" in refused.stderr
    assert refused.stderr.count("\n") == 1
    viewpoint = read_cloud(scan / "cloud.ply").viewpoints[0]
    accepted = weldsim("plan", scan / "mm.xyz", "--units", "mm", "--viewpoint", *viewpoint, "--json")
    line = np.array(json.loads(accepted.stdout)["seams"][0]["points"])
    distance, _, _ = project(line, np.load(scan / "truth.npy"))
    assert distance.mean() < 0.4e-3


def test_a_depth_image_gives_the_same_seam_as_its_cloud(weldsim, scan):
    words = ("--intrinsics", scan / "depth.intrinsics.json", "--pose", scan / "depth.pose.json", "--json")
    done = weldsim("plan", scan / "depth.npy", *words)
    assert done.returncode == 0, done.stderr
    line = np.array(json.loads(done.stdout)["seams"][0]["points"])
    distance, _, _ = project(line, np.load(scan / "truth.npy"))
    assert distance.mean() < 0.4e-3


def test_no_seam_exits_1_and_says_why(weldsim, scan, tmp_path):
    done = weldsim("plan", scan / "plain.ply", "--out", "path.json")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "no seam found" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_seam_is_picked_by_number_or_place(weldsim, scan):
    near = weldsim("plan", scan / "cloud.ply", "--near", "0", "-0.45", "0", "--json")
    assert [seam["id"] for seam in json.loads(near.stdout)["seams"]] == ["seam-1"]
    beyond = weldsim("plan", scan / "cloud.ply", "--seam", "2", "--json")
    assert beyond.returncode == 2
    assert "1 found" in json.loads(beyond.stdout)["error"]


def test_a_report_is_a_page_a_picture_or_a_folder_of_both(weldsim, scan, tmp_path):
    done = weldsim("plan", scan / "cloud.ply", "--report", "report.html", "--set", "cloud.voxel=1.2 mm")
    assert (done.returncode, done.stderr) == (0, "")
    page = (tmp_path / "report.html").read_text()
    assert "greatest movement of the centre line" in page  # how stable the answer is about the threshold
    assert "<script src" not in page
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]  # and no file that nobody asked for
    words = re.sub(r'<script>.*?</script>|src="data:[^"]*"', "", page, flags=re.DOTALL)
    assert "seed" not in words  # a file of one's own has none
    assert re.search(r'<img alt="Cloud, seam and torch path in the robot base" src="data:image/png;base64,', page)
    # What the report took is told, and whose doing it is.
    assert re.search(r"seconds: .* stability [\d.]+, report [\d.]+;", done.stdout)
    assert re.search(r"stability, for the report alone: the seams found twice more, [\d.]+ s", done.stdout)
    assert "stability" not in weldsim("plan", scan / "cloud.ply", "--set", "cloud.voxel=1.2 mm").stdout
    done = weldsim("plan", scan / "cloud.ply", "--report", "report.png", "--set", "cloud.voxel=1.2 mm")
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "report.png").read_bytes().startswith(b"\x89PNG")
    done = weldsim("plan", scan / "plain.ply", "--report", "folder/", "--set", "cloud.voxel=1.2 mm")
    assert done.returncode == 1
    assert sorted(path.name for path in (tmp_path / "folder").iterdir()) == ["report.html", "report.png"]
    assert (tmp_path / "folder" / "report.png").read_bytes().startswith(b"\x89PNG")


def test_a_page_is_written_where_its_picture_could_not_be(weldsim, scan, tmp_path):
    (tmp_path / "report.png").mkdir()
    done = weldsim("plan", scan / "cloud.ply", "--report", "report.html", "--set", "cloud.voxel=1.2 mm")
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "report.html").is_file()


def test_planning_loads_no_heavy_library(scan):
    program = "import sys; from weldsim.cli import main; main(sys.argv[1:]); print(*{m.split('.')[0] for m in sys.modules})"
    command = [sys.executable, "-c", program, "plan", str(scan / "cloud.ply")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert set(done.stdout.splitlines()[-1].split()) & HEAVY == set()


@pytest.mark.parametrize(
    "words",
    [
        ("--out", "no/folder/path.json"),
        ("--out", "same", "--csv", "same"),
        ("--out", "."),
        ("--config", "missing.toml"),
        ("--set", "path.sped=1"),
        ("--set", "seam.method=best"),
        ("--set", "path.speed=fast"),
        ("--seam", "1", "--near", "0", "0", "0"),
        ("--pose", "pose.json"),
        ("--depth-unit", "1 mm"),
        ("--units", "mm", "--intrinsics", "k.json"),
    ],
)
def test_bad_options_are_refused_before_the_work(scan, tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("weldsim.pipeline.plan", None)  # the work
    assert main(["plan", str(scan / "cloud.ply"), *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("where", ["under", "on", "beside"])
def test_a_viewpoint_that_cannot_be_is_named(scan, capsys, where):
    cloud = read_cloud(scan / "cloud.ply")
    middle, (camera,) = cloud.points.mean(axis=0), cloud.viewpoints
    away = {"under": middle - camera, "on": np.zeros(3), "beside": np.array([2.0, 0.0, 0.0])}[where]
    told = [f"{value:.4f}" for value in middle + away]
    assert main(["plan", str(scan / "cloud.ply"), "--viewpoint", *told]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "is that where the camera stood?" in err
    assert main(["plan", str(scan / "plain.ply")]) == 1  # where there is no groove, the viewpoint is not to blame
    assert "camera" not in capsys.readouterr().err


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("reader", ["true", "head -c 10"])
def test_a_reader_that_goes_away_is_no_news(scan, reader, unbuffered):
    program = "import sys; from weldsim.cli import main; sys.exit(main())"
    command = shlex.join([sys.executable, "-c", program, "plan", str(scan / "cloud.ply"), "--json"])
    done = subprocess.run(
        ["bash", "-c", f"{command} | {reader}; exit ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
    )
    assert (done.returncode, done.stderr) == (141, "")


def test_a_home_that_cannot_be_written_is_not_talked_about(scan, tmp_path):
    (tmp_path / "home").write_text("no folder")
    home = str(tmp_path / "home")
    keep = {key: value for key, value in os.environ.items() if key not in ("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME")}
    done = subprocess.run(
        [sys.executable, "-m", "weldsim", "plan", str(scan / "cloud.ply"), "--report", str(tmp_path / "report.html")],
        capture_output=True,
        text=True,
        check=False,
        env={**keep, "HOME": home},
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_thesis_authors_scan_is_planned(weldsim, real_data):
    done = weldsim("plan", real_data / "curved_groove_scan.ply", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    (seam,) = json.loads(done.stdout)["seams"]
    points = read_cloud(real_data / "curved_groove_scan.ply").points
    mean, p95 = valley_distance(np.array([pose["position"] for pose in seam["poses"]]), points)
    assert mean < 1.0e-3
    assert p95 < 2.5e-3
    assert seam["length"] > 0.9 * 0.225


def valley_distance(tip: np.ndarray, points: np.ndarray) -> tuple[float, float]:
    """Mean and 95th percentile distance across the groove from the tip to the valley: at every 2 mm of path, the middle of the
    two walls at half the groove's depth, both seen in slices of 3 mm, without any help from the seam finder."""
    up = np.linalg.svd(points[::20] - points.mean(axis=0), full_matrices=False)[2][2]
    offsets = []
    for i in range(0, len(tip), max(1, len(tip) // 110)):
        j, k = max(0, i - 20), min(len(tip) - 1, i + 20)
        along = (tip[k] - tip[j]) / np.linalg.norm(tip[k] - tip[j])
        across = np.cross(up, along)
        local = (points - tip[i]) @ np.stack([along, across, up], axis=1)
        near = local[(np.abs(local[:, 0]) < 1.5e-3) & (np.abs(local[:, 1]) < 0.02)]
        outside = near[np.abs(near[:, 1]) > 0.014]
        slope, level = np.polyfit(outside[:, 1], outside[:, 2], 1)
        depth = np.abs(slope * near[:, 1] + level - near[:, 2])
        deep = near[depth > 0.5 * np.percentile(depth, 98)]
        offsets.append(abs(deep[:, 1].min() + deep[:, 1].max()) / 2)
    return float(np.mean(offsets)), float(np.percentile(offsets, 95))
