"""Random jobs, of which some cannot be done, and an independent judge of what became of each: used by 20_random_paths.py and tests.

The judge shares no code with the planner beyond the arm's kinematics and MuJoCo's contacts: reach, collision, singularity and
sweeps are decided by brute force over rotations about the wire.
"""

from dataclasses import dataclass, replace
from typing import Any, final

import mujoco
import numpy as np
from numpy import ndarray

from weldsim.config import CellConfig
from weldsim.curves import arc_length, project, tangents
from weldsim.dryrun.cell import Cell, empty_cell
from weldsim.dryrun.program import Program
from weldsim.errors import ExecutionError
from weldsim.execution.gate import SafetyGate
from weldsim.execution.robot import Robot
from weldsim.execution.runner import execute
from weldsim.execution.simulated import SimulatedRobot
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.kinematics import JOINT_NAMES, inverse, torch_pose
from weldsim.motion.rail import make_rail
from weldsim.mounts import X_FT
from weldsim.records import ExecutionLog, RobotFacts, RobotState, SeamFindings, Segment, TorchPath
from weldsim.welding.job import Job, JobConfig, weld

KINDS = ("anywhere", "low", "far", "fast", "jump", "stands in the table", "moved meanwhile")
WEIGHTS = (0.5, 0.12, 0.08, 0.08, 0.08, 0.07, 0.07)
START = np.array([-1.5708, -1.9199, -1.6, -1.1, 1.5708, 0.0])  # [rad] arm up over the table
SUNK = np.array([-1.5708, 0.5, -0.5, -1.1, 1.5708, 0.0])  # [rad] the forearm in the table
ROLLS, PLACES, STRIDE = 90, 20, 0.004
SPEED, ACCELERATION, JERK, TORCH = 3.0, 10.0, 350.0, 0.25  # limits of a plan [rad/s], [rad/s2], [rad/s3], [m/s]
FLOOR = -0.005  # [m] least height of the torch tip in the base
FIRST = 2e-3  # [m] how near the place that is named must be to the first that fails
SINGULAR = 0.012  # [m/rad] dexterity below which a posture is no use
RATE = 60.0  # [rad/m] beyond which a joint jumps


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """A job. Attributes: seed; kind; path; q_stands, where the arm really stands [rad]; arc, whether it may burn."""

    seed: int
    kind: str
    path: TorchPath
    q_stands: ndarray
    arc: bool


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a case. Attributes: seed, kind; done; reason, of a refusal; moved, whether a command was sent;
    faults, what the judge holds against it; figures, of what was executed; confirmed, whether the judge could tell."""

    seed: int
    kind: str
    done: bool
    reason: str
    moved: bool
    faults: tuple[str, ...]
    figures: dict[str, float]
    confirmed: bool = True


@final
class Witness(Robot):
    """Passes everything on, and counts the commands."""

    def __init__(self, inner: Robot) -> None:
        self.inner, self.name, self.period, self.commands = inner, inner.name, inner.period, 0

    def connect(self) -> None:
        self.inner.connect()

    def disconnect(self) -> None:
        self.inner.disconnect()

    def state(self) -> RobotState:
        return self.inner.state()

    def facts(self) -> RobotFacts:
        return self.inner.facts()

    def servo(self, q: ndarray, qd: ndarray) -> ndarray:
        self.commands += 1
        return self.inner.servo(q, qd)

    def set_arc(self, on: bool) -> None:
        self.inner.set_arc(on)

    @property
    def arc(self) -> bool:
        return self.inner.arc

    def stop(self) -> None:
        self.inner.stop()

    def events(self) -> Any:
        return self.inner.events()


def random_case(seed: int) -> Case:
    """A seam of 40 to 120 mm, a line or an arc, in any direction about the arm, or one that is spoilt in a known way."""
    rng = np.random.default_rng([20, seed])
    kind = str(rng.choice(KINDS, p=WEIGHTS))
    steep = {"anywhere": 120, "low": 40, "far": 70}.get(kind, 20)
    tilt, heading, yaw = rng.uniform(0, np.deg2rad(steep)), rng.uniform(0, 2 * np.pi), rng.uniform(-np.pi, np.pi)
    lean = matrix_from_rotation_vector(tilt * np.array([-np.sin(heading), np.cos(heading), 0.0]))
    R = lean @ matrix_from_rotation_vector(np.array([0.0, 0.0, yaw]))
    reach = {"far": (0.85, 1.2), "anywhere": (0.15, 0.95)}.get(kind, (0.42, 0.55))
    height = {"low": (-0.05, 0.02), "anywhere": (0.02, 0.5)}.get(kind, (0.05, 0.2))
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(*reach)
    middle = np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(*height)])
    length, bent = rng.uniform(0.04, 0.12), bool(rng.random() < 0.5)
    u = np.linspace(-length / 2, length / 2, round(length / 0.0007))
    radius = 0.5 * length + 0.05
    flat = np.stack([radius * np.sin(u / radius), radius * (1 - np.cos(u / radius)), 0 * u] if bent else [u, 0 * u, 0 * u], axis=1)
    points, wire = flat @ R.T + middle, np.broadcast_to(-R[:, 2], flat.shape)
    if kind == "jump":
        turn = matrix_from_rotation_vector(rng.uniform(np.deg2rad(15), np.deg2rad(60)) * R[:, 0])
        after = np.arange(len(u)) >= rng.integers(len(u) // 4, 3 * len(u) // 4)
        wire = np.where(after[:, None], wire @ turn.T, wire)
    speed = rng.uniform(0.3, 0.8) if kind == "fast" else rng.uniform(0.008, 0.02)
    stands = START.copy()
    if kind == "stands in the table":
        stands = SUNK + rng.uniform(-0.03, 0.03, 6)
    return Case(
        seed=seed,
        kind=kind,
        path=_path(points, wire, float(speed), bool(rng.random() < 0.7)),
        q_stands=stands,
        arc=bool(rng.random() < 0.5),
    )


def _path(points: ndarray, wire: ndarray, speed: float, roll_free: bool) -> TorchPath:
    z, t = unit(wire), tangents(points)
    x = unit(t - np.einsum("ij,ij->i", t, z)[:, None] * z)
    n = len(points)
    return TorchPath(
        X_BT=Transform("BT", np.stack([x, np.cross(z, x), z], axis=-1), points),
        s=arc_length(points),
        speed=np.full(n, speed),
        arc_on=np.ones(n, bool),
        segments=(Segment.WELD,) * n,
        roll_free=roll_free,
    )


def attempt(case: Case, cell: Cell | None = None) -> Outcome:
    """The job given to the simulated arm in a cell (by default the empty one), and judged."""
    cell, config = cell or empty_cell(START), CellConfig()
    robot = Witness(SimulatedRobot(cell.model, case.q_stands))
    if case.kind == "moved meanwhile":
        return _moved_meanwhile(case, cell, config, robot)
    findings = SeamFindings(seams=(), region=np.zeros(0, np.int32), method="random")
    program = Program(source="random", kind="path", paths=(case.path,), names=("seam",))
    done = weld(program, findings, robot, cell, config, JobConfig(arc=case.arc))
    if done.stopped is not None and done.log is None:
        rule = str(done.stopped.data.get("rule"))
        low = float(make_rail(case.path, config.motion).at(np.linspace(-0.05, case.path.s[-1] + 0.05, 400)).p[:, 2].min())
        # The wire may touch the table, so a path a little below it is no collision: the gate's box refuses it.
        faults = () if rule == "workspace" and low < FLOOR else (f"refused for {rule}: {done.stopped}",)
        faults += ("it moved before it was refused",) if robot.commands else ()
        moved = robot.commands > 0
        return Outcome(seed=case.seed, kind=case.kind, done=False, reason=rule, moved=moved, faults=faults, figures={})
    if done.stopped is not None:
        faults = (f"stopped on the way: {done.stopped}",)
        return Outcome(seed=case.seed, kind=case.kind, done=False, reason="stopped", moved=True, faults=faults, figures={})
    if done.log is not None:
        faults, figures = judge_log(done.log, case, cell)
        return Outcome(seed=case.seed, kind=case.kind, done=True, reason="", moved=True, faults=faults, figures=figures)
    why, faults, confirmed = judge_refusal(done, case, cell, config)
    moved = robot.commands > 0
    faults = (*faults, *(("it moved before it was refused",) if moved else ()))
    return Outcome(
        seed=case.seed, kind=case.kind, done=False, reason=why, moved=moved, faults=faults, figures={}, confirmed=confirmed
    )


def _moved_meanwhile(case: Case, cell: Cell, config: CellConfig, robot: Witness) -> Outcome:
    """Somebody moves the arm by a degree between plan and start: the gate must refuse, where there was a plan."""
    from weldsim.dryrun.try_path import try_path

    trial = try_path(case.path, "seam", replace(cell, q_start=START), config.motion)
    moved = np.zeros(6)
    moved[case.seed % 6] = np.deg2rad(1.0)
    robot = Witness(SimulatedRobot(cell.model, START + moved))
    if trial.trajectory is None:
        why = trial.failure.why if trial.failure is not None else ""
        return Outcome(seed=case.seed, kind=case.kind, done=False, reason=why, moved=False, faults=(), figures={}, confirmed=False)
    try:
        with SafetyGate(robot, arc=case.arc) as gate:
            execute(gate, trial.trajectory)
    except ExecutionError as error:
        faults = () if error.data.get("rule") == "start" else (f"refused for {error.data.get('rule')}, the start was wrong",)
        faults += ("it moved before it was refused",) if robot.commands else ()
        moved_now = robot.commands > 0
        return Outcome(seed=case.seed, kind=case.kind, done=False, reason="start", moved=moved_now, faults=faults, figures={})
    return Outcome(seed=case.seed, kind=case.kind, done=True, reason="", moved=True, faults=("started elsewhere",), figures={})


def judge_log(log: ExecutionLog, case: Case, cell: Cell) -> tuple[tuple[str, ...], dict[str, float]]:
    """What was executed against every limit."""
    h = log.period
    speed = np.diff(log.q_cmd, axis=0) / h
    acceleration, jerk = np.diff(speed, axis=0) / h, np.diff(speed, n=2, axis=0) / h**2
    torch = np.linalg.norm(np.diff(torch_pose(log.q_cmd).p, axis=0), axis=1) / h
    weld_rows = np.array([segment == Segment.WELD for segment in log.segments])
    off = project(log.X_BT_act.p[weld_rows], case.path.X_BT.p)[0]
    figures = {
        "joint speed": float(np.abs(speed).max()),
        "joint acceleration": float(np.abs(acceleration).max()),
        "joint jerk": float(np.abs(jerk).max()),
        "torch speed": float(torch.max()),
        "tip p95": float(np.percentile(off, 95)),
    }
    limits = {"joint speed": SPEED, "joint acceleration": ACCELERATION, "joint jerk": JERK, "torch speed": TORCH, "tip p95": 0.3e-3}
    faults = [f"{name} {figures[name]:.4g} over {limit:g}" for name, limit in limits.items() if figures[name] > limit * 1.001]
    if case.kind not in ("anywhere", "low", "far"):
        faults.append(f"a job of kind {case.kind!r} was executed")
    faults += [event.text for event in log.events if event.kind in ("contact", "stop", "fault")]
    if any(touching(cell, q) for q in log.q_act[::8]):
        faults.append("the arm touches something")
    if (log.arc_on & ~weld_rows).any() or (log.arc_on.any() and not case.arc):
        faults.append("the arc burnt where it must not")
    if case.arc and log.arc_on[weld_rows][1:].mean() < 0.99:
        faults.append("the arc did not burn on all of the weld")
    reached = project(case.path.X_BT.p, log.X_BT_act.p[weld_rows])[0].max()
    if reached > 1e-3:
        faults.append(f"{1e3 * reached:.1f} mm of the path were not reached")
    return tuple(faults), figures


def judge_refusal(done: Job, case: Case, cell: Cell, config: CellConfig) -> tuple[str, tuple[str, ...], bool]:
    """The reason that was given, what is wrong with it, and whether that could be told."""
    assert done.trial is not None
    failure = done.trial.failure
    assert failure is not None
    why, text = failure.why, failure.text
    known = {"fast": "speed", "jump": "orientation jump", "stands in the table": "stale start"}.get(case.kind)
    if known is not None:
        return why, () if why == known else (f"refused for {why}, the truth is {known}: {text}",), True
    if why in ("speed", "orientation jump", "stale start"):
        return why, (f"nothing of that was asked: {text}",), True
    rail = make_rail(case.path, config.motion)
    at = float(text.partition("s = ")[2].partition(" mm")[0]) / 1e3 if "s = " in text else None
    if at is None or "air move" in text:
        return why, (), False
    before = np.linspace(rail.s[0], max(at - FIRST, rail.s[0]), PLACES) if at - FIRST > rail.s[0] else np.zeros(0)
    faults = [
        f"nothing reaches s = {1e3 * s:.1f} mm, before it" for s in before if not len(postures(rail.at(np.array([s]))[0], case))
    ]
    if why in ("unreachable", "collision", "singular") and "no sweep" not in text:
        # What is claimed of the place must hold there or just beyond: a coarser look gives up a little earlier.
        claims = [_claim(why, postures(rail.at(np.array([min(s, rail.s[-1])]))[0], case), cell) for s in (at, at + FIRST)]
        return why, (*faults, *(() if "" in claims else claims[:1])), True
    # No sweep: by brute force there is none either, or it could not be told.
    return why, tuple(faults), not sweep_exists(rail, case, cell, at)


def _claim(why: str, here: ndarray, cell: Cell) -> str:
    """What is wrong with what was said of a place that has these postures; nothing where it is true."""
    if why == "unreachable":
        return "a posture reaches it" if len(here) else ""
    if not len(here):  # where the arm is stretched out, singular ends in out of reach
        return "" if why == "singular" else "nothing reaches it"
    free = sum(dexterity(q) > SINGULAR * 1.05 and not touching(cell, q) for q in here)
    return f"{free} of {len(here)} postures are free" if free else ""


def postures(X_BT: Transform, case: Case, rolls: int = ROLLS) -> ndarray:
    """All joint solutions (k, 6) of a torch pose, at any rotation about the wire where that is free."""
    found = []
    for roll in np.linspace(0, 2 * np.pi, rolls, endpoint=False) if case.path.roll_free else (0.0,):
        turn = Transform.from_rotation_vector("TT", np.array([0.0, 0.0, roll]), np.zeros(3))
        found.append(inverse(X_BT @ turn @ X_FT.inverse()))
    return np.concatenate(found)


def touching(cell: Cell, q: ndarray) -> bool:
    """Whether MuJoCo finds the arm, or what hangs on it, in contact."""
    model, data = cell.model, mujoco.MjData(cell.model)
    data.qpos[[model.joint(name).qposadr[0] for name in JOINT_NAMES]] = q
    mujoco.mj_forward(model, data)
    base = model.body("ur5_base").id
    for k in range(data.ncon):
        if data.contact.dist[k] < 0 and any(_hangs_on(model, int(geom), base) for geom in data.contact.geom[k]):
            return True
    return False


def _hangs_on(model: Any, geom: int, root: int) -> bool:
    body = int(model.geom_bodyid[geom])
    while body:
        if body == root:
            return True
        body = int(model.body_parentid[body])
    return False


def dexterity(q: ndarray) -> float:
    """Least singular value of the torch's Jacobian by differences, angles weighed as arcs of half a metre [m/rad]."""
    step, X = 1e-6, torch_pose(q)
    columns = []
    for joint in range(6):
        Y = torch_pose(q + step * np.eye(6)[joint])
        W = (Y.R - X.R) @ X.R.T / step
        columns.append(np.concatenate([(Y.p - X.p) / step, 0.5 * np.array([W[2, 1], W[0, 2], W[1, 0]])]))
    return float(np.linalg.svd(np.array(columns), compute_uv=False)[-1])


def sweep_exists(rail: Any, case: Case, cell: Cell, end: float) -> bool:
    """Whether free postures join up, none further from the next than a joint may turn, from the rail's start to `end` [m]."""
    s = np.linspace(rail.s[0], end, max(3, int((end - rail.s[0]) / STRIDE) + 1))
    reached: ndarray | None = None
    for place in s:
        here = postures(rail.at(np.array([place]))[0], case, ROLLS // 2)
        if reached is not None and len(here):
            apart = np.abs(np.angle(np.exp(1j * (here[:, None] - reached[None]))))
            # A rotation about the wire lies up to half a step from the one that a smooth sweep would take.
            here = here[(apart.max(axis=2) < RATE * (s[1] - s[0]) + 2 * np.pi / (ROLLS // 2)).any(axis=1)]
        here = np.array([q for q in here if not touching(cell, q)]).reshape(-1, 6)
        if not len(here):
            return False
        reached = here
    return True
