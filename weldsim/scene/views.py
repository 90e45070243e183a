"""Scan views: where the wrist camera stands, with respect to the part or to the base."""

from dataclasses import dataclass

import numpy as np

from weldsim.errors import ConfigError, SceneError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.quantity import REACH, TURN, Metre, Radian, require_within

WIDEST = float(np.radians(120))  # tilt of a view: sides are seen level, or a little from below


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

    def __post_init__(self) -> None:
        require_within(self, dict.fromkeys("xyz", REACH), "camera_in_base")
        length = float(np.linalg.norm(self.quaternion_wxyz))
        if not 0.99 <= length <= 1.01:
            raise ConfigError(
                f"camera_in_base.quaternion_wxyz has length {length:g}; a rotation's is 1", key="quaternion_wxyz", value=length
            )


@dataclass(frozen=True)
class ViewConfig:
    """One scan view of the wrist camera, which looks at P's origin, the middle of the part's upper face, unless told otherwise.

    Attributes:
        standoff: from the part along the optical axis [m].
        tilt: of the optical axis from the part's normal [rad].
        heading: direction about the part's normal, from its x, in which the camera stands off when tilted [rad].
        roll: about the optical axis, 0 with the image's right along the part's x [rad].
        shift_x: of the point looked at, along the part's x [m].
        shift_y: of the point looked at, along the part's y [m].
        shift_z: of the point looked at, along the part's z [m]; negative down the sides.
        camera_in_base: the camera's pose itself; everything above is then not used.
    """

    standoff: Metre = 0.40
    tilt: Radian = 0.0
    heading: Radian = 0.0
    roll: Radian = 0.0
    shift_x: Metre = 0.0
    shift_y: Metre = 0.0
    shift_z: Metre = 0.0
    camera_in_base: CameraPoseConfig | None = None

    def __post_init__(self) -> None:
        shifts = dict.fromkeys(("shift_x", "shift_y", "shift_z"), REACH)
        require_within(self, {"tilt": TURN, "heading": TURN, "roll": TURN, "standoff": (0.0, REACH[1]), **shifts}, "view")

    def pose(self, X_BP: Transform) -> Transform:
        """X_BC, for a part at X_BP.

        Raises:
            SceneError: a standoff outside 0.1 to 2 m, or a tilt of WIDEST or more.
        """
        explicit = self.camera_in_base
        if explicit is not None:
            return Transform.from_quaternion(
                "BC", np.array(explicit.quaternion_wxyz, float), np.array([explicit.x, explicit.y, explicit.z], float)
            )
        if not 0.1 <= self.standoff <= 2.0:
            raise SceneError(f"view: standoff {self.standoff * 1e3:g} mm must be 100 to 2000 mm", key="standoff", limit=(0.1, 2.0))
        if abs(self.tilt) >= WIDEST:
            raise SceneError(
                f"view: tilt {np.degrees(self.tilt):g} deg must be under {np.degrees(WIDEST):g} deg", key="tilt", limit=WIDEST
            )
        return X_BP @ self.pose_in_part()

    def pose_in_part(self) -> Transform:
        """X_PC: the camera looking at the part."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        lean = matrix_from_rotation_vector(self.tilt * np.array([-s, c, 0.0]))  # +z leans towards `heading`
        facing = np.diag([1.0, -1.0, -1.0])
        R = lean @ facing @ matrix_from_rotation_vector(np.array([0.0, 0.0, self.roll]))
        target = np.array([self.shift_x, self.shift_y, self.shift_z])
        return Transform("PC", R, target - self.standoff * R[:, 2])
