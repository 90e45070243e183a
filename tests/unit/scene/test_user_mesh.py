"""One's own part behaves as a built-in one of the same shape; files that cannot be used are refused in one line."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from weldsim.config import load_scene, structure
from weldsim.curves import project
from weldsim.errors import ConfigError, SceneError
from weldsim.scene.config import SceneConfig, make_workpiece
from weldsim.scene.files import anchored
from weldsim.scene.mesh_cache import cached_mesh
from weldsim.scene.workpieces.base import Workpiece
from weldsim.scene.workpieces.seam_file import read_seam_file
from weldsim.scene.workpieces.user_mesh import METRES, MeshConfig, UserMesh, make_user_mesh
from weldsim.scene.world import build_world

BUILT_IN = ("straight", "curve", "cylinder", "cuboid", "y")


def built_in(name: str) -> Workpiece:
    return make_workpiece(load_scene(name))


def written(
    folder: Path, workpiece: Workpiece, *, suffix: str = ".stl", units: str = "mm", columns: str = "x,y,z,width", step: int = 4
) -> MeshConfig:
    """The part and its seam as files in a frame of their own: shifted by (0.3, -0.2, 0.1) m."""
    shift, per_metre = np.array([0.3, -0.2, 0.1]), 1 / METRES[units]
    mesh = workpiece.build_mesh().to_trimesh()
    mesh.vertices = (mesh.vertices + shift) * per_metre
    mesh.export(folder / f"part{suffix}")
    curve = workpiece.seam_curves()[0]
    keep = np.unique([*range(0, len(curve.s), step), len(curve.s) - 1])
    values = {"width": np.full(len(keep), workpiece.section.width * per_metre)}  # type: ignore[attr-defined]
    for i, axis in enumerate("xyz"):
        values[axis] = (curve.opening[keep, i] + shift[i]) * per_metre
        values[f"n{axis}"] = curve.normals[keep, i]
    names = columns.split(",")
    np.savetxt(folder / "seam.csv", np.column_stack([values[name] for name in names]), delimiter=",", header=columns, comments="")
    return MeshConfig(file=str(folder / f"part{suffix}"), units=units, seam=str(folder / "seam.csv"))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", BUILT_IN)
@pytest.mark.parametrize("columns", ["x,y,z,width", "x,y,z,nx,ny,nz,width"])
def test_a_built_in_part_from_files_is_the_same_part(name: str, columns: str, tmp_path: Path) -> None:
    model = built_in(name)
    # A cuboid's seam turns in a point; a polyline without it would cut the corner.
    part = make_user_mesh(written(tmp_path, model, columns=columns, step=1 if name == "cuboid" else 4))
    (true,), (curve,) = model.seam_curves(), part.seam_curves()
    middle = curve.opening[len(curve.s) // 2]
    assert np.abs(middle).max() < 1e-9  # P's origin is the middle of the seam
    shift = part.vertices.min(axis=0) - model.build_mesh().vertices.min(axis=0)
    inside = (curve.s > 0.02) & (curve.s < curve.s[-1] - 0.02)
    if name == "cuboid":
        corners = true.opening[np.flatnonzero(np.abs(np.diff(true.tangents[:, 0])) > 0.1)] + shift
        inside &= np.linalg.norm(curve.opening[:, None] - corners, axis=2).min(axis=1) > 0.03
    for ours, theirs, within in (
        (curve.opening, true.opening, 1e-5),
        (curve.root, true.root, 2e-4),
        (curve.left, true.left, 3e-4),
        (curve.right, true.right, 3e-4),
    ):
        assert project(ours[inside], theirs + shift)[0].max() < within
    assert part.collision_boxes()
    # Labels agree over nearly the whole surface: of the groove's own, and of the rest.
    mine, theirs = part.build_mesh(), model.build_mesh()
    assert area(mine, True) == pytest.approx(area(theirs, True), rel=0.03)
    assert area(mine, False) == pytest.approx(area(theirs, False), rel=0.03)


def area(mesh: object, groove: bool) -> float:
    vertices, faces = mesh.part(groove=groove)  # type: ignore[attr-defined]
    return float(trimesh.Trimesh(vertices, faces, process=False).area)


@pytest.mark.parametrize(("suffix", "units"), [(".stl", "mm"), (".obj", "m"), (".ply", "cm"), (".stl", "inch")])
def test_every_format_and_unit_gives_the_same_part(suffix: str, units: str, tmp_path: Path) -> None:
    part = make_user_mesh(written(tmp_path, built_in("straight"), suffix=suffix, units=units))
    assert np.allclose(np.ptp(part.vertices, axis=0), [0.24, 0.225, 0.02], atol=1e-6)
    assert part.build_mesh().to_trimesh().is_watertight


def test_boxes_fill_the_part_and_leave_its_hollows(tmp_path: Path) -> None:
    part = make_user_mesh(replace(written(tmp_path, built_in("cylinder")), seam=None))
    mesh = part.build_mesh().to_trimesh()
    boxes = part.collision_boxes()
    assert sum(8 * box.half.prod() for box in boxes) == pytest.approx(mesh.volume, rel=0.05)
    assert len(boxes) < 600
    hollow = np.array([0.0, 0.0, -0.04])  # under the crest of the rolled plate, whose origin is the middle of its top
    assert not any((np.abs(hollow - box.centre) < box.half).all() for box in boxes)
    assert part.seam_curves() == ()
    assert not part.build_mesh().groove.any()
    assert part.vertices[:, 2].max() == pytest.approx(0)


def test_a_scene_file_finds_its_part_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "parts").mkdir()
    written(tmp_path / "parts", built_in("straight"))
    text = 'workpiece = "mesh"\n[mesh]\nfile = "parts/part.stl"\nseam = "parts/seam.csv"\nunits = "mm"\n'
    (tmp_path / "mine.toml").write_text(text)
    monkeypatch.chdir("/")
    config = load_scene(tmp_path / "mine.toml")
    assert config.name == "mine"
    world = build_world(config)
    assert world.known_seams[0].length == pytest.approx(0.24, abs=1e-6)
    assert len(world.geoms("groove")) == 1
    world.view_joints()
    assert load_scene(tmp_path / "mine.toml", ["mesh.units=cm"]).mesh == replace(config.mesh, units="cm")  # type: ignore[type-var]


def test_meshes_are_cached_by_content(tmp_path: Path) -> None:
    first = make_user_mesh(written(tmp_path, built_in("straight")))
    cached_mesh(first, tmp_path)
    assert len(list(tmp_path.glob("*.npz"))) == 1
    again = make_user_mesh(MeshConfig(file=str(tmp_path / "part.stl"), units="mm", seam=str(tmp_path / "seam.csv")))
    assert again.content == first.content
    (tmp_path / "seam.csv").write_text((tmp_path / "seam.csv").read_text() + "\n")
    other = make_user_mesh(MeshConfig(file=str(tmp_path / "part.stl"), units="mm", seam=str(tmp_path / "seam.csv")))
    assert other.content != first.content


def refused(config: MeshConfig) -> str:
    with pytest.raises(SceneError) as caught:
        make_user_mesh(config)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
    return str(caught.value)


@pytest.mark.parametrize(("drawn", "said"), [("mm", "m"), ("m", "mm"), ("cm", "m"), ("in", "m"), ("inch", "cm")])
def test_a_part_in_another_unit_is_told_the_units_that_make_it_one_and_they_do(tmp_path: Path, drawn: str, said: str) -> None:
    metres = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "inch": 0.0254}
    box = trimesh.creation.box(np.array([0.9, 0.1, 0.02]) / metres[drawn])
    box.export(tmp_path / "part.stl")
    config = MeshConfig(file=str(tmp_path / "part.stl"), units=said)  # type: ignore[arg-type]
    if 0.005 <= 0.9 / metres[drawn] * metres[said] <= 2.0:
        assert make_user_mesh(config)
        return
    told = re.findall(r"'(\w+)'", refused(config).partition("state units")[2])
    assert drawn.removesuffix("ch") in told
    for unit in told:
        assert make_user_mesh(replace(config, units=unit))


def test_meshes_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    good = written(tmp_path, built_in("straight"))
    assert "looks like millimetres; state units = 'mm'" in refused(replace(good, units="m"))
    metres = written(tmp_path, built_in("straight"), units="m")
    assert "looks like metres; state units = 'm'" in refused(replace(metres, units="mm"))
    assert "no such file" in refused(replace(good, file=str(tmp_path / "missing.stl")))
    assert ".step" in refused(replace(good, file=str(tmp_path / "part.step")))
    assert "cannot be read" in refused(replace(good, file=str(folder(tmp_path / "folder.stl"))))
    opened = trimesh.load_mesh(good.file)
    opened.update_faces(np.arange(len(opened.faces)) > 3)
    opened.export(tmp_path / "open.stl")
    assert "not closed" in refused(replace(good, units="m", file=str(tmp_path / "open.stl")))
    for name, content in (
        ("empty.stl", b""),
        ("text.obj", b"hello\n"),
        ("noise.ply", bytes(range(256)) * 9),
        ("dots.obj", b"v 0 0 0\n"),
    ):
        (tmp_path / name).write_bytes(content)
        assert name in refused(replace(good, file=str(tmp_path / name)))
    fine = trimesh.creation.icosphere(subdivisions=7, radius=0.1)
    fine.export(tmp_path / "fine.stl")
    assert "decimate" in refused(MeshConfig(file=str(tmp_path / "fine.stl"), units="m"))
    turned = trimesh.load_mesh(metres.file)
    turned.invert()
    turned.export(tmp_path / "inside_out.stl")
    mended = make_user_mesh(MeshConfig(file=str(tmp_path / "inside_out.stl"), units="m"))
    assert mended.build_mesh().to_trimesh().volume > 0
    assert mended.notes == ("inside_out.stl: it was inside out: turned",)


def folder(path: Path) -> Path:
    path.mkdir()
    return path


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no points"),
        ("# nothing\n\n", "no points"),
        ("x,y,z\n", "no points"),
        ("0,0,0\n", "one point"),
        ("0,0,0\n0,0,0\n", "all the same"),
        ("0,0\n1,1\n", "line 1: 2 columns"),
        ("0,0,0\n1,1\n", "line 2: 2 columns, 3 before"),
        ("0,0,0\n1,zwei,3\n", "line 2: '1 zwei 3' are no numbers"),
        ("0,0,0\n1,nan,3\n", "line 2: a number that is not finite"),
        ("x,y,depth\n1,2,3\n", "wanted are x, y, z"),
        ("x,y\n1,2\n", "wanted are x, y, z"),
        ("x,y,z,nx\n1,2,3,4\n", "wanted are x, y, z"),
        ("x,y,z,x\n1,2,3,4\n", "wanted are x, y, z"),
        ("0,0,0,-5\n1,0,0,5\n", "width is not positive"),
        ("0,0,0,0,0,0\n1,0,0,0,0,1\n", "a normal is zero"),
        ("0,0,0\n100,0,0\n", "off the part"),
    ],
)
def test_seams_that_cannot_be_used_are_refused(text: str, says: str, tmp_path: Path) -> None:
    config = written(tmp_path, built_in("straight"))
    (tmp_path / "seam.csv").write_text(text)
    assert says in refused(config)


def test_a_seam_off_the_part_is_refused_with_the_limit(tmp_path: Path) -> None:
    config = written(tmp_path, built_in("curve"))
    table = np.loadtxt(tmp_path / "seam.csv", delimiter=",", skiprows=1)
    np.savetxt(tmp_path / "seam.csv", table + np.array([0.0, 0.0, 20.0, 0.0]), delimiter=",")
    said = refused(config)
    assert "at most 8.0 mm" in said
    assert "check its frame and unit" in said
    (tmp_path / "seam.csv").write_bytes(b"\xff\xfe\x00")
    assert "is no text" in refused(config)
    (tmp_path / "seam.csv").unlink()
    assert "no such file" in refused(config)


def test_a_seam_in_another_unit_is_called_that_and_taken_with_its_unit_named(tmp_path: Path) -> None:
    config = written(tmp_path, built_in("straight"))
    table = np.loadtxt(tmp_path / "seam.csv", delimiter=",", skiprows=1)
    metres = np.hstack([table[:, :3], table[:, -1:]]) * 1e-3
    np.savetxt(tmp_path / "seam.csv", metres, delimiter=",")
    said = refused(config)
    assert "looks like metres" in said
    assert "x [m], y [m], z [m]" in said
    np.savetxt(tmp_path / "seam.csv", metres, delimiter=",", header="x [m],y [m],z [m],width [m]", comments="")
    assert make_user_mesh(config).curve is not None


def test_a_scene_says_which_part_it_has(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="give a table"):
        make_workpiece(SceneConfig(workpiece="mesh"))
    with pytest.raises(SceneError, match="write workpiece"):
        make_workpiece(SceneConfig(mesh=MeshConfig(file="a.stl", units="mm")))
    with pytest.raises(ConfigError, match=r"units. is missing: one of m, cm, mm, in, inch"):
        structure({"workpiece": "mesh", "mesh": {"file": "a.stl"}}, SceneConfig)
    with pytest.raises(ConfigError, match="not one of m, cm, mm, in, inch"):
        structure({"workpiece": "mesh", "mesh": {"file": "a.stl", "units": "furlong"}}, SceneConfig)
    with pytest.raises(ConfigError, match="seem"):
        structure({"workpiece": "mesh", "mesh": {"file": "a.stl", "units": "mm", "seem": "a.csv"}}, SceneConfig)
    tables = anchored({"mesh": {"file": "a.stl", "seam": "/b.csv"}}, tmp_path)
    assert tables == {"mesh": {"file": str(tmp_path / "a.stl"), "seam": "/b.csv"}}


@settings(max_examples=80)
@given(content=st.one_of(st.binary(max_size=200), st.text(alphabet="0123456789.,;eE+- xyzn\n#", max_size=200).map(str.encode)))
def test_a_seam_file_of_anything_is_read_or_refused_in_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes(content)
    try:
        seam = read_seam_file(path, 1e-3)
    except SceneError as error:
        said = str(error)
    else:
        said = ""
        assert len(seam.points) >= 2
        assert np.isfinite(seam.points).all()
    assert "\n" not in said


def test_user_meshes_are_workpieces() -> None:
    assert issubclass(UserMesh, Workpiece)
