"""Clouds in files: PLY, PCD, XYZ/TXT/CSV, PTX, NPZ and NPY in, PLY, NPZ and XYZ out.

The format is found from the first bytes, not from the name. Whatever cannot be used is a `CloudFileError` (the bytes) or a
`CloudError` (the points), in one line. Depth images are read by `weldsim.cloud.depth_files`, repeated here.
"""

import io
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.cloud.arrays import read_array_cloud
from weldsim.cloud.depth_files import read_depth_frame, write_depth_png
from weldsim.cloud.extent import MIN_SPAN, check_box, check_extent, check_grain, check_reach, check_viewpoints, cropped_to
from weldsim.cloud.pcd import read_pcd
from weldsim.cloud.ply import read_ply
from weldsim.cloud.ptx import is_ptx, read_ptx
from weldsim.cloud.raw import METRES, RawCloud, Unreadable
from weldsim.cloud.sensor_frame import placed
from weldsim.cloud.sources import read_bytes, unpacked
from weldsim.cloud.table import read_text
from weldsim.columns import decode, utf_16
from weldsim.counted import counted
from weldsim.errors import CloudError, CloudFileError, InputError, OutputError
from weldsim.output import write_whole
from weldsim.records import PointCloud

__all__ = ["LengthUnit", "check_plannable", "read_cloud", "read_depth_frame", "write_cloud", "write_depth_png"]

LengthUnit = Literal["m", "cm", "mm", "um", "in", "ft"]
_OTHERS = {
    b"LASF": "a LAS or LAZ file", b"ASTM-E57": "an E57 file", b"solid ": "an STL mesh", b"OFF": "an OFF mesh",
    b"glTF": "a glTF mesh", b"\x89HDF": "an HDF5 file, as Zivid's ZDF and MATLAB's are", b"MATLAB 5.0": "a MATLAB file",
    b"#ROSBAG": "a ROS bag", b"\xff\xd8\xff": "a JPEG image", b"II*\0": "a TIFF image", b"MM\0*": "a TIFF image",
    b"<!DOCTYPE": "a web page", b"<html": "a web page", b"<?xml": "an XML file", b"%PDF": "a PDF",
}  # fmt: skip
MIN_POINTS = 100  # fewer cannot show a groove
SAMPLE = 20_000  # points tell the breadth of a cloud that is no line
MIN_BREADTH = 0.001  # [m] rms breadth across the longest direction below which the points are a line


def read_cloud(
    path: str | Path,
    *,
    unit: LengthUnit | None = None,
    viewpoint: Sequence[float] | ndarray | None = None,
    crop: tuple[Sequence[float], Sequence[float]] | None = None,
) -> PointCloud:
    """The cloud in a file, in metres, expressed in the robot base; points that are not finite are dropped, and
    those at 0 0 0 where several are.

    Args:
        path: PLY, PCD, XYZ/TXT/CSV, PTX, NPZ or NPY, gzip-compressed or not, told apart by content. Points in the frame
            of a sensor whose pose the file gives are moved by it; the cloud's `notes` say so.
        unit: the file's unit of length; by default the one that its columns' names give, else metres.
        viewpoint: where the camera stood (3,) [m] in the same frame; it outranks what the file says.
        crop: lower and upper corner of the box that is kept [m]; by default everything is.
    Raises:
        CloudFileError: missing, unreadable, cut off, or no cloud.
        CloudError: no finite point, coordinates too coarse, an extent that shows that `unit` is wrong, or a camera too far away.
    """
    if unit is not None and unit not in METRES:
        raise CloudError(f"unit {unit!r} is not one of {', '.join(METRES)}", unit=unit)
    box = None if crop is None else check_box(crop)
    data, given = unpacked(path, read_bytes(path)), _given(viewpoint)
    if utf_16(data) is not None:  # as spreadsheets save text
        data = decode(data).encode()
    try:
        with np.errstate(all="ignore"):  # signalling NaNs and the like are dropped below
            raw = placed(_reader(data)(data), given)
    except Unreadable as error:
        reason = _of_another_kind(Path(path)) or str(error)
        raise CloudFileError(f"{path}: {reason}", path=str(path), reason=reason) from None
    said = unit or raw.unit or "m"
    if raw.unit is not None and said != raw.unit:
        raise CloudError(f"{path}: --units {said}, but its header says {raw.unit}; leave --units out", path=str(path))
    scale = METRES[said]
    keep = _seen(raw.points)
    total, dropped = len(keep), int((~keep).sum())
    if dropped == total:
        raise CloudError(f"{path}: none of its {counted(total, 'point')} is finite", path=str(path), total=total)
    with np.errstate(over="ignore", invalid="ignore"):
        check_grain(str(path), raw.points[keep] if dropped else raw.points, scale)
        if box is not None:
            keep &= cropped_to(box, raw.points * scale)
            if not keep.any():
                raise CloudError(
                    f"crop box: none of the {counted(total, 'point')} of {path} is in it; change cloud.crop_min and crop_max"
                )
        whole = bool(keep.all())
        points = (raw.points if whole else raw.points[keep]) * scale
        check_extent(str(path), points, said, dropped, raw)
    viewpoints, view = _viewpoints(raw, scale, given)
    check_viewpoints(str(path), points, viewpoints, option=given is not None)
    return PointCloud(
        points=points,
        normals=_unit_normals(raw.normals, keep),
        colours=None if raw.colours is None else raw.colours if whole else raw.colours[keep],
        viewpoints=viewpoints,
        view=None if view is None else view[keep],
        notes=raw.notes,
    )


