"""What a camera pose sees of the cell, and whether the arm can hold the camera there."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, inverse
from weldsim.motion.collision import CellCollision
from weldsim.mounts import X_FC
from weldsim.records import CameraIntrinsics
from weldsim.scan.config import ScanConfig
from weldsim.sensor.renderer import VISIBLE_GROUPS
from weldsim.sensor.solids import geom_triangles

if TYPE_CHECKING:
    from weldsim.scene.world import World

LIFT = 1e-3  # [m] off the surface, so that a place does not hide itself


@dataclass(frozen=True, eq=False)
class Sight:
    """Attributes: rays, casts against everything but the arm, in B; camera; blocked, what the arm touches; home, joint angles
    from which solutions are unwrapped [rad]."""

    rays: Any
    camera: CameraIntrinsics
    blocked: CellCollision
    home: Float[ndarray, "6"]

    def sees(
        self, X_BC: Transform, places: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], config: ScanConfig
    ) -> Bool[ndarray, "n"]:
        """Which places are in the image, in range, seen steeply enough and not hidden."""
        import open3d as o3d

        local = (places - X_BC.p) @ X_BC.R
        z = local[:, 2]
        ahead = (z >= config.nearest) & (z <= config.farthest)
        safe = np.where(ahead, z, 1.0)
        c = self.camera
        u, v = c.fx * local[:, 0] / safe + c.cx, c.fy * local[:, 1] / safe + c.cy
        inside = ahead & (np.abs(u / c.width - 0.5) < 0.5 - config.margin) & (np.abs(v / c.height - 0.5) < 0.5 - config.margin)
        towards = X_BC.p - places
        distance = np.linalg.norm(towards, axis=1)
        inside &= np.einsum("ij,ij->i", towards, normals) > np.cos(config.incidence) * distance
        index = np.flatnonzero(inside)
        if len(index):
            start = places[index] + LIFT * normals[index]
            rays = np.hstack([start, X_BC.p - start]).astype(np.float32)
            hidden = self.rays.test_occlusions(o3d.core.Tensor.from_numpy(rays), tnear=0.0, tfar=1.0).numpy()
            inside[index[hidden]] = False
        return inside

    def reach(self, X_BC: Transform) -> Float[ndarray, "6"] | str:
        """Joint angles that hold the camera there, nearest to home and clear of everything, or why there are none."""
        solutions = inverse(X_BC @ X_FC.inverse())
        if not len(solutions):
            return "out of the arm's reach"
        solutions = solutions + 2 * np.pi * np.round((self.home - solutions) / (2 * np.pi))
        touch = None
        for q in solutions[np.abs(solutions - self.home).max(axis=1).argsort()]:
            if (np.abs(q) <= JOINT_LIMIT).all():
                found = self.blocked(q)
                if found is None:
                    return q
                touch = touch or found
        return touch or "beyond a joint's limit"


def make_sight(world: "World") -> Sight:
    """What views of the world are judged by."""
    import open3d as o3d

    from weldsim.scene.world import AWAY, HOME

    data, scene = world.new_data(AWAY), o3d.t.geometry.RaycastingScene()
    X_BW = world.X_WB.inverse()
    for geom, label in world.labels.items():
        if label in ("robot", "room") or world.model.geom_group[geom] >= VISIBLE_GROUPS:
            continue
        mesh = geom_triangles(world.model, geom)
        vertices = X_BW.points(mesh.vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
        scene.add_triangles(o3d.core.Tensor.from_numpy(vertices.astype(np.float32)), o3d.core.Tensor.from_numpy(mesh.faces))
    return Sight(scene, world.intrinsics, CellCollision(world.model), np.array(HOME, float))
