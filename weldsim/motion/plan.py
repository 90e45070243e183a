"""Torch path to joint trajectory: choose how to hold the arm, follow the path, time it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.errors import MotionError
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES
from weldsim.motion.air import air_moves
from weldsim.motion.arm import clearances, dexterity, kinematic_model
from weldsim.motion.config import MotionConfig
from weldsim.motion.cut import cut_path
from weldsim.motion.follow import JointPath, LostPathError, check_clear, first_contact, follow
from weldsim.motion.ladder import Hold, climb, near
from weldsim.motion.rail import Rail, make_rail
from weldsim.motion.refuse import refused, unreachable
from weldsim.motion.rungs import Rungs, make_rungs
from weldsim.motion.sweep import Blocked
from weldsim.motion.timing import Move, piece_move
from weldsim.records import JointTrajectory, Segment, TorchPath

LONG_RAMP = 0.002  # [m] a ramp worth a note
LOST = {  # why a path cannot be followed, by the reason told: all else is something touched
    "branch flip": "joint jump",
    "joint limit": "joint limit",
    "rough path": "orientation jump",
    "out of reach": "unreachable",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionPlan:
    """A joint trajectory and what is worth knowing about it.

    Attributes:
        trajectory: from the start configuration through the weld; `s` has the path's own zero (negative on the lead-in).
        rail: the tip's line, leads included; `rail.at(s)` is the pose asked for at arc length s.
        position_error, axis_error: greatest distance [m] and angle [rad] of the joint path from the rail.
        slowest: least ratio of planned to asked welding speed; below 1 a joint limit made the weld slower.
        slowest_at: arc length where [m].
        ramp: length at the ends of the weld in which the torch speeds up and slows down [m].
        dexterity, clearance: least on the way [m/rad], [m].  roll: rotation about the wire at the start [rad].
        cuts: where the weld is interrupted because no single sweep of the arm covers it [m]; the leads there are not on `rail`.
        notes: one sentence each, for people.
    """

    trajectory: JointTrajectory
    rail: Rail
    position_error: float
    axis_error: float
    slowest: float
    slowest_at: float
    ramp: float
    dexterity: float
    clearance: float
    roll: float
    cuts: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()


def plan_motion(
    path: TorchPath,
    q_start: Float[ndarray, "6"],
    config: MotionConfig | None = None,
    arm: Arm = UR5,
    blocked: Blocked | None = None,
    rungs: Rungs | None = None,
    home: Float[ndarray, "6"] | None = None,
) -> MotionPlan:
    """The joint trajectory that welds the path: air move, lead-in, weld at the path's speed, lead-out, air move home.

    Where no single sweep of the arm covers the weld it is cut at the best places, into `config.pieces` at most; the arm goes from
    one piece to the next through the air.

    Args:
        path: torch poses; leads are added along the wire where it has none.
        q_start: joint angles at t = 0 [rad].
        arm: that welds, with its torch: the joint angles are its own, `blocked` takes them.
        rungs: of the path's own rail with the same settings, where they have been made already.
        home: where the arm goes in the end, where `config.return_home` has it go [rad]; q_start by default.
        blocked: names what a configuration touches, or None (`CellCollision`); nothing planned then touches anything, as
            far as samples of the motion show. Without it only the arm's centre lines are kept clear of table and torch.
    Raises:
        UnreachableError: a pose no posture reaches; `data`: index, s, position, distance, reach.
        MotionError: reachable pose by pose, but in no single sweep of the arm; `data`: index, s, reason.
    """
    config = config or MotionConfig()
    home = q_start if home is None else home
    inside = np.abs(q_start) <= JOINT_LIMIT
    if not inside.all():
        joint = int(np.flatnonzero(~inside)[0])
        raise MotionError(f"start: {JOINT_NAMES[joint]} at {np.rad2deg(q_start[joint]):.0f} deg (limit +-360 deg)", joint=joint)
    try:
        return _in_one(path, q_start, home if config.return_home else None, config, arm, blocked, rungs)
    except MotionError as error:
        split = error.data.get("split")
        if not isinstance(split, tuple) or not split:
            raise
        pieces = f"in {len(split) + 1} pieces, cut at s = {', '.join(f'{1e3 * s:.0f}' for s in split)} mm"
        if len(split) >= config.pieces:
            raise MotionError(f"{error}; weld it {pieces} (motion.pieces = {len(split) + 1})", **error.data) from None
        try:
            return _in_pieces(path, split, q_start, home, config, arm, blocked)
        except MotionError as second:
            why = f"{second.data.get('reason', second)} at s = {1e3 * float(str(second.data.get('s', 0.0))):.1f} mm"
            raise MotionError(f"{error}; nor does it go {pieces}: {why}", **{**error.data, "split": ()}) from None


def _in_pieces(
    path: TorchPath,
    split: tuple[float, ...],
    q_start: Float[ndarray, "6"],
    q_home: Float[ndarray, "6"],
    config: MotionConfig,
    arm: Arm,
    blocked: Blocked | None,
) -> MotionPlan:
    """The plan of a path cut at arc lengths `split` [m], one piece after the other."""
    plans, q, pieces = [], q_start, cut_path(path, split)
    for piece in pieces:
        home = q_home if config.return_home and piece is pieces[-1] else None
        plans.append(_in_one(piece, q, home, config, arm, blocked))
        q = plans[-1].trajectory.q[-1]
    slowest = min(plans, key=lambda plan: plan.slowest)
    where = ", ".join(f"{1e3 * s:.0f}" for s in split)
    note = f"no single sweep of the arm covers the weld: it is cut into {len(plans)} pieces, at s = {where} mm; the arc stops there"
    return MotionPlan(
        trajectory=_joined([plan.trajectory for plan in plans], config.period),
        rail=make_rail(path, config),
        position_error=max(plan.position_error for plan in plans),
        axis_error=max(plan.axis_error for plan in plans),
        slowest=slowest.slowest,
        slowest_at=slowest.slowest_at,
        ramp=max(plan.ramp for plan in plans),
        dexterity=min(plan.dexterity for plan in plans),
        clearance=min(plan.clearance for plan in plans),
        roll=plans[0].roll,
        cuts=split,
        notes=(note, *dict.fromkeys(text for plan in plans for text in plan.notes)),
    )


def _in_one(
    path: TorchPath,
    q_start: Float[ndarray, "6"],
    q_home: Float[ndarray, "6"] | None,
    config: MotionConfig,
    arm: Arm,
    blocked: Blocked | None,
    rungs: Rungs | None = None,
) -> MotionPlan:
    """The plan of a path in a single sweep, from q_start and in the end to q_home, where that is given."""
    rail = make_rail(path, config)
    if blocked is not None and (touch := blocked(q_start)) is not None:
        raise MotionError(f"start: {touch}; drive the arm clear before planning", reason=touch, why="stale start")

    def timed(paths: list[JointPath]) -> list[Move]:
        return _moves(rail, paths, q_start, q_home, arm, config, blocked)

    hold, paths, moves = first_that_holds(rail, q_start, arm, config, blocked, rungs, timed)
    q = np.concatenate([path.spline(path.spline.x) for path in paths])
    clearance = float(clearances(q, config.floor, arm.X_FT).min())
    weld = next(move for move in moves if move.segment == Segment.WELD)
    slowest, notes = weld.slowest, []
    if slowest < 0.999:
        notes.append(f"joint limits slow the weld to {100 * slowest:.0f} % of the asked speed at the slowest place")
    if weld.ramp > LONG_RAMP:
        notes.append(
            f"the first and last {1e3 * weld.ramp:.1f} mm of the weld are below the asked speed; a longer run-in would help"
        )
    if clearance < config.clearance:
        notes.append(f"the arm passes {1e3 * clearance:.0f} mm from the table or itself (asked {1e3 * config.clearance:.0f} mm)")
    return MotionPlan(
        trajectory=_join(moves, path, rail, config),
        rail=rail,
        position_error=max(piece.position_error for piece in paths),
        axis_error=max(piece.axis_error for piece in paths),
        slowest=slowest,
        slowest_at=weld.slowest_at,
        ramp=weld.ramp,
        dexterity=float(dexterity(q, arm.X_FT).min()),
        clearance=clearance,
        roll=float(hold.roll[0]),
        notes=tuple(notes),
    )


def first_that_holds(
    rail: Rail,
    q_start: Float[ndarray, "6"],
    arm: Arm,
    config: MotionConfig,
    blocked: Blocked | None,
    rungs: Rungs | None = None,
    timed: Callable[[list[JointPath]], list[Move]] = lambda paths: [],
) -> tuple[Hold, list[JointPath], list[Move]]:
    """The best way to hold the arm that can be followed all along, with its joint paths and what `timed` makes of them.

    Where a climb is lost between its rungs, the nodes about that place are given up and the next best one is tried.

    Args:
        q_start: near which the arm is best held [rad].  rungs: of the rail, where they have been made already.
        timed: raises LostPathError where the joint paths will not do, as where the air is barred.
    Raises:
        MotionError: none is found; `data`: index, s, reason, why; until, where what is touched on the way is left again [m].
    """
    rungs, model = rungs or make_rungs(rail, arm, config, blocked), kinematic_model(arm)
    banned = np.zeros(rungs.cost.shape, bool)
    lost: list[LostPathError] = []
    for attempt in range(config.candidates):
        hold = climb(rungs, q_start, arm, config, blocked, banned)
        if hold is None:
            break
        try:
            paths = follow(rail, hold.q[0], hold.rest, model, arm, config)
            if blocked is not None:
                check_clear(paths, blocked)
            return hold, paths, timed(paths)
        except LostPathError as error:
            s = float(str(error.data["s"]))
            # A path that is lost on the way has not been checked up to there: what it touches before counts as its end.
            met = None
            if blocked is not None and error.data["reason"] in LOST:
                met = first_contact(hold.rest, float(hold.s[0]), s, blocked)
            lost.append(met or error)
            banned |= near(rungs, hold, s, reach=1 + attempt)
    if not lost:
        raise refused(rail, rungs, arm, config, blocked)
    furthest = max(lost, key=lambda error: float(str(error.data["s"])))
    s, reason = float(str(furthest.data["s"])), str(furthest.data["reason"])
    if reason == "out of reach":
        raise unreachable(rail, s, "the arm cannot follow the path to here in any posture") from furthest
    index = rail.path_index(s)
    why = LOST.get(reason, "collision")
    raise MotionError(
        f"path pose {index}: no posture gets further than {furthest}",
        index=index,
        s=s,
        reason=reason,
        why=why,
        q=furthest.data.get("q", ()),
        until=furthest.data.get("until", s),
    ) from furthest


def _moves(
    rail: Rail,
    paths: list[JointPath],
    q_start: Float[ndarray, "6"],
    q_home: Float[ndarray, "6"] | None,
    arm: Arm,
    config: MotionConfig,
    blocked: Blocked | None,
) -> list[Move]:
    """Air, lead-in, weld, lead-out, air."""
    moves = [piece_move(rail, piece, config) for piece in paths]
    first, last = moves[0], moves[-1]
    there = air_moves(q_start, first.q[0], float(first.s[0]), arm, config, blocked)
    home = [] if q_home is None else air_moves(q_home, last.q[-1], float(last.s[-1]), arm, config, blocked, back=True)
    return [*there, *moves, *home]


def _join(moves: list[Move], path: TorchPath, rail: Rail, config: MotionConfig) -> JointTrajectory:
    """The moves one after the other; each starts from the rest in which the last one ended."""
    keep = [slice(0, None)] + [slice(1, None)] * (len(moves) - 1)
    q, qd, qdd, s = (
        np.concatenate([getattr(m, name)[k] for m, k in zip(moves, keep, strict=True)]) for name in ("q", "qd", "qdd", "s")
    )
    segments = [m.segment for m, k in zip(moves, keep, strict=True) for _ in range(len(m.s[k]))]
    burning = path.arc_on[path.weld]
    nearest = np.searchsorted(path.s[path.weld], s, side="right") - 1
    arc = np.array([segment == Segment.WELD for segment in segments]) & burning[np.clip(nearest, 0, len(burning) - 1)]
    return JointTrajectory(
        t=config.period * np.arange(len(s)),
        q=q,
        qd=qd,
        qdd=qdd,
        s=s,
        arc_on=arc,
        segments=tuple(segments),
        joint_names=JOINT_NAMES,
    )


def _joined(trajectories: list[JointTrajectory], period: float) -> JointTrajectory:
    """One after the other; each starts at rest where the last one ended."""
    keep = [slice(0, None)] + [slice(1, None)] * (len(trajectories) - 1)
    pairs = list(zip(trajectories, keep, strict=True))
    q, qd, qdd, s, arc = (
        np.concatenate([getattr(one, name)[mine] for one, mine in pairs]) for name in ("q", "qd", "qdd", "s", "arc_on")
    )
    return JointTrajectory(
        t=period * np.arange(len(s)),
        q=q,
        qd=qd,
        qdd=qdd,
        s=s,
        arc_on=arc,
        segments=tuple(segment for one, mine in pairs for segment in one.segments[mine]),
        joint_names=JOINT_NAMES,
    )
