"""The nearest change after which a job passes: tried on a coarse look first, then applied and the whole job checked again."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell, shifted
from weldsim.dryrun.path_faults import FASTEST
from weldsim.dryrun.program import Given, Program
from weldsim.dryrun.sieve import quick
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.try_script import try_script
from weldsim.dryrun.verdict import Fix, Trial
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.kinematics import inverse
from weldsim.motion.config import MotionConfig
from weldsim.motion.cut import cut_path
from weldsim.motion.rungs import turned
from weldsim.mounts import X_FT
from weldsim.records import Segment, TorchPath
from weldsim.scene.cell import TABLE

TURNS = np.deg2rad([s * a for a in (5, 10, 15, 20, 30, 40, 50, 60, 75, 90, 105, 120, 135, 150, 165, 180) for s in (1, -1)])
AS_READ = Given()
LEAN_MOST = np.deg2rad(60.0)  # that `--lean` takes
LEANS = np.deg2rad([5.0, 10.0, 15.0, 20.0, 30.0])
LEADS = (0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.10, 0.15)  # [m] tried for lead-in and lead-out
LOOSE = re.compile(r"clamp_(bolt_)?\d+")  # names of what can be taken away begin so
DISTANCES = (0.01, 0.02, 0.03, 0.05, 0.075, 0.10, 0.15, 0.20, 0.25, 0.30, 0.40, 0.50)  # [m] the part is moved by, tried in order
HEADINGS = 12  # directions on the table
CLOSE = 0.005  # [m] to which the nearest place that does is found
FULL_TRIES = 4  # whole checks of changes that passed the coarse look
WORK = 2.0  # [m] of path in all the whole checks of one kind of change: long paths have fewer
CANDIDATES = 3  # ways to hold the arm in such a check: what passes with the best of them passes
FARTHER = 0.02  # [m] by which a part is moved further than the coarse look asks for, where that does not do
MOVE_TRIES = 6  # whole checks of places
OUTWARDS, FURTHER_OUT = 1.5, 0.04  # by so much, and at least by so much [m], further away is the next, where one fails
FEW = 20  # motions of a program that are quickly tried

Progress = Callable[[float], None]


def fixes_for_path(
    path: TorchPath,
    trial: Trial,
    cell: Cell,
    config: MotionConfig,
    tell: Progress = lambda done: None,
    *,
    given: Given = AS_READ,
) -> tuple[Fix, ...]:
    """What would help a path that failed: a slower weld, a turn about the wire, a place for the part, cuts; all verified.

    Args:
        given: what the path was turned and leaned by already: an option tells both together.
    """
    failure = trial.failure
    if failure is None or failure.why in ("orientation jump", "turns back"):
        return ()
    if failure.why == "stale start":
        config = replace(config, candidates=min(config.candidates, CANDIDATES))
        return tuple(_move(path, trial, cell, config, tell)) if failure.first and cell.has_part else ()
    if failure.why == "speed":
        return _slower(path, trial, cell, config)
    config = replace(config, candidates=min(config.candidates, CANDIDATES))
    found = _lead(path, trial, cell, config) if trial.lead else []
    if not path.roll_free:
        found += _turn(path, trial, cell, config, given)
    if failure.why == "collision":
        found += _taken_away(path, trial, cell, config)
    found += _lean(path, trial, cell, config, given)
    # A part that is moved takes with it what stands in the way.
    if failure.why != "collision" or not found:
        found += _move(path, trial, cell, config, tell)
    found += _cut(path, trial, cell, config)
    return tuple(found)


def applied(
    fix: Fix, path: TorchPath, cell: Cell, config: MotionConfig, *, given: Given = AS_READ
) -> tuple[tuple[TorchPath, ...], Cell, MotionConfig]:
    """Path, cell and settings with the change made; several paths where the weld is cut. Args: given, as for `fixes_for_path`."""
    paths: tuple[TorchPath, ...] = (path,)
    match fix.kind:
        case "turn about the wire":
            paths = (_with(path, X_BT=reposed(path.X_BT, given, turn=fix.turn)),)
        case "lean the torch":
            paths = (_with(path, X_BT=reposed(path.X_BT, given, lean=fix.lean)),)
        case "move the part":
            paths, cell = (_with(path, X_BT=shifted(path.X_BT, np.array(fix.move))),), cell.moved(np.array(fix.move))
        case "slower":
            paths = (_with(path, speed=np.minimum(path.speed, fix.speed)),)
        case "take away":
            for body in fix.body.split(", "):
                cell = cell.without(body)
        case "lead-in":
            config = replace(config, approach=fix.approach)
        case "cut the weld":
            paths = tuple(cut_path(path, fix.cut))
    return paths, cell, config


def _slower(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig) -> tuple[Fix, ...]:
    speed = 0.99 * min(float(path.speed.max()), FASTEST) * (trial.slowest or 1.0)
    for _ in range(FULL_TRIES):
        speed = float(f"{speed:.3g}")  # as it is told
        tried = try_path(_with(path, speed=np.minimum(path.speed, speed)), trial.name, cell, config)
        if tried.passed:
            return (
                Fix(
                    kind="slower",
                    text=f"weld at {1e3 * speed:.3g} mm/s at most",
                    speed=speed,
                    how=f'--speed "{1e3 * speed:.3g} mm/s"',
                ),
            )
        speed *= 0.95 * (tried.slowest or 0.5)
    return ()


def _turn(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig, given: Given) -> list[Fix]:
    tries = 0
    for turn in TURNS:
        changed = _with(path, X_BT=reposed(path.X_BT, given, turn=float(turn)))
        if not _quick(changed, trial, cell, config):
            continue
        if try_path(changed, trial.name, cell, config).passed:
            text = f"turn the torch about its wire by {np.rad2deg(turn):+.0f} deg all along"
            return [Fix(kind="turn about the wire", text=text, turn=float(turn), how=_turning(given.turn + turn))]
        if (tries := tries + 1) >= _tries(path, FULL_TRIES):
            break
    return []


def _taken_away(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig) -> list[Fix]:
    """Without the clamps that are touched, one after the other, where that is all that stands in the way."""
    away: list[str] = []
    before = cell
    for _ in range(FULL_TRIES):
        failure = trial.failure
        touching = () if failure is None else (LOOSE.match(name) for name in (failure.first, failure.second))
        clamp = next((loose.group() for loose in touching if loose), "")
        if failure is None or not clamp:
            break
        away.append(clamp)
        cell = cell.without(clamp)
        trial = try_path(path, trial.name, cell, config)
    if not away or not trial.passed:
        return []
    return [
        Fix(
            kind="take away",
            text=f"take {' and '.join(away)} out of the torch's way",
            body=", ".join(away),
            how=_leaving_out(before, away),
        )
    ]


def _lead(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig) -> list[Fix]:
    """Lead-in and lead-out of another length: shorter ones first, the nearest to what they are first."""
    if any(segment in (Segment.APPROACH, Segment.RETRACT) for segment in path.segments):
        return []  # it brings its own
    shorter = [length for length in LEADS if length < config.approach - 1e-9]
    for length in (*reversed(shorter), *(length for length in LEADS if length > config.approach + 1e-9)):
        if try_path(path, trial.name, cell, replace(config, approach=length)).passed:
            word = "shorten" if length < config.approach else "lengthen"
            text = f"{word} the lead-in and lead-out to {1e3 * length:.0f} mm (motion.approach, {1e3 * config.approach:.0f} mm now)"
            how = f'--set motion.approach="{1e3 * length:g} mm"'
            return [Fix(kind="lead-in", text=text, approach=length, how=how)]
    return []


def _lean(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig, given: Given) -> list[Fix]:
    tries = 0
    for angle in LEANS:
        for lean in ((angle, 0.0), (-angle, 0.0), (0.0, angle), (0.0, -angle)):
            both = (given.lean[0] + lean[0], given.lean[1] + lean[1])
            if max(map(abs, both)) > LEAN_MOST:  # the option takes no more
                continue
            changed = _with(path, X_BT=reposed(path.X_BT, given, lean=lean))
            if not _quick(changed, trial, cell, config):
                continue
            if try_path(changed, trial.name, cell, config).passed:
                which = "work" if lean[0] else "travel"
                text = f"add {np.rad2deg(lean[0] + lean[1]):+.0f} deg of {which} angle"
                how = f'--lean "{_degrees(both[0])}, {_degrees(both[1])}"'
                return [Fix(kind="lean the torch", text=text, lean=(float(lean[0]), float(lean[1])), how=how)]
            if (tries := tries + 1) >= _tries(path, FULL_TRIES):
                return []
    return []


def leaned(X_BT: Transform, work: float, travel: float) -> Transform:
    """The poses leaned about their own tips: right-handed about travel, and pushing for a positive travel angle [rad]."""
    turn = Transform.from_rotation_vector("TT", np.array([work, 0.0, 0.0]), np.zeros(3))
    turn = turn @ Transform.from_rotation_vector("TT", np.array([0.0, travel, 0.0]), np.zeros(3))
    return Transform("BT", X_BT.R @ turn.R, X_BT.p)


def reposed(X_BT: Transform, given: Given, turn: float = 0.0, lean: tuple[float, float] = (0.0, 0.0)) -> Transform:
    """The poses as they are when turned and leaned by so much more than was given [rad]: turned first, then leaned."""
    before = leaned(Transform("TT", np.eye(3), np.zeros(3)), *given.lean)
    read = turned_about_wire(Transform("BT", X_BT.R @ before.R.T, X_BT.p), turn)
    return leaned(read, given.lean[0] + lean[0], given.lean[1] + lean[1])


def _move(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig, tell: Progress) -> list[Fix]:
    tries, least = 0, 0.0
    for k, move in enumerate(candidates(path.X_BT.p)):
        tell(min(0.95, k / (len(DISTANCES) * HEADINGS)))
        if np.linalg.norm(move) < least or cell.misplaced(move, path.X_BT.p) is not None:
            continue
        if not _quick(_with(path, X_BT=shifted(path.X_BT, move)), trial, cell.moved(move), config):
            continue
        nearest = _nearest(path, trial, move, cell, config)
        longer = nearest * (1.0 + FARTHER / float(np.linalg.norm(nearest)))
        for way in (nearest, longer if tries == 0 else move):
            way = told(way)
            if passes(path, way, trial.name, cell, config):
                return [moved_fix(way, cell.place, cell.shift)]
            if (tries := tries + 1) >= _tries(path, MOVE_TRIES):
                return []
            length = float(np.linalg.norm(way))
            least = max(OUTWARDS * length, length + FURTHER_OUT)
    return []


def _tries(path: TorchPath, most: int) -> int:
    """How many whole checks are worth the time."""
    return int(np.clip(WORK / max(float(path.s[-1] - path.s[0]), 1e-3), 2, most))


def told(move: Float[ndarray, "3"]) -> Float[ndarray, "3"]:
    """The move as it is told: in tenths of a millimetre."""
    return np.round(move, 4) + 0.0


def moved_fix(move: Float[ndarray, "3"], place: tuple[float, float] | None = None, shift: tuple[float, float] = (0.0, 0.0)) -> Fix:
    """The change of place in words.

    Args:
        place: where the part is now [m].  shift: what it has been moved by already [m]: the option tells both together.
    """
    x, y = 1e3 * move[0], 1e3 * move[1]
    distance = 1e3 * float(np.linalg.norm(move))
    text = f"move the part by {distance:.0f} mm: ({x:+.0f}, {y:+.0f}) mm along x and y of the base"
    how = f'--move "{x + 1e3 * shift[0]:.1f} mm, {y + 1e3 * shift[1]:.1f} mm"'
    if place is not None:
        there = 1e3 * (np.array(place) + move[:2])
        how += f'; once the part is there, in the scene\'s [pose]: x = "{there[0]:.1f} mm", y = "{there[1]:.1f} mm"'
    return Fix(kind="move the part", text=text, move=(float(move[0]), float(move[1]), float(move[2])), how=how)


def _turning(turn: float) -> str:
    turn = (turn + np.pi) % (2 * np.pi) - np.pi if abs(turn) > np.pi + 1e-9 else turn
    return f'--turn "{_degrees(turn)}"'


def _degrees(angle: float) -> str:
    """An angle [rad] as an option takes it."""
    return f"{round(float(np.rad2deg(angle)), 6) + 0.0:.10g} deg"


def _leaving_out(cell: Cell, away: list[str]) -> str:
    """The scene's lines without what is taken away."""
    names = ", ".join(f'"{name}"' for name in (*cell.left_out, *away))
    return f"--set 'scene.fixture.without=[{names}]'; or in the scene's [fixture]: without = [{names}]"


