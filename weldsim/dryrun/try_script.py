"""A robot program tried: each motion as the controller would make it, in the branch the arm is in."""

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.path_faults import BACK, FASTEST, LEAST_BACK
from weldsim.dryrun.program import Motion, Program
from weldsim.dryrun.verdict import Trial, Verdict, Why
from weldsim.frames import Transform, rotation_vector_from_matrix, slerp, unit
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES, SPEED_LIMIT, inverse, torch_pose
from weldsim.motion.arm import dexterity
from weldsim.motion.collision import SHALLOW, Touch
from weldsim.motion.rungs import SINGULAR
from weldsim.motion.sweep import STEP_LENGTH, STEP_TURN, first_touch
from weldsim.mounts import X_FT

HOP = 0.35  # [rad] a joint that turns further within one step of a straight line has jumped
STALE = np.deg2rad(0.5)  # [rad] how far a servoj may begin from where the arm stands
SERVO_JUMP = 0.1  # [rad] between two servoj targets
TURNING = 1.05  # [rad/s] of the tool's rotation where a straight motion turns more than it travels


@dataclass(frozen=True, eq=False, kw_only=True)
class _Way:
    """A motion as sampled. Attributes: q (n, 6) [rad], as far as it goes; duration [s]; why and text of its failure; at, the index
    of the sample that fails."""

    q: Float[ndarray, "n 6"]
    duration: float
    why: Why = "ok"
    text: str = ""
    at: int = 0


def try_script(program: Program, cell: Cell) -> Trial:
    """A verdict for every motion of the program, the arm starting where the cell has it.

    What follows a failure is not reached; it is checked all the same, as if the arm had come to the target that failed, so that
    every failure is told. From a target that it does not reach nobody can say how it would go on: of the motion after it the
    target alone is checked, and the arm taken to stand there, as near to where it was last as it can.
    """
    q: Float[ndarray, "6"] = np.array(cell.q_start, float)
    verdicts: list[Verdict] = []
    t, rows, arc, clock = [np.zeros(1)], [q[None]], [np.zeros(1, bool)], 0.0
    q_worst, p_worst, length, gone, failed = None, None, 0.0, 0.0, False
    start = _bad_start(q, cell)
    labels, there = _labels(program), True
    for index, motion in enumerate(program.motions):
        verdict = Verdict(label=labels[index], index=index, s=gone, line=motion.line, command=motion.command)
        late = replace(verdict, why="not reached", text="the program has failed before")
        target = motion.q if motion.q is not None else _near(motion.X_BT, q)
        if index == 0 and start:
            verdicts.append(replace(verdict, why="stale start", text=f"{start}; say where it really stands (--start)"))
            q_worst, p_worst, failed = cell.q_start, torch_pose(cell.q_start).p, True
            there, q = target is not None, q if target is None else target
            continue
        fresh = index == 0 or program.motions[index - 1].command != "servoj"
        way = _way(motion, q, fresh, index == 0) if there else _target(motion, target, q)
        checked, q_at = _checked(verdict, way, cell, failed)
        verdicts.append(late if failed and checked.ok else checked)
        if there:
            tips = torch_pose(way.q).p
            gone += float(np.linalg.norm(np.diff(tips, axis=0), axis=1).sum())
            length = length if failed else gone
        if not checked.ok or not there:
            if not failed:
                q_worst = q_at
                p_worst = torch_pose(q_at).p if motion.X_BT is None or checked.why == "collision" else motion.X_BT.p
            failed = True
            there, q = target is not None, q if target is None else target
            continue
        if not failed:
            t.append(clock + np.linspace(0, way.duration, len(way.q))[1:])
            rows.append(way.q[1:])
            arc.append(np.full(len(way.q) - 1, motion.arc))
            clock += way.duration
        q = way.q[-1]
    all_q = np.concatenate(rows)
    return Trial(
        name=program.source,
        verdicts=tuple(verdicts),
        t=np.concatenate(t),
        q=all_q,
        arc_on=np.concatenate(arc),
        cycle=0.0 if failed else clock + program.pauses,
        q_worst=q_worst,
        p_worst=p_worst,
        points_B=torch_pose(all_q).p if len(all_q) > 1 else np.zeros((0, 3)),
        length=length,
        notes=_turning_back(program),
    )


def _turning_back(program: Program) -> tuple[str, ...]:
    """Where a process move (movep, or a straight one with the arc on) leads back over the one before it, one sentence each."""
    out = []
    legs = [(motion, _leg(before, motion)) for before, motion in pairwise(program.motions)]
    for (motion, there), (after, back) in pairwise(legs):
        process = all(each.command in ("movep", "movec") or each.arc for each in (motion, after))
        if there is None or back is None or not process:
            continue
        turn = np.arccos(np.clip(unit(there[-1] - there[-2]) @ unit(back[1] - back[0]), -1.0, 1.0))
        if min(np.linalg.norm(np.diff(leg, axis=0), axis=1).sum() for leg in (there, back)) > LEAST_BACK and turn > BACK:
            out.append(f"line {after.line} {after.command}: travel turns back by {np.rad2deg(turn):.0f} deg")
    return tuple(out)


