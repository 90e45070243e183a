"""The joint path along a rail by differential kinematics (mink): tip and wire axis held, rotation about the wire free."""

from collections.abc import Callable
from dataclasses import dataclass

import mink
import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import CubicSpline

from weldsim.arm import Arm
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.motion.arm import TORCH_SITE
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import Rail
from weldsim.motion.sweep import STEP_LENGTH, Blocked, first_touch, posture_at
from weldsim.records import Segment

POSITION_COST, AXIS_COST, POSTURE_COST = 10.0, 3.0, 1e-3  # [1/m], [1/rad], [1/rad]: posture bends the tip by under 1 um
DAMPING = 1e-10
ITERATIONS = 40
SETTLED = 1e-7  # [rad] a smaller step ends the iteration
HALVINGS = 5

Rest = Float[ndarray, "6"] | Callable[[float], Float[ndarray, "6"]]


class LostPathError(MotionError):
    """The arm could not follow the rail in this posture. `data`: s, reason. Another posture may do."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JointPath:
    """Joint angles as a function of arc length, over one piece of a rail.

    Attributes:
        segment: which piece of the rail.
        spline: q(s), twice continuously differentiable.
        position_error, axis_error: greatest distance [m] and angle [rad] from the rail, between and at the solved poses.
        solved: how many poses were solved.
    """

    segment: Segment
    spline: CubicSpline
    position_error: float
    axis_error: float
    solved: int


class _Solver:
    """mink's tasks for one posture; `at` solves one pose from the last solution."""

    def __init__(self, model: mujoco.MjModel, posture: Rest, roll_free: bool, config: MotionConfig) -> None:
        self.configuration = mink.Configuration(model)
        self.config = config
        self.tip = mink.FrameTask(TORCH_SITE, "site", position_cost=POSITION_COST, orientation_cost=0.0 if roll_free else AXIS_COST)
        self.axis = mink.AxisAlignTask(TORCH_SITE, "site", axis=(0.0, 0.0, 1.0), cost=AXIS_COST)
        self.rest, self.posture = mink.PostureTask(model, cost=POSTURE_COST), posture
        # A pull towards one posture makes the free rotation a smooth function of the pose, not of the way there.
        self.tasks = [self.tip, self.axis, self.rest]
        limit = mink.ConfigurationLimit(model, min_distance_from_limits=config.limit_margin)
        self.limits = [limit]

    def at(self, X_BT: Transform, q: Float[ndarray, "6"], s: float) -> Float[ndarray, "6"]:
        """Joint angles for one pose, starting from q.

        Raises:
            LostPathError: no convergence within the tolerances.
        """
        self.configuration.update(q)
        self.tip.set_target(mink.SE3.from_matrix(X_BT.matrix))
        self.axis.set_target(X_BT.R[:, 2])
        self.rest.set_target(self.posture(s) if callable(self.posture) else self.posture)
        for _ in range(ITERATIONS):
            try:
                step = mink.solve_ik(
                    self.configuration, self.tasks, 1.0, "daqp", damping=DAMPING, safety_break=True, limits=self.limits
                )
            except (mink.NotWithinConfigurationLimits, mink.NoSolutionFound) as error:
                raise LostPathError(f"s = {1e3 * s:.1f} mm: {error}", s=s, reason="joint limit") from error
            # Far from a solution a full step overshoots; near it (the usual case) this never bites.
            self.configuration.integrate_inplace(step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12)), 1.0)
            if np.abs(step).max() < SETTLED:
                break
        reached = self.configuration.get_transform_frame_to_world(TORCH_SITE, "site")
        distance = float(np.linalg.norm(reached.translation() - X_BT.p))
        angle = float(_angle(reached.rotation().as_matrix()[None, :, 2], X_BT.R[None, :, 2])[0])
        if distance > self.config.position_tolerance or angle > self.config.axis_tolerance:
            raise LostPathError(
                f"s = {1e3 * s:.1f} mm: stays {1e3 * distance:.3g} mm and {np.rad2deg(angle):.3g} deg off",
                s=s,
                reason="out of reach",
            )
        return self.configuration.q.copy()


