"""`weldsim scenes show` and `export`, one's own part welded from its files, and bad scenes: one line, exit 2, nothing written."""

import json
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from weldsim.cli import main
from weldsim.config import load_scene
from weldsim.scene.config import make_workpiece
from weldsim.scene.files import scene_names
from weldsim.scene.world import HOME, build_world


def seen(model: mujoco.MjModel, q: np.ndarray, camera: str) -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth [m] of one of the model's cameras, the arm at q."""
    data = mujoco.MjData(model)
    data.qpos[:6] = q
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 240, 320) as renderer:
        renderer.update_scene(data, camera)
        colour = renderer.render().astype(float)
        renderer.enable_depth_rendering()
        renderer.update_scene(data, camera)
        return colour, renderer.render()


@pytest.mark.render
@pytest.mark.parametrize("name", ["straight", "cuboid"])
def test_an_exported_scene_is_the_same_to_stock_mujoco(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["scenes", "export", name, "-o", "cell.xml"]) == 0
    assert main(["scenes", "export", name, "-o", "cell.xml", "--json"]) == 0  # over the first
    assert json.loads(capsys.readouterr().out.partition("{")[2].join("{ "))["written"] == ["cell.xml", "cell_assets"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cell.xml", "cell_assets"]
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for path in ("cell.xml", "cell_assets"):
        (tmp_path / path).rename(moved / path)
    model, world = mujoco.MjModel.from_xml_path(str(moved / "cell.xml")), build_world(load_scene(name))
    assert model.ngeom == world.model.ngeom
    assert [model.geom(i).name for i in range(model.ngeom)] == [world.model.geom(i).name for i in range(model.ngeom)]
    assert np.allclose(model.key("home").qpos, HOME)
    q = world.view_joints()
    for camera in ("d415", "overview"):
        ours, theirs = seen(world.model, q, camera), seen(model, q, camera)
        # The file's figures have seven digits: a shadow's edge may fall on the next pixel.
        assert (np.abs(ours[0] - theirs[0]).max(axis=2) > 6).mean() < 0.005
        assert np.median(np.abs(ours[1] - theirs[1])) < 1e-6
        assert (np.abs(ours[1] - theirs[1]) > 1e-4).mean() < 0.002


def test_an_export_leaves_what_is_not_its_own_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell_assets").mkdir()
    (tmp_path / "cell_assets" / "notes.txt").write_text("keep me")
    assert main(["scenes", "export", "plain", "-o", "cell.xml"]) == 2
    assert "is in the way" in capsys.readouterr().err
    assert [str(path.relative_to(tmp_path)) for path in sorted(tmp_path.rglob("*"))] == ["cell_assets", "cell_assets/notes.txt"]


@pytest.mark.render
@pytest.mark.parametrize(("name", "columns"), [("y", 1), ("cuboid", 2)])
def test_a_picture_shows_every_view_and_the_overhead_camera(name, columns, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["scenes", "show", name]) == 0
    picture = cv2.imread(f"{name}.png")
    assert picture.shape[0] == 960
    beside = picture[:, 1280:]
    assert beside.shape[1] > 800 * columns
    assert (beside.std(axis=2) > 30).mean() > 0.1  # depth is drawn in colours


@pytest.fixture
def mine(tmp_path, monkeypatch) -> Path:
    """A folder with a scene of one's own part: the straight plate written as files, in millimetres."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "job"
    folder.mkdir()
    part = make_workpiece(load_scene("straight"))
    mesh = part.build_mesh().to_trimesh()
    mesh.vertices = mesh.vertices * 1e3
    mesh.export(folder / "part.stl")
    curve = part.seam_curves()[0]
    rows = np.column_stack([curve.opening[::5], np.full(len(curve.s[::5]), 0.014)]) * 1e3
    np.savetxt(folder / "seam.csv", rows, delimiter=",", header="x,y,z,width", comments="")
    text = 'workpiece = "mesh"\n\n[mesh]\nfile = "part.stl"\nseam = "seam.csv"\nunits = "mm"\n\n[pose]\ny = "-450 mm"\n'
    (folder / "mine.toml").write_text(text)
    return folder


@pytest.mark.render
@pytest.mark.slow
def test_ones_own_part_is_scanned_welded_and_judged(mine, capsys):
    two_views = 'scene.views=[{standoff="400 mm"}, {standoff="400 mm", tilt="15 deg", heading="90 deg"}]'
    assert main(["run", "job/mine.toml", "--set", two_views, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["plan"]["mean"] < 0.4e-3
    assert report["iou"] > 0.85
    assert report["phantom_seams"] == 0
    assert (mine.parent / "runs" / "mine-0" / "path.json").is_file()


BAD = {
    "open mesh": ("is not closed", {"file": "open.stl"}, {}),
    "mesh in millimetres": ("looks like millimetres; state units = 'mm'", {"units": "m"}, {}),
    "missing mesh": ("no such file", {"file": "part2.stl"}, {}),
    "missing seam": ("no such file", {"seam": "seam2.csv"}, {}),
    "malformed seam": ("line 3", {"seam": "torn.csv"}, {}),
    "seam off the part": ("off the part", {"seam": "far.csv"}, {}),
    "unknown unit": ("not one of", {"units": "yard"}, {}),
    "unknown key": ("unknown", {"untis": "mm"}, {}),
    "unreachable pose": ("scan view 1", {}, {"pose": {"x": "400 mm", "y": "-600 mm", "clearance": "700 mm"}}),
    "beside the table": ("beyond the table's edge", {}, {"pose": {"y": "-2 m"}}),
    "in the base": ("inside the arm's base", {}, {"pose": {"y": "-20 mm"}}),
    "below the table": ("below the table", {}, {"pose": {"z": "-100 mm"}}),
}


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("command", ["run", "export"])
def test_bad_parts_are_one_line_and_nothing_is_written(command, case, mine, capsys):
    says, mesh, tables = BAD[case]
    if command == "export" and case == "unreachable pose":
        return  # a scene can be looked at where the arm cannot reach it
    (mine / "torn.csv").write_text("x,y,z\n0,0,0\n1,0\n")
    (mine / "far.csv").write_text("0,0,90\n100,0,90\n")
    data = (mine / "part.stl").read_bytes()
    count = int.from_bytes(data[80:84], "little") - 4
    (mine / "open.stl").write_bytes(data[:80] + count.to_bytes(4, "little") + data[84 : 84 + 50 * count])
    entries = {"file": "part.stl", "seam": "seam.csv", "units": "mm"} | mesh
    lines = ['workpiece = "mesh"', "[mesh]", *(f'{key} = "{value}"' for key, value in entries.items())]
    for table, values in tables.items():
        lines += [f"[{table}]", *(f'{key} = "{value}"' for key, value in values.items())]
    (mine / "mine.toml").write_text("\n".join(lines) + "\n")
    check_refused(mine.parent, words_for(command, "job/mine.toml"), says, capsys)


@pytest.mark.parametrize(
    ("scene", "setting", "says"),
    [
        ("straight", "groove.width=300 mm", "wider than the plate"),
        ("cylinder", "groove.width=300 mm", "wider than the cylinder"),
        ("cuboid", "groove.width=300 mm", "wider than the cuboid"),
        ("y", "groove.width=300 mm", "wider than the plate"),
        ("y_branches", "branches.junction=200 mm", "move the junction"),
        ("cylinder", "cylinder.raduis=300 mm", "raduis"),
        ("cuboid", "cuboid.length=-1 mm", "outside 0 to 3 m"),
        ("cylinder", "fixture.bolts=2", "bolts"),
        ("cylinder", "fixture.overlap=80 mm", "overlap"),
        ("cuboid", "workpiece=sphere", "not one of"),
    ],
)
def test_bad_figures_are_one_line_and_nothing_is_written(scene, setting, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for command in ("run", "export"):
        check_refused(tmp_path, [*words_for(command, scene), "--set", f"scene.{setting}"], says, capsys)


def words_for(command: str, scene: str) -> list[str]:
    return ["run", scene] if command == "run" else ["scenes", command, scene]


def check_refused(folder: Path, words: list[str], says: str, capsys) -> None:
    before = sorted(folder.rglob("*"))
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert says in err
    assert sorted(folder.rglob("*")) == before


def test_the_scenes_of_the_thesis_are_listed(capsys):
    assert {"straight", "curve", "cylinder", "cuboid", "y", "y_branches"} <= set(scene_names())
    assert main(["scenes", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["scenes"]
    assert [scene["name"] for scene in listed] == list(scene_names())
    assert all(scene["title"] for scene in listed)
