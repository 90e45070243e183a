"""How well the arm followed its path: distance of the measured tip from the planned line, and its speed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.frames import unit
from weldsim.quantity import Second
from weldsim.records import ExecutionLog, TorchPath
from weldsim.report.metrics import STEP, Offsets, offsets


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackingError:
    """Measured tip from the planned line while the arc burns.

    Attributes:
        mean, p95, max: [m].  offsets: of each instant with the arc on.
    """

    mean: float
    p95: float
    max: float
    offsets: Offsets


@dataclass(frozen=True, kw_only=True)
class SpeedRule:
    """Where torch speed is judged.

    Attributes:
        window: speed is the distance between the tip's positions half a window before and after, over the window.
            Long enough that encoder noise does not count, short against what a weld pool notices.
        ramp: time left out after the arc starts and before it stops, where the arm speeds up and slows down.
    """

    window: Second = 0.1
    ramp: Second = 0.3


@dataclass(frozen=True, eq=False, kw_only=True)
class SpeedError:
    """Torch speed against plan on the weld.

    Attributes:
        p95, max: |speed - planned| / planned, outside the ramps.
        s, speed, planned: (k,) arc length [m], measured and planned speed [m/s] with the arc on.
        judged: (k,) which instants count.
    """

    p95: float
    max: float
    s: Float[ndarray, "k"]
    speed: Float[ndarray, "k"]
    planned: Float[ndarray, "k"]
    judged: Bool[ndarray, "k"]


def tracking_error(tip_B: Float[ndarray, "k 3"], planned_B: Float[ndarray, "n 3"]) -> TrackingError:
    """Perpendicular distance of each measured tip position from the planned line, which goes on straight past its ends.

    Being early or late on the line is not an error here: it is one of speed.
    """
    moved = np.concatenate([[True], np.linalg.norm(np.diff(planned_B, axis=0), axis=1) > 0])
    found = offsets(tip_B, planned_B[moved])
    return TrackingError(
        mean=float(found.distance.mean()),
        p95=float(np.percentile(found.distance, 95)),
        max=float(found.distance.max()),
        offsets=found,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class TorchSpeed:
    """Measured torch speed at every instant with the arc on.

    Attributes:
        t: (k,) [s].  s: (k,) arc length that was commanded [m].  speed, planned: (k,) measured and asked for [m/s].
        lit, out: (k,) when the arc of this piece of the weld was lit and when it went out [s].
    """

    t: Float[ndarray, "k"]
    s: Float[ndarray, "k"]
    speed: Float[ndarray, "k"]
    planned: Float[ndarray, "k"]
    lit: Float[ndarray, "k"]
    out: Float[ndarray, "k"]


def torch_speed(log: ExecutionLog, path: TorchPath, rule: SpeedRule | None = None) -> TorchSpeed | None:
    """Torch speed while the arc burns; None when it did not.

    Args:
        log: what the arm did.  path: what was planned; its speed is looked up at the commanded arc length.
        rule: the averaging window.
    """
    rule = rule or SpeedRule()
    on = np.flatnonzero(log.arc_on)
    if len(on) < 2:
        return None
    t = log.t[on]
    half = rule.window / 2
    p = log.X_BT_act.p
    # Near arc start and stop, of every piece of a weld, the window is cut off, so that approach and retract do not leak in.
    lit, out = _arc_times(on, log.t)
    times = [np.clip(t + h, lit, out) for h in (-half, half)]
    before, after = (np.stack([np.interp(at, log.t, column) for column in p.T], axis=1) for at in times)
    speed = np.linalg.norm(after - before, axis=1) / np.maximum(times[1] - times[0], 1e-9)
    s = log.s_cmd[on]
    return TorchSpeed(t=t, s=s, speed=speed, planned=np.interp(s, path.s, path.speed), lit=lit, out=out)


def speed_error(log: ExecutionLog, path: TorchPath, rule: SpeedRule | None = None) -> SpeedError | None:
    """Relative speed error while the arc burns; None when the weld is shorter than its ramps.

    Args:
        log: what the arm did.  path: what was planned; its speed is looked up at the commanded arc length.
        rule: the averaging window and the ramps left out.
    """
    rule = rule or SpeedRule()
    found = torch_speed(log, path, rule)
    if found is None:
        return None
    judged = (found.t >= found.lit + rule.ramp) & (found.t <= found.out - rule.ramp)
    if not judged.any():
        return None
    error = np.abs(found.speed - found.planned)[judged] / found.planned[judged]
    return SpeedError(
        p95=float(np.percentile(error, 95)),
        max=float(error.max()),
        s=found.s,
        speed=found.speed,
        planned=found.planned,
        judged=judged,
    )


def _arc_times(on: Int[ndarray, "k"], t: Float[ndarray, "n"]) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"]]:
    """For each instant at which the arc burns, when it was lit and when it will go out [s]."""
    first = np.concatenate([[True], np.diff(on) > 1])
    piece = np.cumsum(first) - 1
    return t[on[first]][piece], t[on[np.concatenate([first[1:], [True]])]][piece]


def thinned(log: ExecutionLog) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """Tip positions [m] and wire axes with the arc on, averaged over each 0.5 mm of commanded path.

    At 125 to 500 samples a second and 6 mm/s, neighbouring samples are nearer than the encoders' noise: the polyline
    through all of them zigzags and its arc length means nothing.
    """
    on = np.flatnonzero(log.arc_on)
    step = np.floor((log.s_cmd[on] - log.s_cmd[on[0]]) / STEP).astype(int) if len(on) else on
    _, group, count = np.unique(step, return_inverse=True, return_counts=True)
    X = log.X_BT_act[on]
    columns = np.concatenate([X.p, X.R[:, :, 2]], axis=1)
    mean = np.stack([np.bincount(group, column) for column in columns.T], axis=1) / count[:, None]
    if len(mean) > 1:
        # The first and last instants stand for the ends, which averaging would move inwards.
        mean[0], mean[-1] = columns[0], columns[-1]
    return mean[:, :3], unit(mean[:, 3:])