def _of_another_kind(path: Path) -> str:
    """What a file that is no cloud is by its name, and what to do with it; "" for a cloud's name."""
    kinds = {
        ".toml": f"it is no cloud; of a scene, weldsim scan {path} --out {path.stem}.ply makes one",
        ".json": f"it is no cloud; of a path, did you mean weldsim dry-run {path}?",
        ".script": f"it is a robot program, no cloud; did you mean weldsim dry-run {path}?",
        ".stl": "it is an STL mesh, no cloud; a scene with it under [mesh] can be scanned: weldsim scan SCENE.toml --out cloud.ply",
    }
    return kinds.get(path.suffix.lower(), "")


def _reader(data: bytes) -> Callable[[bytes], RawCloud]:
    """What reads `data`, from its first bytes."""
    if data[:3] == b"ply" and data[3:4] in (b"\n", b"\r", b" "):
        return read_ply
    if data[:4] == b"\x89PNG":
        raise Unreadable("it is a PNG image; a depth image needs its intrinsics beside it (--intrinsics)")
    if data.startswith(b"version https://git-lfs"):
        raise Unreadable("it is a pointer of Git LFS, not the file itself: git lfs pull fetches it")
    if data[:2] == b"PK" and b"[Content_Types].xml" in data[:4096]:
        raise Unreadable("it is an Excel workbook; save the sheet as CSV")
    if data[:2] == b"PK" or data[:6] == b"\x93NUMPY":
        return read_array_cloud
    for magic, name in _OTHERS.items():
        if data.startswith(magic):
            raise Unreadable(f"it is {name}; export the cloud as PLY, PCD or XYZ text")
    head = data[:4096]
    if head.startswith((b"# .PCD", b"VERSION")) or (b"\nFIELDS" in head and b"\nSIZE" in head):
        return read_pcd
    if re.search(rb"^v[ \t]+[-+.\d]", head, re.MULTILINE):
        return _read_obj
    return read_ptx if is_ptx(head) else read_text


def _read_obj(data: bytes) -> RawCloud:
    """The vertices of an OBJ."""
    return read_text(b"\n".join(re.findall(rb"^v[ \t]+([^\n]*)", data, re.MULTILINE)))


def _seen(points: Float[ndarray, "n 3"]) -> Bool[ndarray, "n"]:
    """Which points are finite, without the origin where several lie there, and others elsewhere: cameras write
    0 0 0 for a pixel that saw nothing."""
    x, y, z = np.isfinite(points).T
    finite = x & y & z
    x, y, z = (points == 0).T
    blind = x & y & z
    return finite & ~blind if np.count_nonzero(blind) > 1 and not blind[finite].all() else finite


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


def _given(viewpoint: Sequence[float] | ndarray | None) -> Float[ndarray, "3"] | None:
    """Where the caller says that the camera stood [m]. Raises CloudError for what is no place."""
    if viewpoint is None:
        return None
    try:
        given = np.asarray(viewpoint, float).reshape(-1)
    except (TypeError, ValueError):
        given = np.zeros(0)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise CloudError(f"viewpoint {viewpoint!r}: three finite numbers in metres are needed", viewpoint=viewpoint)
    return given


