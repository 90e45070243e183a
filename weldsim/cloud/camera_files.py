"""The camera of a depth image from a table of its figures, by whatever names drivers, ROS, OpenCV and others give them.

Focal lengths and principal point are fx fy cx cy (ppx ppy), or a 3x3 matrix, in the convention of OpenCV, ROS and
librealsense: the centre of the first pixel is (0, 0). Coefficients of the lens are applied where its model is
Brown-Conrady (plumb bob, radial-tangential), rational or without a name; any other model is refused, never ignored.
"""

import re
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import Unreadable
from weldsim.records import CameraIntrinsics

MAX_SIDE = 16_384  # [px]
SHORTEST = 0.1  # of an image's side: a shorter focal length sees over 157 degrees
_MATRIX = ("k", "cameramatrix", "intrinsicmatrix", "intrinsics", "matrix", "cammatrix", "mtx")
_LISTS = {
    "d", "kc", *(
        f"{lens}{dist}{what}" for lens in ("", "lens") for dist in ("", "dist", "distortion")
        for what in ("coeff", "coeffs", "coef", "coefs", "coefficient", "coefficients", "parameters", "params", "vector", "")
        if dist or what.startswith("coef")
    ),
}  # fmt: skip
_RADIAL, _TANGENTIAL = {"radialdistortion", "radial", "radialcoeffs"}, {"tangentialdistortion", "tangential", "tangentialcoeffs"}
_MODELS = ("distortionmodel", "distmodel", "lensmodel", "distortiontype", "projectionmodel", "cameramodel", "model")
_ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4")
_NAMED = (*_ORDER, "t1", "t2")
_KNOWN = {
    "plumbbob", "brown", "brownconrady", "brownconrad", "opencv", "radtan", "radialtangential", "rational", "rationalpolynomial",
    "opencvpinhole", "pinhole", "pinholeradtan", "fullopencv", "polynomial", "standard", "perspective", "thinprism",
}  # fmt: skip
_FOCAL = {"flx": "fx", "fly": "fy"}  # of NeRF's tools
_LENGTHS, _CENTRES = (
    ("focallength", "focal", "focallengths"),
    ("principalpoint", "opticalcenter", "opticalcentre", "center", "centre"),
)
_MATLAB = {"FocalLength", "PrincipalPoint", "IntrinsicMatrix", "RadialDistortion", "TangentialDistortion"}
"""Names of MATLAB's cameraIntrinsics. Beside them ImageSize is rows and columns, and the first pixel's centre is (1, 1)."""
_SAME = 1e-3  # [px] by which one figure, given twice, may differ
_OF_CAMERA = {"fx", "fy", "cx", "cy", "width", "height", *_NAMED}
_NONE = {"none", "null", "", "no", "0"}
_STRANGE_IF_ZERO = re.compile("fisheye|equidistant|kannala|ftheta|omni|ucm|doublesphere|fov|spherical|mei")
_SUSPECT = re.compile(r"dist(?!ance)|coeff?|^kappa\d?$|^lambda\d?$|^[kpst]\d{1,2}$|^xi$|^tau[xy]?$")
_DIVISION = re.compile(r"kappa\d?$|lambda\d?$")
_COUNTS = (4, 5, 8, 12, 14)  # of coefficients
_NO_LENS = re.compile("quat|orient|rot|pose|posit|transl|extrin|matrix|crop|range|fov|size|intrinsics|rect|bbox|time")
_PASSED_OVER = ("roi", "header", "r", "projectionmatrix", "rectificationmatrix", "extrinsics", "regionofinterest")


def read_camera(table: dict[str, Any]) -> CameraIntrinsics:
    """The camera, distortion and all. Raises Unreadable, RecordError."""
    flat = _flattened(table)
    matlab = _is_matlab(table)
    if matlab and isinstance(size := flat.get("imagesize"), list):
        flat["imagesize"] = size[::-1]
    fx, fy, cx, cy = _focal(flat, table)
    cx, cy = (cx - 1.0, cy - 1.0) if matlab else (cx, cy)
    width, height = (_side(flat, name, table) for name in ("width", "height"))
    _check_pixels(flat, (width, height), (fx, fy), (cx, cy))
    return CameraIntrinsics.from_opencv(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy, distortion=_distortion(flat))


