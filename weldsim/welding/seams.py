"""What a path file says of its seams, as the report wants it: findings without a cloud."""

from pathlib import Path
from typing import Any, get_args

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length, project, tangents
from weldsim.dryrun.program import Program
from weldsim.frames import unit
from weldsim.path.files import read_path_json
from weldsim.records import Joint, PointCloud, Reference, Seam, SeamFindings, TorchPath
from weldsim.report.verdict import PATH_FILE

APART = 1e-7  # [m] points nearer than this to the one before are one


def file_findings(program: Program, file: Path) -> tuple[SeamFindings, PointCloud]:
    """The seams of a path file, one for each of its paths, and their points as the only cloud there is.

    Args:
        program: as read from the file.  file: JSON entries tell more of a seam than its path does; a CSV's seams are its paths.
    """
    entries = read_path_json(file)["seams"] if program.kind == "path" else [{} for _ in program.paths]
    seams = tuple(_seam(entry, path) for entry, path in zip(entries, program.paths, strict=True))
    points = np.concatenate([seam.points_B for seam in seams])
    findings = SeamFindings(seams=seams, region=np.zeros(len(points), np.int32), method=PATH_FILE)
    return findings, PointCloud(points=points, frame="B")


def _seam(entry: dict[str, Any], path: TorchPath) -> Seam:
    """The seam of one entry; what it does not say is taken from the path along it."""
    raw = np.array(entry.get("points", path.X_BT.p), float)
    keep = np.concatenate([[True], np.linalg.norm(np.diff(raw, axis=0), axis=1) > APART])
    if keep.sum() < 2:  # a path on the spot: its poses say why it cannot be welded
        raw, keep = path.X_BT.p, np.ones(len(path.X_BT.p), bool)
        raw = raw + np.linspace(0, 1e-6, len(raw))[:, None]
    points = raw[keep]
    sigma = np.array(entry.get("sigma", []), float)
    joints, references = get_args(Joint), get_args(Reference)
    joint: Joint = entry["joint"] if entry.get("joint") in joints else "groove"
    reference: Reference = entry["reference"] if entry.get("reference") in references else "opening"
    closed = bool(entry.get("closed")) and bool(np.linalg.norm(points[0] - points[-1]) <= 1e-6)
    s = arc_length(points)
    return Seam(
        points_B=points,
        s=s,
        tangents_B=tangents(points),
        normals_B=_normals(points, path),
        sigma=sigma[keep] if len(sigma) == len(raw) and bool((sigma >= 0).all()) else None,
        width=_number(entry.get("width")),
        step=_number(entry.get("step")),
        confidence=min(1.0, max(0.0, _number(entry.get("confidence")))),
        joint=joint,
        reference=reference,
        closed=closed,
    )


def _normals(points: Float[ndarray, "n 3"], path: TorchPath) -> Float[ndarray, "n 3"]:
    """Against the wire of the nearest pose."""
    X = path.X_BT
    moved = np.concatenate([[True], np.linalg.norm(np.diff(X.p, axis=0), axis=1) > APART])
    if moved.sum() < 2:
        return np.broadcast_to(-X.R[0, :, 2], points.shape)
    line = X.p[moved]
    _, _, at = project(points, line)
    wire = np.stack([np.interp(at, arc_length(line), column) for column in X.R[moved][:, :, 2].T], axis=1)
    return -unit(wire)


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else 0.0
