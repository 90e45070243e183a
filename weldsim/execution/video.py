"""A film of the twin welding: the cell from the overview camera, a close-up inset, and the bead as it is laid."""

import os
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, final

import cv2
import mujoco
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from weldsim.errors import ConfigError, OutputError
from weldsim.execution.simulated import TORCH_SITE, SimulatedRobot
from weldsim.opengl import open_renderer

BEAD_SPACING, BEAD_RADIUS = 0.0012, 0.0032  # [m]
COOLING = 4.0  # [s] in which a laid bead goes from white to red heat
HOT, WARM, COLD = np.array([1.0, 0.93, 0.70]), np.array([1.0, 0.45, 0.10]), np.array([0.62, 0.30, 0.16])
CLOSE_UP = (232.0, -28.0, 0.36)  # azimuth and elevation [deg], distance [m] of the camera that follows the torch
MARGIN, EDGE = 20, 3  # [px] about the inset
SHADOW = 1024  # [px] side of the shadow map
OVERSAMPLING = 4 / 3  # the whole picture is drawn this much larger: half the time of multisampling in software, edges as smooth
INSET_SAMPLES = 4  # a pixel, for the inset alone
SHOWN_GROUPS = (0, 1, 2)  # collision shapes and sites are not filmed


@dataclass(frozen=True)
class VideoConfig:
    """Settings of `WeldVideo`."""

    width: int = 960
    """Picture width [px]."""
    height: int = 540
    """Picture height [px]."""
    fps: float = 20.0
    """Pictures a second of film [1/s]."""
    speedup: float = 6.0
    """Seconds of welding in a second of film."""
    camera: str = "overview"
    """Camera of the whole picture."""
    inset: bool = True
    """Whether a close-up of the torch is set into the upper right corner."""

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 64 or self.width % 2 or self.height % 2:
            raise ConfigError(f"video: {self.width} x {self.height} px; both must be even and at least 64", key="video.width")
        if not (self.fps > 0 and self.speedup > 0):
            raise ConfigError("video: fps and speedup must be positive", key="video.fps")


