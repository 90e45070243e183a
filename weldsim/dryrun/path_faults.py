"""What is wrong with a path as it is written, whatever the arm: speed, jumps of orientation, travel that turns back."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.scatter import scatter_of
from weldsim.dryrun.verdict import Verdict, Why
from weldsim.frames import Transform
from weldsim.motion.collision import Touch
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import TURN_IN_PLACE
from weldsim.records import TorchPath

FASTEST = 0.25  # [m/s] greatest torch speed with the arc, the safety limit of manual mode
JUMP = np.deg2rad(2.0)  # [rad] two poses may always differ by so much
SAME = 1e-6  # [m] poses nearer to each other are one place
BACK = np.deg2rad(120.0)  # [rad] travel that turns by more may lead back over itself
LOOK = 0.8  # of the way back over which its direction is told
LEAST_BACK = 0.0005  # [m] of travel back
SCATTERS = 5.0  # standard deviations of the waypoints across travel that travel back must exceed
DIRECTION = 12.0  # standard deviations of the waypoints apart: places that tell the direction of travel to 7 deg
BESIDE = 0.1  # of its length that a way back may lie beside the way there: a weave's legs lie further apart


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Why a pose fails. Attributes: index of the pose; why; text; touch, the bodies where any collide."""

    index: int
    why: Why
    text: str
    touch: Touch | None = None


def failing(verdict: Verdict, fault: Fault) -> Verdict:
    """The verdict on a pose that fails so."""
    first, second, depth = ("", "", 0.0) if fault.touch is None else (fault.touch.first, fault.touch.second, fault.touch.depth)
    return replace(verdict, why=fault.why, text=fault.text, first=first, second=second, depth=depth)


def path_faults(path: TorchPath, config: MotionConfig) -> list[Fault]:
    """All faults of the path as it is written, in the order of its poses, one a pose."""
    found = [*_too_fast(path), *turns_back(path), *_jumps(path, config)]
    first: dict[int, Fault] = {}
    for fault in sorted(found, key=lambda fault: fault.index):
        first.setdefault(fault.index, fault)
    return list(first.values())


def _too_fast(path: TorchPath) -> list[Fault]:
    return [
        Fault(
            index=int(i),
            why="speed",
            text=f"{1e3 * path.speed[i]:.0f} mm/s asked for (limit {1e3 * FASTEST:.0f} mm/s with a torch)",
        )
        for i in np.flatnonzero(path.speed > FASTEST)
    ]


def _jumps(path: TorchPath, config: MotionConfig) -> list[Fault]:
    R = path.X_BT.R
    if path.roll_free:
        turn = np.arctan2(np.linalg.norm(np.cross(R[1:, :, 2], R[:-1, :, 2]), axis=1), np.sum(R[1:, :, 2] * R[:-1, :, 2], axis=1))
    else:
        turn = (Transform("BT", R[:-1], np.zeros((len(R) - 1, 3))).inverse() @ Transform("BT", R[1:], np.zeros((len(R) - 1, 3)))).R
        turn = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0))
    ds = np.diff(path.s)
    limit = np.where(ds > 1e-9, np.maximum(JUMP, config.joint_rate * ds), TURN_IN_PLACE)
    return [
        Fault(
            index=int(i) + 1,
            why="orientation jump",
            text=f"the torch turns {np.rad2deg(turn[i]):.1f} deg within {1e3 * ds[i]:.1f} mm"
            f" (limit {np.rad2deg(limit[i]):.1f} deg); smooth the path",
        )
        for i in np.flatnonzero(turn > limit)
    ]


def turns_back(path: TorchPath) -> list[Fault]:
    """Where the weld's travel turns round and leads back over itself, further than the waypoints scatter."""
    weld = np.arange(len(path.s))[path.weld]
    places = [int(weld[0])]
    for i in weld[1:]:
        if np.linalg.norm(path.X_BT.p[i] - path.X_BT.p[places[-1]]) > SAME:
            places.append(int(i))
    across = _scatter_across(path.X_BT.p[places])
    places = _apart(places, path.X_BT.p, DIRECTION * scatter_of(path).position)
    p = path.X_BT.p[places]
    if len(p) < 3:
        return []
    step = np.diff(p, axis=0)
    length = np.linalg.norm(step, axis=1)
    along = step / length[:, None]
    turn = np.arccos(np.clip(np.sum(along[1:] * along[:-1], axis=1), -1.0, 1.0))
    least = max(LEAST_BACK, SCATTERS * across)
    out = []
    for k in np.flatnonzero(turn > BACK) + 1:
        back = _run(p[k:], -along[k - 1])
        there = _run(p[k::-1], -along[k - 1])
        both = min(back, there)
        if both > least and both * np.sin(_opening(p, int(k), both)) < max(BESIDE * both, least):
            text = (
                f"travel turns back by {np.rad2deg(turn[k - 1]):.0f} deg and leads {1e3 * both:.1f} mm back over itself"
                f" (limit {1e3 * least:.1f} mm); put the waypoints in the order of travel"
            )
            out.append(Fault(index=places[k], why="turns back", text=text))
    return out


def _apart(places: list[int], p: Float[ndarray, "n 3"], distance: float) -> list[int]:
    """Those of the places that lie so far from the one kept before [m]: the way between them is travel, not scatter."""
    kept = places[:1]
    for i in places[1:]:
        if np.linalg.norm(p[i] - p[kept[-1]]) >= distance:
            kept.append(i)
    return kept


def _opening(p: Float[ndarray, "n 3"], k: int, length: float) -> float:
    """Angle between the way back from place k and the way there, both seen from there over most of `length` [m]; up to 90 deg."""
    away = np.linalg.norm(p - p[k], axis=1) >= LOOK * length
    after, before = k + int(away[k:].argmax()), k - int(away[k::-1].argmax())
    back, there = p[after] - p[k], p[before] - p[k]
    cosine = float(back @ there) / max(float(np.linalg.norm(back) * np.linalg.norm(there)), 1e-12)
    return float(np.arccos(np.clip(cosine, 0.0, 1.0)))


def _run(p: Float[ndarray, "n 3"], direction: Float[ndarray, "3"]) -> float:
    """How far the points lead in a direction from the first one, until they lead against it [m]."""
    gone = np.diff(p @ direction)
    against = np.flatnonzero(gone <= 0)
    return float(gone[: against[0] if len(against) else None].sum())


def _scatter_across(p: Float[ndarray, "n 3"]) -> float:
    """Standard deviation of the waypoints across travel, each axis alone [m]: their distance from the line through both neighbours.

    The median: a path that turns back has most of its waypoints on its line all the same.
    """
    chord = p[2:] - p[:-2]
    length = np.linalg.norm(chord, axis=1)
    offset = p[1:-1] - p[:-2]
    across = np.linalg.norm(np.cross(chord, offset), axis=1) / np.maximum(length, 1e-12)
    # Of two axes across the median length is 1.18 standard deviations, and the neighbours scatter too: sqrt(3/2).
    return float(np.median(across[length > SAME]) / (1.1774 * np.sqrt(1.5))) if (length > SAME).any() else 0.0
