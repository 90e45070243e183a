"""Exact depth, geom ids and colour by MuJoCo's OpenGL renderer.

The classic renderer draws depth with reversed z in float32 and no multisampling: under 0.1 um from ray casting, and no
mixed pixels at edges. The view frustum is set directly, so focal lengths may differ and the principal point may lie
anywhere, and any pose can be drawn without moving a camera of the model.
"""

import sys
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float32, Int32, UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.opengl import GlPlatform, gl_context_class
from weldsim.records import CameraIntrinsics
from weldsim.sensor.renderer import VISIBLE_GROUPS, Render, Renderer

NEAR, FAR = 0.01, 50.0  # [m] with reversed z their ratio costs no precision


class GlRenderer(Renderer):
    """One OpenGL context and one MuJoCo drawing of a model. Use it from the thread that made it."""

    def __init__(self, model: mujoco.MjModel, platform: GlPlatform, *, max_geom: int = 5000) -> None:
        self._context: Any = None
        self._drawing: mujoco.MjrContext | None = None
        self.backend = platform
        self._model = model
        self._context = gl_context_class(platform)(model.vis.global_.offwidth, model.vis.global_.offheight)
        self._context.make_current()
        drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, drawing)
        drawing.readDepthMap = int(mujoco.mjtDepthMap.mjDEPTH_ZEROFAR)
        self._drawing = drawing
        self._scene = mujoco.MjvScene(model, max_geom)
        self._option = _geoms_only()

    def render(
        self, data: mujoco.MjData, X_WC: Transform, intrinsics: CameraIntrinsics, *, colour: bool = True, depth: bool = True
    ) -> Render:
        drawing = self._drawing
        if drawing is None:
            raise RuntimeError("render after close")
        self._context.make_current()
        h, w = intrinsics.height, intrinsics.width
        if drawing.offWidth < w or drawing.offHeight < h:
            mujoco.mjr_resizeOffscreen(max(w, drawing.offWidth), max(h, drawing.offHeight), drawing)
        everything = mujoco.mjtCatBit.mjCAT_STATIC | mujoco.mjtCatBit.mjCAT_DYNAMIC
        mujoco.mjv_updateScene(self._model, data, self._option, None, mujoco.MjvCamera(), int(everything), self._scene)
        _set_frustum(self._scene, X_WC, intrinsics)
        rect = mujoco.MjrRect(0, 0, w, h)
        picture = self._colour(drawing, rect) if colour else None
        z, geom = np.full((h, w), np.nan, np.float32), np.full((h, w), -1, np.int32)
        if depth:
            z, geom = self._depth_and_geom(drawing, rect)
        return Render(depth=z, geom=geom, colour=picture)

    def _depth_and_geom(
        self, drawing: mujoco.MjrContext, rect: mujoco.MjrRect
    ) -> tuple[Float32[ndarray, "h w"], Int32[ndarray, "h w"]]:
        """Both from one drawing in flat id colours."""
        buffer = np.empty((rect.height, rect.width), np.float32)
        ids = np.empty((rect.height, rect.width, 3), np.uint8)
        self._id_colours(True)
        mujoco.mjr_render(rect, self._scene, drawing)
        mujoco.mjr_readPixels(ids, buffer, rect, drawing)
        self._id_colours(False)
        packed = ids[..., 0].astype(np.int32) | (ids[..., 1].astype(np.int32) << 8) | (ids[..., 2].astype(np.int32) << 16)
        geom = np.flipud(self._geom_of_id()[packed])
        # Reversed z: the buffer holds near (far - z) / (z (far - near)), 0 at the far plane.
        ratio = NEAR / FAR
        with np.errstate(divide="ignore"):
            z = NEAR / (np.flipud(buffer).astype(float) * (1 - ratio) + ratio)
        return np.where(geom >= 0, z, np.nan).astype(np.float32), geom

    def _colour(self, drawing: mujoco.MjrContext, rect: mujoco.MjrRect) -> UInt8[ndarray, "h w 3"]:
        picture = np.empty((rect.height, rect.width, 3), np.uint8)
        mujoco.mjr_render(rect, self._scene, drawing)
        mujoco.mjr_readPixels(picture, None, rect, drawing)
        return np.ascontiguousarray(np.flipud(picture))

    def _id_colours(self, on: bool) -> None:
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = on
        self._scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = on

    def _geom_of_id(self) -> Int32[ndarray, "k"]:
        """Model geom drawn in each id colour; colour 0 is the background."""
        table = np.full(self._scene.ngeom + 1, -1, np.int32)
        for drawn in self._scene.geoms[: self._scene.ngeom]:
            if drawn.segid >= 0 and drawn.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                table[drawn.segid + 1] = drawn.objid
        return table

    def close(self) -> None:
        if self._drawing is not None:
            self._context.make_current()
            self._drawing.free()
            self._drawing = None
        if self._context is not None:
            self._context.free()
            self._context = None

    def __del__(self) -> None:
        if not sys.is_finalizing():  # at exit the platform has already freed its contexts
            self.close()


def _geoms_only() -> mujoco.MjvOption:
    """Draw the geoms of the visible groups and nothing else (sites and tendons would hide them)."""
    option = mujoco.MjvOption()
    option.geomgroup[:] = [index < VISIBLE_GROUPS for index in range(len(option.geomgroup))]
    for groups in (
        option.sitegroup,
        option.jointgroup,
        option.tendongroup,
        option.actuatorgroup,
        option.flexgroup,
        option.skingroup,
    ):
        groups[:] = 0
    return option


def _set_frustum(scene: mujoco.MjvScene, X_WC: Transform, intrinsics: CameraIntrinsics) -> None:
    """Puts both eyes of the scene at X_WC with the frustum of `intrinsics` (image edges, not pixel centres)."""
    i = intrinsics
    for eye in scene.camera:
        eye.pos, eye.forward, eye.up = X_WC.p, X_WC.R[:, 2], -X_WC.R[:, 1]
        eye.orthographic = 0
        eye.frustum_near, eye.frustum_far = NEAR, FAR
        eye.frustum_top, eye.frustum_bottom = NEAR * i.cy / i.fy, -NEAR * (i.height - i.cy) / i.fy
        eye.frustum_width, eye.frustum_center = NEAR * i.width / 2 / i.fx, NEAR * (i.width / 2 - i.cx) / i.fx
