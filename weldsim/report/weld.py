"""The report of one job: figures, verdict with reasons, and what it ran with."""

import importlib.metadata
import platform
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from weldsim.quantity import Metre
from weldsim.records import ExecutionLog, KnownSeam, LineError, Seam, SeamFindings, TorchPath, WeldProgress, WeldReport
from weldsim.report.limits import ReportConfig, checks
from weldsim.report.metrics import line_error, match_seams, region_overlap, sigma_coverage
from weldsim.report.misses import miss, steady_offset
from weldsim.report.pace import paces
from weldsim.report.progress import interruptions
from weldsim.report.tracking import speed_error, thinned, tracking_error
from weldsim.report.verdict import warnings

REPORT_SCHEMA = "weldsim.report/1"
LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "mujoco", "mink", "ruckig", "open3d")


def weld_report(
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    *,
    scene: str,
    log: ExecutionLog | None = None,
    known: tuple[KnownSeam, ...] | None = None,
    true_region: Bool[ndarray, "n"] | None = None,
    welded: int = 0,
    unplanned: tuple[str, ...] = (),
    trims: tuple[Metre, Metre] = (0.0, 0.0),
    unjudged: tuple[tuple[str, str], ...] = (),
    stopped: str | None = None,
    progress: WeldProgress | None = None,
    timing: dict[str, float] | None = None,
    seed: int | None = None,
    config_digest: str = "",
    config: ReportConfig | None = None,
) -> WeldReport:
    """Figures and verdict of one job.

    Args:
        findings: what the seam finder returned.  paths: the torch path of each of its seams, None where it has none.
        scene: what was looked at, by name.
        log: what the arm did along `paths[welded]`, or None when nothing was executed.
        known: the true seams; () says that there is none, None that nobody knows.
        true_region: for each point of the cloud, whether it lies in a groove; None when unknown.
        welded: which of the paths is judged.
        unplanned: found seams without a path, a clause each.
        trims: length left out on purpose at the start and end of the weld [m]; it is not missed.
        unjudged: figures that nothing is known to judge by, and why.
        stopped: why the arm was stopped before the end.  progress: how far it came.
        timing: seconds a stage.  seed, config_digest: what it ran with; seed None where no twin looked.
        config: the limits.

    The verdict is passed when nothing stopped the weld, every judged figure keeps its limit, no known seam is missed and, where
    seams are known or unknown (not ()), at least one was found. Reasons are the failures, or what was found in order.
    """
    config = config or ReportConfig()
    failures: list[str] = [] if stopped is None else [stopped]
    draft = WeldReport(
        passed=False,
        reasons=(),
        scene=scene,
        method=findings.method,
        iou=None if true_region is None else region_overlap(findings.region > 0, true_region),
        unplanned=unplanned,
        unjudged=unjudged,
        seam=welded + 1,
        welded=int(log is not None and stopped is None and bool(log.arc_on.any())),
        seams=len(findings.seams) if known is None else len(known),
        stopped=stopped,
        progress=progress,
        timing=dict(timing or {}),
        seed=seed,
        config_digest=config_digest,
        versions=versions(),
    )
    if known is not None:
        draft = _against_known(draft, findings, paths, log, known, welded, trims, failures, config)
    elif not findings.seams:
        failures.append("no seam was found")
    path = paths[welded] if welded < len(paths) else None
    if log is not None and path is not None:
        draft = _against_plan(draft, path, log, failures, config)
    listed = checks(draft, config)
    judged = [check for check in listed if check.passed is not None]
    failures += [check.clause for check in judged if not check.passed]
    kept = tuple(check.clause for check in judged) or (f"{len(findings.seams)} found; no known seam to compare with",)
    return replace(draft, passed=not failures, reasons=tuple(failures) or kept, warnings=warnings(draft, listed))


def joined(reports: tuple[WeldReport, ...], config: ReportConfig | None = None) -> WeldReport:
    """One report of a job that welded several seams of one findings: the first, with the others in it.

    Args:
        reports: as `weld_report` gives them, one a seam.  config: the limits.
    """
    first, *rest = reports
    if not rest:
        return first
    shared = {reason for reason in first.reasons if all(reason in each.reasons for each in rest)}  # of missed seams, say
    own = tuple(replace(each, phantom_seams=None, iou=None, unjudged=(), unplanned=(), others=()) for each in rest)
    reasons: list[str] = []
    passed = all(each.passed for each in reports)
    for each in reports:
        if each.passed == passed:
            named = (reason if reason in shared else f"seam {each.seam}: {reason}" for reason in each.reasons)
            reasons += [reason for reason in named if reason not in reasons]
    stop = next((each for each in reports if each.stopped is not None), first)
    whole = replace(
        first,
        passed=passed,
        reasons=tuple(reasons),
        others=own,
        welded=sum(each.welded for each in reports),
        stopped=stop.stopped,
        progress=stop.progress,
    )
    return replace(whole, warnings=warnings(whole, checks(whole, config or ReportConfig())))


