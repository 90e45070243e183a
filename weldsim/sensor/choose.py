"""The simulated cameras by name: which class, which settings, where they stand. Imports no heavy library until one is made."""

from typing import TYPE_CHECKING, Protocol, get_args, runtime_checkable

from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.mounts import KINECT_V2, X_WC_KINECT
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import DepthSensor
from weldsim.sensor.d415 import D435_848X480, D415Config, D435Config, unit_intrinsics
from weldsim.sensor.names import SensorName

if TYPE_CHECKING:
    from jaxtyping import Float
    from numpy import ndarray

    from weldsim.scene.world import World
    from weldsim.sensor.active_stereo import D415StereoConfig
    from weldsim.sensor.exact import TwinScene
    from weldsim.sensor.kinect import KinectConfig

__all__ = ["EXACT_STEP", "SensorName", "SensorTables", "depth_step", "make_sensor", "posture", "stations"]

EXACT_STEP = 1e-4  # [m] of depth that has no step of its own, in a PNG


@runtime_checkable
class SensorTables(Protocol):
    """The settings of every camera; `weldsim.config.CellConfig` is one."""

    @property
    def sensor(self) -> D415Config: ...
    @property
    def d435(self) -> D435Config: ...
    @property
    def stereo(self) -> "D415StereoConfig": ...
    @property
    def kinect(self) -> "KinectConfig": ...


def make_sensor(
    name: SensorName, scene: "TwinScene", intrinsics: CameraIntrinsics, tables: SensorTables, *, seed: int = 0
) -> DepthSensor:
    """The camera called `name`, looking at `scene`; close it after use.

    Args:
        intrinsics: nominal ones of the wrist camera; a D435 in its place and the Kinect have their own.
        tables: settings of all of them.  seed: of the unit and its noise.
    Raises:
        SensorError: nothing draws here.  InputError: a name that no camera has.
    """
    if name not in get_args(SensorName):
        raise InputError(f"sensor {name!r} is not one of {', '.join(get_args(SensorName))}", sensor=name)
    if name == "d415-stereo":
        from weldsim.sensor.active_stereo import D415Stereo

        return D415Stereo(scene, intrinsics, tables.stereo, seed=seed)
    if name == "kinect":
        from weldsim.sensor.time_of_flight import KinectV2

        return KinectV2(scene, KINECT_V2, tables.kinect, seed=seed)

    from weldsim.sensor.exact import ExactSensor
    from weldsim.sensor.stereo import D415Fast

    if name == "exact":
        return ExactSensor(scene, intrinsics)
    config, nominal = (tables.d435, D435_848X480) if name == "d435" else (tables.sensor, intrinsics)
    return D415Fast(ExactSensor(scene, unit_intrinsics(nominal, config)), config, seed=seed)


def depth_step(name: SensorName, tables: SensorTables) -> float:
    """The step [m] in which that camera's depth is stored, EXACT_STEP where it has none of its own."""
    units = {
        "d415": tables.sensor.depth_unit,
        "d435": tables.d435.depth_unit,
        "d415-stereo": tables.stereo.depth_unit,
        "kinect": tables.kinect.depth_unit,
    }
    return units.get(name, 0.0) or EXACT_STEP


def stations(world: "World", name: SensorName) -> tuple[Transform, ...]:
    """X_BC of each exposure of that camera: the scene's views for the wrist camera, one from over the table for the Kinect."""
    return (world.X_WB.inverse() @ X_WC_KINECT,) if name == "kinect" else world.views


def posture(world: "World", name: SensorName, view: int) -> "Float[ndarray, '6']":
    """Joint angles [rad] during an exposure: holding the wrist camera at its view, or turned away from under the Kinect.

    Raises:
        ViewError: a view that the arm cannot take.
    """
    from weldsim.scene.world import AWAY

    return AWAY if name == "kinect" else world.view_joints(view)
