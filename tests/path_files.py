"""Path files for the commands that weld them, an arm that is stopped on its way, and the command that goes on."""

import json
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.errors import ExecutionError
from weldsim.execution.gate import SafetyGate
from weldsim.execution.simulated import SimulatedRobot
from weldsim.records import Segment

DOWN = np.array([0.0, 0.0, -1.0])


def document(shift: tuple[float, float, float] = (0.0, -0.48, 0.06), length: float = 0.03, speed: float = 0.01) -> dict[str, Any]:
    """A path file of one straight seam."""
    path = torch_path(flat_curve("line", length) + np.array(shift), DOWN)
    poses = [
        {"s": s, "position": p, "quaternion_wxyz": q}
        for s, p, q in zip(path.s.tolist(), path.X_BT.p.tolist(), path.X_BT.quaternion.tolist(), strict=True)
    ]
    seam = {
        "id": "seam-1",
        "joint": "groove",
        "reference": "opening",
        "speed": speed,
        "points": path.X_BT.p.tolist(),
        "poses": poses,
    }
    units = {"length": "m", "angle": "rad"}
    return {"schema": "weldsim.path/1", "frame": "base", "units": units, "seams": [seam], "timing": {}, "input": {}}


def written(tmp_path: Path, content: Any, name: str = "path.json") -> str:
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return str(path)


@contextmanager
def stopped_at(s: float, why: str = "protective stop") -> Iterator[None]:
    """While this lasts a simulated arm is stopped when it is to weld at arc length s [m]; below 0, on its way there."""
    true_label, true_servo, at = SafetyGate.label, SimulatedRobot.servo, [0.0]

    def label(self: SafetyGate, segment: Segment, along: float) -> None:
        at[0] = along if segment == Segment.WELD else -1.0
        true_label(self, segment, along)

    def servo(self: SimulatedRobot, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        if at[0] >= s:
            raise ExecutionError(why, rule="robot")
        return true_servo(self, q, qd)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SafetyGate, "label", label)
        patch.setattr(SimulatedRobot, "servo", servo)
        yield


def advice(out: str) -> list[str]:
    """The words of the command that goes on with a weld, after `weldsim`."""
    (line,) = [line for line in out.splitlines() if "weldsim execute" in line]
    words = shlex.split(line.partition(": ")[2])
    assert words[0] == "weldsim"
    return words[1:]