def _angle(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
    """Angle between directions [rad], exact for small ones."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def follow(
    rail: Rail,
    q_first: Float[ndarray, "6"],
    posture: Rest,
    model: mujoco.MjModel,
    arm: Arm,
    config: MotionConfig,
) -> list[JointPath]:
    """One joint path per piece of the rail, each keeping the tip on it and the wire along its z.

    Args:
        q_first: where the iteration starts, near a solution of the first pose [rad].
        posture: what the free rotation about the wire is drawn to [rad], everywhere or as a function of arc length.
        model: `kinematic_model` of the arm.  arm: that follows.
    Raises:
        LostPathError: no solution in this posture, a branch flip, or a spline that will not settle.
    """
    solver = _Solver(model, posture, rail.roll_free, config)
    paths, q = [], q_first
    for piece in rail.pieces():
        paths.append(_follow_piece(solver, rail, piece, q, arm))
        q = paths[-1].spline(piece[2])
    return paths


def _follow_piece(
    solver: _Solver, rail: Rail, piece: tuple[Segment, float, float], q_first: Float[ndarray, "6"], arm: Arm
) -> JointPath:
    """Poses solved every `config.grid` and joined by a cubic spline; the grid is halved where the spline's tip strays."""
    config, (segment, start, end) = solver.config, piece
    s = np.linspace(start, end, max(3, int(np.ceil((end - start) / config.grid)) + 1))
    X_BT = rail.at(s)
    q = np.empty((len(s), 6))
    for i in range(len(s)):
        q[i] = solver.at(X_BT[i], q[i - 1] if i else q_first, float(s[i]))
    halvings = 0
    while True:
        _refuse_flips(s, q, config)
        spline = CubicSpline(s, q)
        coarse, distance, angle = _strayed(rail, spline, s, arm, config)
        if len(coarse) == 0:
            return JointPath(segment=segment, spline=spline, position_error=distance, axis_error=angle, solved=len(s))
        middle = (s[coarse] + s[coarse + 1]) / 2
        if (halvings := halvings + 1) > HALVINGS:
            raise LostPathError(
                f"s = {1e3 * middle[0]:.1f} mm: the joint spline stays {1e3 * distance:.3f} mm and {np.rad2deg(angle):.3f} deg"
                f" off the path (limits {1e3 * config.spline_tolerance:.3f} mm, {np.rad2deg(config.axis_tolerance):.3f} deg);"
                " smooth the path",
                s=float(middle[0]),
                reason="rough path",
            )
        X_BT = rail.at(middle)
        extra = np.stack([solver.at(X_BT[k], spline(middle[k]), float(middle[k])) for k in range(len(middle))])
        order = np.argsort(np.concatenate([s, middle]))
        s, q = np.concatenate([s, middle])[order], np.concatenate([q, extra])[order]


def check_clear(paths: list[JointPath], blocked: Blocked) -> None:
    """Raises LostPathError at the first configuration of the swept motion that touches something; `data` as of `first_contact`."""
    for path in paths:
        found = first_contact(path.spline, float(path.spline.x[0]), float(path.spline.x[-1]), blocked)
        if found is not None:
            raise found


def first_contact(q_of_s: CubicSpline, start: float, end: float, blocked: Blocked) -> LostPathError | None:
    """The first configuration from arc length `start` to `end` [m] that touches something, as an error; None where none does.

    `data`: s; reason; q [rad]; until, the arc length of the last sample in a row that touches something [m].
    """
    s = np.linspace(start, end, max(2, int(np.ceil((end - start) / STEP_LENGTH)) + 1))
    q = q_of_s(s)
    found = first_touch(q, blocked)
    if found is None:
        return None
    at = until = float(np.interp(found[0], np.arange(len(s)), s))
    for k in range(int(found[0]) + 1, len(s)):
        if blocked(q[k]) is None:
            break
        until = float(s[k])
    text = f"s = {1e3 * at:.1f} mm: {found[1]}"
    return LostPathError(text, s=at, reason=found[1], q=tuple(posture_at(q, found[0])), until=until)


def _strayed(
    rail: Rail, spline: CubicSpline, s: Float[ndarray, "n"], arm: Arm, config: MotionConfig
) -> tuple[ndarray, float, float]:
    """Indices of the grid intervals in which the spline's tip leaves the rail, with the greatest distance and angle."""
    between = (s[:-1, None] + np.diff(s)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
    reached, asked = arm.torch_pose(spline(between)), rail.at(between)
    distance = np.linalg.norm(reached.p - asked.p, axis=1).reshape(-1, 3).max(axis=1)
    angle = _angle(reached.R[..., 2], asked.R[..., 2]).reshape(-1, 3).max(axis=1)
    coarse = np.flatnonzero((distance > config.spline_tolerance) | (angle > config.axis_tolerance))
    return coarse, float(distance.max()), float(angle.max())


def _refuse_flips(s: Float[ndarray, "n"], q: Float[ndarray, "n 6"], config: MotionConfig) -> None:
    rate = np.abs(np.diff(q, axis=0)).max(axis=1) / np.diff(s)
    if rate.max() > config.joint_rate:
        i = int(rate.argmax())
        joint = int(np.abs(q[i + 1] - q[i]).argmax())
        raise LostPathError(
            f"s = {1e3 * s[i]:.1f} mm: joint {joint + 1} turns {np.rad2deg(rate[i]) / 1e3:.2f} deg/mm"
            f" (limit {np.rad2deg(config.joint_rate) / 1e3:.2f} deg/mm), near a singularity or a branch flip",
            s=float(s[i]),
            joint=joint,
            reason="branch flip",
        )
