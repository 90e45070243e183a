"""The reference D415: both infrared images rendered and matched, where `D415Fast` only imitates what comes of it.

Ten times as slow as the parametric model, whose grooves are fitted to it. Nothing of it is fitted to a real camera but the
maker's noise law (see `weldsim.sensor.infrared`). It does not have what public frames of real cameras show and the parametric
model has: its noise is alike over 5 to 6 px (real: 11 to 16 by 8 to 9.5, with waves of 40 px and more besides) and grows with
the tilt of a plane; its rims have hardly a pixel between two surfaces; no driver's filter follows it.
"""

from typing import TYPE_CHECKING, final

import numpy as np
from jaxtyping import Bool, Float32, UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.sensor.base import Capture, DepthSensor, Finish, View
from weldsim.sensor.d415 import FARTHEST, in_steps, shifted, view_offset
from weldsim.sensor.exact import TwinScene
from weldsim.sensor.infrared import dot_pattern, gain, infrared_image, reflected
from weldsim.sensor.matching import match
from weldsim.sensor.stereo import view_key
from weldsim.sensor.stereo_config import D415StereoConfig

if TYPE_CHECKING:
    from weldsim.sensor.embree import Hits


@final
class D415Stereo(DepthSensor):
    """Left and right infrared images by ray casting, matched; depth is that of the left imager. Colour is plain shading."""

    def __init__(
        self, scene: TwinScene, intrinsics: CameraIntrinsics, config: D415StereoConfig | None = None, *, seed: int = 0
    ) -> None:
        """Args: seed: of the unit; it names the dots and, with the pose, the speckle."""
        from weldsim.sensor.embree import EmbreeRenderer  # open3d takes a second to import

        self._scene, self._intrinsics, self._seed = scene, intrinsics, seed
        self._config = config or D415StereoConfig()
        self._renderer: EmbreeRenderer = EmbreeRenderer(scene.model)

    @property
    def intrinsics(self) -> CameraIntrinsics:
        return self._intrinsics

    @property
    def config(self) -> D415StereoConfig:
        return self._config

    def capture(self, view: View) -> Capture:
        left, right, hits = self._pair(view)
        c, key = self._config, [self._seed, *view_key(view.X_BC)]
        disparity = match(left, right, c.matching)
        if c.disparity_step:
            disparity = np.rint(disparity / np.float32(c.disparity_step)) * np.float32(c.disparity_step)
        disparity[(disparity > c.max_disparity) | (disparity <= FARTHEST)] = np.nan
        depth = np.float32(self._intrinsics.fx * c.baseline) / disparity
        depth = shifted(depth, view_offset(np.random.default_rng([*key, 0]), c.offset_sigma), c.offset_limit)
        frame = DepthFrame(
            depth=in_steps(depth, c.depth_unit),
            intrinsics=self._intrinsics,
            X_BC=view.X_BC,
            colour=self._renderer.shade(hits),
            t=view.t,
            source="d415 stereo pair",
        )
        exact = np.where(np.isfinite(hits.z), hits.z, np.float32(np.nan))
        return Capture(frame=frame, truth=self._scene.truth(exact, hits.geom))

    def infrared(self, view: View) -> tuple[UInt8[ndarray, "h w"], UInt8[ndarray, "h w"]]:
        """The left and the right infrared image of a view, grey levels."""
        left, right, _ = self._pair(view)
        return left, right

    def _pair(self, view: View) -> "tuple[UInt8[ndarray, 'h w'], UInt8[ndarray, 'h w'], Hits]":
        """Both images, and what the left imager's rays meet."""
        c, key = self._config, [self._seed, *view_key(view.X_BC)]
        X_WC = self._scene.X_WB @ view.X_BC
        images, hits, scale = [], None, None
        for side, x in enumerate((0.0, c.baseline)):
            X_WI = X_WC @ Transform("CC", np.eye(3), np.array([x, 0.0, 0.0]))
            seen = self._renderer.hits(self._scene.data, X_WI, self._intrinsics)
            laser, ambient = self._light(seen, X_WI, c.infrared.projector_x - x)
            scale = gain(laser + ambient, c.infrared) if scale is None else scale  # the left imager meters for both
            still = np.random.default_rng([*key, 1, side])
            fresh = np.random.default_rng([*key, 2, side, view.exposure])
            images.append(infrared_image(laser, ambient, scale, c.infrared, still, fresh))
            hits = hits or seen
        if hits is None:
            raise AssertionError("a pair without images")
        return images[0], images[1], hits

    def _light(self, hits: "Hits", X_WI: Transform, lamp_x: float) -> tuple[Float32[ndarray, "h w"], Float32[ndarray, "h w"]]:
        """Light of the projector, `lamp_x` [m] to the right of the imager at X_WI, and ambient light."""
        finishes = self._scene.finishes
        finish = np.zeros(hits.geom.shape, np.uint8) if finishes is None else np.append(finishes, np.uint8(Finish.MATTE))[hits.geom]
        lamp = np.array([lamp_x, 0.0, 0.0], np.float32)
        R = X_WI.R.astype(np.float32)
        return reflected(
            hits.z,
            self._intrinsics.rays().astype(np.float32),
            hits.normals @ R,
            lamp,
            self._reached(hits, X_WI, lamp),
            finish,
            self._config.infrared,
            dot_pattern(self._config.infrared, self._seed),
        )

    def _reached(self, hits: "Hits", X_WI: Transform, lamp: Float32[ndarray, "3"]) -> Bool[ndarray, "h w"]:
        """What the projector lights of what the imager sees."""
        points_W = hits.directions * hits.z[..., None] + X_WI.p.astype(np.float32)
        return self._renderer.reached(self._scene.data, X_WI.points(lamp[None].astype(float))[0], points_W)
