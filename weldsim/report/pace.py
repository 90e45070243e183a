"""Where a weld was too slow or too fast for long enough to lay down another bead: paces over stretches of a given size.

A weld gets the metal of `asked speed x time`. A stretch is as long as the way it makes or, where the torch is slow or stands
still, as the way it should have made in that time: both are millimetres of bead.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.quantity import Metre
from weldsim.records import ExecutionLog, Pace, TorchPath
from weldsim.report.tracking import TorchSpeed, torch_speed


@dataclass(frozen=True, eq=False, kw_only=True)
class _Windows:
    """Every stretch of one size within one piece of weld.

    Attributes:
        first: (w,) the instant at which each begins.  end: (w,) the last instant before it ends.
        share: (w,) of the asked speed, over the whole stretch.
    """

    first: ndarray
    end: ndarray
    share: Float[ndarray, "w"]


def paces(log: ExecutionLog, path: TorchPath, stretch: Metre, told: float) -> tuple[Pace | None, Pace | None, tuple[Pace, ...]]:
    """The slowest and the fastest stretch of a weld, and all that are off the asked speed by more than the share `told`.

    The ramps after the arc is lit and before it goes out count: metal is laid down on them too.

    Args:
        log: what the arm did.  path: what was asked.
        stretch: over which paces are taken [m]; a shorter weld is one stretch.  told: share of the asked speed, 0.2 say.
    Returns:
        Two of None where the arc never burnt; the stretches along the path, each with the worst pace in it.
    """
    speed = torch_speed(log, path)
    if speed is None:
        return None, None, ()
    slow: list[Pace] = []
    fast: list[Pace] = []
    uneven: list[Pace] = []
    for piece in _pieces(speed):
        way, worth = _bead(piece)
        for out, sign, windows in (
            (slow, -1.0, _windows(worth, way, stretch, inverse=False)),
            (fast, 1.0, _windows(way, worth, stretch, inverse=True)),
        ):
            worst = int((sign * windows.share).argmax())
            out.append(_pace(piece, windows, worst))
            off = sign * (piece.speed / piece.planned - 1.0) > told
            uneven += _stretches(piece, windows, sign * (windows.share - 1.0) > told, off, sign)
    return (
        min(slow, key=lambda pace: pace.share),
        max(fast, key=lambda pace: pace.share),
        tuple(sorted(uneven, key=lambda pace: pace.s_from)),
    )


def _pieces(speed: TorchSpeed) -> list[TorchSpeed]:
    """The pieces of a weld: from each time that the arc is lit until it goes out."""
    cuts = np.flatnonzero(np.diff(speed.lit) > 0) + 1
    columns = [np.split(getattr(speed, name), cuts) for name in ("t", "s", "speed", "planned", "lit", "out")]
    pieces = zip(*columns, strict=True)
    return [
        TorchSpeed(t=t, s=s, speed=v, planned=planned, lit=lit, out=out) for t, s, v, planned, lit, out in pieces if len(t) > 1
    ] or [speed]


def _bead(piece: TorchSpeed) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"]]:
    """Way made, and way asked for in the same time, since the arc was lit [m]."""
    dt = np.diff(piece.t)

    def summed(speed: Float[ndarray, "k"]) -> Float[ndarray, "k"]:
        return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * dt)])

    return summed(piece.speed), summed(piece.planned)


def _windows(size: Float[ndarray, "k"], other: Float[ndarray, "k"], stretch: Metre, *, inverse: bool) -> _Windows:
    """Windows of `stretch` in `size` [m], and how `other` compares over each; all of it where it is shorter."""
    stretch = min(stretch, float(size[-1] - size[0]))
    first = np.flatnonzero(size + stretch <= size[-1] + 1e-12)
    if not len(first):
        first = np.zeros(1, int)
    at = size[first] + stretch
    # A torch that stands has many instants at one place: the last of them ends the window.
    end = np.clip(np.searchsorted(size, at - 1e-12), 0, len(size) - 1)
    rest = np.interp(at, size + 1e-15 * np.arange(len(size)), other) - other[first]
    share = rest / max(stretch, 1e-12)
    return _Windows(first=first, end=end, share=1.0 / np.maximum(share, 1e-9) if inverse else share)


def _pace(piece: TorchSpeed, windows: _Windows, worst: int) -> Pace:
    return Pace(
        share=float(windows.share[worst]),
        s_from=float(piece.s[windows.first[worst]]),
        s_to=float(piece.s[windows.end[worst]]),
    )


def _stretches(piece: TorchSpeed, windows: _Windows, bad: ndarray, off: ndarray, sign: float) -> list[Pace]:
    """Neighbouring windows that are `bad` as one stretch each, from the first to the last instant that is `off` in it."""
    covered = np.zeros(len(piece.t) + 1, int)
    np.add.at(covered, windows.first[bad], 1)
    np.add.at(covered, windows.end[bad] + 1, -1)
    inside = np.cumsum(covered)[:-1] > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
    out = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        mine = bad & (windows.first >= a) & (windows.end < b)
        places = a + np.flatnonzero(off[a:b])
        if not len(places):
            places = np.array([a, b - 1])
        worst = sign * float((sign * windows.share[mine]).max())
        out.append(Pace(share=worst, s_from=float(piece.s[places[0]]), s_to=float(piece.s[places[-1]])))
    return out
