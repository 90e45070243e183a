"""The five workpieces welded from the twin's scan: by the simulated arm, and over sockets on both virtual controllers.

Each scene is scanned and planned by the pipeline; its path goes through `weldsim.welding.job.weld`, as `weldsim execute` does it:
contract, dry run from where the arm stands, safety gate. The controllers are `weldsim controller` in a process of their own, driven
by the ur_rtde client through `UrRobot`. Judged are the executed tip against the plan, what was commanded against the arm's limits,
collisions, and where the arc came on and went off. Exits 1 where a limit is broken. Writes Markdown and JSON.

    python experiments/21_execute_scenes.py [--scenes straight y] [--robots sim cb3 e] [--speed 1] [--record]
    python experiments/21_execute_scenes.py --robots cb3 e --calibration experiments/published_ur5.conf

With --speed below 1 the controllers' clock runs slower than the wall's: for a machine that cannot keep 500 Hz. With --calibration
the controllers' arm has the DH figures of that file, and the tip is where they put it; results go to files of their own.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from weldsim.config import CellConfig, load_scene, paced_for
from weldsim.controller.ask import ask
from weldsim.dryrun.cell import scene_cell
from weldsim.dryrun.read import read_program
from weldsim.execution.contract import own_arm
from weldsim.execution.robot import Robot
from weldsim.execution.simulated import SimulatedRobot
from weldsim.execution.ur_robot import UrRobot
from weldsim.jobs import to_weld
from weldsim.path.files import path_document, write_path_json
from weldsim.pipeline import look, plan
from weldsim.records import ExecutionLog, Segment
from weldsim.welding.job import Job, JobConfig, weld
from weldsim.welding.seams import file_findings

sys.path.insert(0, str(Path(__file__).parent))
from figures import ROWS, record

RESULTS = Path(__file__).parent / "results"
SCENES = ("straight", "curve", "cylinder", "cuboid", "y")
ROBOTS = ("sim", "cb3", "e")
LIMITS = {"p95": 0.3e-3, "joint_speed": 3.0, "joint_acceleration": 10.0, "joint_jerk": 350.0, "torch_speed": 0.25, "ends": 1e-3}
WORDS = {
    "p95": ("tip p95", 1e3, "mm"),
    "max": ("max", 1e3, "mm"),
    "joint_speed": ("joint speed", 1.0, "rad/s"),
    "joint_acceleration": ("acceleration", 1.0, "rad/s2"),
    "joint_jerk": ("jerk", 1.0, "rad/s3"),
    "torch_speed": ("torch", 1e3, "mm/s"),
    "ends": ("arc off its ends", 1e3, "mm"),
}


@contextmanager
def controller(profile: str, scene: str, speed: float, host: str, calibration: Path | None) -> Iterator[str]:
    """The address of a controller in its own process while the block lasts."""
    command = [sys.executable, "-m", "weldsim", "controller", "--profile", profile, "--host", host, "--speed", str(speed)]
    command += ["--scene", scene] if calibration is None else ["--scene", scene, "--calibration", str(calibration)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            if host not in process.stdout.readline():
                raise SystemExit(f"no controller at {host}")
            yield host
        finally:
            process.terminate()
            process.wait()


def executed(scene_name: str, robot: str, file: Path, speed: float, seed: int, calibration: Path | None = None) -> dict[str, Any]:
    """One scene welded by one robot, measured."""
    scene = load_scene(scene_name)
    config = paced_for(CellConfig(), scene)
    program = read_program(file, speed=config.path.speed)
    findings, _ = file_findings(program, file)
    cell, job = scene_cell(scene), JobConfig(arc=True)

    def done_by(arm: Robot) -> Job:
        return weld(program, findings, arm, cell, config, job, scene=scene)

    events: list[str] = []
    if robot == "sim":
        done = done_by(SimulatedRobot(cell.model, cell.q_start, config.execution.simulation))
    else:
        host = f"127.32.{ROBOTS.index(robot)}.{SCENES.index(scene_name) + 1}"
        with controller(robot, scene_name, speed, host, calibration):
            done = done_by(UrRobot(replace(config.execution.ur, host=host)))
            events = [str(line) for line in ask(host, {"status": True}).get("log", [])]
    row: dict[str, Any] = {"scene": scene_name, "robot": robot, "seed": seed, "figures": {}, "broken": []}
    if done.log is None or done.stopped is not None:
        failure = done.trial.failure if done.trial is not None else None
        row["broken"] = [f"not welded: {done.stopped or (failure.text if failure else 'no reason')}"]
        row["controller"] = events[-6:]
    if done.log is not None:
        row["figures"] = measured(done.log, done)
        row["arc"] = [event.text for event in done.log.events if event.kind == "arc"]
        contacts = [event.text for event in done.log.events if event.kind == "contact"]
        contacts += [line for line in events if "touches" in line]
        row["broken"] += [f"collision: {text}" for text in contacts]
        row["broken"] += [
            f"{WORDS[name][0]} {WORDS[name][1] * row['figures'][name]:.3g} over {WORDS[name][1] * limit:g} {WORDS[name][2]}"
            for name, limit in LIMITS.items()
            if row["figures"][name] > limit * 1.001
        ]
    return row


def measured(log: ExecutionLog, done: Job) -> dict[str, float]:
    """Figures of a log [SI]: the measured tip from the planned line; differences of what was sent; where the arc burnt."""
    assert done.report is not None
    assert done.facts is not None
    # A state that nobody had time to look at repeats the command before it in the log: commands are told by what is new.
    h, q = log.period, log.q_cmd[np.concatenate([[True], (np.diff(log.q_cmd, axis=0) != 0).any(axis=1)])]
    speed = np.diff(q, axis=0) / h
    jerk, acceleration = np.diff(speed, n=2, axis=0) / h**2, np.diff(speed, axis=0) / h
    torch = np.linalg.norm(np.diff(own_arm(done.facts).torch_tip(q), axis=0), axis=1) / h
    weld_rows = np.array([segment == Segment.WELD for segment in log.segments])
    burnt, asked = log.s_cmd[log.arc_on], log.s_cmd[weld_rows]
    # An output is reported off a few periods after it was told: what counts is how far the torch is by then, and never in the air.
    air_rows = np.array([segment == Segment.AIR for segment in log.segments])
    stray = float("inf") if not len(burnt) or (log.arc_on & air_rows).any() else 0.0
    ends = max(abs(burnt[0] - asked[0]), abs(burnt[-1] - asked[-1])) if len(burnt) else float("inf")
    return {
        "p95": float(done.report.tracking_p95 or np.inf),
        "max": float(done.report.tracking_max or np.inf),
        "joint_speed": float(np.abs(speed).max()),
        "joint_acceleration": float(np.abs(acceleration).max()),
        "joint_jerk": float(np.abs(jerk).max()),
        "torch_speed": float(torch.max()),
        "ends": max(float(ends), stray),
        "time": float(log.t[-1] - log.t[0]),
    }


def path_of(scene_name: str, folder: Path, seed: int) -> Path:
    """The path that the pipeline plans on the twin's scan, as a file."""
    config = CellConfig()
    seen = look(load_scene(scene_name), config, seed=seed)
    result = plan(seen.cloud, config)
    index, path = to_weld(result, None, None)
    if path is None:
        raise SystemExit(f"{scene_name}: no seam found")
    seam = result.findings.seams[index]
    file = folder / f"{scene_name}.json"
    write_path_json(file, path_document((seam,), (path,), {}, {"scene": scene_name, "seed": seed}, result.config_digest))
    return file


