"""Clouds in files: PLY, PCD, XYZ/TXT/CSV, NPZ and NPY in, PLY, NPZ and XYZ out.

The format is found from the first bytes, not from the name. Whatever cannot be used is a `CloudFileError` (the bytes) or a
`CloudError` (the points), in one line. Depth images are read by `weldsim.cloud.depth_files`, repeated here.
"""

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.cloud.arrays import read_array_cloud
from weldsim.cloud.depth_files import read_depth_frame, write_depth_png
from weldsim.cloud.pcd import read_pcd
from weldsim.cloud.ply import read_ply
from weldsim.cloud.raw import RawCloud, Unreadable
from weldsim.cloud.sources import read_bytes
from weldsim.cloud.table import read_text
from weldsim.errors import CloudError, CloudFileError, OutputError
from weldsim.output import write_whole
from weldsim.records import MILLIMETRE_SPAN, PointCloud

__all__ = ["LengthUnit", "check_plannable", "read_cloud", "read_depth_frame", "write_cloud", "write_depth_png"]

LengthUnit = Literal["m", "cm", "mm", "in"]
_METRES: dict[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
MIN_SPAN = 0.005  # [m] a cloud smaller than this was scaled down twice, or shows no weld
MAX_GRAIN = 0.0002  # [m] between neighbouring coordinates of a file in single precision
MIN_POINTS = 100  # fewer cannot show a groove
MIN_BREADTH = 0.001  # [m] rms breadth across the longest direction below which the points are a line


def read_cloud(path: str | Path, *, unit: LengthUnit = "m", viewpoint: Sequence[float] | ndarray | None = None) -> PointCloud:
    """The cloud in a file, in metres, expressed in the robot base; points that are not finite are dropped.

    Args:
        path: PLY, PCD, XYZ/TXT/CSV, NPZ or NPY, told apart by content.
        unit: the file's unit of length.
        viewpoint: where the camera stood (3,) [m] in the same frame; it outranks what the file says.
    Raises:
        CloudFileError: missing, unreadable, cut off, or no cloud.
        CloudError: no finite point, coordinates too coarse, or an extent that shows that `unit` is wrong.
    """
    data = read_bytes(path)
    try:
        with np.errstate(all="ignore"):  # signalling NaNs and the like are dropped below
            raw = _reader(data)(data)
    except Unreadable as error:
        raise CloudFileError(f"{path}: {error}", path=str(path), reason=str(error)) from None
    keep = _finite_rows(raw.points)
    total, dropped = len(keep), int((~keep).sum())
    if dropped == total:
        raise CloudError(f"{path}: none of its {total} points is finite", path=str(path), total=total)
    with np.errstate(over="ignore", invalid="ignore"):
        _check_grain(str(path), raw.points[keep] if dropped else raw.points, _METRES[unit])
        points = (raw.points if dropped == 0 else raw.points[keep]) * _METRES[unit]
        _check_extent(str(path), points, unit, dropped)
    viewpoints, view = _viewpoints(raw, _METRES[unit], viewpoint)
    return PointCloud(
        points=points,
        normals=_unit_normals(raw.normals, keep),
        colours=None if raw.colours is None else raw.colours[keep] if dropped else raw.colours,
        viewpoints=viewpoints,
        view=None if view is None else view[keep],
    )


def _reader(data: bytes) -> Callable[[bytes], RawCloud]:
    """What reads `data`, from its first bytes."""
    if data[:3] == b"ply" and data[3:4] in (b"\n", b"\r", b" "):
        return read_ply
    if data[:2] == b"PK" or data[:6] == b"\x93NUMPY":
        return read_array_cloud
    if data[:4] == b"\x89PNG":
        raise Unreadable("it is a PNG image; a depth image needs its intrinsics beside it (--intrinsics)")
    if data[:2] == b"\x1f\x8b":
        raise Unreadable("it is gzip-compressed; unpack it first")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise Unreadable("it is UTF-16 text; save it as UTF-8")
    head = data[:4096]
    if head.startswith((b"# .PCD", b"VERSION")) or (b"\nFIELDS" in head and b"\nSIZE" in head):
        return read_pcd
    return read_text


def _finite_rows(points: Float[ndarray, "n 3"]) -> Bool[ndarray, "n"]:
    """Which points are finite."""
    x, y, z = np.isfinite(points).T
    return x & y & z


def _check_grain(path: str, points: Float[ndarray, "n 3"], scale: float) -> None:
    """Raises CloudError where single precision, so far from the origin, leaves less than the shape of a groove."""
    reach = float(np.abs(points).max())
    grain = float(np.spacing(np.float32(min(reach, 1e30)))) * scale
    if grain > MAX_GRAIN and (points.astype(np.float32) == points).all():
        raise CloudError(
            f"{path}: its single-precision coordinates reach {reach * scale:.3g} m, where they lie {grain * 1e3:.2g} mm apart"
            f" (limit {MAX_GRAIN * 1e3:g} mm): subtract the offset before saving, or save doubles",
            path=path,
            grain=grain,
            limit=MAX_GRAIN,
        )


def _check_extent(path: str, points: Float[ndarray, "n 3"], unit: str, dropped: int) -> None:
    """Raises CloudError when the extent shows that the unit is wrong."""
    span = float(np.ptp(points, axis=0).max())
    left_out = f" ({dropped} points that are not finite left out)" if dropped else ""
    if span > MILLIMETRE_SPAN:
        low, high = np.percentile(points[:: max(1, len(points) // 20_000)], [2, 98], axis=0)
        bulk = float((high - low).max())
        if bulk <= MILLIMETRE_SPAN / 2:
            advice = f"96 % of the points lie within {bulk:.3g} m: remove the stray ones"
        elif unit == "m" and span <= MILLIMETRE_SPAN * 1e3:
            advice = "it looks like millimetres: pass --units mm"
        else:
            advice = "check its unit, or crop it to the workpiece"
        raise CloudError(
            f"{path}: spans {span:.4g} m read in {unit} (limit {MILLIMETRE_SPAN:g} m){left_out}; {advice}", path=path, span=span
        )
    if unit != "m" and 0 < span < MIN_SPAN:
        raise CloudError(
            f"{path}: spans {span * 1e3:.3g} mm read in {unit} (least {MIN_SPAN * 1e3:g} mm){left_out}; it looks like metres:"
            " pass --units m",
            path=path,
            span=span,
        )


def _unit_normals(normals: Float[ndarray, "n 3"] | None, keep: Bool[ndarray, "n"]) -> Float[ndarray, "m 3"] | None:
    """Normals of the points kept, of unit length; None where one of them has no direction (stages then estimate their own)."""
    if normals is None:
        return None
    with np.errstate(all="ignore"):
        kept = normals if keep.all() else normals[keep]
        squares = np.einsum("ij,ij->i", kept, kept)
        if not (np.isfinite(squares).all() and squares.min() > 1e-200):
            return None
        return kept / np.sqrt(squares)[:, None]


def _viewpoints(
    raw: RawCloud, scale: float, viewpoint: Sequence[float] | ndarray | None
) -> tuple[Float[ndarray, "k 3"], ndarray | None]:
    """Camera positions [m] and which of them saw each point, or none known."""
    if viewpoint is not None:
        given = np.asarray(viewpoint, float).reshape(-1)
        if given.shape != (3,) or not np.isfinite(given).all():
            raise CloudError(f"viewpoint {viewpoint!r}: three finite numbers in metres are needed", viewpoint=viewpoint)
        return given[None], None
    found = raw.viewpoints
    if found is None or not np.isfinite(found).all() or len(found) == 0:
        return np.zeros((0, 3)), None
    if len(found) > 1 and (raw.view is None or raw.view.min() < 0 or raw.view.max() >= len(found)):
        return np.zeros((0, 3)), None
    return found * scale, raw.view if len(found) > 1 else None


def check_plannable(cloud: PointCloud) -> None:
    """Nothing, when the cloud could show a seam.

    Raises:
        CloudError: fewer than 100 points, an extent below 5 mm, or points along a line; `data` has the figure.
    """
    if len(cloud) < MIN_POINTS:
        raise CloudError(f"the cloud has {len(cloud)} points, planning needs {MIN_POINTS}", points=len(cloud), limit=MIN_POINTS)
    columns = cloud.points.T  # by column: reducing along axis 0 is slow
    span = max(float(column.max() - column.min()) for column in columns)
    if span < MIN_SPAN:
        raise CloudError(f"the cloud spans {span * 1e3:.3g} mm, planning needs {MIN_SPAN * 1e3:g} mm; check its unit", span=span)
    centred = np.stack([column - column.mean() for column in columns])
    breadth = float(np.sqrt(max(0.0, np.linalg.eigvalsh(centred @ centred.T / len(cloud))[1])))
    if breadth < MIN_BREADTH:
        raise CloudError(
            f"the cloud is a line: its points lie within {breadth * 1e3:.2g} mm rms of it (least {MIN_BREADTH * 1e3:g} mm)",
            breadth=breadth,
        )


def write_cloud(path: str | Path, cloud: PointCloud) -> Path:
    """Where the cloud now lies: binary PLY (coordinates in double), NPZ (exact, with all viewpoints) or XYZ text (to 1 nm).

    Raises:
        OutputError: a suffix other than .ply, .npz, .xyz, .txt, or a place that cannot be written.
    """
    writers = {".ply": _ply_bytes, ".npz": _npz_bytes, ".xyz": _xyz_bytes, ".txt": _xyz_bytes}
    suffix = Path(path).suffix.lower()
    if suffix not in writers:
        raise OutputError(f"{path}: clouds are written as {', '.join(writers)}", path=str(path), allowed=list(writers))
    return write_whole(path, writers[suffix](cloud))


def _ply_bytes(cloud: PointCloud) -> bytes:
    layout = [(name, "<f8") for name in "xyz"]
    layout += [(name, "<f8") for name in ("nx", "ny", "nz")] if cloud.normals is not None else []
    layout += [(name, "u1") for name in ("red", "green", "blue")] if cloud.colours is not None else []
    table = np.zeros(len(cloud), layout)
    columns = [cloud.points, cloud.normals, None if cloud.colours is None else np.round(cloud.colours * 255)]
    values = [column[:, axis] for column in columns if column is not None for axis in range(3)]
    for (name, _), column in zip(layout, values, strict=True):
        table[name] = column
    header = ["ply", "format binary_little_endian 1.0", f"comment points in frame {cloud.frame}, metres"]
    if len(cloud.viewpoints) == 1:
        header.append("comment viewpoint " + " ".join(repr(float(value)) for value in cloud.viewpoints[0]))
    header.append(f"element vertex {len(cloud)}")
    header += [f"property {'uchar' if kind == 'u1' else 'double'} {name}" for name, kind in layout]
    return "\n".join([*header, "end_header", ""]).encode() + table.tobytes()


def _npz_bytes(cloud: PointCloud) -> bytes:
    arrays: dict[str, Any] = {"points": cloud.points, "viewpoints": cloud.viewpoints}
    arrays |= {name: getattr(cloud, name) for name in ("normals", "colours", "view") if getattr(cloud, name) is not None}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _xyz_bytes(cloud: PointCloud) -> bytes:
    columns, names = [cloud.points], "x y z"
    if cloud.normals is not None:
        columns, names = [cloud.points, cloud.normals], "x y z nx ny nz"
    row = " ".join(["%.9f"] * (3 * len(columns)))
    lines = map(row.__mod__, map(tuple, np.hstack(columns).tolist()))
    return "\n".join([f"# {names}", *lines, ""]).encode()
