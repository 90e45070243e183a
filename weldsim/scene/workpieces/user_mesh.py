"""One's own part: a closed mesh from a file, with the seam that a second file gives, or none."""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.curves import arc_length, interpolate, project, resample, tangents
from weldsim.errors import SceneError
from weldsim.frames import unit
from weldsim.scene.workpieces.base import Box, ClampPlace, LabelledMesh, SeamCurve, Workpiece
from weldsim.scene.workpieces.mesh_file import read_mesh_file
from weldsim.scene.workpieces.seam_file import SeamFile, read_seam_file
from weldsim.scene.workpieces.seam_order import check_order
from weldsim.scene.workpieces.solid import SWEEP_STEP
from weldsim.scene.workpieces.triangles import column_runs, distance_to_faces, ray_lengths

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "inch": 0.0254}
NAMES = {"mm": "millimetres", "cm": "centimetres", "in": "inches", "m": "metres"}
READING = "mesh file/2"  # change it when files are read otherwise, so that kept meshes of old readings are left alone
SHORTEST = 0.01  # of the part's longest side: a shorter seam must be in another unit
LARGEST, SMALLEST = 2.0, 0.005  # [m] of a part's longest side: beyond, its unit must be wrong
USUAL = 0.02  # [m] of a part in the unit that is proposed, at least
NEAR = 0.010  # [m] a seam of unknown width may be so far from the part's surface
EVERY = 4  # samples of a seam between looks at the surface beside it
COLUMNS = 24  # of boxes to collide with, along the part's longer side


@dataclass(frozen=True)
class MeshConfig:
    """One's own part. Axes are the file's, z up; P's origin is the middle of the seam, or of the part's top without one.

    Attributes:
        file: STL, OBJ or PLY, a closed surface; its path starts where the scene's file is.
        units: of the lengths in both files.
        seam: CSV of the groove's opening (see `read_seam_file`); none leaves the part without a known seam.
    """

    file: str
    units: Literal["m", "cm", "mm", "in", "inch"]
    seam: str | None = None


