"""What a scene is made of: the contents of one TOML file of `scenes/`."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from weldsim.errors import SceneError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.quantity import Metre, Radian
from weldsim.scene.workpieces.base import Workpiece
from weldsim.scene.workpieces.centre_line import CentreLineConfig
from weldsim.scene.workpieces.groove import GrooveConfig
from weldsim.scene.workpieces.plate import PlainPlate, PlateConfig, make_groove_plate

Finish = Literal["matte", "mill_scale", "ground", "black"]


@dataclass(frozen=True)
class PartPoseConfig:
    """Where the part lies on the table, in the robot base B (table top z = 0).

    Attributes:
        x: of the middle of its upper face [m].
        y: of the middle of its upper face [m].
        clearance: between the table and its lowest corner [m].
        yaw: about the vertical [rad].
        tilt: of its upper face from the horizontal [rad].
        tilt_heading: direction about the vertical, from B's x, towards which the face leans down [rad].
    """

    x: Metre = 0.0
    y: Metre = -0.45
    clearance: Metre = 0.0
    yaw: Radian = 0.0
    tilt: Radian = 0.0
    tilt_heading: Radian = 0.0


@dataclass(frozen=True)
class FixtureConfig:
    """What holds the part.

    Attributes:
        clamps: step clamps on the part's long sides: 0, 2 or 4.
        overlap: of each clamp's nose over the part [m].
        bolts: bolt heads standing on the part's surface, as clutter: 0 to 6.
    """

    clamps: Literal[0, 2, 4] = 4
    overlap: Metre = 0.018
    bolts: int = 0


@dataclass(frozen=True)
class MaterialConfig:
    """How the part looks.

    Attributes:
        finish: what a camera sees: dusted matte, mill scale, ground steel, or black.
        red: of its colour, 0 to 1.
        green: of its colour, 0 to 1.
        blue: of its colour, 0 to 1.
    """

    finish: Finish = "matte"
    red: float = 0.56
    green: float = 0.57
    blue: float = 0.58


@dataclass(frozen=True)
class CameraPoseConfig:
    """An explicit pose of the wrist camera's optical frame in the robot base B.

    Attributes:
        x: position [m].
        y: position [m].
        z: position [m].
        quaternion_wxyz: orientation; x right, y down, z forward.
    """

    x: Metre
    y: Metre
    z: Metre
    quaternion_wxyz: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 0.0)


@dataclass(frozen=True)
class ViewConfig:
    """One scan view of the wrist camera, which looks at the middle of the part's upper face unless told otherwise.

    Attributes:
        standoff: from the part along the optical axis [m].
        tilt: of the optical axis from the part's normal [rad].
        heading: direction about the part's normal, from its x, in which the camera stands off when tilted [rad].
        roll: about the optical axis, 0 with the image's right along the part's x [rad].
        shift_x: of the point looked at, along the part's x [m].
        shift_y: of the point looked at, along the part's y [m].
        camera_in_base: the camera's pose itself; everything above is then not used.
    """

    standoff: Metre = 0.40
    tilt: Radian = 0.0
    heading: Radian = 0.0
    roll: Radian = 0.0
    shift_x: Metre = 0.0
    shift_y: Metre = 0.0
    camera_in_base: CameraPoseConfig | None = None

    def pose(self, X_BP: Transform) -> Transform:
        """X_BC, for a part at X_BP.

        Raises:
            SceneError: a standoff outside 0.1 to 2 m, or a tilt of 80 deg or more.
        """
        explicit = self.camera_in_base
        if explicit is not None:
            return Transform.from_quaternion(
                "BC", np.array(explicit.quaternion_wxyz, float), np.array([explicit.x, explicit.y, explicit.z], float)
            )
        if not 0.1 <= self.standoff <= 2.0:
            raise SceneError(f"view: standoff {self.standoff * 1e3:g} mm must be 100 to 2000 mm", key="standoff", limit=(0.1, 2.0))
        if abs(self.tilt) >= np.radians(80):
            raise SceneError(
                f"view: tilt {np.degrees(self.tilt):g} deg must be under 80 deg", key="tilt", limit=float(np.radians(80))
            )
        return X_BP @ self.pose_in_part()

    def pose_in_part(self) -> Transform:
        """X_PC: the camera looking at the part."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        lean = matrix_from_rotation_vector(self.tilt * np.array([-s, c, 0.0]))  # +z leans towards `heading`
        facing = np.diag([1.0, -1.0, -1.0])
        R = lean @ facing @ matrix_from_rotation_vector(np.array([0.0, 0.0, self.roll]))
        target = np.array([self.shift_x, self.shift_y, 0.0])
        return Transform("PC", R, target - self.standoff * R[:, 2])


@dataclass(frozen=True)
class SceneConfig:
    """One scene.

    Attributes:
        name: what it is called.
        title: one line for people.
        workpiece: which kind of part.
        plate: its dimensions.
        groove: its groove's cross-section.
        centre_line: where its groove runs.
        pose: where it lies.
        fixture: what holds it.
        material: how it looks.
        views: where the wrist camera scans from, in order; one at least.
    """

    name: str = "scene"
    title: str = ""
    workpiece: Literal["groove_plate", "plain_plate"] = "groove_plate"
    plate: PlateConfig = field(default_factory=PlateConfig)
    groove: GrooveConfig = field(default_factory=GrooveConfig)
    centre_line: CentreLineConfig = field(default_factory=CentreLineConfig)
    pose: PartPoseConfig = field(default_factory=PartPoseConfig)
    fixture: FixtureConfig = field(default_factory=FixtureConfig)
    material: MaterialConfig = field(default_factory=MaterialConfig)
    views: tuple[ViewConfig, ...] = (ViewConfig(),)


def make_workpiece(config: SceneConfig) -> Workpiece:
    """The part that `config` describes.

    Raises:
        SceneError: dimensions that contradict each other.
    """
    if config.workpiece == "plain_plate":
        return PlainPlate(config.plate.checked())
    return make_groove_plate(config.plate, config.groove, config.centre_line)


def part_pose(config: PartPoseConfig, workpiece: Workpiece) -> Transform:
    """X_BP: the part lifted so that its lowest corner is `clearance` above the table.

    Raises:
        SceneError: a tilt of 60 deg or more, or a clearance below the table.
    """
    if abs(config.tilt) >= np.pi / 3:
        raise SceneError(f"pose: tilt {np.degrees(config.tilt):g} deg must be under 60 deg", key="tilt", limit=np.pi / 3)
    if config.clearance < 0:
        raise SceneError(
            f"pose: clearance {config.clearance * 1e3:g} mm would sink the part into the table", key="clearance", limit=0.0
        )
    c, s = np.cos(config.tilt_heading), np.sin(config.tilt_heading)
    lean = matrix_from_rotation_vector(config.tilt * np.array([-s, c, 0.0]))
    R = lean @ matrix_from_rotation_vector(np.array([0.0, 0.0, config.yaw]))
    lowest = float((workpiece.base_corners @ R.T)[:, 2].min())
    return Transform("BP", R, np.array([config.x, config.y, config.clearance - lowest]))
