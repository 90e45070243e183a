"""The pose of a camera in the robot base from a file, as hand-eye calibrations, ROS, OpenCV and others write it.

A position with a rotation, or a 4x4 matrix. Whatever leaves open which of two poses is meant is refused, never guessed: a bare
`quaternion` (w first or last?), Euler angles without an order, a transform from the base to the camera.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.camera_files import numbers, plain
from weldsim.cloud.extent import FARTHEST_CAMERA
from weldsim.cloud.key_values import read_table
from weldsim.cloud.raw import Unreadable
from weldsim.cloud.sources import read_bytes
from weldsim.columns import UNITS, decode, is_number
from weldsim.counted import counted
from weldsim.errors import CloudFileError, WeldsimError
from weldsim.frames import Transform, matrix_from_quaternion, matrix_from_rotation_vector

WANTED = "position and quaternion_wxyz (or quaternion_xyzw, rotation_vector, rotation_matrix), or a 4x4 matrix"
RIGID = 1e-3  # by which a printed rotation may be off
_POSITIONS = re.compile("(?:position|translation|trans|tvec|translationvector|xyz|origin|location|t|p)(m|mm|cm|inm|inmm|incm)?")
_QUATERNIONS = re.compile("(?:quaternion|quat|q|orientation|rotation|rot)(wxyz|xyzw)?")
_VECTORS = re.compile("(?:rotationvector|rotvec|rvec|axisangle)(rad|deg|inrad|indeg)?")
_ANGLES = re.compile("(?:rpy|rollpitchyaw)(rad|deg|inrad|indeg)?")
_MATRICES = re.compile("(?:rotationmatrix|rotmat|rotation|rot|r)")
_EULER = re.compile("euler|angles|ypr|abc|wpr")
_OTHER_WAY = re.compile(
    "(?:base|world|robot)(?:link)?(?:to|2)(?:the)?cam|cam(?:era)?(?:opticalframe)?(?:t|from|in)?(?:base|world|robot)(?:link)?$"
    "|extrinsic|inverse|viewmatrix|w2c"
)
_HAND = "gripper|hand|flange|tool|tcp|ee"
_OF_HAND = re.compile(f"cam(?:era)?(?:to|2|in)(?:{_HAND}|end)|(?:{_HAND})(?:t|to|2)?cam")
_OF_CAMERA = re.compile("cam(?:era)?(?:opticalframe)?(?:to|2|in)(?:base|robot|world)$")  # which says of a name only what is wanted
_LINK = re.compile(r"(?:^|[^a-z])cam(?:era)?\d?(?:_[a-z0-9]+)*_link(?![a-z])|cam(?:era)?link$")
_BODY = re.compile(r"/?\w*(?:cam\w*_link|(?:colou?r|depth|infra\d?|rgb|left|right|ir)_frame)")
_BASE_LINK = re.compile(r"/?(?:\w*/)?base_?link")
_PARENTS = (
    "frameid",
    "parent",
    "parentframe",
    "parentframeid",
    "robotbaseframe",
    "baseframe",
    "referenceframe",
    "fixedframe",
    "to",
)
_CHILDREN = ("childframeid", "child", "childframe", "trackingbaseframe", "cameraframe", "sensorframe", "from")
_CAMERA_FRAME = re.compile(r"\w*(?:cam|optical)\w*")
_HAND_FRAME = re.compile(r"(?:\w+_)?(?:tool|tool0|flange|gripper|hand|tcp|ee|eef|ee_link|end_effector|wrist_3_link)")
_BASE_FRAME = re.compile(r"(?:\w+_)?(?:base|base_link|world|robot)")
_PASSED_OVER = ("header", "stamp", "covariance", "version", "parameters", "uncertainty", "residuals")
_UNIT_KEYS = ("unit", "units", "lengthunit", "translationunit", "positionunit")
_UR_POSE = re.compile(r"\s*p\[([^\]]*)\]\s*")
_MARKS = re.compile(r"[\[\](){},;]")


def read_pose(path: str | Path) -> Transform:
    """X_BC from a table of keys (JSON, TOML, YAML), rows of a matrix, or a UR pose `p[...]`. Raises CloudFileError."""
    try:
        bare = _bare_numbers(decode(read_bytes(path)))
        return _pose(read_table(path)) if bare is None else bare
    except (Unreadable, WeldsimError) as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise CloudFileError(f"{path}: {reason}", path=str(path), reason=reason) from None


def _bare_numbers(text: str) -> Transform | None:
    """The pose in a file of numbers alone; None where it has words. Raises Unreadable."""
    if (found := _UR_POSE.fullmatch(text)) is not None:
        values = numbers({"p[...]": _MARKS.sub(" ", found[1]).split()}, "p[...]", (6,))
        return Transform.from_rotation_vector("BC", values[3:], values[:3])
    lines = [line.partition("#")[0] for line in text.split("\n")]
    words = re.split(r"[\s;]+", " ".join(lines).replace(",", ".").strip("\ufeff; "))  # with decimal commas, or none
    if len(words) not in (12, 16) or not all(map(is_number, words)):
        words = _MARKS.sub(" ", " ".join(lines)).split()
    if not words or not all(map(is_number, words)):
        return None
    if len(words) not in (12, 16):
        raise Unreadable(f"it holds {counted(len(words), 'number')}, which is no 4x4 matrix; with names: {WANTED}")
    return _rigid(np.array(words, float), "its matrix", 1.0)


def _pose(table: dict[str, Any]) -> Transform:
    """The pose in a table. Raises Unreadable."""
    leaves = list(_leaves(table, ""))
    _refuse_frames(table)
    unit = next((str(value).strip().lower() for key, value in leaves if key in _UNIT_KEYS), "m")
    if unit not in UNITS:
        raise Unreadable(f"unit {unit[:20]!r}: lengths are in m, cm, mm or in")
    matrices = [(key, value) for key, value in leaves if _size(value) in (12, 16) and not _QUATERNIONS.fullmatch(key)]
    if len(matrices) > 1:
        raise Unreadable(f"it holds several matrices ({', '.join(key for key, _ in matrices)[:80]}): keep the camera's in the base")
    position, rotation = _position(leaves, UNITS[unit]), _rotation(leaves)
    if not matrices:
        if position is None or rotation is None:
            for name, _ in _words(table):
                _refuse_name(plain(name), name)
            lacking = "position" if position is None else "rotation"
            raise Unreadable(f"it gives no {lacking} (found: {', '.join(map(str, table))[:80]}); wanted: {WANTED}")
        return Transform("BC", rotation, position)
    key, value = matrices[0]
    _refuse_name(key, next((name for name, _ in _words(table) if plain(name) == key), key))
    pose = _rigid(numbers({key: value}, key, np.shape(value)).ravel(), f"{key}: the matrix", UNITS[unit])
    if key == "floatmatrix" and unit == "m" and np.linalg.norm(pose.p) > FARTHEST_CAMERA:  # Zivid's are in millimetres
        pose = Transform("BC", pose.R, pose.p * UNITS["mm"])
    if position is not None and np.abs(position - pose.p).max() > RIGID:
        raise Unreadable("it gives the position twice, in a matrix and beside it, and differently: keep one")
    if rotation is not None and np.abs(rotation - pose.R).max() > RIGID:
        raise Unreadable("it gives the rotation twice, in a matrix and beside it, and differently: keep one")
    return pose


def _leaves(node: dict[str, Any], parent: str) -> Iterator[tuple[str, Any]]:
    """(plain key, value) of what is no table; x y z (w) in a table of their own stand under its name, as lists."""
    keys = {plain(key): value for key, value in node.items()}
    rest = dict(keys)
    if {"x", "y", "z", "w"} <= set(keys):
        yield "quaternionxyzw", [rest.pop(key) for key in "xyzw"]
    if {"qx", "qy", "qz", "qw"} <= set(keys):
        yield "quaternionxyzw", [rest.pop(f"q{key}") for key in "xyzw"]
    if {"x", "y", "z"} <= set(rest):
        yield "position", [rest.pop(key) for key in "xyz"]
    for unit in ("mm", "cm", "m"):
        if {f"x{unit}", f"y{unit}", f"z{unit}"} <= set(rest):
            yield f"position{unit}", [rest.pop(f"{key}{unit}") for key in "xyz"]
    for unit in ("", "deg", "rad"):
        if {f"roll{unit}", f"pitch{unit}", f"yaw{unit}"} <= set(rest):
            yield f"rpy{unit}", [rest.pop(f"{key}{unit}") for key in ("roll", "pitch", "yaw")]
        if {f"rx{unit}", f"ry{unit}", f"rz{unit}"} <= set(rest):
            raise Unreadable(
                f"rx{unit}, ry{unit}, rz{unit}: a rotation vector, or angles about three axes? give rotation_vector [rx, ry, rz] in"
                " radians, or rpy"
            )
    for name, value in rest.items():
        key = _OF_CAMERA.sub("", name) or name
        if key in _PASSED_OVER:
            continue
        if isinstance(value, dict):
            yield from _leaves(value, key)
        elif key == "data" and parent:
            yield parent, value
        elif isinstance(value, str) and key == "rotation" and "quaternion" in value.lower():  # tf_echo
            yield "quaternionxyzw", re.findall(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?", value.partition("[")[2])
        elif key not in ("rows", "cols", "dt"):
            yield key, value


def _size(value: Any) -> int:
    try:
        return int(np.size(value)) if isinstance(value, list) else 0
    except ValueError:  # rows of different lengths
        return 0


def _position(leaves: list[tuple[str, Any]], scale: float) -> Float[ndarray, "3"] | None:
    """The position [m]; None where there is none. Raises Unreadable."""
    named = [(key, value, match) for key, value in leaves if (match := _POSITIONS.fullmatch(key)) is not None]
    found = [entry for entry in named if _size(entry[1]) not in (12, 16)]  # t and p may be called matrices, too
    if not found:
        return None
    key, value, match = found[0]
    if len(found) > 1:
        raise Unreadable(f"it gives the position twice ({', '.join(name for name, _, _ in found)}): keep one")
    unit = match[1].removeprefix("in") if match[1] else None
    return numbers({key: value}, key, (3,)) * (scale if unit is None else UNITS[unit])


def _rotation(leaves: list[tuple[str, Any]]) -> Float[ndarray, "3 3"] | None:
    """The rotation; None where there is none. Raises Unreadable for one that may be read in two ways, or is there twice."""
    found: list[tuple[str, Float[ndarray, "3 3"]]] = []
    for key, value in leaves:
        size = _size(value)
        if size == 4 and (match := _QUATERNIONS.fullmatch(key)) is not None:
            found.append((key, _of_quaternion(key, value, match[1])))
        elif size == 9 and _MATRICES.fullmatch(key) is not None:
            found.append((key, _orthogonal(numbers({key: value}, key, (3, 3)), key)))
        elif size == 3 and (match := _VECTORS.fullmatch(key)) is not None:
            found.append((key, matrix_from_rotation_vector(_radians(key, value, match[1]))))
        elif size == 3 and (match := _ANGLES.fullmatch(key)) is not None:
            found.append((key, _of_rpy(_radians(key, value, match[1]))))
        elif size == 3 and (_EULER.search(key) or key in ("rotation", "orientation", "rot")):
            raise Unreadable(f"{key}: three angles, of which order and axes is not said; give quaternion_wxyz, or rpy")
        elif _QUATERNIONS.fullmatch(key) and size in (1, 2, 3, 5):
            numbers({key: value}, key, (4,))
    if len(found) > 1:
        raise Unreadable(f"it gives the rotation twice ({', '.join(key for key, _ in found)}): keep one")
    return found[0][1] if found else None


def _of_quaternion(key: str, value: Any, order: str | None) -> Float[ndarray, "3 3"]:
    if order is None:
        raise Unreadable(f"{key}: is w its first number or its last? name it quaternion_wxyz or quaternion_xyzw")
    quaternion = numbers({key: value}, key, (4,))
    if abs(np.linalg.norm(quaternion) - 1.0) > 0.01:
        raise Unreadable(f"its quaternion_{order} has length {np.linalg.norm(quaternion):.3g}, not 1")
    return matrix_from_quaternion(quaternion if order == "wxyz" else quaternion[[3, 0, 1, 2]])


def _radians(key: str, value: Any, unit: str | None) -> Float[ndarray, "3"]:
    """Angles [rad]. Raises Unreadable for degrees without that name."""
    angles = numbers({key: value}, key, (3,))
    if unit is not None and unit.endswith("deg"):
        return np.radians(angles)
    if np.abs(angles).max() > 2 * np.pi:
        raise Unreadable(f"{key}: {np.abs(angles).max():g} looks like degrees; name it {key}_deg")
    return angles


def _of_rpy(angles: Float[ndarray, "3"]) -> Float[ndarray, "3 3"]:
    """Roll, pitch and yaw about the fixed axes x, y and z [rad], as ROS and UR have them."""
    x, y, z = (matrix_from_rotation_vector(angle * axis) for angle, axis in zip(angles, np.eye(3), strict=True))
    return z @ y @ x


def _rigid(values: Float[ndarray, "_"], what: str, scale: float) -> Transform:
    """The pose in the 12 or 16 numbers of a matrix, row by row, or column by column. Raises Unreadable."""
    matrix = np.vstack([values.reshape(3, 4), [0, 0, 0, 1]]) if values.size == 12 else values.reshape(4, 4)
    if (matrix[3] != [0, 0, 0, 1]).any() and (matrix[:, 3] == [0, 0, 0, 1]).all():
        matrix = matrix.T
    if np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-6:
        raise Unreadable(f"{what} is no rigid transform: its last row is not 0 0 0 1")
    return Transform("BC", _orthogonal(matrix[:3, :3], what), matrix[:3, 3] * scale)


def _orthogonal(R: Float[ndarray, "3 3"], what: str) -> Float[ndarray, "3 3"]:
    """The rotation next to a printed one. Raises Unreadable where that is none."""
    u, _, vt = np.linalg.svd(R)
    if np.abs(u @ vt - R).max() > RIGID or np.linalg.det(u @ vt) < 0:
        raise Unreadable(f"{what} is no rigid transform: its axes are scaled, aslant or left-handed")
    return u @ vt


_OF_BODY = "the x axis of that frame looks ahead; give the pose of the camera's optical frame"
_OF_BASE_LINK = "half a turn about z from a UR controller's base; give the pose in the controller's, and call that frame base"


def _refuse_name(key: str, name: str) -> None:
    """Raises Unreadable for a matrix that by its name is no pose of the camera in the base."""
    if _OF_HAND.search(key):
        raise Unreadable(f"{name}: is the camera's pose in the hand; its pose in the base is wanted, hand in base times this")
    if _LINK.search(name.lower()):
        raise Unreadable(f"{name}: {_OF_BODY}")
    if re.search(r"base_?link", name.lower()):
        raise Unreadable(f"{name}: {_OF_BASE_LINK}")
    if _OTHER_WAY.search(key):
        raise Unreadable(f"{name}: may lead from the base to the camera; give the camera's pose in the base, and call it matrix")


def _refuse_frames(table: dict[str, Any]) -> None:
    """Raises Unreadable where frames are named, and they are not the optical frame of a camera in the robot's base."""
    words = [(name, plain(name), str(value)) for name, value in _words(table)]
    for name, key, value in words:
        if key in ("eyeonhand", "eyeinhand") and value.lower() == "true":
            raise Unreadable("its camera is on the hand; its pose in the base is wanted: hand in base times this")
        frame = value.strip().lower().removeprefix("/")
        parent, child = key in (*_PARENTS, "target"), key in (*_CHILDREN, "source")
        if (parent and _CAMERA_FRAME.fullmatch(frame)) or (child and _BASE_FRAME.fullmatch(frame)):
            raise Unreadable(f"{name} {value}: it leads from the base to the camera; the camera's pose in the base is wanted")
        if (parent or child) and _HAND_FRAME.fullmatch(frame):
            raise Unreadable(f"{name} {value}: it is a pose of or in the hand; that of the camera in the base is wanted")
        if _BODY.fullmatch(frame):
            raise Unreadable(f"it is the pose of {value}: {_OF_BODY}")
        if parent and _BASE_LINK.fullmatch(frame):
            raise Unreadable(f"{name} {value}: {_OF_BASE_LINK}")


def _words(node: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        if isinstance(value, dict):
            yield from _words(value)
        else:
            yield str(key), value