def _is_matlab(table: dict[str, Any]) -> bool:
    """Whether a table, or one in it, has the names of MATLAB's cameraIntrinsics."""
    inner = any(_is_matlab(value) for value in table.values() if isinstance(value, dict))
    return inner or ("ImageSize" in table and not _MATLAB.isdisjoint(table))


def _check_pixels(flat: dict[str, Any], size: tuple[int, int], focal: tuple[float, float], centre: tuple[float, float]) -> None:
    """Raises Unreadable where the figures are of another unit, or of another image than the one of this size."""
    for name, length, side in zip(("fx", "fy"), focal, size, strict=True):
        if 0 < length < SHORTEST * side:
            raise Unreadable(
                f"{name} {length:.4g} px is under {SHORTEST:g} of an image {side} px wide or high: millimetres, or shares of its"
                " size? pixels are needed"
            )
    for name, at, side in zip(("cx", "cy"), centre, size, strict=True):
        if not -0.5 <= at <= side - 0.5:
            raise Unreadable(
                f"{name} {at:.6g} px lies outside the image of {side} px: is the camera's table of another resolution?"
            )
    for name in ("binningx", "binningy"):
        if (binning := flat.get(name, 0)) not in (0, 1):
            raise Unreadable(
                f"{name} {binning}: pixels are joined, but the figures are of the whole image; give those of this image"
            )


def numbers(table: dict[str, Any], key: str, shape: tuple[int, ...]) -> Float[ndarray, "..."]:
    """The finite numbers under `key`, in `shape`. Raises Unreadable."""
    if key not in table:
        raise Unreadable(f"key {key!r} is missing (found: {', '.join(map(str, table))[:80]})")
    try:
        array = np.asarray(table[key], dtype=float)
    except (ValueError, TypeError, OverflowError):
        raise Unreadable(f"{key}: {str(table[key])[:40]!r} is no number") from None
    if array.size != int(np.prod(shape)) or not np.isfinite(array).all():
        raise Unreadable(f"{key}: {str(table[key])[:40]!r}, expected {int(np.prod(shape))} finite numbers")
    return array.reshape(shape)


def plain(key: object) -> str:
    """A key without case and marks, so that `dist_coeffs`, `distCoeffs` and `Dist-Coeffs` are one."""
    return re.sub(r"[^a-z0-9]", "", str(key).lower())


def _flattened(table: dict[str, Any]) -> dict[str, Any]:
    """All keys of a table and those within it, plain; `data` of a matrix stands under the matrix's own name.

    Raises:
        Unreadable: one key with two values, as in a file of several cameras.
    """
    flat: dict[str, Any] = {}

    def put(key: str, value: Any) -> None:
        if key in flat and flat[key] != value:
            raise Unreadable(f"it gives {key!r} twice, as of several cameras or streams: keep the depth camera's alone")
        flat[key] = value

    def walk(inner: dict[str, Any], parent: str) -> None:
        for key, value in inner.items():
            name = plain(key)
            name = name.removeprefix("camera") if name.startswith("camera") and name[6:] in _OF_CAMERA else name  # ORB-SLAM
            name = _FOCAL.get(name, name)
            name = _radial_or_tangential(name, value) if str(key).strip() != "K" else name
            if name in _PASSED_OVER:
                continue
            if isinstance(value, dict):
                walk(value, name)
            elif name == "data":
                put(parent, value)
            elif name in ("rows", "cols", "dt"):
                continue
            elif parent in _LISTS | {"distortion"} and name in ("type", "name"):
                put("distortionmodel", value)
            else:
                put(name, value)

    walk(table, "")
    return flat


def _radial_or_tangential(name: str, value: Any) -> str:
    """`k` and `p` where they hold coefficients of the lens, rather than the camera's matrix and its projection."""
    size = np.size(value) if isinstance(value, list | int | float) else 0
    if name == "k" and 1 <= size <= 6:
        return "radial"
    return name if name != "p" else "tangential" if size == 2 else "projectionmatrix"


