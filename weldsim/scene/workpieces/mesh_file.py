"""The closed surface in a mesh file: STL, OBJ or PLY, with vertices merged by place and every body's faces outward."""

import io
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.columns import decode
from weldsim.counted import counted
from weldsim.errors import SceneError
from weldsim.scene.workpieces.ply_faces import read_ply_mesh
from weldsim.scene.workpieces.polygons import triangulated
from weldsim.scene.workpieces.shells import Broken, Shells, outward
from weldsim.scene.workpieces.stitches import stitched

SUFFIXES = (".stl", ".obj", ".ply")
MOST_FACES = 200_000
SAME_PLACE = 1e-6  # of the part's longest side: vertices nearer to one another are one, where exact places leave it open
GAPS = (SAME_PLACE, 1e-5, 1e-4, 1e-3)  # of the part's longest side, one after the other: gaps so wide are stitched
_STL_HEAD = 84  # bytes before the facets of a binary STL, the last four of them their number
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_OBJ = re.compile(rb"^v[ \t]+[-+.\d]", re.MULTILINE)
_COMMA = re.compile(rb"(?<=\d),(?=\d)")


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshFile:
    """What a mesh file holds.

    Attributes:
        vertices: (v, 3) in the file's unit.  faces: (f, 3) outward, closed.
        content: the file's bytes.
        notes: what was mended, one sentence each, for people.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    content: bytes
    notes: tuple[str, ...]


def read_mesh_file(path: Path) -> MeshFile:
    """The surface in a file. Normals, textures, materials and groups are passed over; faces of many corners are cut in triangles.

    Raises:
        SceneError: a file that is missing, of another kind or unreadable, without triangles, with too many, or whose surface is
            not closed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(
            f"mesh.file {path}: {path.suffix or 'no suffix'}; known are {', '.join(SUFFIXES)}", path=str(path), allowed=SUFFIXES
        )
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"mesh.file {path}: no such file", path=str(path), key="file") from None
    except OSError as error:
        raise SceneError(f"mesh.file {path}: cannot be read ({error.strerror})", path=str(path), key="file") from None
    try:
        vertices, faces = _read_any(content)
    except Exception as error:  # readers raise whatever the bytes lead them to
        raise SceneError(
            f"mesh.file {path}: no {path.suffix[1:].upper()} ({type(error).__name__}: {error or 'it ends too early'})",
            path=str(path),
        ) from None
    if len(faces) == 0 or not np.isfinite(vertices).all():
        raise SceneError(f"mesh.file {path}: holds no triangles", path=str(path), key="file")
    if len(faces) > MOST_FACES:
        raise SceneError(
            f"mesh.file {path}: {len(faces)} triangles; at most {MOST_FACES} are drawn, so decimate it", limit=MOST_FACES
        )
    try:
        vertices, shells = _closed(vertices, faces)
    except Broken as error:
        raise SceneError(f"mesh.file {path}: {error}", path=str(path), key="file") from None
    return MeshFile(vertices=vertices, faces=shells.faces, content=content, notes=tuple(f"{path.name}: {n}" for n in shells.notes))


def _closed(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> tuple[Float[ndarray, "w 3"], Shells]:
    """The surface by as few changes as close it: none, vertices merged by place, facets that are there twice left out, walls
    between bodies left out, places rounded, facets parted where others' vertices lie on their edges, gaps stitched.

    Raises:
        Broken: none of them does; the reason is that of the merged surface.
    """
    merged, size = _merged(vertices, faces), float(np.ptp(vertices, axis=0).max())
    reason = None
    for change in (
        lambda: (vertices, faces, ""),
        lambda: (*merged, ""),
        lambda: (*_once(*merged), "facets that were there twice: left out once"),
        lambda: (*_without_walls(*merged), ""),
        lambda: (*_merged(*merged, SAME_PLACE * size), ""),
        *(partial(_stitched, *merged, share * size) for share in GAPS),
    ):
        changed, kept, note = change()
        if len(kept) == 0:
            continue
        try:
            shells = outward(changed, kept)
        except Broken as error:
            reason = error if changed is not vertices and reason is None else reason
            continue
        return changed, Shells(shells.faces, (note, *shells.notes) if note else shells.notes)
    raise reason or Broken("holds no triangles")


def _stitched(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], tolerance: float
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"], str]:
    """With its borders stitched, and what was done for people."""
    found = stitched(vertices, faces, tolerance)
    done = []
    if found.parted:
        one = found.parted == 1
        done.append(f"{found.parted} {'vertex' if one else 'vertices'} on edges of other facets: these facets were parted there")
    if found.gap > SAME_PLACE * float(np.ptp(vertices, axis=0).max()):
        done.append(f"gaps of up to {found.gap:.2g} of its unit between facets: closed")
    return found.vertices, found.faces, "; ".join(done)


def _once(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "g 3"]]:
    """With one facet alone on the same three vertices."""
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices, faces[np.sort(first)]


