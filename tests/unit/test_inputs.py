"""What a caller may hand to the pipeline in place of records, and the line that says what is wanted of anything else."""

import subprocess
import sys

import numpy as np
import pytest

import weldsim
from tests.clouds import groove_cloud
from weldsim.cloud.files import write_cloud
from weldsim.config import CellConfig, load_config, load_scene
from weldsim.errors import InputError, RecordError, WeldsimError
from weldsim.inputs import cloud_from, config_from, findings_from, scene_from
from weldsim.records import DepthFrame, PointCloud, Seam, SeamFindings

POINTS = np.random.default_rng(0).uniform(0.0, 0.2, (200, 3))


class OfAnotherLibrary:
    """A cloud as open3d has it: its points are an array by protocol alone."""

    class Vector:
        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            return POINTS

    points = Vector()


@pytest.mark.parametrize(
    "given",
    [
        POINTS,
        POINTS.astype(np.float32).astype(float),
        POINTS.tolist(),
        [tuple(row) for row in POINTS],
        POINTS.reshape(10, 20, 3),
        np.vstack([POINTS, [[np.nan, 0.0, 0.0]]]),
        np.array([tuple(row) for row in POINTS], dtype=[("x", float), ("y", float), ("z", float)]),
        PointCloud(points=POINTS),
        OfAnotherLibrary(),
    ],
)
def test_an_array_is_a_cloud(given):
    assert np.allclose(cloud_from(given).points, POINTS, atol=1e-7)


def test_a_file_and_a_depth_frame_are_clouds(tmp_path):
    write_cloud(tmp_path / "a.ply", PointCloud(points=POINTS))
    for name in (tmp_path / "a.ply", str(tmp_path / "a.ply")):
        assert np.array_equal(cloud_from(name).points, POINTS)
    made = groove_cloud(np.random.default_rng(1), noise="iid", sigma=0.0002)
    z = np.full(480 * 640, np.nan, np.float32)
    z[made.cloud.pixel] = made.cloud.X_BC.inverse().points(made.cloud.points)[:, 2]
    frame = DepthFrame(depth=z.reshape(480, 640), intrinsics=made.cloud.intrinsics, X_BC=made.cloud.X_BC)
    assert len(cloud_from(frame)) == len(made.cloud)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (None, "None is no cloud"),
        (3, "an int is no cloud; a PointCloud, an (n, 3) array in metres, a DepthFrame or a file is wanted"),
        ({"points": POINTS}, "a dict is no cloud"),
        (POINTS.T, "give its transpose"),
        (np.zeros((10, 6)), "shape (10, 6)"),
        (np.zeros((480, 640)), "a depth image needs its camera"),
        ([["a", "b", "c"]], "no array of numbers"),
        (np.full((5, 3), np.nan), "none of the 5 points is finite"),
        (1e3 * POINTS, "looks like millimetres (times 0.001)"),
        (POINTS > 0, "no array of numbers"),
        (POINTS + 0j, "no array of numbers"),
        ("straight", 'weldsim.run("straight"), or weldsim.look("straight").cloud'),
        ("nowhere.ply", "no such file"),
    ],
)
def test_what_is_no_cloud_is_said_with_what_is_wanted(given, says):
    with pytest.raises(WeldsimError) as caught:
        weldsim.plan(given)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_advice_for_a_scene_works():
    assert len(weldsim.plan(weldsim.look("plain", sensor="exact").cloud).findings.seams) == 0


