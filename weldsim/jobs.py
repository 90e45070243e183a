"""What a job leaves behind: a scene as it was seen, what was planned on it, and what came of that. And which seam is meant."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from weldsim.cloud.register import Registration
from weldsim.curves import project
from weldsim.errors import ExecutionError, InputError, PathError
from weldsim.records import ExecutionLog, PointCloud, SeamFindings, TorchPath, WeldReport
from weldsim.sensor.choose import SensorName

if TYPE_CHECKING:
    from weldsim.motion.plan import MotionPlan
    from weldsim.scan.tour import Tour
    from weldsim.scene.world import World
    from weldsim.sensor.base import Capture

Finder = Callable[[PointCloud], SeamFindings]
"""A seam finder: a cloud in the robot base in, seams best first out. It may read nothing but the cloud."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sighting:
    """A scene of the twin as its camera saw it, before anything is concluded from it.

    Attributes:
        world: the compiled scene.  captures: one a view.  cloud: all views in the base, as perception receives it.
        registration: how several views were lined up; None for one.
        tour: how the arm was driven from view to view; None where it was put there.
        seed, sensor: what it was seen with.  timing: seconds a stage.
    """

    world: "World"
    captures: tuple["Capture", ...]
    cloud: PointCloud
    registration: Registration | None
    tour: "Tour | None"
    seed: int
    sensor: SensorName
    timing: dict[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanResult:
    """What was planned from a cloud. Attributes: cloud, as the seam finder saw it; findings; paths, one for each seam, None
    where none can be laid; refused, why, by the seam's index; notes, for people, one sentence each; timing, seconds a stage;
    config_digest."""

    cloud: PointCloud
    findings: SeamFindings
    paths: tuple[TorchPath | None, ...]
    refused: Mapping[int, PathError] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    timing: dict[str, float]
    config_digest: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Weld:
    """One seam of a job that was begun. Attributes: seam, its index; path; motion; log, what the arm did; error, why it was
    stopped before the end, or None."""

    seam: int
    path: TorchPath
    motion: "MotionPlan"
    log: ExecutionLog
    error: ExecutionError | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class RunResult:
    """A whole job on the twin. Attributes: world; captures, one a view; registration, how they were lined up, None for one;
    tour, how the arm was driven to them, None where it was put there; plan; welded, the index of the seam that was welded, the
    first of several; motion and log, None where there was nothing to weld; others, the welds after that; report."""

    world: "World"
    captures: tuple["Capture", ...]
    registration: Registration | None
    tour: "Tour | None"
    plan: PlanResult
    welded: int
    motion: "MotionPlan | None"
    log: ExecutionLog | None
    report: WeldReport
    others: tuple[Weld, ...] = ()


def unplanned(result: PlanResult) -> tuple[str, ...]:
    """A clause for each seam that has no path: its number from 1 and why."""
    return tuple(f"seam {index + 1} has no path: {error}" for index, error in result.refused.items())


def check_meant(number: Any, near: Any) -> None:
    """Nothing, where a seam may be meant: by its number, "all", a point near it, or nothing at all. Raises InputError."""
    if number is not None and near is not None:
        raise InputError("number and near exclude each other; give one", number=number, near=near)
    if number is not None and number != "all" and (isinstance(number, bool) or not isinstance(number, int | np.integer)):
        raise InputError(f'number {number!r:.60}: a whole number from 1 is needed, or "all"', number=number)
    if near is None:
        return
    try:
        point = np.asarray(near, float)
    except (TypeError, ValueError):
        point = np.zeros(0)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(f"near {near!r:.60}: three finite numbers in metres are needed", near=near)


def pick(findings: SeamFindings, number: int | None = None, near: Sequence[float] | None = None) -> int:
    """Index of the seam that is meant: the best one, or the `number`-th from 1, or the one nearest to a point in B [m].

    Raises:
        InputError: a number that no seam has, a point that is none; both.
    """
    check_meant(number, near)
    count = len(findings.seams)
    if near is not None and count:
        distances = [project(np.array([near], float), seam.points_B)[0][0] for seam in findings.seams]
        return int(np.argmin(distances))
    if number is None:
        return 0
    if not 1 <= number <= count:
        raise InputError(f"seam {number}: {count} found, numbered from 1", seam=number, found=count)
    return number - 1


def seams_to_weld(
    result: PlanResult, number: int | Literal["all"] | None, near: Sequence[float] | None
) -> tuple[tuple[int, TorchPath], ...]:
    """Index and path of every seam that is meant, one unless all are, best first; none where there is no seam.

    Raises:
        InputError, PathError: see `to_weld`.
    """
    if number == "all":
        return tuple((index, path) for index, path in enumerate(result.paths) if path is not None)
    index, path = to_weld(result, number, near)
    return () if path is None else ((index, path),)


def to_weld(result: PlanResult, number: int | None, near: Sequence[float] | None) -> tuple[int, TorchPath | None]:
    """Index and path of the seam that is meant, by default the best that has a path; (0, None) where there is no seam.

    Raises:
        InputError: a number that no seam has.  PathError: the seam that is meant has no path.
    """
    if not result.paths:
        return 0, None
    if number is None and near is None:
        return next((index, path) for index, path in enumerate(result.paths) if path is not None)
    index = pick(result.findings, number, near)
    if index in result.refused:
        raise PathError(f"seam {index + 1}: {result.refused[index]}", **result.refused[index].data)
    return index, result.paths[index]
