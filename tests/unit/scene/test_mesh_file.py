"""Meshes as modellers export them: split vertices, many-cornered faces, turned facets, bodies inside out."""

import struct
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh

from weldsim.errors import SceneError
from weldsim.scene.workpieces.mesh_file import MeshFile, read_mesh_file
from weldsim.scene.workpieces.polygons import triangulated

# A plate of 240 x 160 x 20 mm with a V-groove of 14 x 8 mm along x: its ends are polygons with a notch.
PROFILE = [(80, 0), (80, 20), (7, 20), (0, 12), (-7, 20), (-80, 20), (-80, 0)]
CORNERS = np.array([(x, y, z) for x in (-120, 120) for y, z in PROFILE], float)
POLYGONS = [[6, 5, 4, 3, 2, 1, 0], [7, 8, 9, 10, 11, 12, 13], *[[i, (i + 1) % 7, (i + 1) % 7 + 7, i + 7] for i in range(7)]]
VOLUME = (160 * 20 - 14 * 8 / 2) * 240.0
AREA = 2 * (160 * 20 - 56) + 240 * (160 + 2 * 20 + 2 * 73 + 2 * np.hypot(7, 8))


def stl(path: Path, corners: np.ndarray, faces: np.ndarray, *, text: bool = False, name: bytes = b"part") -> Path:
    """An STL as it stands, whatever its winding; trimesh's own writer is for closed meshes too, but normals do not matter here."""
    triangles = corners[faces]
    if text:
        rows = ["\n".join(["facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in each)]) for each in triangles]
        body = "\nendloop\nendfacet\n".join(rows) + "\nendloop\nendfacet\n"
        path.write_bytes(b"solid " + name + b"\n" + body.encode() + b"endsolid\n")
        return path
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *each.ravel(), 0) for each in triangles)
    path.write_bytes(name.ljust(80, b" ") + struct.pack("<I", len(triangles)) + rows)
    return path


def obj(path: Path, corners: np.ndarray, polygons: Sequence[Sequence[int]], face: str = "{0}", *, tail: str = "") -> Path:
    lines = [f"v {x:g} {y:g} {z:g}{tail}" for x, y, z in corners]
    lines += [f"f {' '.join(face.format(corner + 1, i + 1) for corner in each)}" for i, each in enumerate(polygons)]
    path.write_text("\n".join([*lines, ""]))
    return path


def as_mesh(read: MeshFile) -> trimesh.Trimesh:
    mesh = trimesh.Trimesh(read.vertices, read.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    return mesh


def is_the_plate(read: MeshFile) -> None:
    assert as_mesh(read).volume == pytest.approx(VOLUME)
    assert as_mesh(read).area == pytest.approx(AREA)  # a fan over the notched ends would be larger


FACES = triangulated(CORNERS, POLYGONS)
BOX = trimesh.creation.box((40.0, 30.0, 30.0))
BLOCK = np.array(BOX.vertices) + np.array([0.0, 50.0, 35.0])


@pytest.mark.parametrize(
    ("face", "tail", "before"),
    [
        ("{0}", "", ""),
        ("{0}//{1}", "", "vn 0 0 1\n" * 9),
        ("{0}/{1}", "", "vt 0 0\n" * 9),
        ("{0}/{1}/{1}", " 0.5 0.5 0.5", "mtllib none.mtl\no part\ng side\nusemtl steel\ns off\nvt 0 0\nvn 0 0 1\n"),
    ],
)
def test_an_obj_of_any_dialect_is_the_same_part(tmp_path: Path, face: str, tail: str, before: str) -> None:
    path = obj(tmp_path / "a.obj", CORNERS, POLYGONS, face, tail=tail)
    path.write_text(
        f"# Gr\u00f6\u00dfe in mm\n{before}" + path.read_text().replace("f ", "usemtl other\nf ", 3), encoding="latin-1"
    )
    is_the_plate(read_mesh_file(path))


def test_an_obj_whose_every_face_has_vertices_of_its_own_counted_from_the_end(tmp_path: Path) -> None:
    lines = []
    for each in POLYGONS:
        lines += [f"v {x:g} {y:g} {z:g}" for x, y, z in CORNERS[each]]
        lines.append("f " + " ".join(f"-{len(each) - i}" for i in range(len(each))))
    (tmp_path / "a.obj").write_text("\n".join(lines))
    is_the_plate(read_mesh_file(tmp_path / "a.obj"))
    assert len(read_mesh_file(tmp_path / "a.obj").vertices) == 14


def test_an_obj_that_names_no_vertex_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n")
    with pytest.raises(SceneError, match="a face names vertex 4 of 3"):
        read_mesh_file(tmp_path / "a.obj")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 zwei 0\n")
    with pytest.raises(SceneError, match="line 2: 'v 1 zwei 0'"):
        read_mesh_file(tmp_path / "a.obj")


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
def test_a_ply_with_notched_faces_is_the_same_part(tmp_path: Path, order: str, name: str) -> None:
    kind = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {kind} 1.0\ncomment Gr\u00f6\u00dfe\nelement vertex 14\nproperty float x\nproperty float y\n"
        "property float z\n"
        f"property uchar red\nelement face 9\nproperty list uchar int {name}\nproperty uchar flags\nend_header\n"
    ).encode("latin-1")
    if order == "":
        rows = [f"{x} {y} {z} 7" for x, y, z in CORNERS] + [f"{len(p)} {' '.join(map(str, p))} 1" for p in POLYGONS]
        body = "\n".join(rows).encode()
    else:
        body = b"".join(struct.pack(order + "3fB", *corner, 7) for corner in CORNERS)
        body += b"".join(struct.pack(f"{order}B{len(p)}iB", len(p), *p, 1) for p in POLYGONS)
    (tmp_path / "a.ply").write_bytes(head + body)
    is_the_plate(read_mesh_file(tmp_path / "a.ply"))
    (tmp_path / "a.ply").write_bytes((head + body)[:-9])
    with pytest.raises(SceneError, match=r"a\.ply"):
        read_mesh_file(tmp_path / "a.ply")


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("name", [b"part", b"Gr\xf6\xdfe", b"solid of sorts"])
def test_an_stl_with_turned_facets_has_them_turned_back_and_told(tmp_path: Path, text: bool, name: bytes) -> None:
    rng = np.random.default_rng(0)
    for number in (1, 5, 12, 23):
        faces, turned = FACES.copy(), rng.choice(len(FACES), number, replace=False)
        faces[turned] = faces[turned][:, ::-1]
        read = read_mesh_file(stl(tmp_path / "a.stl", CORNERS, faces, text=text, name=name))
        is_the_plate(read)
        verb = "was" if number == 1 else "were"
        assert read.notes == (f"a.stl: {number} of its 24 facets {verb} turned the wrong way: turned back",)
    assert read_mesh_file(stl(tmp_path / "a.stl", CORNERS, FACES, text=text, name=name)).notes == ()
    assert read_mesh_file(stl(tmp_path / "a.stl", CORNERS, FACES[:, ::-1], text=text)).notes == (
        "a.stl: it was inside out: turned",
    )


@pytest.mark.parametrize("inverted", [(), (0,), (1,), (2,), (0, 2), (0, 1, 2)])
def test_every_body_is_turned_outward_by_its_own_volume(tmp_path: Path, inverted: tuple[int, ...]) -> None:
    parts = [(CORNERS, FACES), (BLOCK, BOX.faces), (BLOCK - [0, 100, 0], BOX.faces)]
    corners = np.vstack([part for part, _ in parts])
    faces = np.vstack(
        [
            (each[:, ::-1] if i in inverted else each) + start
            for i, ((_, each), start) in enumerate(zip(parts, (0, 14, 22), strict=True))
        ]
    )
    read = read_mesh_file(stl(tmp_path / "a.stl", corners, faces))
    mesh = trimesh.Trimesh(read.vertices, read.faces, process=False)
    volumes = sorted(body.volume for body in mesh.split(only_watertight=False))
    assert volumes == pytest.approx([36_000, 36_000, VOLUME])
    told = () if not inverted else (f"a.stl: of its 3 bodies {len(inverted)} inside out: turned",)
    assert read.notes == told


@pytest.mark.parametrize("outer", [1, -1])
@pytest.mark.parametrize("inner", [1, -1])
def test_a_hollow_stays_a_hollow(tmp_path: Path, outer: int, inner: int) -> None:
    hull, hole = trimesh.creation.box((100, 100, 50)), trimesh.creation.icosphere(2, 20)
    faces = np.vstack([hull.faces[:, ::outer], hole.faces[:, ::inner] + len(hull.vertices)])
    read = read_mesh_file(stl(tmp_path / "a.stl", np.vstack([hull.vertices, hole.vertices]), faces))
    assert as_mesh(read).volume == pytest.approx(500_000 - hole.volume, rel=1e-5)


def test_bodies_that_touch_along_an_edge_or_stand_on_one_another_are_closed(tmp_path: Path) -> None:
    side = trimesh.creation.box((40, 30, 30))
    for shift in ([40, 30, 0], [-40, 30, 0], [0, 0, 30], [0, 30, 0]):  # along an edge of four faces, and face to face
        corners = np.vstack([side.vertices, side.vertices + shift])
        read = read_mesh_file(stl(tmp_path / "a.stl", corners, np.vstack([side.faces, side.faces + 8])))
        volume = trimesh.Trimesh(read.vertices, read.faces, process=False).volume
        assert volume == pytest.approx(2 * 36_000)
        assert read.notes == ()


def test_places_that_differ_by_a_digit_are_one(tmp_path: Path) -> None:
    corners = CORNERS[FACES].reshape(-1, 3) + np.random.default_rng(1).uniform(-4e-5, 4e-5, (72, 3))
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners] + [f"f {i} {i + 1} {i + 2}" for i in range(1, 73, 3)]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    assert as_mesh(read_mesh_file(tmp_path / "a.obj")).volume == pytest.approx(VOLUME, rel=1e-5)