def markdown(rows: list[dict[str, Any]], speed: float, calibration: Path | None = None) -> str:
    """A row for each scene and robot; the limits; what is broken."""
    names = list(WORDS)
    head = " | ".join(
        f"{word} [{unit}]" + (f" (<= {scale * LIMITS[name]:g})" if name in LIMITS else "")
        for name, (word, scale, unit) in WORDS.items()
    )
    lines = [
        "Welded from the twin's scan through the safety gate; sim: the simulated arm in this process, cb3 and e: the ur_rtde client"
        f" over sockets to a virtual controller (clock at {speed:g} of the wall's)."
        + (
            ""
            if calibration is None
            else f" The controller's arm has the DH figures of {calibration.name}, the tip is where they put it."
        ),
        "",
        f"| scene | robot | time | {head} | collisions | holds |",
        "|---" * (len(names) + 5) + "|",
    ]
    for row in rows:
        figures = row["figures"]
        cells = [f"{WORDS[name][1] * figures[name]:.3g}" if name in figures else "-" for name in names]
        touched = sum("collision" in text for text in row["broken"])
        time = f"{figures['time']:.1f} s" if figures else "-"
        lines.append(
            f"| {row['scene']} | {row['robot']} | {time} | {' | '.join(cells)} | {touched} | {'no' if row['broken'] else 'yes'} |"
        )
    lines.append("")
    lines += [f"* {row['scene']}, {row['robot']}: {'; '.join(row['broken'])}" for row in rows if row["broken"]]
    return "\n".join(lines).rstrip() + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="*", choices=SCENES, default=list(SCENES))
    parser.add_argument("--robots", nargs="*", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--calibration", type=Path, help="factory calibration of the controllers' arm, a calibration.conf")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--record", action="store_true", help="write the figures of README.md too")
    options = parser.parse_args()
    if options.calibration is not None and (options.record or "sim" in options.robots):
        parser.error("--calibration goes with --robots cb3 e, and without --record")
    os.environ.setdefault("MUJOCO_GL", "egl")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes:
            file = path_of(scene, Path(folder), options.seed)
            for robot in options.robots:
                row = executed(scene, robot, file, options.speed, options.seed, options.calibration)
                rows.append(row)
                shown = ", ".join(f"{w} {k * row['figures'][n]:.3g} {u}" for n, (w, k, u) in WORDS.items() if n in row["figures"])
                print(
                    f"{scene}, {robot}: {shown}; {'; '.join(row['broken']) or 'holds'}; {row.get('arc')}",
                    *row.get("controller", ()),
                    sep="\n    ",
                    flush=True,
                )
    text = markdown(rows, options.speed, options.calibration)
    name = "21_execute_scenes" if options.calibration is None else "21_execute_scenes_calibrated"
    print(text)
    options.out.mkdir(exist_ok=True)
    (options.out / f"{name}.md").write_text(text)
    (options.out / f"{name}.json").write_text(json.dumps({"speed": options.speed, "rows": rows}, indent=1) + "\n")
    complete = set(options.scenes) == set(SCENES) and set(options.robots) == set(ROBOTS)
    if options.record and complete and not any("not welded" in text for row in rows for text in row["broken"]):
        command = "python experiments/21_execute_scenes.py --record"
        for robot, key in (("sim", "execute_sim"), ("cb3", "execute_cb3"), ("e", "execute_e")):
            if key in ROWS:
                record(key, command, p95=max(row["figures"]["p95"] for row in rows if row["robot"] == robot))
    return 1 if any(row["broken"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
