"""What a dry run says: a verdict for every waypoint, the first failure, fixes that were tried, the motion if there is one."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.margin import Margin, margin_json
from weldsim.motion.collision import SHALLOW, deep
from weldsim.records import JointTrajectory

Why = Literal[
    "ok",
    "unreachable",
    "joint limit",
    "singular",
    "collision",
    "orientation jump",
    "turns back",
    "speed",
    "joint jump",
    "stale start",
    "not reached",
]


EVENTS: tuple[Why, ...] = ("orientation jump", "turns back", "joint jump", "stale start")  # at one waypoint, each its own
STREAMED = ("", "servoj")  # commands whose targets follow each other closely, as the poses of a path do


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What becomes of one waypoint.

    Attributes:
        label: which one, for people.  index: from 0.  s: arc length [m], or None for a joint target.
        why: "ok" or the kind of failure.  text: the reason in full, with values and limits.
        first, second: bodies that collide.  depth: how deep [m].
        line: of a robot program's motion, from 1; 0 of a path's pose.  command: of such a motion.
    """

    label: str
    index: int
    s: float | None
    why: Why = "ok"
    text: str = ""
    first: str = ""
    second: str = ""
    depth: float = 0.0
    line: int = 0
    command: str = ""

    @property
    def ok(self) -> bool:
        return self.why == "ok"


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A change after which a path passes, and the whole job with it unless `breaks` says otherwise: it was applied and checked.

    Attributes:
        kind: what is changed.  text: the change in words.
        lean: added work angle and travel angle [rad].  body: what is taken away.
        turn: about the wire [rad].  move: of the part, in the base [m].  speed: of the weld [m/s].  cut: arc lengths [m].
        approach: length of lead-in and lead-out [m], `motion.approach`.
        how: what makes the change, options to be added to the command or lines of the scene's file.
        breaks: names of the job's other paths that fail with it.
    """

    kind: Literal["turn about the wire", "lean the torch", "take away", "move the part", "slower", "cut the weld", "lead-in"]
    text: str
    lean: tuple[float, float] = (0.0, 0.0)
    body: str = ""
    turn: float = 0.0
    move: tuple[float, float, float] = (0.0, 0.0, 0.0)
    speed: float = 0.0
    cut: tuple[float, ...] = ()
    approach: float = 0.0
    how: str = ""
    breaks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """One path or program tried.

    Attributes:
        name: of the seam or program.  verdicts: one a waypoint.
        t, q: the planned motion as far as there is one [s], [rad]; empty arrays where there is none.
        arc_on: when the arc burns.  cycle: time it takes [s], 0 where it cannot be done.
        s_worst: arc length of the first failure [m], negative on a lead-in; None where a waypoint says it all.
        q_worst: joint angles at the first failure, to be drawn; None where no posture gets there.  p_worst: its place in B [m].
        points_B: the tip's way, to be drawn.  notes: what else is worth knowing.  length: of the tip's way [m].
        trajectory: the planned motion in full, None where there is none or the program is the robot's own.
        lead: whether it fails before the weld's first pose or after its last one: on a lead or in the air.
        split: where cutting the weld would help [m].  slowest: least ratio of possible to asked speed, 0 where it is not known.
        margins: how far a motion that would pass is from failing.
    """

    name: str
    verdicts: tuple[Verdict, ...]
    t: Float[ndarray, "k"] = field(default_factory=lambda: np.zeros(0))
    q: Float[ndarray, "k 6"] = field(default_factory=lambda: np.zeros((0, 6)))
    arc_on: ndarray = field(default_factory=lambda: np.zeros(0, bool))
    cycle: float = 0.0
    s_worst: float | None = None
    q_worst: Float[ndarray, "6"] | None = None
    p_worst: Float[ndarray, "3"] | None = None
    points_B: Float[ndarray, "n 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    notes: tuple[str, ...] = ()
    length: float = 0.0
    trajectory: JointTrajectory | None = None
    lead: bool = False
    split: tuple[float, ...] = ()
    slowest: float = 0.0
    margins: tuple[Margin, ...] = ()

    @property
    def passed(self) -> bool:
        return all(verdict.ok for verdict in self.verdicts)

    @property
    def failure(self) -> Verdict | None:
        """The first verdict that is not ok."""
        return next((verdict for verdict in self.verdicts if not verdict.ok), None)


@dataclass(frozen=True, eq=False, kw_only=True)
class DryRun:
    """A whole dry run. Attributes: source, cell, what was checked against what; trials; fixes, one tuple a trial; notes."""

    source: str
    cell: str
    trials: tuple[Trial, ...]
    fixes: tuple[tuple[Fix, ...], ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        return all(trial.passed for trial in self.trials)

    @property
    def cycle(self) -> float:
        """Time of all trials together [s]."""
        return sum(trial.cycle for trial in self.trials)


def runs(verdicts: tuple[Verdict, ...]) -> list[tuple[Verdict, Verdict]]:
    """First and last of each run of neighbouring verdicts that are told as one; the first with the greatest depth.

    Those are verdicts of one kind with the same bodies. A failure that has a reason of its own, such as a jump or a whole
    motion of a program, is a run alone.
    """
    out: list[tuple[Verdict, Verdict, float]] = []
    for verdict in verdicts:
        if out and _told_as_one(out[-1][0], verdict):
            out[-1] = (out[-1][0], verdict, max(out[-1][2], verdict.depth))
        else:
            out.append((verdict, verdict, verdict.depth))
    return [(_with_depth(first, depth), last) for first, last, depth in out]


def _told_as_one(a: Verdict, b: Verdict) -> bool:
    if (a.why, a.first, a.second) != (b.why, b.first, b.second):
        return False
    return a.why in ("ok", "not reached") or (a.why not in EVENTS and a.command in STREAMED and b.command in STREAMED)


def _with_depth(first: Verdict, depth: float) -> Verdict:
    """The first of a run, saying how deep the bodies get in it [m]."""
    if depth - first.depth < SHALLOW:
        return first
    return replace(first, depth=depth, text=f"{first.text}; up to {deep(depth)} further on")


def span(first: Verdict, last: Verdict) -> str:
    """The waypoints of a run in words."""
    if first.index == last.index:
        return first.label
    if not first.line:
        return f"{first.label} to {last.index}"
    if last.line > first.line:
        return f"{first.label} to {last.label}"
    return f"{first.label} and the {last.index - first.index} after it"


def dry_run_json(result: DryRun) -> dict[str, Any]:
    """The dry run as one JSON object: SI units; waypoints as ranges `from` to `to` of one verdict, all of them covered."""
    return {
        "schema": "weldsim.dry-run/1",
        "source": result.source,
        "cell": result.cell,
        "passed": result.passed,
        "cycle_time": round(result.cycle, 6),
        "notes": list(result.notes),
        "trials": [_trial_json(trial, fixes) for trial, fixes in zip(result.trials, result.fixes, strict=True)],
    }


def _trial_json(trial: Trial, fixes: tuple[Fix, ...]) -> dict[str, Any]:
    failure = trial.failure
    return {
        "name": trial.name,
        "passed": trial.passed,
        "cycle_time": round(trial.cycle, 6),
        "length": round(trial.length, 9),
        "waypoints": [
            {"from": a.index, "to": b.index, "s": [a.s, b.s], **_verdict_json(a), "label": a.label} for a, b in runs(trial.verdicts)
        ],
        "first_failure": None if failure is None else _failure_json(trial, failure),
        "fixes": [
            {
                "kind": fix.kind,
                "text": fix.text,
                "turn": fix.turn,
                "lean": list(fix.lean),
                "body": fix.body,
                "move": list(fix.move),
                "speed": fix.speed,
                "cut": list(fix.cut),
                "approach": fix.approach,
                "how": fix.how,
                "breaks": list(fix.breaks),
            }
            for fix in fixes
        ],
        "margins": [margin_json(margin) for margin in trial.margins],
        "notes": list(trial.notes),
    }


def _failure_json(trial: Trial, failure: Verdict) -> dict[str, Any]:
    """The waypoint, and exactly where and how the arm stands or would have to."""
    return {
        "index": failure.index,
        "s": failure.s if trial.s_worst is None else round(trial.s_worst, 6),
        **_verdict_json(failure),
        "position": None if trial.p_worst is None else np.round(trial.p_worst, 6).tolist(),
        "joints": None if trial.q_worst is None else np.round(trial.q_worst, 9).tolist(),
    }


def _verdict_json(verdict: Verdict) -> dict[str, Any]:
    bodies = {"bodies": [verdict.first, verdict.second], "depth": verdict.depth} if verdict.first else {}
    return {"verdict": verdict.why, "reason": verdict.text, **bodies}
