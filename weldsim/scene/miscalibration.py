"""What the cell's software believes wrongly about the cell: errors of the hand-eye calibration and of the arm's geometry.

The twin builds the true cell with them; perception and planning go on using `weldsim.mounts` and `weldsim.kinematics`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import ConfigError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.mounts import X_FC
from weldsim.quantity import Metre, Radian

HAND_EYE, ARM = 1, 2  # streams of random numbers: one error does not change the other
LIMIT_LENGTH, LIMIT_ANGLE = 0.05, 0.1  # [m], [rad] more is no calibration error but a different cell
JOINTS = 6


@dataclass(frozen=True)
class TwinConfig:
    """How the true cell differs from what its software believes. All zero by default: the calibration is perfect.

    The hand-eye error has exactly the size given, in a random direction; each length and angle of the arm is off by a
    normal deviate. Directions and deviates are functions of `seed` alone, so an error can be doubled and stay alike.
    """

    hand_eye_position: Metre = 0.0
    """Distance of the camera from where the hand-eye calibration has it on the flange. Three calibrations of the thesis
    author's agree within 1 mm, 4 mm along the optical axis."""
    hand_eye_rotation: Radian = 0.0
    """Angle between the camera and what the calibration says of it."""
    kinematic_position: Metre = 0.0
    """Standard deviation of each coordinate of each joint's place on its link."""
    kinematic_rotation: Radian = 0.0
    """Standard deviation of each joint's zero and of its axis about x and y on its link."""
    seed: int = 0
    """Which unit: of the directions and deviates."""

    def __post_init__(self) -> None:
        limits = {"position": LIMIT_LENGTH, "rotation": LIMIT_ANGLE}
        for name in ("hand_eye_position", "hand_eye_rotation", "kinematic_position", "kinematic_rotation"):
            value, limit = getattr(self, name), limits[name.rpartition("_")[2]]
            if not 0 <= value <= limit:
                unit = "m" if limit == LIMIT_LENGTH else "rad"
                raise ConfigError(f"twin.{name} = {value:g} {unit}: expected 0 to {limit:g} {unit}", key=name, limit=limit)
        if self.seed < 0:
            raise ConfigError(f"twin.seed = {self.seed}: 0 or more is needed", key="seed", value=self.seed)

    @property
    def perfect(self) -> bool:
        """Whether the software is right about everything."""
        return not any((self.hand_eye_position, self.hand_eye_rotation, self.kinematic_position, self.kinematic_rotation))

    @cached_property
    def X_FC(self) -> Transform:
        """Where the camera really is on the flange."""
        rng = np.random.default_rng([self.seed, HAND_EYE])
        shift, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        error = Transform("CC", matrix_from_rotation_vector(self.hand_eye_rotation * axis), self.hand_eye_position * shift)
        return X_FC @ error

    def joint_errors(self) -> tuple[Float[ndarray, "6 3"], Float[ndarray, "6 3"]]:
        """Of each joint in the frame it should have: displacement [m], and rotation vector [rad]."""
        rng = np.random.default_rng([self.seed, ARM])
        unit_position, unit_rotation = rng.normal(size=(2, JOINTS, 3))
        return self.kinematic_position * unit_position, self.kinematic_rotation * unit_rotation
