"""A simulated Kinect v2 over the cell: rays finer than its pixels, summed as light of modulated brightness."""

from typing import TYPE_CHECKING, final

import cv2
import numpy as np
from jaxtyping import Bool, Complex64, Float32
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.sensor.base import Capture, DepthSensor, Finish, View
from weldsim.sensor.exact import TwinScene
from weldsim.sensor.infrared import REFLECTANCE
from weldsim.sensor.kinect import FREQUENCIES, LIGHT, KinectConfig, kinect_depth, phasors
from weldsim.sensor.renderer import dot, lengths
from weldsim.sensor.stereo import view_key

if TYPE_CHECKING:
    from weldsim.sensor.embree import Hits

BOUNCE_CELL = 2  # [px] bounced light varies slowly: it is sampled on a grid this coarse
CLEAR = 1e-4  # [m] a bounced ray starts this far off the surface

_ALBEDO = np.array([REFLECTANCE[finish][0] for finish in Finish], np.float32)


@final
class KinectV2(DepthSensor):
    """The Kinect v2's depth camera; colour is plain shading, registered."""

    def __init__(
        self, scene: TwinScene, intrinsics: CameraIntrinsics, config: KinectConfig | None = None, *, seed: int = 0
    ) -> None:
        """Args: seed: of the unit's noise."""
        from weldsim.sensor.embree import EmbreeRenderer  # open3d takes a second to import

        self._scene, self._intrinsics, self._seed = scene, intrinsics, seed
        self._config = config or KinectConfig()
        s = self._config.supersample
        self._fine = intrinsics if s == 1 else _finer(intrinsics, s)
        self._renderer: EmbreeRenderer = EmbreeRenderer(scene.model)
        self._samples: EmbreeRenderer = EmbreeRenderer(scene.model)  # each keeps the rays of its own image size

    @property
    def intrinsics(self) -> CameraIntrinsics:
        return self._intrinsics

    @property
    def config(self) -> KinectConfig:
        return self._config

    def capture(self, view: View) -> Capture:
        c, key = self._config, [self._seed, *view_key(view.X_BC)]
        X_WC = self._scene.X_WB @ view.X_BC
        hits = self._renderer.hits(self._scene.data, X_WC, self._intrinsics)
        fine = self._samples.hits(self._scene.data, X_WC, self._fine)
        received = phasors(*self._returns(fine), c.supersample, c.blur)
        if c.bounces:
            bounced = self._bounced(hits, X_WC, np.random.default_rng([*key, 0]))
            received = [direct + indirect for direct, indirect in zip(received, bounced, strict=True)]
        stretch = lengths(hits.directions)
        facing = np.abs(dot(hits.normals, hits.directions)) / stretch
        angle = np.arccos(np.clip(np.where(np.isfinite(hits.z), facing, 1), 0, 1))
        depth = kinect_depth(received, stretch, angle, c, np.random.default_rng([*key, 1, view.exposure]))
        frame = DepthFrame(
            depth=depth,
            intrinsics=self._intrinsics,
            X_BC=view.X_BC,
            colour=self._renderer.shade(hits),
            t=view.t,
            source="kinect v2 model",
        )
        exact = np.where(np.isfinite(hits.z), hits.z, np.float32(np.nan))
        return Capture(frame=frame, truth=self._scene.truth(exact, hits.geom))

    def _albedo(self, geom: ndarray) -> ndarray:
        finishes = self._scene.finishes
        return np.full(geom.shape, _ALBEDO[0]) if finishes is None else _ALBEDO[np.append(finishes, np.uint8(0))[geom]]

    def _in_image(self, points: Float32[ndarray, "h w 3"], X_WC: Transform) -> Bool[ndarray, "h w"]:
        """Whether points, in W from the camera, lie in the camera's field of view."""
        x, y, z = np.moveaxis(points @ X_WC.R.astype(np.float32), -1, 0)
        i = self._intrinsics
        u, v = i.fx * x + i.cx * z, i.fy * y + i.cy * z
        return (z > 0) & (u >= 0) & (u <= i.width * z) & (v >= 0) & (v <= i.height * z)

    def _returns(self, hits: "Hits") -> tuple[Float32[ndarray, "h w"], Float32[ndarray, "h w"]]:
        """Range [m] and amplitude of what comes straight back, for light and camera in one place; 0 for a miss."""
        seen = np.isfinite(hits.z)
        length = lengths(hits.directions)
        reach = np.where(seen, hits.z, np.float32(1)) * length
        cosine = np.abs(dot(hits.normals, hits.directions)) / length
        amplitude = self._albedo(hits.geom) * cosine / reach**2
        return reach, np.where(seen, amplitude, np.float32(0)).astype(np.float32)

    def _bounced(self, hits: "Hits", X_WC: Transform, rng: np.random.Generator) -> list[Complex64[ndarray, "h w"]]:
        """Phasors of light that reaches each pixel's surface by way of one other, from `bounces` rays over the hemisphere.

        Rays spread as the cosine, so the light that a surface of albedo a receives and returns is a times the mean of
        albedo * cosine / distance^2 where they end; the way is that of camera, there, here, camera. The lamp lights what is
        in the image; whether something stands before it there is not asked.
        """
        cell = np.s_[::BOUNCE_CELL, ::BOUNCE_CELL]
        seen = np.isfinite(hits.z[cell])
        direction, normal = hits.directions[cell], hits.normals[cell]
        normal = np.where((dot(normal, direction) > 0)[..., None], -normal, normal)
        eye = X_WC.p.astype(np.float32)
        here = direction * np.where(seen, hits.z[cell], np.float32(1))[..., None]  # from the camera
        first = lengths(here)
        sums = [np.zeros(seen.shape, np.complex64) for _ in FREQUENCIES]
        for _ in range(self._config.bounces):
            towards = rng.standard_normal(here.shape, dtype=np.float32)
            towards = normal * np.float32(1.0001) + towards / lengths(towards)[..., None]
            towards /= lengths(towards)[..., None]
            end = self._renderer.cast(self._scene.data, eye + here + normal * np.float32(CLEAR), towards)
            far = np.isfinite(end.z)
            there = here + towards * np.where(far, end.z, np.float32(1))[..., None]
            met = seen & far & self._in_image(there, X_WC)
            back = lengths(there)
            cosine = np.clip(np.abs(dot(end.normals, there)) / back, 0, 1)
            weight = self._albedo(hits.geom[cell]) * self._albedo(end.geom) * cosine / back**2 * met
            way = (first + np.where(met, end.z, np.float32(0)) + back) / 2
            for total, frequency in zip(sums, FREQUENCIES, strict=True):
                total += weight * np.exp(np.complex64(4j * np.pi * frequency / LIGHT) * way)
        size = (self._intrinsics.width, self._intrinsics.height)
        return [_spread(total / np.float32(self._config.bounces), size) for total in sums]


def _spread(coarse: Complex64[ndarray, "a b"], size: tuple[int, int]) -> Complex64[ndarray, "h w"]:
    """A coarse image blurred over its sampling noise and brought to full size."""
    parts = [cv2.GaussianBlur(np.ascontiguousarray(part), (0, 0), 2.0) for part in (np.real(coarse), np.imag(coarse))]
    real, imag = (cv2.resize(part, size, interpolation=cv2.INTER_LINEAR) for part in parts)
    return (real + np.complex64(1j) * imag).astype(np.complex64)


def _finer(i: CameraIntrinsics, s: int) -> CameraIntrinsics:
    """The same camera with s x s pixels for each."""
    return CameraIntrinsics(width=i.width * s, height=i.height * s, fx=i.fx * s, fy=i.fy * s, cx=i.cx * s, cy=i.cy * s)
