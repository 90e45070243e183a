"""Recorded depth frames: a 16-bit PNG or an NPY, its intrinsics in a text file, and the camera's pose.

Intrinsics are width, height, fx, fy, cx, cy (or ppx, ppy), or a 3x3 `K` with width and height, and the coefficients of the
lens, as JSON, TOML or `key: value` lines (see `weldsim.cloud.camera_files`).
A `depth_scale` there [m per count] outranks the caller's. A pose is that of the optical frame in the robot base (see
`weldsim.cloud.pose_files`).
"""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from weldsim.cloud.arrays import read_npy, read_npz
from weldsim.cloud.camera_files import numbers, read_camera
from weldsim.cloud.extent import FARTHEST_CAMERA, meant_metres
from weldsim.cloud.key_values import read_table
from weldsim.cloud.pose_files import read_pose
from weldsim.cloud.raw import Unreadable
from weldsim.cloud.sources import read_bytes
from weldsim.errors import CloudFileError, RecordError
from weldsim.frames import Transform
from weldsim.output import write_whole
from weldsim.records import CameraIntrinsics, DepthFrame

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_MAX_DEPTH = 100.0  # [m] a median beyond it was surely written in millimetres


def read_depth_frame(
    path: str | Path, intrinsics_path: str | Path, *, pose: str | Path | Transform | None = None, depth_unit: float = 1e-3
) -> DepthFrame:
    """The depth frame in a 16-bit PNG, or in an NPY or NPZ (whole numbers as in the PNG, floats in metres).

    Args:
        path: the image; 0, the largest whole number, negative and non-finite values mean no return.
        intrinsics_path: see the module's docstring.
        pose: X_BC, or a file that holds it; None puts the robot base where the camera is.
        depth_unit: metres per count of a whole number.
    Raises:
        CloudFileError: a file is missing, damaged, of another size than the intrinsics say, or holds no depth.
    """
    table = read_table(intrinsics_path)
    try:
        intrinsics, unit = read_camera(table), _scale(table, depth_unit)
    except (Unreadable, RecordError) as error:
        raise CloudFileError(f"{intrinsics_path}: {error}", path=str(intrinsics_path), reason=str(error)) from None
    X_BC = pose if isinstance(pose, Transform) else Transform.identity("BC") if pose is None else read_pose(pose)
    _check_pose(X_BC, "pose" if pose is None or isinstance(pose, Transform) else str(pose))
    data = read_bytes(path)
    try:
        depth = _metres(_image(data, (intrinsics.height, intrinsics.width)), unit)
        _check_lens(intrinsics, depth, str(intrinsics_path))
    except Unreadable as error:
        raise CloudFileError(f"{path}: {error}", path=str(path), reason=str(error)) from None
    return DepthFrame(depth=depth, intrinsics=intrinsics, X_BC=X_BC, source=Path(path).name)


def _check_pose(X_BC: Transform, where: str) -> None:
    """Raises CloudFileError for a camera so far from the base that its position must be in another unit."""
    away = float(np.linalg.norm(X_BC.p))
    if away <= FARTHEST_CAMERA:
        return
    advice = "is it in the frame of the robot's base?"
    if (told := meant_metres(X_BC.p)) is not None:
        x, y, z = (f"{value:.6g}" for value in told[1])
        advice = f"it looks like {told[0]}; positions are in metres: ({x}, {y}, {z})"
    reason = f"the camera is {away:.4g} m from the robot's base (limit {FARTHEST_CAMERA:g} m): {advice}"
    raise CloudFileError(f"{where}: {reason}", path=where, reason=reason, distance=away, limit=FARTHEST_CAMERA)


def _check_lens(camera: CameraIntrinsics, depth: Float32[ndarray, "h w"], path: str) -> None:
    """Raises CloudFileError where the lens has no ray for a pixel with depth: its coefficients are of another camera or unit."""
    if not camera.distortion:
        return
    lost = np.isnan(camera.rays()[..., 0]) & np.isfinite(depth)
    if lost.any():
        row, column = np.argwhere(lost)[0]
        reason = f"its lens coefficients fold the image over at pixel ({column}, {row}); check their order (k1 k2 p1 p2 k3)"
        raise CloudFileError(f"{path}: {reason}", path=path, reason=reason)


def write_depth_png(path: str | Path, depth: Float32[ndarray, "h w"], *, depth_unit: float = 1e-3) -> Path:
    """Where the 16-bit PNG now lies; NaN is written as 0. Raises OutputError, RecordError (depth beyond 16 bits)."""
    import cv2

    counts = np.round(np.nan_to_num(depth.astype(float) / depth_unit))
    if counts.min() < 0 or counts.max() >= 65_535:
        raise RecordError(f"depth up to {counts.max() * depth_unit:.3g} m does not fit 16 bits of {depth_unit:g} m", field="depth")
    _, png = cv2.imencode(".png", counts.astype(np.uint16))
    return write_whole(path, png.tobytes())


# Text ---------------------------------------------------------------------------------------------------------------