def _leg(before: Motion, motion: Motion) -> Float[ndarray, "n 3"] | None:
    """Places of the torch along a straight motion or an arc [m]; None of another, and where the one before it was another."""
    if any(each.X_BT is None or each.command not in ("movel", "movep", "movec") for each in (before, motion)):
        return None
    return np.vstack([before.X_BT.p, motion.X_BT.p if motion.way is None else motion.way.p])  # type: ignore[union-attr]


def _bad_start(q: Float[ndarray, "6"], cell: Cell) -> str:
    """What is wrong with where the arm stands, or ""."""
    over = np.abs(q) > JOINT_LIMIT
    if over.any():
        return f"the arm is said to stand with {JOINT_NAMES[int(np.flatnonzero(over)[0])]} beyond +-360 deg"
    return f"where the arm stands {touch}" if (touch := cell.collision(q)) is not None else ""


def _labels(program: Program) -> list[str]:
    """What each motion is called; of a line that moves several times also which of its motions it is."""
    names = [f"line {motion.line} {motion.command}" for motion in program.motions]
    count, seen, out = Counter(names), Counter[str](), []
    for name in names:
        seen[name] += 1
        out.append(name if count[name] == 1 else f"{name} ({seen[name]} of {count[name]})")
    return out


def _target(motion: Motion, target: Float[ndarray, "6"] | None, q: Float[ndarray, "6"]) -> _Way:
    """A motion from nobody knows where: its target and speed alone. Args: q, where the arm was last [rad]."""
    if target is None:
        return _Way(q=q[None], duration=0.0, why="unreachable", text=_unreached(motion))
    if np.abs(target).max() > JOINT_LIMIT:
        return _beyond(target[None], target, 0.0)
    text = "" if motion.t or motion.command == "servoj" else _too_fast(motion.speed, motion)
    return _Way(q=target[None], duration=0.0, why="speed" if text else "ok", text=text)


def _too_fast(speed: float, motion: Motion) -> str:
    """What is wrong with a speed, of the leading joint in a movej [rad/s], else of the tip [m/s]; "" where nothing is."""
    if motion.command == "movej":
        fast = speed > SPEED_LIMIT + 1e-6
        return f"{np.rad2deg(speed):.0f} deg/s asked for (limit {np.rad2deg(SPEED_LIMIT):.0f} deg/s)" if fast else ""
    fast = motion.arc and speed > FASTEST
    return f"{1e3 * speed:.0f} mm/s with the arc on (limit {1e3 * FASTEST:.0f} mm/s)" if fast else ""


def _checked(verdict: Verdict, way: _Way, cell: Cell, failed: bool) -> tuple[Verdict, Float[ndarray, "6"]]:
    """The verdict of a motion, and how the arm stands where it fails, or in the end [rad].

    Args:
        failed: whether a motion before it has: then what the arm touches from the beginning of its way on is no fault of this one,
            unless it ends there.
    """
    at = min(way.at, len(way.q) - 1)
    first = _first_clear(way.q, cell) if failed else 0
    found = first_touch(way.q[first:], cell.collision)
    carried_on = failed and first == len(way.q) - 1
    if found is None or (carried_on and way.why != "ok"):
        return replace(verdict, why=way.why, text=way.text), way.q[at]
    hit_at = found[0] + first
    near = min(int(np.ceil(hit_at)), len(way.q) - 1)
    q_hit = way.q[near - 1] + (hit_at - near + 1) * (way.q[near] - way.q[near - 1]) if near else way.q[0]
    hit = cell.collision.touch(q_hit)
    first_name, second, depth = ("", "", 0.0) if hit is None else (hit.first, hit.second, _deepest(way.q[near:], hit, cell))
    text = str(found[1] if hit is None else replace(hit, depth=depth))
    if depth - (0.0 if hit is None else hit.depth) >= SHALLOW:
        text = text.replace("(", "(up to ", 1)
    if carried_on and len(way.q) > 1:
        text += ", all the way"
    elif len(way.q) > 1:
        text += f", first at {100 * hit_at / (len(way.q) - 1):.0f} % of the way"
    if way.why != "ok" and hit_at > way.at:
        return replace(verdict, why=way.why, text=f"{way.text}; and {text}"), way.q[at]
    text += f"; and {way.text}" if way.text else ""
    return replace(verdict, why="collision", text=text, first=first_name, second=second, depth=depth), q_hit


