"""The reference the arm follows: where it should be now and how fast, moved on once a control period.

Whoever moves the arm says so every period; where nobody does, the reference comes to rest.
"""

from collections.abc import Sequence
from math import exp

import numpy as np

from weldsim.controller.errors import MotionFault, TooFast
from weldsim.controller.kinematics import Kinematics
from weldsim.kinematics import JOINT_LIMIT, SPEED_LIMIT
from weldsim.urscript.poses import Matrix

STOP_DECELERATION = 12.0  # [rad/s2] of the leading joint when nobody commands any longer: rest from full speed in 0.26 s
SPEED_MARGIN = 1.05  # what a numerical derivative may exceed the limit by


class Reference:
    """Joint reference of the servos.

    Attributes:
        q, qd, qdd: angles [rad], speeds [rad/s] and accelerations [rad/s2].
        period: of control [s].
        commanded: whether this period's motion has been commanded.
    """

    def __init__(self, q: Sequence[float], period: float, kinematics: Kinematics) -> None:
        self.period, self._kinematics = period, kinematics
        self.place(q)

    def place(self, q: Sequence[float]) -> None:
        """At rest at q."""
        self.q, self.qd, self.qdd = [float(x) for x in q], [0.0] * 6, [0.0] * 6
        self.commanded = False

    @property
    def resting(self) -> bool:
        return not any(self.qd)

    def move(self, q: Sequence[float], qd: Sequence[float] | None = None) -> None:
        """This period ends at q, at speed qd or else at the mean speed of the period.

        Raises:
            TooFast: a joint would be faster than it can.
            MotionFault: a joint would leave its range.
        """
        h = self.period
        mean = [(new - old) / h for new, old in zip(q, self.q, strict=True)]
        speeds = mean if qd is None else list(qd)
        for joint in range(6):
            if abs(mean[joint]) > SPEED_LIMIT * SPEED_MARGIN:
                raise TooFast(f"joint {joint} would turn at {mean[joint]:.2f} rad/s, the limit is {SPEED_LIMIT:.2f} rad/s")
            if abs(q[joint]) > JOINT_LIMIT:
                raise MotionFault(f"joint {joint} would turn to {q[joint]:.3f} rad, beyond its range of {JOINT_LIMIT:.3f} rad")
        self.qdd = [(new - old) / h for new, old in zip(speeds, self.qd, strict=True)]
        self.q, self.qd, self.commanded = list(q), speeds, True

    def speed(self, qd: Sequence[float]) -> None:
        """This period's speed runs from the last one to qd; a joint faster than it can is held to the limit."""
        speeds = [min(SPEED_LIMIT, max(-SPEED_LIMIT, x)) for x in qd]
        self.move([q + (old + new) / 2 * self.period for q, old, new in zip(self.q, self.qd, speeds, strict=True)], speeds)

    def ramp(self, target: Sequence[float], acceleration: float) -> bool:
        """One period towards joint speeds `target`, the leading joint changing at `acceleration`; whether they are reached."""
        change = [new - old for new, old in zip(target, self.qd, strict=True)]
        step, leading = acceleration * self.period, max(abs(x) for x in change)
        if leading <= step:
            self.speed(target)
            return True
        self.speed([old + x * step / leading for old, x in zip(self.qd, change, strict=True)])
        return False

    def servo(self, target: Sequence[float], lookahead: float) -> None:
        """One period of following `target`, critically damped: a target in steady motion is followed `lookahead` seconds late."""
        h = self.period
        rate = 2.0 / lookahead
        decay = exp(-rate * h)
        q, qd = [], []
        for goal, at, speed in zip(target, self.q, self.qd, strict=True):
            error, drive = at - goal, speed + rate * (at - goal)
            q.append(goal + (error + drive * h) * decay)
            qd.append((drive - rate * (error + drive * h)) * decay)
        if max(abs(x) for x in qd) > SPEED_LIMIT or max(abs(b - a) for a, b in zip(self.q, q, strict=True)) > SPEED_LIMIT * h:
            self.speed(qd)
        else:
            self.move(q, qd)

    def rest(self) -> None:
        """One period of coming to rest, for who was not commanded."""
        if self.resting:
            self.qdd = [0.0] * 6
            return
        try:
            self.ramp([0.0] * 6, STOP_DECELERATION)
        except MotionFault:  # at the end of a joint's range, or too fast for a stop within it: the brakes
            self.place(self.q)

    def twist(self, tcp: Matrix) -> list[float]:
        """Velocity of the TCP [m/s, rad/s] in the base."""
        return (self._kinematics.jacobian(self.q, tcp) @ np.array(self.qd)).tolist()

    def drive(self, twist: Sequence[float], tcp: Matrix) -> None:
        """This period ends with the TCP at this velocity.

        Raises:
            MotionFault: the arm is singular there, or a joint would be too fast.
        """
        J = self._kinematics.jacobian(self.q, tcp)
        try:
            qd = np.linalg.solve(J, np.array(twist)).tolist()
        except np.linalg.LinAlgError:
            qd = [np.inf] * 6
        leading = max(abs(x) for x in qd)
        if not leading <= SPEED_LIMIT:
            raise MotionFault(f"a joint would turn at {leading:.2f} rad/s near a singularity, the limit is {SPEED_LIMIT:.2f} rad/s")
        self.speed(qd)
