"""Exported URScript on the virtual controller: sent over its script port as any client would, followed through RTDE.

Each scene is scanned and planned, the path goes through `weldsim dry-run --export`, and the program it writes is sent to
port 30003 of a `weldsim controller` in a process of its own that has the same scene on its table; the thesis author's program of
the Y shape (poses of `tool0`, no scene) likewise. Judged are, while the arc output is on: the greatest distance of the reported
TCP from the planned path, and of the planned path from where the TCP has been; the speed along the weld; where the arc comes
on and goes off. Exits 1 where a limit is broken. Writes Markdown and JSON.

    python experiments/22_exported_scripts.py [--scenes straight y thesis] [--profiles cb3 e] [--speed 2] [--record]
"""

import argparse
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from weldsim.cli import main as run_command
from weldsim.config import load_scene
from weldsim.curves import arc_length, project
from weldsim.dryrun.cell import empty_cell, scene_cell
from weldsim.dryrun.read import read_program
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType, unpack_values
from weldsim.execution.ur_ports import REALTIME, RTDE
from weldsim.frames import Transform
from weldsim.kinematics import torch_pose
from weldsim.output import write_whole
from weldsim.records import TorchPath

sys.path.insert(0, str(Path(__file__).parent))
from figures import record

RESULTS = Path(__file__).parent / "results"
SCENES = ("straight", "curve", "cylinder", "cuboid", "y")
THESIS = "thesis"  # the author's own program, no scene
ADDRESS = "127.31.0.{}"
RECIPE = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "actual_digital_output_bits": "UINT64",
    "runtime_state": "UINT32",
    "safety_mode": "INT32",
}
PLAYING, NORMAL, ARC = 2, 1, 1  # runtime state, safety mode, bit of digital output 0
LIMITS = {"off": 0.2e-3, "missed": 0.2e-3, "speed": 0.02, "start": 0.2e-3, "end": 0.2e-3}
WINDOW = 0.1  # [s] over which speed is measured
CORNER, BEND = np.deg2rad(5.0), 3e-3  # [rad] within [m]: a corner of the path, or an edge of the part
SLOW = 0.01  # share by which a place that is planned slower is no longer judged
QUIET = 30.0  # [s] without a packet


@dataclass(frozen=True, eq=False, kw_only=True)
class Ride:
    """What RTDE told of one program. Attributes: t (k,) [s]; tip (k, 3) TCP in the base [m]; arc (k,); ended: it ran to its end."""

    t: np.ndarray
    tip: np.ndarray
    arc: np.ndarray
    ended: bool


@contextmanager
def controller(profile: str, scene: str | None, speed: float, host: str) -> Iterator[None]:
    """A controller in its own process while the block lasts."""
    command = [sys.executable, "-m", "weldsim", "controller", "--profile", profile, "--host", host, "--speed", str(speed)]
    command += ["--scene", scene] if scene else []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            if host not in process.stdout.readline():
                raise SystemExit(f"no controller at {host}")
            yield
        finally:
            process.terminate()
            process.wait()


def ride(host: str, text: str) -> Ride:
    """The program sent to the script port and followed to its end; without an end where it does not begin or is stopped."""
    patience = time.monotonic() + QUIET
    rows: list[list[Any]] = []
    reader, began, ended, normal = PacketReader(), False, False, False
    with socket.create_connection((host, RTDE), timeout=QUIET) as sock:
        setup = struct.pack(">d", 1e3) + ",".join(RECIPE).encode()
        for packet in (
            Packet(PacketType.PROTOCOL_VERSION, b"\x00\x02"),
            Packet(PacketType.SETUP_OUTPUTS, setup),
            Packet(PacketType.START, b""),
        ):
            sock.sendall(packet.encode())
        with socket.create_connection((host, REALTIME), timeout=QUIET) as script:
            script.sendall(text.encode())
            while not ended:
                for packet in reader.feed(sock.recv(65536)):
                    if packet.type != PacketType.DATA:
                        continue
                    row = unpack_values(list(RECIPE.values()), packet.payload[1:])
                    playing = row[4] == PLAYING
                    if row[5] != NORMAL or (began and not playing) or (not began and time.monotonic() > patience):
                        ended = True
                    normal = began and row[5] == NORMAL
                    if playing:
                        began = True
                        rows.append(row)
    return Ride(
        t=np.array([row[0] for row in rows]),
        tip=np.array([row[2][:3] for row in rows]),
        arc=np.array([bool(row[3] & ARC) for row in rows]),
        ended=normal,
    )


