"""The twin's exact camera: what a perfect depth camera would see of the simulated scene."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from weldsim.errors import SensorError
from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.sensor.backend import Backend
from weldsim.sensor.base import Capture, DepthSensor, Label, Truth, View
from weldsim.sensor.renderer import make_renderer

if TYPE_CHECKING:
    import mujoco

    from weldsim.scene.world import World


@dataclass(frozen=True, eq=False, kw_only=True)
class TwinScene:
    """A compiled scene to look at. `data` belongs to the caller, who moves it and runs `mj_kinematics` or `mj_forward`.

    Attributes:
        model, data: MuJoCo's, as they are at the moment of each capture.
        X_WB: the robot base in the world.
        labels: (ngeom,) a `Label` for each geom.
    """

    model: "mujoco.MjModel"
    data: "mujoco.MjData"
    X_WB: Transform
    labels: UInt8[ndarray, "ngeom"]

    def __post_init__(self) -> None:
        if self.labels.shape != (self.model.ngeom,):
            raise SensorError(f"scene labels: {self.labels.shape} for {self.model.ngeom} geoms", limit=self.model.ngeom)


def twin_scene(world: "World", data: "mujoco.MjData") -> TwinScene:
    """What the sensors of the twin look at: a world at the state `data`, its labels by geom."""
    labels = np.array([Label[world.labels[geom].upper()] for geom in range(world.model.ngeom)], np.uint8)
    return TwinScene(model=world.model, data=data, X_WB=world.X_WB, labels=labels)


@final
class ExactSensor(DepthSensor):
    """Exact depth, colour and labels from any pose, the arm staying where it is."""

    def __init__(
        self,
        scene: TwinScene,
        intrinsics: CameraIntrinsics,
        *,
        backend: Backend | Literal["auto"] = "auto",
        colour: bool = True,
    ) -> None:
        """Raises SensorError if `backend` does not work here; "auto" always finds one."""
        self._scene, self._intrinsics, self._colour = scene, intrinsics, colour
        self._renderer = make_renderer(scene.model, backend)

    @property
    def intrinsics(self) -> CameraIntrinsics:
        return self._intrinsics

    @property
    def backend(self) -> Backend:
        """What draws."""
        return self._renderer.backend

    def capture(self, view: View) -> Capture:
        image = self._renderer.render(self._scene.data, self._scene.X_WB @ view.X_BC, self._intrinsics, colour=self._colour)
        labels = np.append(self._scene.labels, np.uint8(Label.NONE))[image.geom]  # geom -1 takes the last
        frame = DepthFrame(
            depth=image.depth,
            intrinsics=self._intrinsics,
            X_BC=view.X_BC,
            colour=image.colour,
            t=view.t,
            source=f"exact ({self.backend})",
        )
        return Capture(frame=frame, truth=Truth(depth=image.depth, labels=labels))

    def close(self) -> None:
        """Frees the renderer."""
        self._renderer.close()