def test_facets_that_are_there_twice_are_left_out_once(tmp_path: Path) -> None:
    read = read_mesh_file(stl(tmp_path / "a.stl", CORNERS, np.vstack([FACES, FACES[3:6]])))
    is_the_plate(read)
    assert read.notes == ()  # the same facet again says nothing new
    read = read_mesh_file(stl(tmp_path / "a.stl", CORNERS, np.vstack([FACES, FACES[3:6, ::-1]])))
    is_the_plate(read)
    assert read.notes == ("a.stl: facets that were there twice: left out once",)


def test_a_surface_that_is_open_is_refused_with_the_place_and_filling_it_works(tmp_path: Path) -> None:
    path = stl(tmp_path / "a.stl", CORNERS, FACES[:-1])
    with pytest.raises(SceneError, match=r"is not closed: of its 36 edges 3 have one face only, the first at \(.*fill holes"):
        read_mesh_file(path)
    is_the_plate(read_mesh_file(stl(path, CORNERS, np.vstack([FACES[:-1], FACES[-1:, ::-1]]))))  # filled, by whatever winding


def test_a_strip_with_one_side_is_refused_as_that(tmp_path: Path) -> None:
    # The real projective plane in six vertices: closed, every edge with two faces, and without an outside.
    faces = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 1), (1, 2, 4), (2, 3, 5), (3, 4, 1), (4, 5, 2), (5, 1, 3)]
    corners = np.array([(0, 0, 9), (10, 0, 0), (3, 9, 1), (-8, 5, 2), (-8, -5, 3), (3, -9, 4)], float)
    with pytest.raises(SceneError, match="has one side only, like a Moebius strip"):
        read_mesh_file(stl(tmp_path / "a.stl", corners, np.array(faces)))