@final
@dataclass(frozen=True, eq=False)
class UserMesh(Workpiece):
    """A part from a file. Nothing clamps it: what holds it can be part of the mesh.

    Attributes:
        title: name of the file.  digest: of both files' contents and the unit.
        vertices, faces: of the closed surface, in P [m].
        curve: its seam, where it is known.  width: between the lips at the samples of the seam, where that is known [m].
        mended: what was mended in the file, one sentence each.
    """

    title: str
    digest: str
    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    curve: SeamCurve | None
    width: Float[ndarray, "n"] | None
    mended: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        return self.mended

    @property
    def name(self) -> str:
        return self.title

    @property
    def content(self) -> str:
        return self.digest

    def build_mesh(self) -> LabelledMesh:
        """The file's triangles; those whose corners lie between the lips and below them are the groove's."""
        groove = (
            np.zeros(len(self.faces), bool) if self.curve is None or self.width is None else self._in_groove(self.curve, self.width)
        )
        return LabelledMesh(vertices=self.vertices, faces=self.faces, groove=groove)

    def _in_groove(self, curve: SeamCurve, width: Float[ndarray, "n"]) -> Bool[ndarray, "f"]:
        _, foot, s = project(self.vertices, curve.opening)

        def at(values: Float[ndarray, "_ d"]) -> Float[ndarray, "_ d"]:
            return interpolate(curve.s, values, s)

        offset, inward = self.vertices - foot, unit(at(curve.bisectors))
        left = np.cross(unit(at(curve.tangents)), inward)
        across, below = np.abs(np.einsum("ij,ij->i", offset, left)), np.einsum("ij,ij->i", offset, inward)
        along = np.abs(np.einsum("ij,ij->i", offset, unit(at(curve.tangents))))
        half, depth = at(width[:, None])[:, 0] / 2, np.linalg.norm(at(curve.root) - foot, axis=1)
        slack = 0.02 * half + 1e-4
        inside = (across <= half + slack) & (below > -half) & (below < depth + 2 * half) & (along < half)
        return inside[self.faces].all(axis=1) & (below[self.faces] > slack[self.faces]).any(axis=1)

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        return () if self.curve is None else (self.curve,)

    @property
    def seams_are_known(self) -> bool:
        return self.curve is not None

    @property
    def region_is_known(self) -> bool:
        return self.width is not None

    def collision_boxes(self) -> tuple[Box, ...]:
        """Upright boxes that fill the part, column by column; neighbours of equal height are one."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        pitch = float((high - low)[:2].max()) / COLUMNS
        counts = np.maximum(1, np.round((high - low)[:2] / pitch)).astype(int)
        half = (high - low)[:2] / counts / 2
        x, y = (low[i] + (2 * np.arange(counts[i]) + 1) * half[i] + 1.3e-7 for i in range(2))
        boxes = []
        for at in x:
            runs = column_runs(self.vertices, self.faces, float(at), y)
            boxes += [_column(at, y, half, run) for run in _joined(runs)]
        return tuple(boxes)

    @property
    def base_corners(self) -> Float[ndarray, "k 3"]:
        """Of the box about the part."""
        (x0, y0, z), (x1, y1, _) = self.vertices.min(axis=0), self.vertices.max(axis=0)
        return np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])

    def clamp_places(self, count: int) -> tuple[ClampPlace, ...]:
        """None, whatever is asked for."""
        return ()


def make_user_mesh(config: MeshConfig) -> UserMesh:
    """The part in a file.

    Raises:
        SceneError: a file that is missing, of another kind or unreadable, a surface that is not closed or too fine, a size that
            speaks of another unit, or a seam that lies off the part or whose points are not in order.
    """
    path, scale = Path(config.file), METRES[config.units]
    mesh = read_mesh_file(path)
    vertices, faces, notes = mesh.vertices * scale, mesh.faces, mesh.notes
    _check_size(path, vertices, config.units)
    digest = hashlib.sha256(READING.encode() + mesh.content + config.units.encode())
    if config.seam is None:
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        origin = np.array([*(low + high)[:2] / 2, high[2]])
        return UserMesh(path.stem, digest.hexdigest(), vertices - origin, faces, None, None, notes)
    seam = read_seam_file(Path(config.seam), scale)
    check_order(Path(config.seam), seam.points)
    digest.update(Path(config.seam).read_bytes())
    _check_near(Path(config.seam), seam, vertices, faces)
    middle = resample(seam.points, SWEEP_STEP)
    origin = middle[len(middle) // 2]
    vertices = vertices - origin
    curve, width = _curve(path.stem, replace(seam, points=seam.points - origin), vertices, faces)
    return UserMesh(path.stem, digest.hexdigest(), vertices, faces, curve, width, notes)


def _check_size(path: Path, vertices: Float[ndarray, "v 3"], units: str) -> None:
    size = float(np.ptp(vertices, axis=0).max())
    if SMALLEST <= size <= LARGEST:
        return
    sizes = {name: size / METRES[units] * METRES[name] for name in NAMES}
    fits = {name: length for name, length in sizes.items() if USUAL <= length <= LARGEST}
    advice = "look at the file"
    if len(fits) == 1:
        advice = f"looks like {NAMES[next(iter(fits))]}; state units = {next(iter(fits))!r}"
    elif fits:
        advice = "state units = " + " or ".join(f"{name!r} ({1e3 * length:.4g} mm long)" for name, length in fits.items())
    raise SceneError(
        f"mesh.file {path}: is {size:.4g} m long with units = {units!r}, must be {SMALLEST:g} to {LARGEST:g} m: {advice}",
        path=str(path),
        key="units",
        limit=(SMALLEST, LARGEST),
    )


def _check_near(path: Path, seam: SeamFile, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> None:
    """Raises SceneError where the seam is farther from the surface than an opening can be."""
    length, size = float(arc_length(seam.points)[-1]), float(np.ptp(vertices, axis=0).max())
    if length < SHORTEST * size:
        raise SceneError(
            f"mesh.seam {path}: is {length * 1e3:.2g} mm long on a part of {size * 1e3:.4g} mm: looks like metres; a unit that"
            " is not the mesh's goes with the names of the columns: x [m], y [m], z [m]",
            path=str(path),
            key="seam",
            limit=SHORTEST * size,
        )
    points = resample(seam.points, max(SWEEP_STEP, length / 100))
    limit = NEAR if seam.width is None else float(seam.width.max()) / 2 + 1e-3
    distance = distance_to_faces(vertices, faces, points)
    if distance.max() > limit:
        x, y, z = points[distance.argmax()]
        raise SceneError(
            f"mesh.seam {path}: lies {distance.max() * 1e3:.1f} mm off the part at ({x:.4f}, {y:.4f}, {z:.4f}) m, at most"
            f" {limit * 1e3:.1f} mm is an opening; check its frame and unit, both are the mesh's",
            path=str(path),
            key="seam",
            limit=limit,
        )


def _curve(
    name: str, seam: SeamFile, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]
) -> tuple[SeamCurve, Float[ndarray, "n"] | None]:
    """The seam's samples: lips by the width, the root where a ray along the bisector meets the part."""
    line = resample(seam.points, SWEEP_STEP)
    s, along = arc_length(line), tangents(line)
    given = arc_length(seam.points)
    width = None if seam.width is None else np.interp(s, given, seam.width)
    outward = (
        _outward(line, 0.010 if width is None else float(width.mean()), vertices, faces)
        if seam.normals is None
        else interpolate(given, unit(seam.normals), s)
    )
    outward = outward - np.einsum("ij,ij->i", outward, along)[:, None] * along
    length = np.linalg.norm(outward, axis=1)
    if not (length > 0.05).all():
        where = line[int(length.argmin())]
        raise SceneError(
            f"mesh.seam: at ({where[0]:.4f}, {where[1]:.4f}, {where[2]:.4f}) m from its middle the surface has no outward normal"
            " across the seam; give nx, ny, nz in the seam's file",
            key="seam",
        )
    outward = outward / length[:, None]
    few = np.unique(np.linspace(0, len(s) - 1, min(len(s), 400)).astype(int))
    deep = ray_lengths(vertices, faces, line[few] + 1e-3 * outward[few], -outward[few]) - 1e-3
    deep = np.interp(s, s[few], np.where(np.isfinite(deep), np.maximum(deep, 0.0), 0.0))
    side = np.cross(outward, along) * (0.0 if width is None else width[:, None] / 2)
    curve = SeamCurve(
        opening=line,
        root=line - deep[:, None] * outward,
        left=line + side,
        right=line - side,
        tangents=along,
        bisectors=-outward,
        s=s,
        name=name,
    )
    return curve, width


