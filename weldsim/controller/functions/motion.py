"""Functions that move the arm. Each period of motion is one turn of a generator."""

from collections.abc import Callable, Generator
from math import hypot
from typing import Any, TypeVar

from weldsim.controller.errors import MotionFault, TooFast
from weldsim.controller.machine import Machine
from weldsim.controller.reference import STOP_DECELERATION
from weldsim.controller.trapezoid import Trapezoid
from weldsim.kinematics import JOINT_LIMIT, SPEED_LIMIT
from weldsim.urscript.arc import Arc
from weldsim.urscript.check import is_pose, positive, six
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.poses import Matrix, pose_between, turn_between
from weldsim.urscript.values import number

Motion = Generator[None, None, None]
Step = Callable[[], object]
PoseAt = Callable[[float], list[float]]  # the pose a share of the way along
Way = tuple[float, PoseAt]  # how long [m], and where it leads
T = TypeVar("T")
TURN_RADIUS = 0.25  # [m] a turn of one radian of the tool counts as this long a way
MAX_ACCELERATION = 40.0  # [rad/s2] or [m/s2]
LOOKAHEAD, GAIN = (0.03, 0.2), (100.0, 2000.0)  # ranges of servoj
LEAST_TIME = 1e-9  # [s]
LIMITER_STEP, LEAST_LIMITER = 0.9, 0.02  # how finely a path too fast for a joint is slowed down, and how far before it is a fault
ARRIVED, ARRIVAL_TIME = 5e-5, 0.1  # [rad] a move ends when every joint is this near to its target, or this much [s] later