def _first_clear(q: Float[ndarray, "n 6"], cell: Cell) -> int:
    """Index of the first posture that touches nothing; of the last where none is clear."""
    return next((i for i, posture in enumerate(q) if cell.collision.touch(posture) is None), len(q) - 1)


def _deepest(q: Float[ndarray, "n 6"], hit: Touch, cell: Cell) -> float:
    """How deep the two bodies of a contact get at these postures [m], at least as deep as in it."""
    touches = (cell.collision.touch(posture) for posture in q)
    same = (touch.depth for touch in touches if touch is not None and (touch.first, touch.second) == (hit.first, hit.second))
    return max([hit.depth, *same])


def _way(motion: Motion, q: Float[ndarray, "6"], fresh: bool, first: bool) -> _Way:
    """The motion from q; `fresh` where no servoj came before it, `first` where nothing did."""
    if motion.command == "servoj":
        return _servo(motion, q, fresh, first)
    if motion.command == "movej":
        return _joint_move(motion, q)
    return _straight(motion, q)


def _servo(motion: Motion, q: Float[ndarray, "6"], fresh: bool, first: bool) -> _Way:
    target = motion.q if motion.q is not None else _near(motion.X_BT, q)
    if target is None:
        return _Way(q=q[None], duration=0.0, why="unreachable", text=_unreached(motion))
    step = np.abs(target - q)
    joint = int(step.argmax())
    way = np.linspace(q, target, max(2, int(step.max() / STEP_TURN) + 2))
    name, turn = JOINT_NAMES[joint], np.rad2deg(step[joint])
    if np.abs(target).max() > JOINT_LIMIT:
        return _beyond(way, target, motion.t)
    if fresh and step[joint] > STALE:
        standing = ", or say where it really stands (--start)" if first else ""
        text = f"servoj begins {turn:.1f} deg of {name} away from where the arm stands (limit {np.rad2deg(STALE):.1f} deg)"
        return _Way(q=way, duration=motion.t, why="stale start", text=f"{text}; movej there first{standing}", at=len(way) - 1)
    if step[joint] > SERVO_JUMP:
        text = f"{name} jumps {turn:.1f} deg to this target (limit {np.rad2deg(SERVO_JUMP):.1f} deg)"
        return _Way(q=way, duration=motion.t, why="joint jump", text=text, at=len(way) - 1)
    if step[joint] / motion.t > SPEED_LIMIT:
        text = f"{name} would need {np.rad2deg(step[joint] / motion.t):.0f} deg/s (limit {np.rad2deg(SPEED_LIMIT):.0f} deg/s)"
        return _Way(q=way, duration=motion.t, why="speed", text=text, at=len(way) - 1)
    return _Way(q=way, duration=motion.t)


def _joint_move(motion: Motion, q: Float[ndarray, "6"]) -> _Way:
    target = motion.q if motion.q is not None else _near(motion.X_BT, q)
    if target is None:
        return _Way(q=q[None], duration=0.0, why="unreachable", text=_unreached(motion))
    turn = float(np.abs(target - q).max())
    way = np.linspace(q, target, max(2, int(turn / STEP_TURN) + 2))
    duration = motion.t or _trapezoid(turn, motion.speed, motion.acceleration)
    if np.abs(target).max() > JOINT_LIMIT:
        return _beyond(way, target, duration)
    fastest = turn / duration if motion.t else motion.speed
    if turn > 1e-6 and (text := _too_fast(fastest, motion)):
        return _Way(q=way, duration=duration, why="speed", text=text)
    return _Way(q=way, duration=duration)