def test_settings_may_be_a_file_or_its_tables(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text('[path]\nspeed = "6 mm/s"\n')
    own = CellConfig()
    assert config_from(None) == CellConfig()
    assert config_from(own) is own
    for given in (file, str(file), {"path": {"speed": "6 mm/s"}}):
        assert config_from(given).path.speed == pytest.approx(0.006)
        assert config_from(given).source("path.speed").kind == "file"
    for given in ({"path.speed": "6 mm/s"}, "path.speed=6 mm/s", ["path.speed=6 mm/s", "path.step=1 mm"]):
        assert config_from(given).path.speed == pytest.approx(0.006)
    both = config_from({"path.speed": "6 mm/s", "path": {"step": "1 mm"}, "seam.profile.min_width": "5 mm"})
    assert (both.path.speed, both.path.step) == pytest.approx((0.006, 0.001))
    assert both.seam.profile.min_width == pytest.approx(0.005)
    with pytest.raises(InputError, match="config: an int is none; a CellConfig"):
        weldsim.plan(POINTS, 3)  # type: ignore[arg-type]
    with pytest.raises(WeldsimError, match=r"unknown key 'path\.sped'; did you mean path\.speed"):
        weldsim.plan(POINTS, {"path": {"sped": 1}})


def test_what_is_no_sighting_and_no_plan_is_said_with_what_is_wanted():
    """In a process of its own, without the tests' checker of types, which would see it first."""
    program = (
        "import numpy as np, weldsim\n"
        "P = np.zeros((4, 3))\n"
        "finish, write = weldsim.finish, weldsim.write_cloud\n"
        "for call in (lambda: finish('straight', P), lambda: write(P, 'a.ply'), lambda: write('a.ply', None)):\n"
        "    try:\n        call()\n    except weldsim.WeldsimError as error:\n        print(error)"
    )
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[0] == "finish: a str is no sighting; what weldsim.look returned is wanted"
    assert said[1] == "write_cloud: a file name and a cloud, in this order, are wanted, not ndarray, str"
    assert said[2] == "write_cloud: a file name and a cloud, in this order, are wanted, not str, NoneType"


def test_an_array_is_written_as_a_cloud(tmp_path):
    assert np.array_equal(weldsim.read_cloud(write_cloud(tmp_path / "a.ply", POINTS)).points, POINTS)


def test_a_scene_may_be_a_name_a_file_or_its_tables(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('workpiece = "cylinder"\n')
    assert scene_from("cuboid") == load_scene("cuboid")
    assert scene_from(file).workpiece == scene_from({"workpiece": "cylinder"}).workpiece == "cylinder"
    assert scene_from(load_scene("y")) == load_scene("y")
    assert scene_from({"groove.width": "10 mm", "groove.depth": "5 mm"}).groove.width == pytest.approx(0.01)


@pytest.mark.parametrize("call", [weldsim.run, weldsim.look])
@pytest.mark.parametrize(
    ("given", "more", "says"),
    [
        (3, {}, "scene: an int is none; the name of one, a TOML file or a SceneConfig (weldsim.load_scene) is wanted"),
        (None, {}, "scene: None is none"),
        ("strait", {}, "did you mean straight?"),
        ({"workpiece": "cone"}, {}, "not one of"),
        ("straight", {"seed": -1}, "seed -1: a whole number, 0 or more, is needed"),
        ("straight", {"config": 3}, "config: an int is none"),
    ],
)
def test_what_is_no_scene_seed_or_sensor_is_said_with_what_is_wanted(call, given, more, says):
    with pytest.raises(WeldsimError) as caught:
        call(given, **more)
    assert says in str(caught.value)


def test_a_camera_that_there_is_not_is_no_other_camera():
    """In a process of its own, without the tests' checker of types, which would see it first."""
    program = (
        "import weldsim\ntry:\n    weldsim.look('plain', sensor='d416')\nexcept weldsim.WeldsimError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "sensor 'd416' is not one of d415, d435, d415-stereo, kinect, exact" in done.stdout


def test_what_is_no_path_is_refused_in_one_line() -> None:
    """In a process of its own: here the tests' own type check would come first."""
    program = """
import weldsim
for call in (weldsim.load_config, weldsim.load_scene, weldsim.read_cloud):
    try:
        call(5)
    except weldsim.WeldsimError as error:
        print(error)
print(weldsim.load_config(None, 'path.speed=6 mm/s').path.speed)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    config, scene, cloud, speed = done.stdout.splitlines()
    assert "5 is no TOML file" in config
    assert "the name of one or a TOML file is wanted" in scene
    assert "5 is no file" in cloud
    assert speed == "0.006"


CLOUD = PointCloud(points=POINTS)
LINE = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]])


@pytest.mark.parametrize(
    ("given", "count"),
    [
        (None, 0),
        ([], 0),
        (np.zeros((0, 3)), 0),
        (LINE, 1),
        ([LINE, LINE + 0.1], 2),
        (Seam.along(LINE), 1),
        ((Seam.along(LINE), LINE), 2),
        (SeamFindings(seams=(Seam.along(LINE),), region=np.zeros(200, np.int32)), 1),
    ],
)
def test_a_finder_may_return_lines(given, count):
    found = findings_from(given, CLOUD, "mine")
    assert len(found.seams) == count
    assert len(found.region) == len(CLOUD)


def boom(cloud: PointCloud) -> SeamFindings:
    """A finder of the user's own with a fault in it."""
    raise KeyError("threshold")


def leaves(cloud: PointCloud) -> SeamFindings:
    """A finder that ends the program."""
    raise SystemExit(3)


@pytest.mark.parametrize(
    ("find", "says"),
    [
        (leaves, "finder leaves: raised SystemExit: 3"),
        (boom, "finder boom: raised KeyError: 'threshold'"),
        (lambda cloud: 7, "returned an int; SeamFindings, a Seam, several, or (n, 3) points are wanted"),
        (lambda cloud: "straight", "returned a str"),
        (lambda cloud: np.zeros((1, 3)), "returned no seam"),
        (lambda cloud: LINE[[0, 2, 1]], "turns back on itself at point 2"),
        (lambda cloud: SeamFindings(seams=(), region=np.zeros(3, np.int32)), "region has 3 entries, the cloud 200 points"),
    ],
)
def test_a_finder_that_fails_is_told_as_the_finders_fault(find, says):
    with pytest.raises(InputError) as caught:
        weldsim.plan(POINTS, find=find)
    assert says in str(caught.value)


def test_a_seam_along_a_polyline_has_its_arc_length_and_frames():
    """A quarter of a circle of radius 0.1 m on a plate that slopes by 30 deg."""
    angle = np.linspace(0.0, np.pi / 2, 91)
    flat = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    seam = weldsim.Seam.along(flat @ tilt.T, tilt[:, 2], width=0.014)
    assert seam.length == pytest.approx(0.1 * np.pi / 2, rel=1e-4)
    assert seam.width == 0.014
    assert not seam.closed
    true = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1) @ tilt.T
    assert np.einsum("ij,ij->i", seam.tangents_B[1:-1], true[1:-1]).min() > 1 - 1e-6
    assert np.allclose(seam.normals_B, tilt[:, 2], atol=1e-9)
    again = Seam.along(np.repeat(flat, 2, axis=0).tolist())  # points that repeat are left out
    assert len(again.s) == 91


def test_normals_of_a_seam_stand_across_it():
    seam = Seam.along([[0, 0, 0], [0.1, 0, 0.05], [0.2, 0, 0.1]])
    assert np.allclose(seam.normals_B, np.array([-0.1, 0, 0.2]) / np.hypot(0.1, 0.2))
    ring = 0.05 * np.stack([np.cos(a := np.linspace(0, 2 * np.pi, 73)), np.sin(a), 0 * a], axis=1)
    closed = Seam.along(ring)
    assert closed.closed
    assert np.allclose(closed.tangents_B[0], [0, 1, 0], atol=1e-6)
    assert np.allclose(closed.tangents_B[0], closed.tangents_B[-1])


@pytest.mark.parametrize(
    ("points", "normals", "says"),
    [
        ([[0, 0, 0]], (0, 0, 1), "1 place; a seam needs two"),
        ([[0, 0, 0], [0, 0, 0]], (0, 0, 1), "1 place"),
        ([[0, 0, 0], [0, 0, 0.1]], (0, 0, 1), "along travel in places"),
        ([[0, 0], [1, 1]], (0, 0, 1), "shape (2, 2)"),
        ([[0, 0, np.nan], [0, 1, 0]], (0, 0, 1), "finite"),
        ("line", (0, 0, 1), "no array of numbers"),
        ([[0, 0, 0], [0.1, 0, 0]], (0, 1), "normals_B: shape (2,)"),
        ([[0, 0, 0], [100, 0, 0]], (0, 0, 1), "millimetres"),
        ([[0, 0, 0], [0.1, 0, 0], [0.05, 0, 0]], (0, 0, 1), "turns back on itself at point 2, (0.1000, 0.0000, 0.0000) m"),
        ([[0, 0, 0], [0.1, 0, 0]], [[0, 0, 0], [0, 0, 1]], "a normal is zero"),
    ],
)
def test_what_is_no_seam_is_said(points, normals, says):
    with pytest.raises(RecordError) as caught:
        Seam.along(points, normals)
    assert says in str(caught.value)


def test_names_are_where_one_looks():
    assert {"look", "finish", "write_junit", "regress", "Seam", "SeamFindings", "write_cloud"} <= set(dir(weldsim))
    from weldsim.regression import write_junit

    assert weldsim.write_junit is write_junit


def test_one_seam_of_ones_own_is_welded_by_the_path_alone():
    made = groove_cloud(np.random.default_rng(1), noise="iid", sigma=0.0002)
    result = weldsim.plan(made.cloud, find=lambda cloud: made.seam.opening_B)
    assert result.paths[0] is not None
    assert result.paths[0].s[-1] == pytest.approx(made.seam.length, rel=1e-3)


def said_by(calls: str) -> list[str]:
    """What each of these calls raises, a line each, in a process without the tests' checker of types, which would see it first."""
    program = (
        "import weldsim\nfrom weldsim import *\n"
        f"for call in ({calls}):\n"
        "    try:\n        print('no error:', call())\n"
        "    except weldsim.WeldsimError as error:\n        print(error)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_a_seam_or_film_that_cannot_be_meant_is_told_before_the_scan(tmp_path):
    said = said_by(
        "lambda: run('plain', number='al'), lambda: run('plain', number=1.5), lambda: run('plain', near=(1, 0)),"
        "lambda: run('plain', near='0 0 0'), lambda: run('plain', near=(0, 0, float('nan'))),"
        "lambda: run('plain', number=1, near=(0, 0, 0)), lambda: run('plain', video='a.avi'),"
        f"lambda: run('plain', video={str(tmp_path / 'none' / 'a.mp4')!r}), lambda: run('plain', video=3),"
    )
    assert said == [
        "number 'al': a whole number from 1 is needed, or \"all\"",
        'number 1.5: a whole number from 1 is needed, or "all"',
        "near (1, 0): three finite numbers in metres are needed",
        "near '0 0 0': three finite numbers in metres are needed",
        "near (0, 0, nan): three finite numbers in metres are needed",
        "number and near exclude each other; give one",
        "video a.avi: a film ends in .mp4",
        f"video {tmp_path}/none/a.mp4: its folder does not exist",
        "video: an int is none; the name of a file that ends in .mp4 is wanted",
    ]


def test_what_is_no_unit_viewpoint_or_box_of_a_cloud_is_told(tmp_path):
    file = str(write_cloud(tmp_path / "a.ply", POINTS))
    corners = "a lower and an upper corner, x, y, z in metres each, are needed"
    said = said_by(
        f"lambda: read_cloud({file!r}, unit='km'), lambda: read_cloud({file!r}, viewpoint='0 0 1'),"
        f"lambda: read_cloud({file!r}, crop=((0, 0, 0),)), lambda: read_cloud({file!r}, crop=((0, 0, 0), (-1, 1, 1))),"
    )
    assert said == [
        "unit 'km' is not one of m, cm, mm, um, in, ft",
        "viewpoint '0 0 1': three finite numbers in metres are needed",
        f"crop ((0, 0, 0),): {corners}",
        f"crop ((0, 0, 0), (-1, 1, 1)): {corners}",
    ]


def test_settings_of_a_scene_may_be_named_as_on_the_command_line():
    for given in (
        "groove.width=10 mm",
        ["scene.groove.width=10 mm"],
        {"groove.width": "10 mm"},
        {"groove": {"width": "10 mm"}},
        {"scene.groove.width": "10 mm"},
    ):
        assert load_scene("straight", given).groove.width == pytest.approx(0.01)
    with pytest.raises(WeldsimError, match=r"did you mean scene\.groove\.width"):
        load_scene("straight", ["groove.widht=10 mm"])
    assert load_config({"path.speed": "6 mm/s"}).path.speed == pytest.approx(0.006)
    config = load_config(None, {"path.speed": "6 mm/s", "path": {"step": "1 mm"}})
    assert (config.path.speed, config.path.step) == pytest.approx((0.006, 0.001))
    assert config.source("path.speed").kind == "command line"
    for calls in ("lambda: load_config(None, 3),", "lambda: load_scene('straight', 3),"):
        assert said_by(calls) == ["overrides 3: a list of dotted.key=value, or a mapping, is wanted"]
    assert said_by("lambda: load_config(None, [3]),")[0].startswith("override 3: write dotted.key=value")


def test_a_run_is_written_by_names_and_what_is_no_run_is_told(tmp_path):
    program = (
        "import weldsim\nfrom pathlib import Path\n"
        "seen = weldsim.look('plain', sensor='exact', move=False)\n"
        "plan = weldsim.plan(seen.cloud)\n"
        "done = weldsim.finish(seen, plan, execute=False)\n"
        "weldsim.write_run('a run', done, None, 'plain', 0, 'exact')\n"
        "print(*sorted(path.name for path in Path('a run').iterdir()))\n"
        "calls = (lambda: weldsim.write_run('b', plan, None, 'plain', 0, 'exact'), lambda: weldsim.write_junit(None, 'b.xml'),"
        " lambda: weldsim.regress('plain', seeds='3'), lambda: weldsim.regress('plain', jobs=1.5),"
        " lambda: weldsim.regress('plain', golden='none.json'))\n"
        "for call in calls:\n"
        "    try:\n        call()\n    except weldsim.WeldsimError as error:\n        print(error)\n"
        "print(*sorted(path.name for path in Path('.').iterdir()))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    files, *said, left = done.stdout.splitlines()
    assert {"run.json", "report.html", "path.json", "config.json"} <= set(files.split())
    assert said == [
        "write_run: a PlanResult is no run; what weldsim.run or weldsim.finish returned is wanted",
        "write_junit: a file name and what weldsim.regress returned, in this order, are wanted, not NoneType, str",
        "seeds '3': a whole number, 1 or more, is needed",
        "jobs 1.5: a whole number, 1 or more, is needed",
        "none.json: no such golden file; record one with --update --reason",
    ]
    assert left == "a run"