class MotionFunctions:
    """movej, movel, movec, movep, servoj, servoc, speedj, speedl, stopj, stopl.

    Blends are not modelled: every move comes to rest at its target. servoj follows its target `lookahead_time` late; its gain is
    checked and otherwise not modelled.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine, self._reference = machine, machine.reference

    def movej(self, q: Any, a: float = 1.4, v: float = 1.05, t: float = 0, r: float = 0) -> Motion:
        """Joints to q, or to the joints of a pose, all arriving together; a [rad/s2], v [rad/s], t [s] instead of v."""
        target = self._within(self._joints(q))
        a, v = min(positive(a, "a"), MAX_ACCELERATION), min(positive(v, "v"), SPEED_LIMIT)
        yield from self._towards(self._machine.kinematics.tcp_pose(target, self._tcp), self._turn(target, a, v, t))

    def _turn(self, target: list[float], a: float, v: float, t: float) -> Motion:
        """Joints to target [rad], planned anew after whatever held them."""
        while True:
            yield from self._settle()
            start = self._reference.q
            way = [new - old for new, old in zip(target, start, strict=True)]
            length = max(abs(x) for x in way)
            profile = self._profile(length, v, a, t)

            def at(
                elapsed: float, start: list[float] = start, way: list[float] = way, length: float = length, p: Trapezoid = profile
            ) -> None:
                s, speed = p.at(elapsed)
                share, rate = (s / length, speed / length) if length > 0 else (1.0, 0.0)
                rate *= self._machine.pace
                self._reference.move([q0 + share * x for q0, x in zip(start, way, strict=True)], [rate * x for x in way])

            if (yield from self._along(at, profile.duration)):
                return

    def movel(self, pose: Any, a: float = 1.2, v: float = 0.25, t: float = 0, r: float = 0) -> Motion:
        """TCP to a pose, or to that of joint angles, on a straight line; a [m/s2], v [m/s], t [s] instead of v."""
        target = self._pose(pose)
        a, v = min(positive(a, "a"), MAX_ACCELERATION), positive(v, "v")
        self._joints_of(target)
        yield from self._towards(target, self._line(target, a, v, t))

    def movec(self, pose_via: Any, pose_to: Any, a: float = 1.2, v: float = 0.25, r: float = 0, mode: int = 0) -> Motion:
        """TCP on a circular arc through one pose to another, at v [m/s] and a [m/s2] along it.

        The orientation turns evenly to that of pose_to, or with mode 1 keeps its angle to the arc.
        """
        via, target = self._pose(pose_via), self._pose(pose_to)
        a, v = min(positive(a, "a"), MAX_ACCELERATION), positive(v, "v")
        if number(mode) not in (0, 1):
            raise ScriptError(f"movec: mode = {mode} is neither 0 nor 1")
        for pose in (via, target):
            self._joints_of(pose)

        arcs: list[Arc] = []

        def arc(start: list[float]) -> Way:
            """The whole arc; after a stop on the way what is left of it."""
            if not arcs:
                arcs.append(Arc(start, via, target, fixed=bool(mode)))
            whole = max(arcs[0].length, TURN_RADIUS * arcs[0].turn)
            return whole * (1.0 - arcs[0].share_of(start)), arcs[0].rest(start)

        yield from self._towards(target, self._follow(arc, a, v, 0))

    def _line(self, target: list[float], a: float, v: float, t: float) -> Motion:
        """TCP to the pose target."""

        def line(start: list[float]) -> Way:
            way = hypot(*(new - old for new, old in zip(target[:3], start[:3], strict=True)))
            return max(way, TURN_RADIUS * turn_between(start, target)), lambda share: pose_between(start, target, share)

        return self._follow(line, a, v, t)

    def _follow(self, way: Callable[[list[float]], Way], a: float, v: float, t: float) -> Motion:
        """TCP along the way that leads on from a pose, planned anew after whatever held it."""
        while True:
            yield from self._settle()
            length, pose_at = way(self._machine.kinematics.tcp_pose(self._reference.q, self._tcp))
            profile = self._profile(length, v, a, t)

            def at(elapsed: float, length: float = length, pose_at: PoseAt = pose_at, p: Trapezoid = profile) -> None:
                s, speed = p.at(elapsed)
                q = self._near(pose_at(s / length if length > 0 else 1.0))
                self._reference.move(q, None if speed > 0 else [0.0] * 6)

            if (yield from self._along(at, profile.duration)):
                return

    def movep(self, pose: Any, a: float = 1.2, v: float = 0.25, r: float = 0) -> Motion:
        """As movel."""
        yield from self.movel(pose, a, v)

    def servoj(self, q: Any, a: float = 0, v: float = 0, t: float = 0, lookahead_time: float = 0.1, gain: float = 300) -> Motion:
        """Follow q [rad] for t [s], or for one period, `lookahead_time` late; a and v are not used, as on a real controller."""
        target = six(q, "servoj q")
        for name, value, (low, high) in (("lookahead_time", lookahead_time, LOOKAHEAD), ("gain", gain, GAIN)):
            if not low <= number(value) <= high:
                raise ScriptError(f"servoj: {name} = {value} is outside {low} to {high}")
        yield from self._for(t, lambda: self._reference.servo(target, lookahead_time))

    def servoc(self, pose: Any, a: float = 1.2, v: float = 0.25, r: float = 0) -> Motion:
        """As movel."""
        yield from self.movel(pose, a, v)

    def speedj(self, qd: Any, a: float = 1.4, t: float = 0) -> Motion:
        """Joint speeds to qd [rad/s] at a [rad/s2]; returns after t [s], or when they are reached."""
        target, a = six(qd, "speedj qd"), min(positive(a, "a"), MAX_ACCELERATION)
        if number(t) > 0:
            yield from self._for(t, lambda: self._reference.ramp(target, a))
        else:
            yield from self._until(lambda: self._reference.ramp(target, a))

    def speedl(self, xd: Any, a: float = 1.2, t: float = 0, aRot: float = 0) -> Motion:
        """TCP velocity to xd [m/s, rad/s] at a [m/s2]; returns after t [s], or when it is reached."""
        target, a = six(xd, "speedl xd"), min(positive(a, "a"), MAX_ACCELERATION)
        if number(t) > 0:
            yield from self._for(t, lambda: self._ramp_tool(target, a))
        else:
            yield from self._until(lambda: self._ramp_tool(target, a))

    def stopj(self, a: float = 2.0) -> Motion:
        """Rest, the leading joint slowing down at a [rad/s2]."""
        a = min(positive(a, "a"), MAX_ACCELERATION)
        yield from self._until(lambda: self._reference.ramp([0.0] * 6, a))

    def stopl(self, a: float = 20.0, aRot: float = 0) -> Motion:
        """Rest, the TCP slowing down at a [m/s2] on its line."""
        a = min(positive(a, "a"), MAX_ACCELERATION)
        yield from self._until(lambda: self._ramp_tool([0.0] * 6, a))

    def _ramp_tool(self, target: list[float], a: float) -> bool:
        """One period towards a TCP velocity; whether it is reached."""
        reference = self._reference
        now = reference.twist(self._tcp)
        change = [new - old for new, old in zip(target, now, strict=True)]
        leading = max(hypot(*change[:3]), TURN_RADIUS * hypot(*change[3:]))
        step = a * reference.period
        if leading <= step:
            if any(target):
                reference.drive(target, self._tcp)
            else:
                reference.ramp(target, MAX_ACCELERATION)
            return True
        reference.drive([old + x * step / leading for old, x in zip(now, change, strict=True)], self._tcp)
        return False

    @property
    def _tcp(self) -> Matrix:
        return self._machine.tool.tcp_matrix

    def _joints(self, target: Any) -> list[float]:
        return self._joints_of(six(target, "target")) if is_pose(target) else six(target, "target")

    def _pose(self, target: Any) -> list[float]:
        pose = six(target, "target")
        return pose if is_pose(target) else self._machine.kinematics.tcp_pose(self._within(pose), self._tcp)

    def _within(self, q: list[float]) -> list[float]:
        """Joint angles that are within their ranges. Raises ScriptError."""
        for joint, angle in enumerate(q):
            if abs(angle) > JOINT_LIMIT:
                raise ScriptError(f"joint {joint} cannot turn to {angle:.3f} rad, its range is +-{JOINT_LIMIT:.3f} rad")
        return q

    def _joints_of(self, pose: list[float]) -> list[float]:
        q = self._machine.kinematics.pose_joints(pose, self._tcp, self._reference.q)
        if q is None:
            raise ScriptError(f"the arm cannot reach p[{', '.join(f'{x:.4f}' for x in pose)}]")
        return q

    def _near(self, pose: list[float]) -> list[float]:
        q = self._machine.kinematics.pose_joints(pose, self._tcp, self._reference.q)
        if q is None:
            raise MotionFault(f"the arm cannot reach p[{', '.join(f'{x:.4f}' for x in pose)}] on its line")
        return q

    def _profile(self, length: float, v: float, a: float, t: float) -> Trapezoid:
        return Trapezoid.lasting(length, t, a) if number(t) > 0 and length > 0 else Trapezoid(length, v, a)

    def _command(self, step: Callable[[], T]) -> T | None:
        """What `step` returns after it has commanded this period; a fault stops the arm and counts as not done: None."""
        if self._reference.commanded:
            raise ScriptError("another thread is already moving the arm")
        try:
            return step()
        except MotionFault as fault:
            self._machine.protective_stop(str(fault))
            return None

    def _for(self, t: float, step: Step) -> Motion:
        """`step` every period for t [s], one period at least."""
        for _ in range(max(1, round(number(t) / self._reference.period))):
            self._command(step)
            yield

    def _until(self, step: Step) -> Motion:
        """`step` every period until it says that it is done."""
        done = False
        while not done:
            done = bool(self._command(step))
            yield

    def _towards(self, pose: list[float], motion: Motion) -> Motion:
        """A motion, during which `pose` is what the controller calls its waypoint."""
        self._machine.waypoint = pose
        try:
            yield from motion
        finally:  # whether it has arrived or its thread was killed
            self._machine.waypoint, self._machine.limiter = None, 1.0

    def _settle(self) -> Motion:
        """Rest, before a move that begins from rest."""
        while not self._reference.resting:
            self._command(lambda: self._reference.ramp([0.0] * 6, STOP_DECELERATION))
            yield

    def _along(self, at: Callable[[float], None], duration: float) -> Generator[None, None, bool]:
        """`at(elapsed)` every period up to `duration`; whether it got there, or was held and must be planned anew.

        Where a joint would be too fast it is slowed down as far as it takes: UR's trajectory limiter, reported as speed_scaling.
        """
        elapsed, before = 0.0, self._reference.q
        if duration < LEAST_TIME:  # there already: a move takes one period all the same
            yield
        while elapsed < duration - LEAST_TIME:
            if self._reference.q is not before:
                return False  # something else moved the reference: a pause, a protective stop
            done, step = elapsed, self._reference.period * self._machine.pace

            def limited(done: float = done, step: float = step) -> float:
                limiter = self._machine.limiter = min(1.0, self._machine.limiter / LIMITER_STEP)
                while True:
                    now = min(duration, done + limiter * step)
                    try:
                        at(now)
                    except TooFast:
                        if limiter < LEAST_LIMITER:
                            raise
                        limiter = self._machine.limiter = limiter * LIMITER_STEP
                    else:
                        return now

            elapsed = self._command(limited) or elapsed
            before = self._reference.q
            yield
        for _ in range(round(ARRIVAL_TIME / self._reference.period)):
            if max(abs(q - goal) for q, goal in zip(self._machine.arm.q, self._reference.q, strict=True)) < ARRIVED:
                break
            yield
        return True
