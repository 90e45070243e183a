"""A path of waypoints tried: through each of them, or along a smooth curve as near to them as their own scatter allows."""

import re
from dataclasses import replace

import numpy as np

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.path_faults import FASTEST, path_faults
from weldsim.dryrun.scatter import Refit, Scatter, is_even, nearest_in_order, refit, scatter_of
from weldsim.dryrun.sections import with_every_failure
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.verdict import Trial, Verdict
from weldsim.motion.config import MotionConfig
from weldsim.records import TorchPath

MENDED = ("speed", "orientation jump", "joint jump")  # failures that a smoother motion may not have
CLOSER, SMOOTHER = (1.0, 0.5, 0.25, 0.0), (1.5, 2.0)  # shares of the scatter that a curve may leave the waypoints by, all in all
MOST = 6.0  # standard deviations of the scatter that any waypoint may be off the curve
CHORD = 0.0005  # [m] more that the curve may be off the straight lines between the waypoints
ZIGZAG = 0.3  # scatter over the mean step between waypoints from which the way between them is mostly forth and back
TOLD = (2e-5, np.deg2rad(0.05))  # [m], [rad] scatter worth being told


def try_waypoints(path: TorchPath, name: str, cell: Cell, config: MotionConfig) -> tuple[TorchPath, Trial]:
    """The path that the motion follows, and a verdict for every waypoint of the one that was asked for.

    A path that fails where it is followed straight from waypoint to waypoint is tried again along a smooth curve: only what
    no such curve within tolerance mends is a failure.
    """
    scatter = scatter_of(path)
    rough = bool(_scattered(scatter))
    # What is all forth and back within the scatter is not followed exactly by anybody, and to try it takes minutes.
    fit = _fit(path, scatter, config) if _zigzags(path, scatter) and not path_faults(path, config) else None
    trial = try_path(path, name, cell, config) if fit is None else None
    if trial is not None and trial.passed:
        return path, trial
    if trial is not None and _worth_refitting(path, trial):
        fit = _fit(path, scatter, config)
    if trial is not None and fit is None:
        return path, with_every_failure(trial, path, cell, config, rough=rough)
    assert fit is not None  # else the path was tried as it is
    tried = [(fit, try_path(fit.path, name, cell, config))]
    if not tried[0][1].passed:
        tried += [
            (fitted, try_path(fitted.path, name, cell, config))
            for fitted in (refit(path, scatter, share) for share in SMOOTHER)
            if _within(fitted, scatter)
        ]
    better = next(((fitted, one) for fitted, one in tried if one.passed), None)
    if better is not None:
        fitted, best = better
        notes = (*_told(path, fitted, scatter, trial), *best.notes)
        return fitted.path, replace(_of_waypoints(best, fitted, path), notes=notes)
    fitted, smooth = tried[0]
    if trial is not None and _fail_alike(trial, _of_waypoints(smooth, fitted, path)):
        worse = with_every_failure(trial, path, cell, config, rough=rough)
    else:  # the reason of the one that is followed exactly comes from the scatter
        worse = _of_waypoints(with_every_failure(smooth, fitted.path, cell, config), fitted, path)
    said = f"{_scattered(scatter)}no smooth curve within that passes either"
    return path, replace(worse, notes=(*worse.notes, said)) if rough else worse


def _zigzags(path: TorchPath, scatter: Scatter) -> bool:
    """Whether the way from waypoint to waypoint is mostly their scatter."""
    dense = scatter.position * (len(path.s) - 1) > ZIGZAG * float(path.s[-1] - path.s[0])
    return scatter.position > TOLD[0] and dense and is_even(path)


def _worth_refitting(path: TorchPath, trial: Trial) -> bool:
    failure = trial.failure
    return failure is not None and failure.why in MENDED and not trial.lead and float(path.speed.max()) <= FASTEST


def _fit(path: TorchPath, scatter: Scatter, config: MotionConfig) -> Refit | None:
    """The smoothest curve within tolerance; None where there is none but the straight lines between the waypoints."""
    for share in CLOSER:
        fitted = refit(path, scatter, share)
        apart = fitted.chord_off > config.spline_tolerance or fitted.rotation_off > TOLD[1]
        if apart and _within(fitted, scatter):
            return fitted
    return None


def _within(fitted: Refit, scatter: Scatter) -> bool:
    """Whether a curve is as near to the waypoints as their scatter allows, and to the lines between them."""
    near = MOST * scatter.position + TOLD[0]
    return bool(
        fitted.position_off <= near
        and fitted.rotation_off <= MOST * scatter.rotation + TOLD[1]
        and fitted.chord_off <= near + CHORD
    )


def _of_waypoints(trial: Trial, fitted: Refit, path: TorchPath) -> Trial:
    """The trial of a curve with a verdict for each waypoint of the path: that of the first of its own poses that fails."""
    owner = nearest_in_order(fitted.path.s[fitted.nearest], fitted.path.s)
    worst: dict[int, Verdict] = {}
    for verdict in trial.verdicts:
        mine = int(owner[verdict.index])
        if mine not in worst or (worst[mine].ok and not verdict.ok) or worst[mine].why == "not reached":
            worst[mine] = verdict
    verdicts = []
    for index, s in enumerate(path.s):
        found = worst.get(index, worst[max(k for k in worst if k <= index)])
        text = re.sub(r"\bpose (\d+)", lambda said: f"pose {owner[int(said[1])]}", found.text)
        verdicts.append(replace(found, label=f"pose {index}", index=index, s=float(s), text=text))
    return replace(trial, verdicts=tuple(verdicts))


def _fail_alike(a: Trial, b: Trial) -> bool:
    """Whether two trials fail for one reason at one pose, or next to it."""
    first, second = a.failure, b.failure
    return first is None or second is None or (first.why == second.why and abs(first.index - second.index) <= 1)


def _scattered(scatter: Scatter) -> str:
    """The scatter in words, or "" where there is none worth being told."""
    if scatter.position < TOLD[0] and scatter.rotation < TOLD[1]:
        return ""
    return (
        f"the waypoints scatter by {1e3 * scatter.position:.2f} mm and {np.rad2deg(scatter.rotation):.2f} deg (standard"
        " deviation of each axis about a smooth curve); "
    )


def _told(path: TorchPath, fitted: Refit, scatter: Scatter, exact: Trial | None) -> tuple[str, ...]:
    said = _scattered(scatter)
    if said:
        text = (
            f"{said}the motion follows a curve that leaves them by up to {1e3 * fitted.position_off:.2f} mm and"
            f" {np.rad2deg(fitted.rotation_off):.1f} deg"
        )
    else:
        furthest = float(np.linalg.norm(np.diff(path.X_BT.p, axis=0), axis=1).max())
        text = (
            f"the waypoints are up to {1e3 * furthest:.1f} mm apart: the motion follows a smooth curve through them, up to"
            f" {1e3 * fitted.chord_off:.2f} mm off the straight lines between them"
        )
    failure = None if exact is None else exact.failure
    return (
        (text,)
        if failure is None
        else (text, f"straight from waypoint to waypoint it would fail at {failure.label}: {failure.text}")
    )