def _focal(flat: dict[str, Any], table: dict[str, Any]) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy [px] in OpenCV's convention."""
    key = next((name for name in _MATRIX if np.size(flat.get(name, 0)) == 9 and name in flat), None)
    if key is None and "fx" not in flat and "k" in flat:
        key = "k"
    if key is None and "fx" not in flat and np.size(flat.get("intrinsics", 0)) == 4:  # Kalibr
        fx, fy, cx, cy = numbers(flat, "intrinsics", (4,)).tolist()
        return fx, fy, cx, cy
    named = _named_focal(flat)
    if key is None:
        if named is None:
            missing = next(name for name in ("fx", "fy", "cx", "cy") if name not in flat)
            raise Unreadable(f"key {missing!r} is missing (found: {', '.join(map(str, table))[:80]})")
        return named
    K = numbers(flat, key, (3, 3))
    K = K.T if (K[2] != [0, 0, 1]).any() and (K[:, 2] == [0, 0, 1]).all() else K  # Open3D writes it column by column
    if K[0, 1] != 0 or K[1, 0] != 0 or (K[2] != [0, 0, 1]).any():
        raise Unreadable("K is no matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    found = float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])
    if named is not None and np.abs(np.subtract(found, named)).max() > _SAME:
        raise Unreadable(
            f"{key}: it gives the focal lengths and the principal point twice, and differently: keep those of this image"
        )
    return found


def _named_focal(flat: dict[str, Any]) -> tuple[float, float, float, float] | None:
    """fx, fy, cx, cy from keys of their own, or from lists of the focal lengths and of the principal point; None without."""
    if "skew" in flat and numbers(flat, "skew", ()) != 0:
        raise Unreadable(f"skew {flat['skew']}: pixels aslant are not modelled; give a depth image without")
    lengths = next((name for name in _LENGTHS if name in flat), None)
    centre = next((name for name in _CENTRES if np.size(flat.get(name, 0)) == 2), None)
    if lengths is not None and centre is not None and "fx" not in flat:
        fx, fy = numbers(flat, lengths, (2,)) if np.size(flat[lengths]) > 1 else [float(numbers(flat, lengths, ()))] * 2
        cx, cy = numbers(flat, centre, (2,))
        return float(fx), float(fy), float(cx), float(cy)
    names = ("fx", "fy", "ppx" if "ppx" in flat else "cx", "ppy" if "ppy" in flat else "cy")
    if any(name not in flat for name in names):
        return None
    fx, fy, cx, cy = (float(numbers(flat, name, ())) for name in names)
    return fx, fy, cx, cy


def _side(flat: dict[str, Any], name: str, table: dict[str, Any]) -> int:
    """Width or height [px]."""
    key = next((key for key in (name, f"image{name}", f"img{name}", name[0]) if key in flat), None)
    size = next((flat[key] for key in ("resolution", "imagesize", "size") if np.size(flat.get(key, 0)) == 2), None)
    if key is None and size is None:
        raise Unreadable(f"key {name!r} is missing (found: {', '.join(map(str, table))[:80]})")
    pair = size if isinstance(size, list) else []
    value = float(numbers(flat, key, ()) if key is not None else numbers({name: pair["wh".index(name[0])]}, name, ()))
    if value != round(value) or not 1 <= value <= MAX_SIDE:
        raise Unreadable(f"{name} {value:g} is no image size (1 to {MAX_SIDE} px)")
    return int(value)


def _distortion(flat: dict[str, Any]) -> tuple[float, ...]:
    """Coefficients in OpenCV's order, none where all are zero. Raises Unreadable for what is not understood and not zero."""
    model = next((flat[key] for key in _MODELS if isinstance(flat.get(key), str) and not _is_device(key, flat[key])), None)
    coefficients: list[float] | None = None
    for key, value in flat.items():
        if key in _LISTS and isinstance(value, str):  # rs-enumerate-devices: `Distortion: Brown Conrady`
            model = value
        elif key in _LISTS and value is not None:
            values = numbers({key: value}, key, np.shape(value)).ravel().tolist()
            if coefficients is not None and np.any(values) and np.any(coefficients) and values != coefficients:
                raise Unreadable(f"{key}: it gives the lens's coefficients twice, and differently")
            coefficients = values if coefficients is None or np.any(values) else coefficients
    named = {name: float(numbers(flat, name, ())) for name in _NAMED if name in flat and np.ndim(flat[name]) == 0}
    named |= _parted(flat, _RADIAL, ("k1", "k2", "k3", "k4", "k5", "k6")) | _parted(flat, _TANGENTIAL, ("p1", "p2"))
    _refuse_unknown(flat)
    if any(named.values()):
        if coefficients is not None and np.any(coefficients):
            raise Unreadable("it gives the lens's coefficients twice, as a list and by name: keep one")
        if named.get("k4") and not {"k5", "k6", "p1", "p2"} & named.keys() and model is None:
            raise Unreadable("k1 to k4 without p1 and p2: of a fisheye lens, or rational? name the lens's model (distortion_model)")
        coefficients = [named.get(name, 0.0) for name in _ORDER]
        if named.get("t1") or named.get("t2"):
            raise Unreadable("t1, t2: a tilted sensor is not modelled; give a depth image without distortion")
    return _checked(coefficients or [], model)


def _is_device(key: str, value: str) -> bool:
    """Whether a camera's model is the name of a device, D415 say, rather than of a lens model."""
    device = any(mark.isdigit() for mark in value) or re.search("intel|realsense|zivid|kinect|photoneo", value.lower()) is not None
    return key in ("model", "cameramodel") and device and not _STRANGE_IF_ZERO.search(plain(value))


def _parted(flat: dict[str, Any], keys: set[str], names: tuple[str, ...]) -> dict[str, float]:
    """Coefficients of a list of the radial or of the tangential ones alone, by name."""
    key = next((key for key in keys if key in flat), None)
    if key is None:
        return {}
    values = numbers(flat, key, np.shape(flat[key])).ravel().tolist()
    if len(values) > len(names):
        raise Unreadable(f"{key}: {len(values)} coefficients, at most {len(names)} are known")
    return dict(zip(names, values, strict=False))


def _refuse_unknown(flat: dict[str, Any]) -> None:
    """Raises Unreadable where a key that speaks of the lens is not understood and its value not zero."""
    known = {*_LISTS, *_RADIAL, *_TANGENTIAL, *_MODELS, *_NAMED, *_MATRIX}
    for key, value in flat.items():
        if key in known or value in (None, "", False) or isinstance(value, str):
            continue
        if not _SUSPECT.search(key) and not _may_be_coefficients(key, value):
            continue
        if np.any(np.asarray(value, dtype=object) != 0):
            if _DIVISION.match(key):
                raise Unreadable(
                    f"{key}: of a division model of the lens, which is not known; give a depth image without distortion"
                )
            raise Unreadable(
                f"{key}: may be a coefficient of the lens that is not known; call them D (k1 k2 p1 p2 k3), or leave the key out"
                " where it is none"
            )


def _may_be_coefficients(key: str, value: Any) -> bool:
    """Whether a list under a name that nobody knows looks like coefficients: as many numbers, some of them broken."""
    try:
        values = np.asarray(value, float).ravel()
    except (TypeError, ValueError):
        return False
    return values.size in _COUNTS and _NO_LENS.search(key) is None and bool((values != np.round(values)).any())


def _checked(coefficients: list[float], model: str | None) -> tuple[float, ...]:
    name = None if model is None else plain(model).removeprefix("distortion")
    if name is not None and _STRANGE_IF_ZERO.search(name):
        raise Unreadable(f"the lens's model {model!r} is no pinhole with Brown-Conrady distortion; give a rectified depth image")
    if not np.any(coefficients):
        return ()
    if name is not None and name in _NONE:
        raise Unreadable(f"the lens's model is {model!r}, and its coefficients are not zero: which is right?")
    if name is not None and name not in _KNOWN:
        raise Unreadable(
            f"the lens's model {model!r} is not known (Brown-Conrady, plumb_bob and rational_polynomial are); give a depth image"
            " without distortion"
        )
    padded = [*coefficients]
    while len(padded) > 4 and padded[-1] == 0:
        padded.pop()
    if len(coefficients) not in (2, 4, 5, 8, 12, 14) or len(padded) > 12:
        raise Unreadable(f"{len(coefficients)} coefficients of the lens; 4, 5, 8 or 12 are known (k1 k2 p1 p2 k3 ...)")
    size = next(count for count in (4, 5, 8, 12) if len(padded) <= count)
    return tuple(padded + [0.0] * (size - len(padded)))
