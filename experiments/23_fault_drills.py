"""What goes wrong with a cell, at random instants of a weld, on both virtual controllers: are arc and arm at rest in time?

A short weld of the scene `straight` runs through SafetyGate(UrRobot) in a process of its own and is struck: by the controller's
faults, by signals to the client process, to its owner or to both, by a network that loses one direction, by two faults at once,
by a fault while connecting, stopping or disconnecting. Measured by the controller's own record, in its own time: from the strike
to the last period with the arc on, and to the last with a joint over 0.001 rad/s. The log and the black box are held against
that record, every period of it; the next connection is tried at once, as things are; the next weld follows. Exits 1 where a
limit is broken. Writes Markdown and JSON.

    python experiments/23_fault_drills.py [--profiles cb3 e] [--cases NAME ...] [--times 3] [--speed 1] [--record]

Detection takes wall time, a controller slower than the wall (--speed below 1) hides some of it: figures are those of --speed 1.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from weldsim.records import JointTrajectory

sys.path.insert(0, str(Path(__file__).parent))
from drill_cell import HOSTS, LENGTH, SCENE, Cell, cell_of, place
from figures import record

RESULTS = Path(__file__).parent / "results"
AT_REST = 1e-3  # [rad/s]: a joint of the weld turns faster
SEEN_AT_REST = 0.02  # [rad/s] what a log may end with
NETWORK = ("link-drop", "stall", "deaf", "mute", "dashboard-gone", "dashboard-silent")  # these pass by themselves
ATTEMPTS = 4  # a machine that others use holds up the weld itself now and then
LIMIT, LIMIT_KILLED = 0.3, 0.5  # [s]


@dataclass(frozen=True)
class Case:
    """A way to go wrong.

    Attributes:
        acts: what happens, [s] after the strike, with a number.  rules: that may be named as the reason.
        limit: for arc and arm [s].  profiles: that know it.  when: the instants it is struck at.
        owner: what becomes of the owner: "told" the reason, "dead".  blind: seconds for which there is nothing to be logged.
        again: rule that keeps the next connection from being made before somebody clears the fault; None where nothing does.
    """

    acts: tuple[tuple[float, str, float], ...]
    rules: tuple[str | None, ...] = ()
    limit: float = LIMIT
    profiles: tuple[str, ...] = ("cb3", "e")
    when: tuple[str, ...] = ("weld", "weld", "air", "first", "last")
    owner: str = "told"
    blind: float = 0.0
    again: str | None = None


def one(name: str, number: float = 1.0) -> tuple[tuple[float, str, float], ...]:
    return ((0.0, name, number),)


ODD = ("weld", "air")
CASES = {
    "client killed": Case(one("kill-client"), ("client",), LIMIT_KILLED),
    "link dropped": Case(one("link-drop", 0.4), ("link",), blind=0.6),
    "protective stop": Case(one("protective-stop"), ("protective_stop",), again="protective_stop"),
    "emergency stop": Case(one("emergency-stop"), ("emergency_stop",), again="emergency_stop"),
    "stall of 1 s": Case(one("stall", 1.0), ("silence", "client"), blind=1.1),
    "cable out for 4 s": Case(one("stall", 4.0), ("silence", "client"), when=("weld",), blind=4.1),
    "foreign program": Case(one("foreign-program"), ("foreign_program", "tracking")),
    "remote control off": Case(one("local-control"), ("remote_control",), profiles=("e",), again="remote_control"),
    "client held": Case(one("hold-client"), ("client",), LIMIT_KILLED, when=ODD),
    "owner killed": Case(one("kill-owner"), limit=LIMIT_KILLED, owner="dead", when=ODD),
    "owner and client killed": Case((*one("kill-client"), *one("kill-owner")), limit=LIMIT_KILLED, owner="dead", when=ODD),
    "owner and client held": Case(
        (*one("hold-client"), *one("hold-owner"), (0.8, "go-owner", 0)), ("client", "program", "stall"), LIMIT_KILLED, when=ODD
    ),
    "owner held 0.6 s": Case(((0.0, "hold-owner", 0), (0.6, "go-owner", 0)), ("stall",), when=ODD),
    "nothing reaches the controller": Case(one("deaf", 1.0), ("client", "program", "silence", "stall"), when=ODD),
    "nothing leaves the controller": Case(one("mute", 1.0), ("silence", "client", "link"), blind=1.1, when=ODD),
    "client killed, dashboard gone": Case((*one("kill-client"), *one("dashboard-gone", 2.0)), ("client",), LIMIT_KILLED, when=ODD),
    "protective stop, dashboard silent": Case(
        (*one("protective-stop"), *one("dashboard-silent", 2.0)), ("protective_stop",), when=ODD, again="protective_stop"
    ),
    "foreign program, dashboard silent": Case(
        (*one("foreign-program"), *one("dashboard-silent", 2.0)), ("program", "arc", "follow", "tracking"), when=ODD
    ),
    "protective stop, link dropped": Case(
        (*one("protective-stop"), *one("link-drop", 0.4)), ("protective_stop", "link"), blind=0.6, when=ODD, again="protective_stop"
    ),
    "emergency stop after client killed": Case(
        (*one("kill-client"), (0.03, "emergency-stop", 1.0)), ("client", "emergency_stop"), when=ODD, again="emergency_stop"
    ),
    "link dropped while connecting": Case(one("link-drop", 0.4), ("connection", "link", None), when=("connect",) * 3, blind=0.6),
    "protective stop while connecting": Case(
        one("protective-stop"), ("protective_stop", None), when=("connect",) * 3, again="protective_stop"
    ),
    "emergency stop while connecting": Case(
        one("emergency-stop"), ("emergency_stop", None), when=("connect",) * 3, again="emergency_stop"
    ),
    "stall of 1 s while connecting": Case(
        one("stall", 1.0), ("connection", "silence", "client", None), when=("connect",) * 2, blind=1.1
    ),
    "foreign program while connecting": Case(one("foreign-program"), ("foreign_program", "tracking", None), when=("connect",) * 2),
    "remote control off while connecting": Case(
        one("local-control"), ("remote_control", None), profiles=("e",), when=("connect",) * 2, again="remote_control"
    ),
    "link dropped while stopping": Case(one("link-drop", 0.4), ("asked",), when=("stop",) * 2, blind=0.6),
    "client killed while stopping": Case(one("kill-client"), ("asked",), LIMIT_KILLED, when=("stop",) * 2),
    "emergency stop while stopping": Case(one("emergency-stop"), ("asked",), when=("stop",) * 2, again="emergency_stop"),
    "link dropped while disconnecting": Case(one("link-drop", 0.4), (None, "link"), when=("end",) * 2, blind=0.6),
    "client held while disconnecting": Case(one("hold-client"), (None, "client"), LIMIT_KILLED, when=("end",) * 2),
    "client killed while disconnecting": Case(one("kill-client"), (None, "client"), LIMIT_KILLED, when=("end",) * 2),
    "nothing": Case((), (None,), when=("weld",)),
}


def instant(when: str, trajectory: JointTrajectory, random: np.random.Generator) -> tuple[str, float]:
    """The event and the delay [s] after it of one strike."""
    t, on = trajectory.t, trajectory.t[trajectory.arc_on]
    burning, end = on[-1] - on[0], t[-1]
    match when:
        case "weld":
            return "arc on", random.uniform(0.05, burning - 0.05)
        case "first":
            return "arc on", random.uniform(0.0, 0.05)
        case "last":
            return "arc on", burning - random.uniform(0.0, 0.05)
        case "air":
            air = random.uniform(0.1, on[0] + (end - on[-1]) - 0.3)
            return "motion", float(air if air < on[0] else air + burning)
        case "connect":
            return "now", random.uniform(0.0, 0.6)
        case "stop":
            return "arc off", random.uniform(0.0, 0.08)
    return "arc off", end - on[-1] + 0.2 + random.uniform(0.0, 0.3)


def repeated(cell: Cell, name: str, when: str, random: np.random.Generator) -> dict[str, Any]:
    """One strike, again where something was wrong; what was wrong before is kept."""
    event, delay = instant(when, cell.trajectory, random)
    share, before = random.uniform(0.45, 0.55), []
    while True:
        row = drill(cell, name, when, event, delay, share)
        if not row["wrong"] or len(before) == ATTEMPTS - 1:
            return row | {"before": before}
        before.append("; ".join(row["wrong"]))
        print(f"      again after: {before[-1]} (late {row['late']}, lost {row['lost']:.3f} s)", flush=True)


def drill(cell: Cell, name: str, when: str, event: str, delay: float, share: float) -> dict[str, Any]:
    """One weld, struck once, and what came of it."""
    case, controller, owner = CASES[name], cell.controller, cell.ready()
    controller.ask(mend=True)
    place(cell.host, cell.start)
    strike = {"after": event, "delay": delay, "acts": case.acts}
    controller.ask(watch=True)
    if when == "connect":
        controller.ask(strike=strike)
    boxes = tempfile.mkdtemp(dir=cell.folder)
    owner.tell(run={"boxes": boxes, "stop_at": share if when == "stop" else None})
    said = owner.hear()
    if said and "connected" in said:
        if when != "connect" and case.acts:
            controller.ask(strike=strike, pids={"owner": owner.process.pid, "client": said["connected"]})
        said = owner.hear()
    seen = {"rule": "HANG"} if said is None else said.get("ended", {"rule": "DEAD", "text": " ".join(owner.heard[-3:])})
    if said is None:
        owner.end()
    time.sleep(0.9 if case.owner == "dead" else 0.1)
    file = cell.folder / "rows.npz"
    answer = controller.ask(rows=str(file))
    with np.load(file) as rows:
        row = judged(case, name, when, seen, {key: rows[key] for key in rows.files}, answer)
    if case.acts:
        row["wrong"] += next_connection(cell, case)
    return row | {"profile": cell.profile, "delay": delay}


def next_connection(cell: Cell, case: Case) -> list[str]:
    """What is wrong about a connection made at once, once the network is whole again, by whom nobody has helped."""
    time.sleep(max([0.0] + [number for _, name, number in case.acts if name in NETWORK]))
    owner = cell.ready()
    owner.tell(again=True)
    said = owner.hear()
    if not said:
        owner.end()
        return ["the next connection hangs" if said is None else "the owner died of the next connection"]
    return [] if said["again"] == case.again else [f"next connection: {said['again']}: {said['text']} ({said['took']:.1f} s)"]


def judged(case: Case, name: str, when: str, seen: dict[str, Any], rows: dict[str, np.ndarray], answer: Any) -> dict[str, Any]:
    """Times of one strike, and what is wrong about it."""
    wrong: list[str] = []
    struck = answer["struck"][0][0] if answer["struck"] else None
    reason = seen.get("text", "").split("; black box")[0]  # whose path is this machine's own
    row: dict[str, Any] = {"case": name, "when": when, "rule": seen["rule"], "text": reason}
    if struck is None and case.acts:
        wrong.append("was not struck")
    # A fault may be over before the arm moves: then there is nothing to be measured.
    if struck is not None and (when != "connect" or seen["rule"] in set(case.rules) - {None}):
        for key, mask in (("arc", rows["arc"] > 0), ("rest", rows["speed"] > AT_REST)):
            late = rows["t"][mask & (rows["t"] >= struck)]
            row[key] = float(late[-1] - struck) if len(late) else 0.0
            if row[key] > case.limit:
                wrong.append(f"{key} after {row[key]:.3f} s (limit {case.limit:g} s)")
    if case.owner == "dead":
        if seen["rule"] != "DEAD":
            wrong.append(f"the owner lives: {seen['rule']}")
    elif seen["rule"] not in case.rules:
        wrong.append(f"reason {seen['rule']}: {reason}")
    wrong += log_troubles(case, seen, rows, struck)
    row |= {"lost": answer["lost"], "late": seen.get("late"), "disconnect": seen.get("disconnect"), "wrong": wrong}
    if wrong:
        row |= {"controller": answer["log"][-6:], "events": seen.get("events", [])[-8:]}
    return row


def log_troubles(case: Case, seen: dict[str, Any], rows: dict[str, np.ndarray], struck: float | None) -> list[str]:
    """What the log and the black box lack of the controller's own record."""
    wrong = []
    if seen.get("disconnect", 0.0) > 4.0:
        wrong.append(f"disconnect took {seen['disconnect']:.1f} s")
    if seen.get("log"):
        t = np.array(seen["log"]) + seen["origin"]
        mine = np.round(t / seen["period"]).astype(int)
        have = np.round(rows["t"] / seen["period"]).astype(int)
        inside = have[(have >= mine[0]) & (have <= mine[-1])]
        missing = np.setdiff1d(inside, mine) * seen["period"]
        if struck is not None:
            missing = missing[(missing < struck - 0.1) | (missing > struck + case.blind)]
        if len(missing):
            wrong.append(f"{len(missing)} periods not in the log, from {missing[0] - t[0]:.3f} s")
        if len(np.unique(mine)) < len(mine):
            wrong.append("a period twice in the log")
        unseen = "unseen" in {kind for _, kind, _ in seen["events"]}
        if unseen and "not seen" not in seen["text"]:
            wrong.append("the reason does not say that rest was not seen")
        if not unseen and (seen["last_arc"] or seen["last_speed"] > SEEN_AT_REST):
            wrong.append(f"log ends with arc {seen['last_arc']}, {seen['last_speed']:.3f} rad/s")
        if seen["rule"] and not any(seen["rule"] == kind or text in seen["text"] for _, kind, text in seen["events"]):
            wrong.append(f"no event tells of {seen['rule']}")
    box = seen.get("box")
    if seen["rule"] and seen["rule"] not in ("asked", "DEAD", "HANG") and seen.get("log"):
        if box is None:
            wrong.append("no black box")
        elif seen["text"].split("; black box")[0] not in box["reason"] and box["reason"] not in seen["text"]:
            wrong.append(f"black box says {box['reason']!r}")
    if box is not None:
        if "unseen" not in box["kinds"] and (box["arc"] or box["speed"] > SEEN_AT_REST):
            wrong.append(f"black box ends with arc {box['arc']}, {box['speed']:.3f} rad/s")
        t = np.round((np.array(box["t"]) + seen["origin"]) / (h := seen.get("period", 0.002))).astype(int)
        have = np.round(rows["t"] / h).astype(int)
        missing = np.setdiff1d(have[(have >= t[0]) & (have <= t[-1])], t) * h
        if struck is not None:
            missing = missing[(missing < struck - 0.1) | (missing > struck + case.blind)]
        if len(missing):
            wrong.append(f"{len(missing)} periods not in the black box, from {missing[0] - seen['origin']:.3f} s")
    return wrong