def _outward(
    line: Float[ndarray, "n 3"], width: float, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]
) -> Float[ndarray, "n 3"]:
    """Normals of the surface beside the groove, not of unit length, both sides counting alike; zero where there is none.

    A first look takes what is near; the second keeps what lies beside the lips of the groove seen along the first's normal.
    """
    import trimesh
    from scipy.spatial import KDTree

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    samples, face = trimesh.sample.sample_surface(mesh, 60_000, seed=0)[:2]
    normals = mesh.face_normals[face]
    s, along = arc_length(line), tangents(line)
    looks = np.unique([*range(0, len(line), EVERY), len(line) - 1])
    out = np.zeros_like(line)
    for i, near in zip(looks, KDTree(samples).query_ball_point(line[looks], 2.5 * width), strict=True):
        offset, facing = samples[near] - line[i], normals[near]
        beside = np.linalg.norm(offset, axis=1) - 0.55 * width
        weight = np.where(beside > 0, np.exp(-((beside / (0.4 * width)) ** 2)), 0.0)
        first = weight @ facing
        first = first - (first @ along[i]) * along[i]
        if np.linalg.norm(first) < 1e-9:
            continue
        first /= np.linalg.norm(first)
        across, height = offset @ np.cross(first, along[i]), offset @ first
        level = (np.abs(height) < 0.4 * width) & (np.abs(offset @ along[i]) < 0.6 * width) & (facing @ first > 0.8)
        level &= np.abs(across) < 1.4 * width
        sides = [level & (across > 0.55 * width), level & (across < -0.55 * width)]
        seen = [facing[side].mean(axis=0) for side in sides if side.any()]
        out[i] = np.sum(seen, axis=0) if seen else first
    return interpolate(s[looks], out[looks], s)


def _joined(runs: list[tuple[int, float, float]]) -> list[tuple[int, int, float, float]]:
    """Runs of one row as (first, last, low, high): neighbours whose ends differ by less than 1 mm are one."""
    joined: list[tuple[int, int, float, float]] = []
    for i, low, high in runs:
        for k, (first, last, below, above) in enumerate(joined):
            if last == i - 1 and abs(below - low) < 1e-3 and abs(above - high) < 1e-3:
                joined[k] = (first, i, max(low, below), min(high, above))
                break
        else:
            joined.append((i, i, low, high))
    return [run for run in joined if run[3] - run[2] > 1e-4]


def _column(x: float, y: Float[ndarray, "m"], half: Float[ndarray, "2"], run: tuple[int, int, float, float]) -> Box:
    first, last, low, high = run
    centre = np.array([x, (y[first] + y[last]) / 2, (low + high) / 2])
    size = np.array([half[0], (y[last] - y[first]) / 2 + half[1], (high - low) / 2])
    return Box(centre=centre, half=size, R=np.eye(3))