def _against_known(
    report: WeldReport,
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    log: ExecutionLog | None,
    known: tuple[KnownSeam, ...],
    welded: int,
    trims: tuple[Metre, Metre],
    failures: list[str],
    config: ReportConfig,
) -> WeldReport:
    """The report with the figures that need the true seams; seams that were missed, and a welded line that is a phantom or a
    piece of a seam, are added to `failures`."""
    match = match_seams(findings.seams, known)
    lost = {i + 1: findings.seams[i] for i in match.phantoms}
    failures += [miss(known[j], j + 1, lost) for j in match.missed]
    report = replace(report, phantom_seams=len(match.phantoms))
    path = paths[welded] if welded < len(paths) else None
    if path is None:
        return report
    owner = match.owners[welded]
    if owner < 0:
        failures.append(f"seam {welded + 1}, the one judged, lies on no known seam")
        return report
    partner = known[owner]
    if welded in match.fragments:
        failures.append(f"seam {welded + 1}, the one judged, is a piece of known seam {partner.name or owner + 1}")
    seam = findings.seams[welded]
    if clause := steady_offset(seam, partner, config.max):
        failures.append(clause)
    return replace(
        report,
        plan=path_error(path, partner, seam, trims),
        executed=None if log is None else executed_error(log, partner, seam, trims),
        widths=(seam.width, partner.width) if seam.width > 0 and partner.width > 0 else None,
        sigma_coverage=None if seam.sigma is None else sigma_coverage(seam.points_B, seam.sigma, partner, seam.reference),
    )


def _against_plan(report: WeldReport, path: TorchPath, log: ExecutionLog, failures: list[str], config: ReportConfig) -> WeldReport:
    """The report with the figures of the executed weld against its plan; an arc that never burned is a failure."""
    if not log.arc_on.any():
        failures.append("the arc never burned")
        return report
    tracking = tracking_error(log.X_BT_act.p[log.arc_on], path.X_BT.p[path.weld])
    speed = speed_error(log, path)
    slowest, fastest, uneven = paces(log, path, config.stretch, config.pace)
    return replace(
        report,
        tracking_p95=tracking.p95,
        tracking_max=tracking.max,
        speed_error_p95=None if speed is None else speed.p95,
        speed_error_max=None if speed is None else speed.max,
        slowest=slowest,
        fastest=fastest,
        uneven=uneven,
        interruptions=interruptions(log),
    )


def path_error(path: TorchPath, known: KnownSeam, seam: Seam, trims: tuple[Metre, Metre] = (0.0, 0.0)) -> LineError:
    """The planned torch tip and wire axis against the known seam, at the seam's own reference."""
    X = path.X_BT[path.weld]
    return line_error(X.p, X.R[:, :, 2], known, seam.reference, trims)


def executed_error(log: ExecutionLog, known: KnownSeam, seam: Seam, trims: tuple[Metre, Metre] = (0.0, 0.0)) -> LineError | None:
    """The measured torch tip and wire axis against the known seam, with the arc on; None when it never moved."""
    tip, wire = thinned(log)
    return line_error(tip, wire, known, seam.reference, trims) if len(tip) > 1 else None


def versions() -> dict[str, str]:
    """Versions of weldsim, Python and the libraries that decide figures; those not installed are left out."""
    out = {"python": platform.python_version()}
    for name in ("weldsim", *LIBRARIES):
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return out


def report_json(report: WeldReport, config: ReportConfig | None = None) -> dict[str, Any]:
    """The report as plain JSON values: SI figures as in `WeldReport`, and the checks in words beside their limits."""
    config = config or ReportConfig()
    listed = [
        {"figure": c.figure, "value": c.value, "limit": c.limit, "passed": c.passed, "amber": c.amber or None}
        for c in checks(report, config)
    ]
    record = _plain(asdict(report))
    return {"schema": REPORT_SCHEMA, "units": {"length": "m", "angle": "rad", "time": "s"}, **record, "checks": listed}


def _plain(value: Any) -> Any:
    """Lists for tuples and None for floats that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
