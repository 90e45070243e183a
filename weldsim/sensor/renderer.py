"""Exact images of a compiled MuJoCo model from any pose: the interface, and the choice of back end."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float, Float32, Int32, UInt8
from numpy import ndarray

from weldsim.errors import SensorError
from weldsim.frames import Transform
from weldsim.opengl import Backend, backend_failures, rendering_backend
from weldsim.records import CameraIntrinsics

if TYPE_CHECKING:
    import mujoco

OPTICAL_FROM_MUJOCO = np.diag([1.0, -1.0, -1.0])  # a MuJoCo camera looks along -z with y up
VISIBLE_GROUPS = 3  # geom groups 0, 1, 2 are drawn; 3 and up hold collision shapes


@dataclass(frozen=True, eq=False, kw_only=True)
class Render:
    """An exact image.

    Attributes:
        depth: z-depth at each pixel's centre [m], NaN for a miss.
        geom: id of the geom seen, -1 for a miss.
        colour: RGB, or None when not asked for.
    """

    depth: Float32[ndarray, "h w"]
    geom: Int32[ndarray, "h w"]
    colour: UInt8[ndarray, "h w 3"] | None = None


class Renderer(ABC):
    """Draws one model. The state is the caller's: run `mj_kinematics` or `mj_forward` on `data` first."""

    backend: Backend

    @abstractmethod
    def render(
        self, data: "mujoco.MjData", X_WC: Transform, intrinsics: CameraIntrinsics, *, colour: bool = True, depth: bool = True
    ) -> Render:
        """What a pinhole camera at X_WC sees of `data`; without `depth`, depth and geom are all misses (pictures, video)."""

    @abstractmethod
    def close(self) -> None:
        """Frees what the renderer holds outside Python; closing twice is allowed."""


def make_renderer(model: "mujoco.MjModel", backend: Backend | Literal["auto"] = "auto") -> Renderer:
    """A renderer of `model`: OpenGL where a platform draws, else ray casting.

    Raises:
        SensorError: the back end asked for does not work here; the message says why.
    """
    chosen = rendering_backend() if backend == "auto" else backend
    if chosen == "embree":
        from weldsim.sensor.embree import EmbreeRenderer  # open3d takes a second to import

        return EmbreeRenderer(model)
    if backend != "auto" and rendering_backend() != backend:
        reason = backend_failures().get(backend, f"MUJOCO_GL leads to {rendering_backend()}")
        raise SensorError(f"rendering back end {backend!r} does not work here: {reason}", backend=backend, reason=reason)
    from weldsim.sensor.gl import GlRenderer  # mujoco

    return GlRenderer(model, chosen)


def camera_pose(model: "mujoco.MjModel", data: "mujoco.MjData", camera: str) -> Transform:
    """X_WC of a camera of the model at the current state, turned from MuJoCo's axes to optical ones.

    Raises:
        SensorError: the model has no such camera.
    """
    names = [model.camera(i).name for i in range(model.ncam)]
    if camera not in names:
        raise SensorError(
            f"camera {camera!r} is not in the model; it has {', '.join(names) or 'none'}", camera=camera, allowed=names
        )
    index = names.index(camera)
    return Transform("WC", data.cam_xmat[index].reshape(3, 3) @ OPTICAL_FROM_MUJOCO, data.cam_xpos[index])


def dot(a: Float32[ndarray, "*n 3"], b: Float32[ndarray, "*n 3"]) -> Float32[ndarray, "*n"]:
    """Scalar products of vectors along the last axis; several times as fast as a sum over an axis of three."""
    return np.einsum("...i,...i", a, b)


def lengths(a: Float32[ndarray, "*n 3"]) -> Float32[ndarray, "*n"]:
    """Lengths of vectors along the last axis."""
    return np.sqrt(dot(a, a))


def geom_colours(model: "mujoco.MjModel") -> Float[ndarray, "n 4"]:
    """RGBA of each geom as MuJoCo draws it, a texture by its mean: the material's, unless the geom's own is not the default."""
    rgba = np.array(model.geom_rgba, float)
    if model.nmat:
        materials = np.array([_material_colour(model, material) for material in range(model.nmat)])
        use = np.isclose(rgba, [0.5, 0.5, 0.5, 1.0]).all(axis=1) & (model.geom_matid >= 0)
        rgba[use] = materials[model.geom_matid[use]]
    return rgba


def _material_colour(model: "mujoco.MjModel", material: int) -> Float[ndarray, "4"]:
    rgba = np.array(model.mat_rgba[material], float)
    texture = int(model.mat_texid[material].max())  # -1 in every role but the one that is textured
    if texture >= 0 and model.tex_nchannel[texture] >= 3:
        start, channels = model.tex_adr[texture], model.tex_nchannel[texture]
        texels = model.tex_data[start : start + model.tex_height[texture] * model.tex_width[texture] * channels]
        rgba[:3] *= texels.reshape(-1, channels)[:, :3].mean(axis=0) / 255
    return rgba