def _viewpoints(raw: RawCloud, scale: float, given: Float[ndarray, "3"] | None) -> tuple[Float[ndarray, "k 3"], ndarray | None]:
    """Camera positions [m] and which of them saw each point, or none known."""
    if given is not None:
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
        CloudError: fewer than 100 points, an extent below 5 mm, points along a line, or none within an arm's reach; `data` has
            the figure.
    """
    if len(cloud) < MIN_POINTS:
        raise CloudError(
            f"the cloud has {counted(len(cloud), 'point')}, planning needs {MIN_POINTS}", points=len(cloud), limit=MIN_POINTS
        )
    columns = cloud.points.T  # by column: reducing along axis 0 is slow
    span = max(float(column.max() - column.min()) for column in columns)
    if span < MIN_SPAN:
        raise CloudError(f"the cloud spans {span * 1e3:.3g} mm, planning needs {MIN_SPAN * 1e3:g} mm; check its unit", span=span)
    breadth = _breadth(cloud.points[:: max(1, len(cloud) // SAMPLE)])
    if breadth < MIN_BREADTH:
        breadth = _breadth(cloud.points)
    if breadth < MIN_BREADTH:
        raise CloudError(
            f"the cloud is a line: its points lie within {breadth * 1e3:.2g} mm rms of it (least {MIN_BREADTH * 1e3:g} mm)",
            breadth=breadth,
        )
    check_reach(cloud)


def _breadth(points: Float[ndarray, "n 3"]) -> float:
    """rms distance of points from the line along which they are longest, seen in the broadest direction [m]."""
    centred = points - points.mean(axis=0)
    return float(np.sqrt(max(0.0, np.linalg.eigvalsh(centred.T @ centred / len(points))[1])))


def write_cloud(path: str | Path, cloud: PointCloud | Float[ndarray, "n 3"]) -> Path:
    """Where the cloud now lies: binary PLY (coordinates in double), NPZ (exact) or XYZ text (to 1 nm).

    Args:
        cloud: or its points [m].
    Raises:
        OutputError: a suffix other than .ply, .npz, .xyz, .txt, or a place that cannot be written.
        InputError: what is neither a cloud nor an array.  RecordError: an array that is no cloud.
    """
    if isinstance(cloud, ndarray):
        cloud = PointCloud(points=cloud)
    if not isinstance(path, str | Path) or not isinstance(cloud, PointCloud):
        raise InputError(
            f"write_cloud: a file name and a cloud, in this order, are wanted, not {type(path).__name__}, {type(cloud).__name__}"
        )
    writers = {".ply": _ply_bytes, ".npz": _npz_bytes, ".xyz": _xyz_bytes, ".txt": _xyz_bytes}
    suffix = Path(path).suffix.lower()
    if suffix not in writers:
        raise OutputError(f"{path}: clouds are written as {', '.join(writers)}", path=str(path), allowed=list(writers))
    return write_whole(path, writers[suffix](cloud))


_PLY_TYPES = {"<f8": "double", "u1": "uchar", "<u2": "ushort"}


def _ply_bytes(cloud: PointCloud) -> bytes:
    layout = [(name, "<f8") for name in "xyz"]
    layout += [(name, "<f8") for name in ("nx", "ny", "nz")] if cloud.normals is not None else []
    layout += [(name, "u1") for name in ("red", "green", "blue")] if cloud.colours is not None else []
    layout += [("view", "<u2")] if cloud.view is not None else []
    table = np.zeros(len(cloud), layout)
    columns = [cloud.points, cloud.normals, None if cloud.colours is None else np.round(cloud.colours * 255)]
    values = [column[:, axis] for column in columns if column is not None for axis in range(3)]
    values += [cloud.view] if cloud.view is not None else []
    for (name, _), column in zip(layout, values, strict=True):
        table[name] = column
    header = ["ply", "format binary_little_endian 1.0", f"comment points in frame {cloud.frame}, metres"]
    header += ["comment viewpoint " + " ".join(repr(float(value)) for value in place) for place in cloud.viewpoints]
    header.append(f"element vertex {len(cloud)}")
    header += [f"property {_PLY_TYPES[kind]} {name}" for name, kind in layout]
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