def passes(path: TorchPath, move: Float[ndarray, "3"], name: str, cell: Cell, config: MotionConfig) -> bool:
    """Whether the part can stand where it is moved [m], and the whole check passes there."""
    if cell.misplaced(move) is not None:
        return False
    return try_path(_with(path, X_BT=shifted(path.X_BT, move)), name, cell.moved(move), config).passed


def candidates(points_B: Float[ndarray, "n 3"]) -> Iterator[Float[ndarray, "3"]]:
    """Moves on the table [m], near ones first, towards the middle of the arm's reach first; a seam over the table stays there."""
    middle = points_B.mean(axis=0)
    over = _over_table(points_B[:, :2])
    inwards = np.arctan2(-0.45 - middle[1], -middle[0])
    for distance in DISTANCES:
        for k in sorted(range(HEADINGS), key=lambda k: min(k, HEADINGS - k)):
            heading = inwards + 2 * np.pi * k / HEADINGS
            move = distance * np.array([np.cos(heading), np.sin(heading), 0.0])
            if not over or _over_table(points_B[:, :2] + move[:2]):
                yield move


def _over_table(points: Float[ndarray, "n 2"]) -> bool:
    return bool((points >= TABLE[0]).all() and (points <= TABLE[1]).all())


def _nearest(path: TorchPath, trial: Trial, move: Float[ndarray, "3"], cell: Cell, config: MotionConfig) -> Float[ndarray, "3"]:
    """The shortest move in the same direction that the coarse look finds good, to CLOSE."""
    length = float(np.linalg.norm(move))
    low = max((d for d in DISTANCES if d < length - 1e-9), default=0.0)
    high = length
    while high - low > CLOSE:
        middle = (low + high) / 2
        trying = move * middle / length
        good = _quick(_with(path, X_BT=shifted(path.X_BT, trying)), trial, cell.moved(trying), config)
        low, high = (low, middle) if good else (middle, high)
    return move * high / length


