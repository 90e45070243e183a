"""The twin's exact camera: what a perfect depth camera would see of the simulated scene."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, final

import numpy as np
from jaxtyping import Float32, Int32, UInt8
from numpy import ndarray

from weldsim.errors import SensorError
from weldsim.frames import Transform
from weldsim.opengl import Backend
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.sensor.base import Capture, DepthSensor, Finish, Label, Truth, View
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
        finishes: (ngeom,) a `Finish` for each geom, or None where every surface is matte.
    """

    model: "mujoco.MjModel"
    data: "mujoco.MjData"
    X_WB: Transform
    labels: UInt8[ndarray, "ngeom"]
    finishes: UInt8[ndarray, "ngeom"] | None = None

    def __post_init__(self) -> None:
        for name, values in (("labels", self.labels), ("finishes", self.finishes)):
            if values is not None and values.shape != (self.model.ngeom,):
                raise SensorError(f"scene {name}: {values.shape} for {self.model.ngeom} geoms", limit=self.model.ngeom)

    def truth(self, depth: Float32[ndarray, "h w"], geom: Int32[ndarray, "h w"]) -> Truth:
        """What an exact image shows: depth [m], and the label and finish of each pixel's geom (-1 for a miss)."""
        labels = np.append(self.labels, np.uint8(Label.NONE))[geom]  # geom -1 takes the last
        finishes = None if self.finishes is None else np.append(self.finishes, np.uint8(Finish.MATTE))[geom]
        return Truth(depth=depth, labels=labels, finishes=finishes)


def twin_scene(world: "World", data: "mujoco.MjData") -> TwinScene:
    """What the sensors of the twin look at: a world at the state `data`, its labels by geom.

    The part has the finish that the scene gives it; all else counts as matte.
    """
    labels = np.array([Label[world.labels[geom].upper()] for geom in range(world.model.ngeom)], np.uint8)
    finish = Finish[world.config.material.finish.upper()]
    finishes = np.where(np.isin(labels, (Label.PART, Label.GROOVE)), finish, Finish.MATTE).astype(np.uint8)
    return TwinScene(model=world.model, data=data, X_WB=world.X_WB, labels=labels, finishes=finishes if finish else None)


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
        frame = DepthFrame(
            depth=image.depth,
            intrinsics=self._intrinsics,
            X_BC=view.X_BC,
            colour=image.colour,
            t=view.t,
            source=f"exact ({self.backend})",
        )
        return Capture(frame=frame, truth=self._scene.truth(image.depth, image.geom))

    def close(self) -> None:
        self._renderer.close()