def speeds(tips: np.ndarray, weld: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Where along the weld [m] and how fast [m/s] tips sampled every `period` go, over WINDOW and along the way they went."""
    n = max(1, round(WINDOW / period))
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tips, axis=0), axis=1))])
    speed = (gone[n:] - gone[:-n]) / (n * period)
    return project(tips, weld)[2][n // 2 : n // 2 + len(speed)], speed


def corners(X_BT: Transform) -> np.ndarray:
    """Arc lengths [m] of the ends of a path, and of where the path or the wire turns by more than CORNER within BEND."""
    along = np.diff(X_BT.p, axis=0) / np.linalg.norm(np.diff(X_BT.p, axis=0), axis=1)[:, None]
    s = arc_length(X_BT.p)
    before, after = np.searchsorted(s, s - BEND / 2), np.searchsorted(s, s + BEND / 2, side="right") - 1
    turned = np.zeros(len(s), bool)
    for rows, first, last in (
        (along, np.maximum(np.minimum(before, np.arange(len(s)) - 1), 0), np.minimum(after, len(along) - 1)),
        (X_BT.R[:, :, 2], before, after),
    ):
        turned |= np.sum(rows[first] * rows[last], axis=1) < np.cos(CORNER)
    turned[[0, -1]] = True
    return s[turned]


def judged(ride: Ride, path: TorchPath, targets: np.ndarray, period: float) -> dict[str, float]:
    """The figures of one weld [SI]; targets (n, 3), the tips that the program streams every `period` with the arc on."""
    on, weld = np.flatnonzero(ride.arc), path.X_BT.p[path.weld]
    if not len(on):
        return {"off": np.inf}
    runs = np.split(on, np.flatnonzero(np.diff(on) > 1) + 1)
    burning, t, asked = ride.tip[on], ride.t[on], float(np.median(path.speed[path.weld]))
    s, speed = speeds(burning, weld, float(np.median(np.diff(t))))
    s_asked, planned = speeds(targets, weld, period)
    # Ramps, and where joint limits slow the weld, are planned slower; at a corner of the path the tip rounds it or stands.
    slow = np.concatenate([s_asked[planned < (1 - SLOW) * asked], corners(path.X_BT[path.weld])])
    steady = np.abs(s[:, None] - slow).min(axis=1) > 2 * asked * WINDOW if len(slow) else np.ones(len(s), bool)
    error = np.abs(speed[steady] / asked - 1) if steady.any() else np.array([np.inf])
    return {
        "off": float(project(burning, weld)[0].max()),
        "missed": float(project(weld, burning)[0].max()),
        "speed": float(np.percentile(error, 99)),
        "speed_max": float(error.max()),
        "steady": float(steady.mean()),
        "start": float(np.linalg.norm(burning[0] - weld[0])),
        "end": float(np.linalg.norm(burning[-1] - weld[-1])),
        "arcs": float(len(runs)),
        "length": float(path.s[-1]),
        "time": float(t[-1] - t[0]),
    }


def exported(name: str, folder: Path) -> tuple[Path, TorchPath] | str:
    """The program that `dry-run --export` writes and the path it should follow, or why there is none."""
    script = folder / f"{name}.script"
    if name == THESIS:
        data = os.environ.get("WELDSIM_DATA")
        if data is None:
            return "WELDSIM_DATA is not set"
        source, around = Path(data) / "real" / "thesis_paths" / "ur_y_shape.csv", ["--empty"]
    else:
        source, around = folder / name / "path.json", ["--scene", name]
        if run_command(["run", name, "--out", str(folder / name), "--json"]) > 1:
            return "no path was planned"
    if run_command(["dry-run", str(source), *around, "--no-fix", "--export", str(script), "--json"]) != 0:
        return "the dry run fails"
    return script, read_program(source).paths[0]


def measure(names: list[str], profiles: list[str], speed: float) -> list[dict[str, Any]]:
    """A row for each job and profile."""
    out: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            found = exported(name, Path(folder))
            for k, profile in enumerate(profiles):
                if isinstance(found, str):
                    out.append({"job": name, "profile": profile, "broken": [found]})
                    continue
                host, began = ADDRESS.format(k + 1), time.perf_counter()
                with controller(profile, None if name == THESIS else name, speed, host):
                    rode = ride(host, found[0].read_text())
                cell = empty_cell() if name == THESIS else scene_cell(load_scene(name))
                burning = [motion for motion in read_program(found[0], q_start=cell.q_start).motions if motion.arc]
                figures = judged(rode, found[1], torch_pose(np.array([motion.q for motion in burning])).p, burning[0].t)
                broken = [
                    f"{key} {value:.3g} (limit {limit:g})"
                    for key, limit in LIMITS.items()
                    if not (value := figures.get(key, np.inf)) <= limit
                ]
                broken += [] if rode.ended else ["stopped on its way"]
                broken += [] if figures.get("arcs") == 1 else [f"the arc is on {figures.get('arcs', 0):.0f} times"]
                out.append({"job": name, "profile": profile, **figures, "broken": broken})
                print(f"{name} {profile}: {', '.join(broken) or 'holds'} ({time.perf_counter() - began:.0f} s)", file=sys.stderr)
    return out


SHOWN = {
    "off": "off mm",
    "missed": "missed mm",
    "speed": "speed p99 %",
    "speed_max": "max %",
    "steady": "steady %",
    "start": "arc on mm",
    "end": "arc off mm",
    "length": "length mm",
}
SCALE = {"speed": 1e2, "speed_max": 1e2, "steady": 1e2}


def markdown(rows: list[dict[str, Any]]) -> str:
    """A table, a row for each job and profile, and the limits that are broken."""
    lines = [
        "Exported URScript run by the virtual controller, while the arc output is on. off: greatest distance of the TCP from the",
        "planned path; missed: of the path from where the TCP was; speed: error of it in the steady share of the arc's time,",
        "where the plan has the asked speed (not in ramps, where path or wire bend sharply, or where joint limits slow the weld);",
        "arc on, arc off: distance of the TCP from the weld's ends when the output switches.",
        "",
        f"| job | profile | {' | '.join(SHOWN.values())} | arc s |",
        "|---|---|" + "---|" * (len(SHOWN) + 1),
    ]
    for row in rows:
        cells = [
            f"{SCALE.get(key, 1e3) * row[key]:.{1 if key in ('length', 'steady') else 3}f}" if key in row else "-" for key in SHOWN
        ]
        lines.append(f"| {row['job']} | {row['profile']} | {' | '.join(cells)} | {row.get('time', float('nan')):.1f} |")
    limits = ", ".join(f"{SHOWN[key]} {SCALE.get(key, 1e3) * limit:g}" for key, limit in LIMITS.items())
    broken = [f"* {row['job']}, {row['profile']}: {'; '.join(row['broken'])}" for row in rows if row["broken"]]
    return "\n".join([*lines, "", f"Limits: {limits}. Broken: {'' if broken else 'none.'}", *broken]) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", choices=(*SCENES, THESIS), default=[*SCENES, THESIS])
    parser.add_argument("--profiles", nargs="+", choices=("cb3", "e"), default=["cb3", "e"])
    parser.add_argument("--speed", type=float, default=2.0, help="simulated seconds in a second")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the table and the figures")
    parser.add_argument("--record", action="store_true", help="keep the figures for README.md")
    asked = parser.parse_args()
    rows = measure(asked.scenes, asked.profiles, asked.speed)
    text = markdown(rows)
    print(text)
    asked.out.mkdir(parents=True, exist_ok=True)
    write_whole(asked.out / "22_exported_scripts.md", text)
    write_whole(asked.out / "22_exported_scripts.json", json.dumps({"limits": LIMITS, "rows": rows}, indent=1) + "\n")
    if asked.record:
        worst = max((max(row.get("off", np.inf), row.get("missed", np.inf)) for row in rows), default=np.inf)
        record("exported", "python experiments/22_exported_scripts.py --record", max=worst)
    return int(any(row["broken"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