def _cut(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig) -> list[Fix]:
    """The weld in pieces, where the search for a sweep said that this would help."""
    if not trial.split:
        return []
    pieces = cut_path(path, trial.split)
    if not all(try_path(piece, trial.name, cell, config).passed for piece in pieces):
        return []
    where = ", ".join(f"{1e3 * s:.0f}" for s in trial.split)
    text = f"weld it in {len(pieces)} pieces, cut at s = {where} mm (motion.pieces = {len(pieces)})"
    return [Fix(kind="cut the weld", text=text, cut=trial.split, how=f"--set motion.pieces={len(pieces)}")]


def fixes_for_script(program: Program, trial: Trial, cell: Cell, tell: Progress = lambda done: None) -> tuple[Fix, ...]:
    """What would help a program that failed at a pose: the same turn about the wire at every pose, or the part elsewhere."""
    failure = trial.failure
    if failure is None or failure.why in ("stale start", "speed") or all(motion.X_BT is None for motion in program.motions):
        return ()
    found: list[Fix] = []
    turns = ((turn, changed_program(program, turn=float(turn))) for turn in TURNS)
    for turn, changed in islice((pair for pair in turns if _held(pair[1], failure.index, cell)), FULL_TRIES):
        if try_script(changed, cell).passed:
            text = f"turn the torch about its wire by {np.rad2deg(turn):+.0f} deg at every pose"
            how = _turning(program.given.turn + turn)
            found.append(Fix(kind="turn about the wire", text=text, turn=float(turn), how=how))
            break
    points = np.stack([motion.X_BT.p for motion in program.motions if motion.X_BT is not None])
    tries = 0
    for k, move in enumerate(candidates(points)):
        tell(min(0.95, k / (len(DISTANCES) * HEADINGS)))
        move = told(move)
        if cell.misplaced(move) is not None:
            continue
        changed, there = changed_program(program, move=move), cell.moved(move)
        if not _held(changed, failure.index, there):
            continue
        if try_script(changed, there).passed:
            found.append(moved_fix(move, cell.place, cell.shift))
            break
        if (tries := tries + 1) >= FULL_TRIES:
            break
    return tuple(found)