@final
class WeldVideo:
    """Frame callback of a `SimulatedRobot` that writes an MP4; a context manager.

    The film appears under its name when the block ends well, and not at all otherwise.
    """

    def __init__(self, path: str | Path, config: VideoConfig | None = None) -> None:
        self.path, self.config = Path(path), config or VideoConfig()
        self._part = self.path.with_name(f".{self.path.stem}.{os.getpid()}.part.mp4")
        self._writer: Any = None
        self._renderers: list[tuple[Any, Any]] = []
        self._bead: list[tuple[float, Float[ndarray, "3"]]] = []

    @property
    def frame_period(self) -> float:
        """Simulated time between pictures [s]: what `SimulationConfig.frame_period` must be."""
        return self.config.speedup / self.config.fps

    def __enter__(self) -> "WeldVideo":
        size = (self.config.width, self.config.height)
        # OpenCV reports a missing folder only by a writer that is not open.
        self._writer = cv2.VideoWriter(str(self._part), cv2.VideoWriter.fourcc(*"mp4v"), self.config.fps, size)
        if not self._writer.isOpened():
            self._part.unlink(missing_ok=True)
            raise OutputError(f"{self.path}: cannot write a video there; check the folder and its permissions", path=str(self.path))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._writer.release()
        for _, renderer in self._renderers:
            renderer.close()
        self._renderers = []
        if kind is None:
            os.replace(self._part, self.path)
        else:
            self._part.unlink(missing_ok=True)

    def __call__(self, robot: SimulatedRobot) -> None:
        """One more picture of the robot as it is now."""
        self._writer.write(cv2.cvtColor(self.picture(robot), cv2.COLOR_RGB2BGR))

    def picture(self, robot: SimulatedRobot) -> UInt8[ndarray, "h w 3"]:
        """RGB of the cell, the bead laid so far, the burning arc, the inset and the clock."""
        if not self._renderers:
            self._open(robot)
        self._lay_bead(robot)
        views = []
        for camera, renderer in self._renderers:
            if isinstance(camera, mujoco.MjvCamera):
                camera.lookat[:] = robot.data.site(TORCH_SITE).xpos
            renderer.update_scene(robot.data, camera=camera, scene_option=_shown())
            # A shadow map coarse enough to be quick would show its steps in a close-up.
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = camera == self.config.camera
            self._draw_bead(renderer.scene, robot)
            views.append(renderer.render().copy())
        picture = cv2.resize(views[0], (self.config.width, self.config.height), interpolation=cv2.INTER_AREA)
        if len(views) > 1:
            h, w = views[1].shape[:2]
            picture[MARGIN - EDGE : MARGIN + h + EDGE, -w - MARGIN - EDGE : -MARGIN + EDGE] = 245
            picture[MARGIN : MARGIN + h, -w - MARGIN : -MARGIN] = views[1]
        for line, size, where in ((self._clock(robot), 0.9, (24, 44)), (self.pace, 0.6, (24, 74))):
            cv2.putText(picture, line, where, cv2.FONT_HERSHEY_SIMPLEX, size, (20, 22, 26), 2, cv2.LINE_AA)
        return picture

    @property
    def pace(self) -> str:
        """How fast the film runs, in words: what is written into every picture."""
        speedup = self.config.speedup
        if speedup == 1:
            return "shown at true speed"
        return f"shown {speedup:g} x as fast" if speedup > 1 else f"shown {1 / speedup:.3g} x as slow"

    @staticmethod
    def _clock(robot: SimulatedRobot) -> str:
        return f"{robot.t:5.1f} s   arc {'on' if robot.arc else 'off'}"

    def _open(self, robot: SimulatedRobot) -> None:
        config, model = self.config, robot.model
        visual = model.vis
        width, height = (round(OVERSAMPLING * size) for size in (config.width, config.height))
        visual.global_.offwidth = max(visual.global_.offwidth, width)
        visual.global_.offheight = max(visual.global_.offheight, height)
        # Software rendering spends most of its time on shadows, mirrored floors and round shapes.
        visual.quality.shadowsize = min(visual.quality.shadowsize, SHADOW)
        visual.quality.numslices, visual.quality.numstacks = 16, 8
        model.mat_reflectance[:] = 0.0
        visual.quality.offsamples = 0
        self._renderers.append((config.camera, open_renderer(model, height, width, "video")))
        if config.inset:
            follower = mujoco.MjvCamera()
            follower.type = mujoco.mjtCamera.mjCAMERA_FREE
            visual.quality.offsamples = INSET_SAMPLES
            follower.azimuth, follower.elevation, follower.distance = CLOSE_UP
            self._renderers.append((follower, open_renderer(model, config.height * 2 // 5, config.width * 3 // 10, "video")))

    def _lay_bead(self, robot: SimulatedRobot) -> None:
        """Balls from the last one to the tip while the arc burns."""
        tip = np.array(robot.data.site(TORCH_SITE).xpos)
        if not robot.arc:
            return
        last = self._bead[-1][1] if self._bead else tip
        n = int(np.linalg.norm(tip - last) / BEAD_SPACING)
        if not self._bead:
            self._bead.append((robot.t, tip))
        self._bead.extend((robot.t, last + (tip - last) * k / n) for k in range(1, n + 1))

    def _draw_bead(self, scene: Any, robot: SimulatedRobot) -> None:
        for t, p in self._bead:
            heat = max(0.0, 1.0 - (robot.t - t) / COOLING)
            rgb = WARM + (HOT - WARM) * (2 * heat - 1) if heat > 0.5 else COLD + (WARM - COLD) * 2 * heat
            _ball(scene, p, BEAD_RADIUS, [*rgb, 1.0], emission=0.2 + 0.8 * heat)
        if robot.arc:
            tip = np.array(robot.data.site(TORCH_SITE).xpos)
            _ball(scene, tip, 0.0045, [1.0, 1.0, 0.97, 1.0], emission=1.0)
            for radius, alpha in ((0.010, 0.35), (0.018, 0.18), (0.030, 0.08)):
                _ball(scene, tip, radius, [0.75, 0.87, 1.0, alpha], emission=1.0)


def _shown() -> Any:
    option = mujoco.MjvOption()
    option.geomgroup[:] = [group in SHOWN_GROUPS for group in range(6)]
    option.sitegroup[:] = 0
    return option


def _ball(scene: Any, p: Float[ndarray, "3"], radius: float, rgba: list[float], emission: float) -> None:
    """One more sphere in a scene that is about to be rendered; ignored when the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    mujoco.mjv_initGeom(geom, sphere, np.full(3, radius), p, np.eye(3).ravel(), np.array(rgba, np.float32))
    geom.emission = emission
    scene.ngeom += 1
