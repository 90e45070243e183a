"""Triangles of a model's geoms, for ray casting: the same shapes that OpenGL draws, curved ones more finely."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, UInt32
from numpy import ndarray

from weldsim.errors import SensorError

SLICES = 96  # around a curved geom: the chord leaves a 60 mm circle by 32 um
INFINITE = 10.0  # [m] half-size given to a plane without limits

_BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
_BOX_FACES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ],
    np.uint32,
)


@dataclass(frozen=True, eq=False)
class Triangles:
    """Vertices [m] in the geom's own frame, and vertex indices of each triangle."""

    vertices: Float[ndarray, "n 3"]
    faces: UInt32[ndarray, "k 3"]


def geom_triangles(model: mujoco.MjModel, geom: int) -> Triangles:
    """Triangles of one geom.

    Raises:
        SensorError: a geom type that cannot be ray-cast (height field, signed distance field).
    """
    kind, size = mujoco.mjtGeom(model.geom_type[geom]), np.array(model.geom_size[geom], float)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return Triangles(_BOX_CORNERS * size, _BOX_FACES)
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        x, y = (INFINITE if half <= 0 else float(half) for half in size[:2])
        corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], float)
        return Triangles(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    if kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        radii = size if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID else np.full(3, size[0])
        ball = revolve(np.sin(_half_turn()), -np.cos(_half_turn()))
        return Triangles(ball.vertices * radii, ball.faces)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return revolve(size[0] * np.array([0.0, 1.0, 1.0, 0.0]), size[1] * np.array([-1.0, -1.0, 1.0, 1.0]))
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        turn = _half_turn()
        return revolve(size[0] * np.sin(turn), -size[0] * np.cos(turn) + np.where(turn < np.pi / 2, -size[1], size[1]))
    raise SensorError(f"geom {model.geom(geom).name!r} is a {kind.name}, which cannot be ray-cast; use a mesh", geom=geom)


def revolve(radius: Float[ndarray, "m"], height: Float[ndarray, "m"]) -> Triangles:
    """The surface of revolution about z of the polyline (radius, height) [m]."""
    angle = np.linspace(0, 2 * np.pi, SLICES, endpoint=False)
    x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    vertices = np.stack([x, y, np.broadcast_to(height[:, None], x.shape)], axis=-1).reshape(-1, 3)
    ring, turn = np.meshgrid(np.arange(len(radius) - 1), np.arange(SLICES), indexing="ij")
    a, b = ring * SLICES + turn, ring * SLICES + (turn + 1) % SLICES
    quads = np.stack([a, b, b + SLICES, a, b + SLICES, a + SLICES], axis=-1)
    return Triangles(vertices, quads.reshape(-1, 3).astype(np.uint32))


def _half_turn() -> Float[ndarray, "m"]:
    """Angles from pole to pole; an even number of points, so that the equator of a capsule is cut between two."""
    return np.linspace(0, np.pi, SLICES // 2)


def _mesh(model: mujoco.MjModel, mesh: int) -> Triangles:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return Triangles(
        np.array(model.mesh_vert[first : first + count], float), np.array(model.mesh_face[face : face + faces], np.uint32)
    )
