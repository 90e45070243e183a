"""The line the torch tip runs on: lead-in, weld and lead-out as one curve over arc length, with poses anywhere on it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.errors import MotionError
from weldsim.frames import Transform, slerp
from weldsim.motion.config import MotionConfig
from weldsim.records import Segment, TorchPath

TURN_IN_PLACE = np.deg2rad(0.5)  # [rad] more rotation than this without travel cannot be timed by arc length


@dataclass(frozen=True, eq=False, kw_only=True)
class Rail:
    """Poses along the whole torch motion.

    Attributes:
        s: (n,) arc length [m], strictly increasing; the same zero as the path it was made from.
        p: (n, 3) tip positions in B [m].  quaternion: (n, 4) wxyz, neighbours on the same side.
        speed: (n,) asked tip speed [m/s].  index: (n,) the pose of the path each comes from; -1 for added leads.
        start, end: arc length where the weld begins and ends [m].
        roll_free: whether rotation about the wire may differ.
    """

    s: Float[ndarray, "n"]
    p: Float[ndarray, "n 3"]
    quaternion: Float[ndarray, "n 4"]
    speed: Float[ndarray, "n"]
    index: ndarray
    start: float
    end: float
    roll_free: bool

    def at(self, s: Float[ndarray, "m"]) -> Transform:
        """X_BT at arc lengths s [m]: straight between poses, orientation by slerp; constant beyond the ends."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        u = np.clip((s - self.s[i]) / (self.s[i + 1] - self.s[i]), 0.0, 1.0)
        p = self.p[i] + u[:, None] * (self.p[i + 1] - self.p[i])
        return Transform.from_quaternion("BT", slerp(self.quaternion[i], self.quaternion[i + 1], u), p)

    def path_index(self, s: float) -> int:
        """Index of the path's pose nearest to arc length s (the first or last pose for the leads)."""
        index = int(self.index[np.abs(self.s - s).argmin()])
        if index >= 0:
            return index
        known = self.index[self.index >= 0]
        return int(known[0] if s <= self.start else known[-1])

    def pieces(self) -> list[tuple[Segment, float, float]]:
        """The pieces that start and end at rest: name, first and last arc length [m]; empty ones left out."""
        cuts = [(Segment.APPROACH, self.s[0], self.start), (Segment.WELD, self.start, self.end)]
        cuts.append((Segment.RETRACT, self.end, self.s[-1]))
        return [(name, float(a), float(b)) for name, a, b in cuts if b - a > 1e-9]


def make_rail(path: TorchPath, config: MotionConfig) -> Rail:
    """The path with a straight lead-in and lead-out along the wire wherever it has none of its own.

    Raises:
        MotionError: the torch turns in place, or the weld has no length; `data` has the index.
    """
    weld = path.weld
    p, q, speed = path.X_BT.p, path.X_BT.quaternion, path.speed
    index = np.arange(len(p))
    if config.approach > 0 and weld.start == 0:
        p, q, speed, index = _lead(p, q, speed, index, config, first=True)
    if config.approach > 0 and weld.stop == len(path.X_BT):
        p, q, speed, index = _lead(p, q, speed, index, config, first=False)
    s = arc_length(p)
    keep = np.concatenate([[True], np.diff(s) > 1e-9])
    # A repeated point is dropped only if the torch does not turn there.
    turn = 2 * np.arccos(np.clip(np.abs(np.einsum("ij,ij->i", q[1:], q[:-1])), 0.0, 1.0))
    spin = np.flatnonzero(~keep[1:] & (turn > TURN_IN_PLACE))
    if len(spin):
        at = int(index[spin[0] + 1])
        raise MotionError(
            f"path pose {at}: the torch turns {np.rad2deg(turn[spin[0]]):.2f} deg without travelling"
            f" (limit {np.rad2deg(TURN_IN_PLACE):g} deg); spread the turn over some length",
            index=at,
        )
    first, last = (int(np.flatnonzero(index == i)[0]) for i in (weld.start, weld.stop - 1))
    s = s - s[first] + float(path.s[weld.start])
    start, end = float(s[first]), float(s[last])
    if end - start <= 1e-9:
        raise MotionError("path: the weld has no length; it needs two different points", index=weld.start)
    q = q[keep]
    flips = np.cumprod(np.concatenate([[1.0], np.where(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0, -1.0, 1.0)]))
    return Rail(
        s=s[keep],
        p=p[keep],
        quaternion=q * flips[:, None],
        speed=speed[keep],
        index=index[keep],
        start=start,
        end=end,
        roll_free=path.roll_free,
    )


def _lead(
    p: Float[ndarray, "n 3"],
    q: Float[ndarray, "n 4"],
    speed: Float[ndarray, "n"],
    index: ndarray,
    config: MotionConfig,
    first: bool,
) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 4"], Float[ndarray, "m"], ndarray]:
    """The arrays with one pose added before or after them, `approach` back along the wire."""
    end = 0 if first else -1
    wire = Transform.from_quaternion("BT", q[end], p[end]).R[:, 2]
    columns = [(p, p[end] - config.approach * wire), (q, q[end]), (speed, config.lead_speed), (index, -1)]
    pairs = [
        (np.asarray(extra)[None], np.asarray(rows)) if first else (np.asarray(rows), np.asarray(extra)[None])
        for rows, extra in columns
    ]
    p, q, speed, index = (np.concatenate(pair) for pair in pairs)
    return p, q, speed, index
