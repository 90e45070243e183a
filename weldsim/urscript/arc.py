"""A circular arc through three poses, as `movec` follows it."""

from collections.abc import Callable, Sequence
from math import atan2, cos, pi, sin

import numpy as np

from weldsim.urscript.errors import ScriptError
from weldsim.urscript.poses import inverse_matrix, matrix_of, pose_between, pose_of, turn_between

FLAT = 1e-9  # [m2] twice the area of the triangle below which three positions make no circle


class Arc:
    """From the position of `start` through that of `via` to that of `end`.

    Attributes:
        length: along the arc [m].  angle: that it turns about its centre [rad], up to a whole turn.
    """

    def __init__(self, start: Sequence[float], via: Sequence[float], end: Sequence[float], fixed: bool = False) -> None:
        """Args: three poses [m, rad]; fixed: the orientation keeps its angle to the arc, else it turns evenly to that of `end`.

        Raises:
            ScriptError: two positions coincide, or all three lie on one line.
        """
        first, middle, last = (np.array(pose[:3], float) for pose in (start, via, end))
        u, w = middle - first, last - first
        normal = np.cross(u, w)
        size = float(np.linalg.norm(normal))
        if size < FLAT:
            raise ScriptError("movec: the three positions lie on one line and make no circle")
        arm = np.cross(w * (u @ u) - u * (w @ w), normal) / (2.0 * size * size)  # circumcentre from the first corner
        self._start, self._end, self._fixed = list(start), list(end), fixed
        self._centre, self._axis = first + arm, normal / size
        self._radius = float(np.linalg.norm(arm))
        self._ahead = -arm / self._radius
        self._across = np.cross(self._axis, self._ahead)
        leg = last - self._centre
        self.angle = atan2(float(leg @ self._across), float(leg @ self._ahead)) % (2.0 * pi)
        self.length = self._radius * self.angle

    def at(self, share: float) -> list[float]:
        """The pose a share of the way along."""
        angle = share * self.angle
        if self._fixed:
            matrix = matrix_of([0.0, 0.0, 0.0, *(angle * self._axis)]) @ matrix_of(self._start)
        else:
            matrix = matrix_of(pose_between(self._start, self._end, share))
        position = self._centre + self._radius * (cos(angle) * self._ahead + sin(angle) * self._across)
        return [*position.tolist(), *pose_of(matrix)[3:]]

    def share_of(self, pose: Sequence[float]) -> float:
        """How far along the arc a pose near to it is, 0 to 1."""
        leg = np.array(pose[:3], float) - self._centre
        angle = atan2(float(leg @ self._across), float(leg @ self._ahead)) % (2.0 * pi)
        return angle / self.angle if angle <= self.angle else float(angle - self.angle < (2.0 * pi - self.angle) / 2.0)

    def rest(self, pose: Sequence[float]) -> Callable[[float], list[float]]:
        """What is left of the arc from a pose near to it: the pose a share of that way along, beginning at `pose` itself."""
        done = self.share_of(pose)
        off = pose_of(inverse_matrix(matrix_of(self.at(done))) @ matrix_of(pose))
        still = [0.0] * 6

        def at(share: float) -> list[float]:
            return pose_of(matrix_of(self.at(done + share * (1.0 - done))) @ matrix_of(pose_between(off, still, share)))

        return at

    @property
    def turn(self) -> float:
        """Angle [rad] that the orientation turns on the way beyond what follows from the arc itself."""
        return 0.0 if self._fixed else turn_between(self._start, self._end)
