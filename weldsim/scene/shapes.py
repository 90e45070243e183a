"""Geoms for MjSpec, written shortly: cylinders between two points, boxes, meshes, cameras; visual ones never collide."""

from enum import IntEnum
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics

# The model's elements are typed by the library's stubs only in part.
Spec = Any
Body = Any

TO_OPTICAL = np.diag([1.0, -1.0, -1.0])
"""A MuJoCo camera looks along -z with y up; the optical frame has z forward and y down."""


class Group(IntEnum):
    """Geom groups; MuJoCo draws 0 to 2 unless told otherwise."""

    SCENE = 0
    WORKPIECE = 1
    ROBOT = 2
    COLLISION = 3


def box(body: Body, name: str, centre: Any, half: Any, material: str, *, group: Group = Group.SCENE, collide: bool = False) -> Any:
    """A box, axes along the body's."""
    return _geom(body, name, mujoco.mjtGeom.mjGEOM_BOX, material, group, collide, pos=_list(centre), size=_list(half))


def rod(
    body: Body,
    name: str,
    start: Any,
    end: Any,
    radius: float,
    material: str,
    *,
    group: Group = Group.SCENE,
    collide: bool = False,
    round_ends: bool = False,
) -> Any:
    """A cylinder, or a capsule, from `start` to `end`."""
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE if round_ends else mujoco.mjtGeom.mjGEOM_CYLINDER
    return _geom(body, name, kind, material, group, collide, fromto=[*map(float, start), *map(float, end)], size=[radius, 0.0, 0.0])


def mesh_geom(
    spec: Spec,
    body: Body,
    name: str,
    vertices: Float[ndarray, "n 3"],
    faces: Int[ndarray, "m 3"],
    material: str,
    *,
    group: Group = Group.SCENE,
    normals: Float[ndarray, "n 3"] | None = None,
) -> Any:
    """A mesh drawn where its vertices are. It never collides: MuJoCo would take its convex hull and close a groove."""
    mesh = spec.add_mesh(name=name)
    mesh.uservert = np.ascontiguousarray(vertices, np.float32).ravel()
    mesh.userface = np.ascontiguousarray(faces, np.int32).ravel()
    if normals is not None:
        mesh.usernormal = np.ascontiguousarray(normals, np.float32).ravel()
    # An open surface has no volume; as a shell its inertia is defined.
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    geom = _geom(body, name, mujoco.mjtGeom.mjGEOM_MESH, material, group, collide=False)
    geom.meshname = name
    return geom


def camera(body: Body, name: str, X_body_C: Transform, intrinsics: CameraIntrinsics) -> Any:
    """A camera with the given optical frame and intrinsics, off-centre principal point included.

    The renderer moves the image against `principal_pixel` (measured; tests/unit/scene pins the sign).
    """
    cam = body.add_camera(name=name)
    cam.pos, cam.quat = X_body_C.p, Transform(X_body_C.names, X_body_C.R @ TO_OPTICAL, X_body_C.p).quaternion
    cam.resolution = [intrinsics.width, intrinsics.height]
    cam.sensor_size = [intrinsics.width * 3e-6, intrinsics.height * 3e-6]
    cam.focal_pixel = [intrinsics.fx, intrinsics.fy]
    cam.principal_pixel = [-(intrinsics.cx - intrinsics.width / 2), -(intrinsics.cy - intrinsics.height / 2)]
    return cam


def look_at(body: Body, name: str, eye: Any, target: Any, fovy: float) -> Any:
    """A camera at `eye` looking at `target`, level, with a vertical field of view `fovy` [deg]."""
    back = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    X = Transform("WC", np.column_stack([right, np.cross(back, right), back]), np.asarray(eye, float))
    cam = body.add_camera(name=name)
    cam.pos, cam.quat, cam.fovy = X.p, X.quaternion, fovy
    return cam


def _geom(body: Body, name: str, kind: Any, material: str, group: Group, collide: bool, **fields: Any) -> Any:
    bits = int(collide)
    geom = body.add_geom(name=name, type=kind, group=int(group), contype=bits, conaffinity=bits, mass=0.0, **fields)
    geom.material = material
    return geom


def _list(values: Any) -> list[float]:
    return [float(value) for value in values]