def _straight(motion: Motion, q: Float[ndarray, "6"]) -> _Way:
    """movel, movep: the tip on a straight line, the orientation turning evenly; movec: on its arc; in the branch the arm is in."""
    X_BT, length, turn = _line(motion, torch_pose(q)) if motion.way is None else _arc(motion.way, torch_pose(q))
    n = len(X_BT.p) - 1
    u = np.linspace(0.0, 1.0, n + 1)
    fastest = motion.speed if not motion.t else length / motion.t
    duration = motion.t or max(
        _trapezoid(length, motion.speed, motion.acceleration),
        _trapezoid(turn, TURNING, 4 * TURNING) if turn > length / 0.1 else 0.0,
    )
    way = [q]
    for i in range(1, n + 1):
        done = f"{1e3 * u[i] * length:.1f} of {1e3 * length:.1f} mm"
        found = _near(X_BT[i], way[-1])
        if found is None:
            return _Way(
                q=np.array(way), duration=0.0, why="unreachable", text=f"{_unreached(motion, X_BT.p[i])}, after {done}", at=i
            )
        step = np.abs(found - way[-1])
        joint = int(step.argmax())
        if step[joint] > HOP:
            singular = float(dexterity(found[None])[0]) < 2 * SINGULAR or float(dexterity(way[-1][None])[0]) < 2 * SINGULAR
            text = f"{JOINT_NAMES[joint]} would turn {np.rad2deg(step[joint]):.0f} deg at once after {done}"
            why: Why = "singular" if singular else "joint jump"
            return _Way(q=np.array(way), duration=0.0, why=why, text=text, at=i)
        if np.abs(found).max() > JOINT_LIMIT:
            return replace(_beyond(np.array(way), found, 0.0), at=i)
        way.append(found)
    out = _Way(q=np.array(way), duration=duration)
    if text := _too_fast(fastest, motion):
        return replace(out, why="speed", text=text)
    rates = np.abs(np.diff(out.q, axis=0)) * n / max(duration, 1e-9)
    if length > 1e-6 and not motion.t:
        rates = np.abs(np.diff(out.q, axis=0)) * n / max(length, 1e-9) * min(motion.speed, np.sqrt(motion.acceleration * length))
    i, joint = (int(k) for k in np.unravel_index(rates.argmax(), rates.shape))
    if rates[i, joint] > SPEED_LIMIT:
        text = (
            f"{JOINT_NAMES[joint]} would need {np.rad2deg(rates[i, joint]):.0f} deg/s (limit {np.rad2deg(SPEED_LIMIT):.0f} deg/s)"
        )
        near = float(dexterity(out.q[i][None])[0]) < 3 * SINGULAR
        return replace(out, why="singular" if near else "speed", text=text, at=i)
    return out


def _line(motion: Motion, begin: Transform) -> tuple[Transform, float, float]:
    """Poses on the straight way from one to the motion's target, the length of it [m], and by how much the torch turns [rad]."""
    end = motion.X_BT if motion.X_BT is not None else torch_pose(motion.q)  # type: ignore[arg-type]
    length = float(np.linalg.norm(end.p - begin.p))
    turn = float(np.linalg.norm(rotation_vector_from_matrix(begin.R.T @ end.R)))
    n = max(1, int(np.ceil(max(length / STEP_LENGTH, turn / STEP_TURN))))
    u = np.linspace(0.0, 1.0, n + 1)
    R = slerp(np.tile(begin.quaternion, (n + 1, 1)), np.tile(end.quaternion, (n + 1, 1)), u)
    return Transform.from_quaternion("BT", R, begin.p + u[:, None] * (end.p - begin.p)), length, turn


def _arc(way: Transform, begin: Transform) -> tuple[Transform, float, float]:
    """The same for a way that is given, from where the torch is."""
    X_BT = Transform("BT", np.concatenate([begin.R[None], way.R]), np.vstack([begin.p, way.p]))
    turns = rotation_vector_from_matrix(np.swapaxes(X_BT.R[:-1], -1, -2) @ X_BT.R[1:])
    return X_BT, float(np.linalg.norm(np.diff(X_BT.p, axis=0), axis=1).sum()), float(np.linalg.norm(turns, axis=1).sum())


def _near(X_BT: Transform | None, q: Float[ndarray, "6"]) -> Float[ndarray, "6"] | None:
    """The joint solution of a torch pose nearest to q, whole turns chosen freely; None where there is none."""
    if X_BT is None:
        return None
    solutions = inverse(X_BT @ X_FT.inverse())
    if len(solutions) == 0:
        return None
    solutions = solutions + 2 * np.pi * np.round((q - solutions) / (2 * np.pi))
    return solutions[np.abs(solutions - q).max(axis=1).argmin()]


def _beyond(way: Float[ndarray, "n 6"], target: Float[ndarray, "6"], duration: float) -> _Way:
    joint = int(np.abs(target).argmax())
    text = f"{JOINT_NAMES[joint]} would have to go to {np.rad2deg(target[joint]):.0f} deg (limit +-360 deg)"
    return _Way(q=way, duration=duration, why="joint limit", text=text, at=len(way) - 1)


def _unreached(motion: Motion, p: Float[ndarray, "3"] | None = None) -> str:
    p = p if p is not None else (motion.X_BT.p if motion.X_BT is not None else np.full(3, np.nan))
    x, y, z = np.round(p, 3) + 0.0
    return f"no joint solution for the torch at ({x:.3f}, {y:.3f}, {z:.3f}) m in base"


def _trapezoid(distance: float, speed: float, acceleration: float) -> float:
    """Time [s] from rest to rest over a distance."""
    if distance <= speed**2 / acceleration:
        return 2 * float(np.sqrt(max(distance, 0.0) / acceleration))
    return distance / speed + speed / acceleration
