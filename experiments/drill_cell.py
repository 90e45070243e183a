"""What a fault drill consists of: a controller that keeps its own record, an owner that welds, and the weld."""

import json
import os
import pickle
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from weldsim.config import CellConfig, load_scene
from weldsim.controller.ask import ask
from weldsim.dryrun.cell import scene_cell
from weldsim.dryrun.try_path import try_path
from weldsim.execution.ur_ports import REALTIME
from weldsim.jobs import to_weld
from weldsim.motion.cut import cut_path
from weldsim.pipeline import look, plan
from weldsim.records import JointTrajectory

HERE = Path(__file__).parent
SCENE, LENGTH = "straight", 0.012  # [m] that is welded
PATIENCE = 20.0  # [s] after which somebody hangs
HOSTS = {"cb3": "127.15.0.1", "e": "127.15.0.2"}


class Speaker:
    """A process that is told and tells lines of JSON."""

    def __init__(self, *command: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        self._text = b""
        self.heard: list[str] = []

    def tell(self, **words: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(words).encode() + b"\n")
        self.process.stdin.flush()

    def hear(self, seconds: float = PATIENCE) -> dict[str, Any] | None:
        """The next object, {} where the process has ended, None where none comes in time."""
        assert self.process.stdout is not None
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            line, found, rest = self._text.partition(b"\n")
            if found:
                self._text = rest
                if line.startswith(b"{"):
                    return json.loads(line)
                self.heard.append(line.decode(errors="replace"))
                continue
            if select.select([self.process.stdout], [], [], left)[0]:
                data = os.read(self.process.stdout.fileno(), 1 << 20)
                if not data:
                    return {}
                self._text += data
        return None

    def ask(self, **words: Any) -> dict[str, Any]:
        self.tell(**words)
        answer = self.hear()
        if not answer:
            raise SystemExit(f"{self.process.args} does not answer: {self.heard[-5:]}")
        return answer

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


def short_weld() -> tuple[JointTrajectory, np.ndarray]:
    """A weld of LENGTH on the scene, with its air moves, and where the arm starts."""
    scene, config = load_scene(SCENE), CellConfig()
    result = plan(look(scene, config, seed=0).cloud, config)
    _, path = to_weld(result, None, None)
    if path is None:
        raise SystemExit(f"{SCENE}: no seam found")
    path = cut_path(path, (float(path.s[0]) + LENGTH,))[0]
    cell = scene_cell(scene)
    trial = try_path(path, SCENE, cell, replace(config.motion, period=0.002))
    if trial.trajectory is None:
        raise SystemExit(f"no weld: {trial.failure}")
    return trial.trajectory, np.array(cell.q_start)


def place(host: str, q: np.ndarray) -> None:
    """The arm at rest at q, nothing running."""
    program = f"def go():\n  movej([{', '.join(f'{x:.9f}' for x in q)}], a=5, v=2)\nend\n"
    with socket.create_connection((host, REALTIME), 2.0) as sock:
        sock.sendall(program.encode())
        end, now = time.monotonic() + PATIENCE, ask(host, {"status": True})
        while time.monotonic() < end:
            if not now["program"] and np.abs(np.array(now["q"]) - q).max() < 5e-4:
                return
            time.sleep(0.02)
            now = ask(host, {"status": True})
    raise SystemExit(f"{host}: the arm cannot be brought to its start: {now}")


@dataclass
class Cell:
    """A controller, an owner, and the weld."""

    profile: str
    folder: Path
    trajectory: JointTrajectory
    start: np.ndarray
    controller: Speaker
    owner: Speaker | None = None

    @property
    def host(self) -> str:
        return HOSTS[self.profile]

    def ready(self) -> Speaker:
        """An owner that waits for orders."""
        if self.owner is None or self.owner.process.poll() is not None:
            self.owner = Speaker(str(HERE / "drill_owner.py"), self.host, str(self.folder / "weld.pkl"))
            if self.owner.hear() != {"owner": "ready"}:
                raise SystemExit(f"no owner: {self.owner.heard}")
        return self.owner


@contextmanager
def cell_of(profile: str, speed: float, folder: Path) -> Iterator[Cell]:
    """A cell that serves while the block lasts. Args: folder, for what the processes leave to one another."""
    trajectory, start = short_weld()
    (folder / "weld.pkl").write_bytes(pickle.dumps(trajectory))
    command = ("--profile", profile, "--host", HOSTS[profile], "--scene", SCENE, "--speed", str(speed))
    controller = Speaker(str(HERE / "drill_controller.py"), *command)
    cell = Cell(profile, folder, trajectory, start, controller)
    try:
        if controller.hear() != {"serving": HOSTS[profile]}:
            raise SystemExit(f"no controller: {controller.heard}")
        yield cell
    finally:
        controller.end()
        if cell.owner is not None:
            cell.owner.end()
