"""NPY and NPZ: clouds and depth images as numpy arrays, read without pickles and without believing a header's shape."""

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable

import numpy as np
from numpy import ndarray
from numpy.lib import format as npy

from weldsim.cloud.raw import MAX_POINTS, RawCloud, Unreadable, check_count, from_columns, unit_colours

_POINTS = (
    "points", "xyz", "pcd", "cloud", "vertices", "pts", "pc", "arr_0", "pointcloud", "point_cloud", "positions", "coords", "verts",
    "points_xyz", "xyz_points", "points3d",
)  # fmt: skip
_NORMALS = ("normals", "normal")
_COLOURS = ("colours", "colors", "rgb", "colour", "color")
_MAX_BYTES = MAX_POINTS * 24
_BROKEN = (
    ValueError,
    SyntaxError,
    TypeError,
    KeyError,
    IndexError,
    OverflowError,
    RecursionError,
    MemoryError,
    NotImplementedError,
    RuntimeError,
    EOFError,
    OSError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)  # what numpy and zipfile are known to raise on bytes that are not what they say


def read_npy(data: bytes) -> ndarray:
    """The array in the NPY file `data`: numbers only. Raises Unreadable."""
    return _array(io.BytesIO(data), len(data))


def read_npz(data: bytes) -> dict[str, Callable[[], ndarray]]:
    """For each array in the NPZ file `data`, what reads it; reading raises Unreadable."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        members = {info.filename: info for info in archive.infolist() if info.filename.endswith(".npy")}
    except _BROKEN as error:
        raise Unreadable(f"its zip directory is damaged ({_clause(error)})") from None

    def reader(info: zipfile.ZipInfo) -> Callable[[], ndarray]:
        def read() -> ndarray:
            if info.file_size > _MAX_BYTES:
                raise Unreadable(f"its array {info.filename[:40]!r} claims {info.file_size} bytes (limit {_MAX_BYTES})")
            try:
                with archive.open(info) as stream:
                    content = stream.read(_MAX_BYTES)
            except _BROKEN as error:
                raise Unreadable(f"its array {info.filename[:40]!r} is damaged ({_clause(error)})") from None
            return read_npy(content)

        return read

    return {name.removesuffix(".npy"): reader(info) for name, info in members.items()}


def read_array_cloud(data: bytes) -> RawCloud:
    """The cloud in an NPY or NPZ file: one array (n, 3 or more), or arrays named points, normals, colours.

    Raises:
        Unreadable: damaged bytes, no such array, pickled objects.
    """
    if data[:2] != b"PK":
        return _cloud(read_npy(data), {})
    arrays = {name.lower(): read for name, read in read_npz(data).items()}
    key = next((name for name in _POINTS if name in arrays), None)
    if key is None and all(name in arrays for name in "xyz"):
        axes = {name: _numbers(arrays[name]()).ravel() for name in "xyz"}
        if len({len(values) for values in axes.values()}) > 1:
            raise Unreadable(f"its arrays x, y and z have {', '.join(str(len(values)) for values in axes.values())} numbers")
        check_count(len(axes["x"]))
        return from_columns(axes)
    if key is None and len(arrays) == 1:
        key = next(iter(arrays))
    if key is None:
        raise Unreadable(f"it has no array called {', '.join(_POINTS[:6])} (found: {', '.join(arrays)[:80] or 'none'})")
    return _cloud(arrays[key](), arrays)


def _array(stream: io.BytesIO, size: int) -> ndarray:
    try:
        version = npy.read_magic(stream)
        if version not in ((1, 0), (2, 0), (3, 0)):
            raise Unreadable(f"it is NPY version {version[0]}.{version[1]}")
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(stream)
        if dtype.hasobject:
            raise Unreadable("its array holds pickled objects, which are never loaded")
        promised = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if promised < 0 or promised > size - stream.tell():
            raise Unreadable(f"its header promises {promised} bytes, {size - stream.tell()} follow: cut off?")
        stream.seek(0)
        return npy.read_array(stream, allow_pickle=False)
    except Unreadable:
        raise
    except _BROKEN as error:
        raise Unreadable(f"its array is damaged ({_clause(error)})") from None


def _clause(error: BaseException) -> str:
    return " ".join(str(error).split())[:100].rstrip(".") or type(error).__name__


def _is_column(array: ndarray) -> bool:
    return array.ndim == 1 and array.dtype.kind in "fiu"


def _numbers(array: ndarray) -> ndarray:
    """`array` as float64. Raises Unreadable for text, times, complex numbers."""
    if array.dtype.kind not in "fiub":
        raise Unreadable(f"its array has type {array.dtype}, not numbers")
    with np.errstate(all="ignore"):
        return array.astype(np.float64)


def _cloud(array: ndarray, arrays: dict[str, Callable[[], ndarray]]) -> RawCloud:
    if array.dtype.names:
        flat = array.reshape(-1)
        check_count(len(flat))
        return from_columns({name.lower(): flat[name] for name in array.dtype.names if _is_column(flat[name])})
    if array.ndim in (2, 3) and array.shape[0] == 3 and array.shape[-1] > 64:  # axis by axis
        array = np.moveaxis(array, 0, -1)
    if array.ndim < 2 or array.shape[-1] < 3 or array.shape[-1] > 64:
        image = "; a depth image needs its intrinsics beside it (--intrinsics)" if array.ndim == 2 and min(array.shape) > 16 else ""
        turned = ": save its transpose" if array.ndim == 2 and 3 < array.shape[0] <= 16 else ""
        raise Unreadable(f"its array has shape {array.shape}; points are (n, 3){turned}{image}")
    if array.dtype == np.float16:
        raise Unreadable("its numbers have half precision, 0.5 mm apart at 0.6 m: save singles or doubles")
    points = _numbers(array.reshape(-1, array.shape[-1])[:, :3])
    check_count(len(points))

    def beside(names: tuple[str, ...]) -> ndarray | None:
        """The array (n, 3) of one of these names, if there is one."""
        found = next((arrays[name]() for name in names if name in arrays), None)
        return found.reshape(-1, 3) if found is not None and found.dtype.kind in "fiu" and found.shape[-1:] == (3,) else None

    normals, colours, viewpoints = beside(_NORMALS), beside(_COLOURS), beside(("viewpoints", "viewpoint"))
    view = arrays["view"]() if "view" in arrays else None
    return RawCloud(
        points=points,
        normals=_numbers(normals) if normals is not None and len(normals) == len(points) else None,
        colours=unit_colours(_numbers(colours), whole=colours.dtype.kind in "iu")
        if colours is not None and len(colours) == len(points)
        else None,
        viewpoints=None if viewpoints is None else _numbers(viewpoints),
        view=view.astype(np.int64) if view is not None and view.dtype.kind in "iu" and view.shape == (len(points),) else None,
    )