def test_polygons_are_cut_into_as_many_triangles_and_their_area() -> None:
    rng = np.random.default_rng(3)
    for corners in range(4, 12):
        angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
        radius = rng.uniform(0.2, 1.0, corners)  # a star about its middle: seldom convex, never crossing itself
        star = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
        if np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() > np.pi:
            continue
        faces = triangulated(star, [list(range(corners))])
        crosses = np.cross(star[faces[:, 1]] - star[faces[:, 0]], star[faces[:, 2]] - star[faces[:, 0]])[:, 2]
        x, y = star[:, 0], star[:, 1]
        assert len(faces) == corners - 2
        assert (crosses > 0).all()
        assert crosses.sum() == pytest.approx(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply"])
def test_a_mesh_is_known_by_its_content_not_by_its_name(tmp_path: Path, suffix: str) -> None:
    for written in (
        stl(tmp_path / "a.stl", CORNERS, FACES),
        stl(tmp_path / "b.stl", CORNERS, FACES, text=True),
        obj(tmp_path / "c.obj", CORNERS, POLYGONS),
    ):
        is_the_plate(read_mesh_file(written.rename(tmp_path / f"renamed{suffix}")))


def test_an_stl_that_is_cut_off_is_called_that_and_bytes_after_it_are_passed_over(tmp_path: Path) -> None:
    path = stl(tmp_path / "part.stl", CORNERS, FACES)
    whole = path.read_bytes()
    path.write_bytes(whole + b"\0" * 17)
    is_the_plate(read_mesh_file(path))
    path.write_bytes(whole[:-60])
    with pytest.raises(SceneError, match=rf"promises {len(FACES)} facets, the file holds {len(FACES) - 2}: cut off"):
        read_mesh_file(path)


def parted(count: int, off: float, each: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """The plate with `each` new vertices on an edge of `count` facets, of one side of the edge alone, `off` [rms mm] beside it."""
    rng = np.random.default_rng(count)
    corners, faces = list(CORNERS), FACES.tolist()
    for _ in range(count):
        a, b, c = faces.pop(int(rng.integers(len(faces))))
        chain = [a]
        for share in np.sort(rng.uniform(0.2, 0.8, each)):
            corners.append(corners[a] + share * (corners[b] - corners[a]) + off * rng.normal(size=3))
            chain.append(len(corners) - 1)
        faces += [[first, second, c] for first, second in pairwise([*chain, b])]
    return np.array(corners), np.array(faces)


@pytest.mark.parametrize(("count", "each"), [(1, 1), (3, 3), (10, 2), (40, 1)])
def test_vertices_on_edges_of_other_facets_part_these_and_that_is_told(tmp_path: Path, count: int, each: int) -> None:
    read = read_mesh_file(stl(tmp_path / "a.stl", *parted(count, 0.0, each)))
    is_the_plate(read)
    which = "1 vertex" if count == 1 else f"{count * each} vertices"
    assert read.notes == (f"a.stl: {which} on edges of other facets: these facets were parted there",)


def test_gaps_up_to_a_thousandth_of_the_part_are_stitched_and_told_and_wider_ones_are_not(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for width in (0.002, 0.02, 0.1):
        apart = CORNERS[FACES].reshape(-1, 3) + rng.uniform(-width, width, (72, 3))
        for corners, faces in ((apart, np.arange(72).reshape(-1, 3)), parted(10, width / 3)):
            read = read_mesh_file(stl(tmp_path / "a.stl", corners, faces))
            assert as_mesh(read).volume == pytest.approx(VOLUME, rel=0.05 * width)
            (note,) = read.notes
            gap = float(note.partition("gaps of up to ")[2].split()[0])
            assert 0.3 * width < gap < 4 * width
    apart = CORNERS[FACES].reshape(-1, 3) + rng.uniform(-2.0, 2.0, (72, 3))
    with pytest.raises(SceneError, match=r"72 have one face only.*export it as a solid"):
        read_mesh_file(stl(tmp_path / "a.stl", apart, np.arange(72).reshape(-1, 3)))


def test_a_hole_with_a_fine_border_is_not_stitched(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(5, 100.0)  # edges of 3 to 4 mm
    kept = np.linalg.norm(ball.triangles_center - [0, 0, 100], axis=1) > 8.0
    with pytest.raises(SceneError, match="have one face only"):
        read_mesh_file(stl(tmp_path / "a.stl", np.array(ball.vertices), np.array(ball.faces)[kept]))
    fine = np.array(ball.vertices)
    fine[np.linalg.norm(fine - [0, 0, 100], axis=1) < 12.0, :2] *= 0.03  # edges shorter than gaps that are stitched, along a hole
    with pytest.raises(SceneError, match="have one face only"):
        read_mesh_file(stl(tmp_path / "a.stl", fine, np.array(ball.faces)[kept]))


def test_a_surface_without_thickness_is_called_that(tmp_path: Path) -> None:
    path = stl(tmp_path / "a.stl", CORNERS, FACES[:6])
    with pytest.raises(SceneError, match="a surface without thickness is no part: export it as a solid"):
        read_mesh_file(path)