def check_depth_unit(intrinsics_path: str | Path, depth_unit: float) -> None:
    """Raises CloudFileError where the camera's file says another length of a count [m] than `depth_unit`."""
    table = read_table(intrinsics_path)
    if "depth_scale" not in table:
        return
    try:
        said = _scale(table, depth_unit)
    except Unreadable as error:
        raise CloudFileError(f"{intrinsics_path}: {error}", path=str(intrinsics_path), reason=str(error)) from None
    if not np.isclose(said, depth_unit, rtol=1e-3, atol=0.0):
        reason = f"depth_scale is {said:g} m a count, --depth-unit {depth_unit:g} m; leave that out, or correct the file"
        raise CloudFileError(f"{intrinsics_path}: {reason}", path=str(intrinsics_path), reason=reason)


def _scale(table: dict[str, Any], depth_unit: float) -> float:
    unit = float(numbers(table, "depth_scale", ())) if "depth_scale" in table else depth_unit
    if not 1e-9 < unit < 1.0:
        raise Unreadable(f"depth_scale {unit:g} m per count is not between 1e-9 and 1")
    return unit


# Images -------------------------------------------------------------------------------------------------------------


def _image(data: bytes, shape: tuple[int, int]) -> ndarray:
    """The image (h, w) in `data`, uint16 or float. Raises Unreadable."""
    if data[:8] == _SIGNATURE:
        return _png(data, shape)
    if data[:6] == b"\x93NUMPY":
        image = read_npy(data)
    elif data[:2] == b"PK":
        arrays = read_npz(data)
        if "depth" not in arrays:
            raise Unreadable(f"it has no array called depth (found: {', '.join(arrays)[:80] or 'none'})")
        image = arrays["depth"]()
    else:
        raise Unreadable("it is neither a PNG nor an NPY nor an NPZ")
    image = image[..., 0] if image.ndim == 3 and image.shape[-1] == 1 else image
    _check_size(image.shape, shape)
    if image.dtype.kind not in "fiu" or image.dtype.itemsize == 1:
        raise Unreadable(f"its type is {image.dtype}; depth is uint16 or float")
    return image


def _check_size(found: tuple[int, ...], expected: tuple[int, int]) -> None:
    if found != expected:
        shown = " x ".join(map(str, found[::-1]))
        turned = "; are width and height swapped there, rows first?" if found == expected[::-1] else ""
        raise Unreadable(f"the image is {shown} px, its intrinsics are for {expected[1]} x {expected[0]}{turned}")


def _png(data: bytes, shape: tuple[int, int]) -> ndarray:
    """A 16-bit single-channel PNG. Every part is checked first: the decoder writes to stderr what it does not like."""
    import cv2

    header, packed = b"", []
    at = 8
    while at + 12 <= len(data):
        size, kind = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + size]
        if at + 12 + size > len(data) or zlib.crc32(kind + body) != int.from_bytes(data[at + 8 + size : at + 12 + size]):
            raise Unreadable("its PNG data is cut off or damaged")
        header = body if kind == b"IHDR" and not header else header
        packed += [body] if kind == b"IDAT" else []
        at += 12 + size
        if kind == b"IEND":
            break
    else:
        raise Unreadable("its PNG data is cut off")
    if len(header) != 13:
        raise Unreadable("its PNG header is missing")
    width, height = int.from_bytes(header[:4]), int.from_bytes(header[4:8])
    bits, colour, interlaced = header[8], header[9], header[12]
    if bits != 16 or colour != 0 or any(header[10:12]):
        kinds = {0: "grey", 2: "RGB", 3: "palette", 4: "grey + alpha", 6: "RGBA"}
        raise Unreadable(f"it is a {bits}-bit {kinds.get(colour, 'unknown')} PNG; depth is one channel of 16 bits")
    if interlaced:
        raise Unreadable("it is an interlaced PNG; save it without")
    _check_size((height, width), shape)
    rows = height * (1 + 2 * width)
    try:
        unpacker = zlib.decompressobj()
        pixels = unpacker.decompress(b"".join(packed), rows + 1)
    except zlib.error as error:
        raise Unreadable(f"its PNG data is damaged ({error})") from None
    if len(pixels) != rows or max(pixels[:: 1 + 2 * width]) > 4:
        raise Unreadable("its PNG data is damaged")

    def chunk(kind: bytes, body: bytes) -> bytes:
        return len(body).to_bytes(4) + kind + body + zlib.crc32(kind + body).to_bytes(4)

    plain = _SIGNATURE + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(pixels, 0)) + chunk(b"IEND", b"")
    image = cv2.imdecode(np.frombuffer(plain, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint16 or image.shape != shape:
        raise Unreadable("its PNG data cannot be decoded")
    return image


def _metres(image: ndarray, unit: float) -> Float32[ndarray, "h w"]:
    """Depth [m], NaN where there is none. Raises Unreadable when nowhere is any, or when it looks like millimetres."""
    with np.errstate(all="ignore"):
        depth = image.astype(np.float64)
        if image.dtype.kind in "iu":
            depth[image == np.iinfo(image.dtype).max] = np.nan
            depth *= unit
        depth[~(np.isfinite(depth) & (depth > 0) & (depth < 1e6))] = np.nan
        depth = depth.astype(np.float32)
        depth[depth == 0] = np.nan  # smaller than float32 holds
    seen = depth[np.isfinite(depth)]
    if not seen.size:
        raise Unreadable("no pixel of it has a depth")
    median = float(np.median(seen))
    if median > _MAX_DEPTH:
        advice = "floats are metres: divide millimetres by 1000" if image.dtype.kind == "f" else "check depth_scale"
        raise Unreadable(f"its median depth is {median:.4g} m (limit {_MAX_DEPTH:g}); {advice}")
    return depth