def _without_walls(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]
) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "g 3"]]:
    """Without pairs of faces on the same three vertices: the wall between two bodies that stand on one another."""
    _, which, number = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    return vertices, faces[number[which.ravel()] == 1]


def _read_any(content: bytes) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """Vertices and faces, not merged yet, of what the content shows, whatever the file is called. Raises whatever it leads to."""
    is_ply = content.removeprefix(b"\xef\xbb\xbf").lstrip()[:4].rstrip() == b"ply"
    if b"\0" not in content or content.lstrip().startswith(b"ply\nformat ascii"):  # a text
        content = decode(_COMMA.sub(b".", content)).encode()
    if is_ply:
        points, polygons = read_ply_mesh(content)
        return points, triangulated(points, polygons)
    if _OBJ.search(content) is not None and b"\0" not in content:
        return _read_obj(content)
    if b"\0" in content and len(content) >= _STL_HEAD:
        return _read_binary_stl(content)
    import trimesh

    mesh = trimesh.load_mesh(io.BytesIO(content), file_type="stl", process=False)
    if not isinstance(mesh, trimesh.Trimesh):
        raise TypeError("no mesh")
    return np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)


def _read_binary_stl(content: bytes) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """Corners and facets of a binary STL; bytes after them are passed over. Raises ValueError for one that is cut off."""
    count = int.from_bytes(content[_STL_HEAD - 4 : _STL_HEAD], "little")
    held = (len(content) - _STL_HEAD) // _FACET.itemsize
    if count > held:
        raise ValueError(f"its header promises {counted(count, 'facet')}, the file holds {held}: cut off?")
    corners = np.frombuffer(content, _FACET, count, _STL_HEAD)["corners"].reshape(-1, 3).astype(float)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _read_obj(content: bytes) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """Vertices and faces of an OBJ: `v x y z ...`, `f` with 1/2/3, 1//3 or 1, also counted from the end. Raises ValueError."""
    vertices: list[list[float]] = []
    polygons: list[list[int]] = []
    for number, line in enumerate(content.decode().replace("\\\n", " ").split("\n"), 1):
        words = line.partition("#")[0].split()
        if not words or words[0] not in ("v", "f"):
            continue
        try:
            if words[0] == "v":
                vertices.append([float(word) for word in words[1:4]])
                if len(words) < 4:
                    raise ValueError
            else:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                polygons.append([corner - 1 if corner > 0 else len(vertices) + corner for corner in corners])
                if len(corners) < 3 or 0 in corners or min(polygons[-1]) < 0:
                    raise ValueError
        except ValueError:
            raise ValueError(f"line {number}: {line.strip()[:40]!r}") from None
    points = np.array(vertices, float).reshape(-1, 3)
    if polygons and max(map(max, polygons)) >= len(points):
        raise ValueError(f"a face names vertex {max(map(max, polygons)) + 1} of {len(points)}")
    return points, triangulated(points, polygons)


def _merged(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], tolerance: float = 0.0
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"]]:
    """Vertices at one place made one; faces that lose a corner by it, and second copies of a face, are left out."""
    unique, which = np.unique(vertices, axis=0, return_inverse=True)
    which = which.ravel()
    if tolerance > 0:
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import KDTree

        pairs = KDTree(unique).query_pairs(tolerance, output_type="ndarray")
        graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(unique), len(unique)))
        _, group = connected_components(graph, directed=False)
        _, first = np.unique(group, return_index=True)
        unique, which = unique[first], group[which]
    faces = which[faces]
    corners = np.sort(faces, axis=1)
    faces = faces[(corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])]
    lowest = faces.argmin(axis=1)[:, None]
    turned = np.take_along_axis(faces, (lowest + np.arange(3)) % 3, axis=1)  # the same face begins with any corner
    _, once = np.unique(turned, axis=0, return_index=True)
    faces = faces[np.sort(once)]
    used, index = np.unique(faces, return_inverse=True)
    return unique[used], index.reshape(-1, 3)
