"""The camera put at each view, as if the arm had always stood there: a scan without the way."""

from dataclasses import replace
from typing import TYPE_CHECKING

from weldsim.sensor.choose import SensorName, SensorTables, make_sensor, posture, stations

if TYPE_CHECKING:
    from weldsim.scene.world import World
    from weldsim.sensor.base import Capture


def scan(world: "World", tables: SensorTables, seed: int = 0, sensor: SensorName = "d415") -> tuple["Capture", ...]:
    """One exposure from each view of the scene, the arm standing where it holds the camera; the Kinect takes one from above.

    The frames say where the camera was meant to stand; where the cell is miscalibrated (`TwinConfig`, with which the world
    was built) it stood elsewhere.

    Args:
        world: the scene.  tables: settings of the cameras.  seed: of the camera's noise.  sensor: which camera looks.
    Raises:
        ViewError: a view that the arm cannot take.  SensorError: nothing draws here.
    """
    from weldsim.sensor.base import View
    from weldsim.sensor.exact import twin_scene

    captures = []
    for index, X_BC in enumerate(stations(world, sensor)):
        data = world.new_data(posture(world, sensor, index))
        camera = make_sensor(sensor, twin_scene(world, data), world.intrinsics, tables, seed=seed)
        try:
            stands = X_BC if sensor == "kinect" else world.camera_pose(index, data)
            capture = camera.capture(View(X_BC=stands))
            captures.append(replace(capture, frame=replace(capture.frame, X_BC=X_BC)))
        finally:
            camera.close()
    return tuple(captures)