def summary(rows: list[dict[str, Any]], speed: float) -> str:
    """A row for each case and profile: median and worst."""
    lines = [
        f"A weld of {1e3 * LENGTH:g} mm on `{SCENE}` struck at random instants; times from the controller's own record, in its time"
        f" (clock at {speed:g} of the wall's).",
        "",
        "| what goes wrong | controller | strikes | arc off, median / worst [s] | at rest, median / worst [s] | limit | holds |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in CASES:
        for profile in HOSTS:
            mine = [row for row in rows if row["case"] == name and row["profile"] == profile]
            if not mine:
                continue
            cells = []
            for key in ("arc", "rest"):
                values = [row[key] for row in mine if key in row]
                cells.append(f"{np.median(values):.3f} / {max(values):.3f}" if values else "-")
            bad = sum(bool(row["wrong"]) for row in mine)
            holds = "yes" if not bad else f"no ({bad})"
            lines.append(f"| {name} | {profile} | {len(mine)} | {cells[0]} | {cells[1]} | {CASES[name].limit:g} | {holds} |")
    lines.append("")
    lines += [
        f"* {row['case']}, {row['profile']}, {row['when']} + {row['delay']:.3f} s: {'; '.join(row['wrong'])}"
        for row in rows
        if row["wrong"]
    ]
    return "\n".join(lines).rstrip() + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--profiles", nargs="*", choices=list(HOSTS), default=list(HOSTS))
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--times", type=int, default=1, help="rounds of all instants of a case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    options = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "egl")
    rows: list[dict[str, Any]] = []
    for profile in options.profiles:
        with tempfile.TemporaryDirectory() as folder, cell_of(profile, options.speed, Path(folder)) as cell:
            for name in options.cases:
                case = CASES[name]
                if profile not in case.profiles:
                    continue
                random = np.random.default_rng([options.seed, list(CASES).index(name)])
                for when in case.when * options.times:
                    rows.append(row := repeated(cell, name, when, random))
                    times = "  ".join(f"{key} {row[key]:.3f}" for key in ("arc", "rest") if key in row)
                    print(f"{profile:3} {name:36} {when:8} {row['delay']:.3f}  {times}  {row['rule']}", flush=True)
                    for line in (*row["wrong"], *row.get("controller", ()), *row.get("events", ())):
                        print(f"      {line}", flush=True)
    text = summary(rows, options.speed)
    print(text)
    options.out.mkdir(exist_ok=True, parents=True)
    (options.out / "23_fault_drills.md").write_text(text)
    (options.out / "23_fault_drills.json").write_text(json.dumps({"speed": options.speed, "rows": rows}, indent=1) + "\n")
    if options.record and set(options.cases) == set(CASES) and set(options.profiles) == set(HOSTS):
        command = "python experiments/23_fault_drills.py --record"
        for key, limit in (("drill_faults", LIMIT), ("drill_killed", LIMIT_KILLED)):
            mine = [row for row in rows if CASES[row["case"]].limit == limit]
            record(key, command, **{name: max(row.get(name, 0.0) for row in mine) for name in ("arc", "rest")})
    return 1 if any(row["wrong"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
