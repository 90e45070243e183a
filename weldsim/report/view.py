"""What the pictures show, as arrays: the view plane, the cloud thinned, the mean cross-section, torch axes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.curves import project
from weldsim.frames import Transform, unit
from weldsim.quantity import Metre
from weldsim.records import ExecutionLog, KnownSeam, PointCloud, Reference, Seam, SeamFindings, TorchPath
from weldsim.report.metrics import across, known_offsets, match_seams
from weldsim.report.tracking import thinned

LINE: Metre = 1e-3  # points nearer together across a seam than this are the seam itself
MARGIN: Metre = 0.06  # of cloud shown around the seams
SECTION: Metre = 0.025  # half width of the cross-section shown
BIN: Metre = 0.5e-3  # of the cross-section


@dataclass(frozen=True, eq=False, kw_only=True)
class CrossSection:
    """The cloud's mean profile across a seam, relative to the parent surface at the reference line.

    Attributes:
        across: (k,) [m], positive to the left of travel.  median, low, high: (k,) height [m], its middle and 16 to 84 %.
        lips: (2, 2) across and height of the left and right lip [m], or None.
        depth: of the root below the opening [m], or None.
    """

    across: Float[ndarray, "k"]
    median: Float[ndarray, "k"]
    low: Float[ndarray, "k"]
    high: Float[ndarray, "k"]
    lips: Float[ndarray, "2 2"] | None
    depth: float | None


def view_frame(cloud: PointCloud, seams: tuple[Seam, ...]) -> Transform:
    """X_BS: origin amid the seams, x along the first seam's chord, z out of its parent surface (mean normal).

    Without a seam: amid the cloud, z along its least extent towards the sensor, x along its greatest.
    """
    if seams:
        first = seams[0]
        origin = np.concatenate([seam.points_B for seam in seams]).mean(axis=0)
        z = first.normals_B.mean(axis=0)
        x = first.points_B[-1] - first.points_B[0]
        if np.linalg.norm(x) < 0.2 * first.length:
            x = first.points_B[len(first.s) // 2] - first.points_B[0]
    else:
        origin = np.median(cloud.points, axis=0)
        axes = np.linalg.svd((cloud.points - origin)[:: max(1, len(cloud) // 20_000)], full_matrices=False)[2]
        z, x = axes[2], axes[0]
        towards = cloud.viewpoints[0] - origin if len(cloud.viewpoints) else np.array([0.0, 0.0, 1.0])
        z = z * (1.0 if z @ towards >= 0 else -1.0)
    z = unit(z)
    y = unit(np.cross(z, x))
    return Transform("BS", np.stack([np.cross(y, z), y, z], axis=1), origin)


def shown(cloud: PointCloud, seams: tuple[Seam, ...], limit: int, margin: Metre = MARGIN) -> Int[ndarray, "m"]:
    """Indices of at most `limit` points near the seams' bounding box, evenly strided (all of the cloud when there is no seam)."""
    index = np.arange(len(cloud))
    if seams:
        X_SB = view_frame(cloud, seams).inverse()
        local = X_SB.points(cloud.points)
        ours = X_SB.points(np.concatenate([seam.points_B for seam in seams]))
        index = index[((local > ours.min(axis=0) - margin) & (local < ours.max(axis=0) + margin)).all(axis=1)]
    return index[:: max(1, -(-len(index) // limit))]


def cross_section(cloud: PointCloud, seam: Seam, half: Metre = SECTION) -> CrossSection:
    """The cloud seen along the seam: every point within `half` of it, as height over the parent surface against offset across."""
    near = np.flatnonzero(KDTree(seam.points_B).query(cloud.points, distance_upper_bound=1.5 * half)[0] < np.inf)
    points = cloud.points[near]
    _, foot, s = project(points, seam.points_B)
    inner = (s > 0.03 * seam.length) & (s < 0.97 * seam.length)
    aside, height = _local(points, foot, s, seam)
    keep = inner & (np.abs(aside) < half) & (np.abs(height) < half)
    centres, (low, median, high) = _binned(aside[keep], height[keep], half)
    lips = None
    if seam.left_B is not None and seam.right_B is not None:
        sides = [_local(side, seam.points_B, seam.s, seam) for side in (seam.left_B, seam.right_B)]
        lips = np.array([[a.mean(), h.mean()] for a, h in sides])
    return CrossSection(across=centres, median=median, low=low, high=high, lips=lips, depth=seam.depth)


def shows_surface(cloud: PointCloud, seams: tuple[Seam, ...]) -> bool:
    """Whether a cloud shows more than the seams themselves; that of a path file does not."""
    return not seams or any(len(across := cross_section(cloud, seam).across) and np.ptp(across) > LINE for seam in seams)


def torch_axes(path: TorchPath, every: Metre = 0.01, length: Metre = 0.03) -> Float[ndarray, "m 2 3"]:
    """Short lines from the tip back along the wire, one each `every` of weld [m]."""
    weld = path.weld
    s = path.s[weld] - path.s[weld.start]
    at = np.searchsorted(s, np.arange(0.0, s[-1] + 1e-9, every)).clip(0, len(s) - 1)
    X = path.X_BT[weld][at]
    return np.stack([X.p, X.p - length * X.R[:, :, 2]], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorLine:
    """How far a line lies from the known seam, along it.

    Attributes:
        s: (k,) arc length of the known seam [m].  across: (k,) error in the parent surface, left of travel positive [m].
        distance: (k,) perpendicular distance in space [m].  sigma: (k,) what the finder claimed [m], or None.
    """

    s: Float[ndarray, "k"]
    across: Float[ndarray, "k"]
    distance: Float[ndarray, "k"]
    sigma: Float[ndarray, "k"] | None = None


def error_lines(
    findings: SeamFindings,
    paths: tuple[TorchPath | None, ...],
    log: ExecutionLog | None,
    known: tuple[KnownSeam, ...],
    welded: int,
) -> dict[str, ErrorLine]:
    """ "plan" and "executed" against the known seam that the welded one is paired with; empty when there is none."""
    partner = {i: known[j] for i, j in match_seams(findings.seams, known).pairs}.get(welded)
    path = paths[welded] if welded < len(paths) else None
    if partner is None or path is None:
        return {}
    seam = findings.seams[welded]
    weld = path.weld
    claimed = None if path.sigma is None else path.sigma[weld]
    out = {"plan": _error_line(path.X_BT.p[weld], partner, seam.reference, claimed)}
    if log is not None and log.arc_on.any():
        out["executed"] = _error_line(thinned(log)[0], partner, seam.reference, None)
    return out


def heights(points_B: Float[ndarray, "n 3"], seams: tuple[Seam, ...], X_BS: Transform) -> Float[ndarray, "n"]:
    """Height over the parent surface, which near a seam is the tangent plane at the nearest seam point [m].

    A bent plate is level in these heights; without a seam they are heights over the view plane.
    """
    if not seams:
        return X_BS.inverse().points(points_B)[:, 2]
    at = np.concatenate([seam.points_B for seam in seams])
    normals = np.concatenate([seam.normals_B for seam in seams])
    nearest = KDTree(at).query(points_B)[1]
    return np.einsum("ij,ij->i", points_B - at[nearest], normals[nearest])


def height_range(values: Float[ndarray, "n"], seams: tuple[Seam, ...]) -> tuple[float, float]:
    """The range of heights that colours are spread over [m]: around seams the groove and its surface, not the table below."""
    low, high = (float(v) for v in np.percentile(values, [1, 99])) if len(values) else (0.0, 0.0)
    if seams:
        deepest = max((seam.depth or 0.008 for seam in seams), default=0.008)
        low, high = max(low, -1.2 * deepest), min(high, 0.4 * deepest)
    return (low, high) if high > low else (low - 1e-3, low + 1e-3)


def _error_line(points: ndarray, known: KnownSeam, reference: Reference, sigma: ndarray | None) -> ErrorLine:
    found = known_offsets(points, known, reference)
    order = np.argsort(found.s, kind="stable")
    return ErrorLine(
        s=found.s[order],
        across=across(found, known, reference)[order],
        distance=found.distance[order],
        sigma=None if sigma is None else sigma[order],
    )


def _local(points: ndarray, foot: ndarray, s: ndarray, seam: Seam) -> tuple[ndarray, ndarray]:
    """Offset across (left positive) and height over the parent surface of points about their feet [m]."""
    index = np.abs(np.searchsorted(seam.s, s)).clip(0, len(seam.s) - 1)
    normal = seam.normals_B[index]
    left = unit(np.cross(normal, seam.tangents_B[index]))
    offset = points - foot
    return np.einsum("ij,ij->i", offset, left), np.einsum("ij,ij->i", offset, normal)


def _binned(x: ndarray, y: ndarray, half: float) -> tuple[ndarray, ndarray]:
    """Bin centres and the 16th, 50th and 84th percentile of y in each bin that holds five points or more."""
    count = round(2 * half / BIN)
    which = np.clip(((x + half) / BIN).astype(int), 0, count - 1)
    order = np.lexsort((y, which))
    y, which = y[order], which[order]
    first = np.searchsorted(which, np.arange(count))
    size = np.searchsorted(which, np.arange(count), side="right") - first
    full = np.flatnonzero(size >= 5)
    quantiles = np.stack([y[first[full] + (q * (size[full] - 1)).astype(int)] for q in (0.16, 0.5, 0.84)])
    return -half + (full + 0.5) * BIN, quantiles