def _held(program: Program, index: int, cell: Cell) -> bool:
    """Whether the program gets past the target of one motion; of a late one, whether some posture there is clear."""
    if index < FEW:
        return try_script(replace(program, motions=program.motions[: index + 1]), cell).passed
    motion = program.motions[index]
    solutions = motion.q[None] if motion.X_BT is None else inverse(motion.X_BT @ X_FT.inverse())  # type: ignore[index]
    return any(not cell.collision.touches(q) for q in solutions)


def changed_program(program: Program, turn: float = 0.0, move: Float[ndarray, "3"] | None = None) -> Program:
    """The program with every pose turned about the wire and moved; joint targets stay."""
    shift = np.zeros(3) if move is None else move

    def changed(X_BT: Transform | None) -> Transform | None:
        return None if X_BT is None else shifted(turned_about_wire(X_BT, turn), shift)

    motions = tuple(replace(motion, X_BT=changed(motion.X_BT), way=changed(motion.way)) for motion in program.motions)
    return replace(program, motions=motions)


def turned_about_wire(X_BT: Transform, turn: float) -> Transform:
    """The poses turned about their own z [rad]."""
    return Transform("BT", turned(X_BT.R, turn), X_BT.p)


def _quick(path: TorchPath, trial: Trial, cell: Cell, config: MotionConfig) -> bool:
    try:
        return cell.collision(cell.q_start) is None and quick(path, cell, config, first=trial.s_worst, air=True)
    except MotionError:
        return False


def _with(path: TorchPath, **changes: object) -> TorchPath:
    return replace(path, **changes)  # type: ignore[arg-type]
