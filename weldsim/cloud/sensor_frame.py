"""Points whose file gives the pose of the sensor that saw them: in the sensor's frame, or in the frame its pose is in?

PCL leaves that open: its viewer moves the points by the pose, its normals take them as they are, with the position alone. So
the points tell: they lie ahead of the sensor in the frame that they are in.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import RawCloud, Unreadable
from weldsim.frames import matrix_from_quaternion, unit_quaternion

AHEAD = np.radians(50)  # from the axis along which a sensor looks to the middle of its cloud, at most
STRAIGHT = np.radians(25)  # from PCL's axis: so near to it, no other axis is tried
ASIDE = np.radians(40)  # from PCL's axis in the other frame
AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Along which sensors look: depth cameras (and PCL), scanners and ROS, OpenGL."""
RIGID = 1e-3  # by which a printed rotation may be off
SAMPLE = 20_000  # points that tell where the middle is
TURNED = "its points are taken from the sensor's frame to the one of the pose that its header gives"


def rotation_of_quaternion(quaternion_wxyz: list[float]) -> Float[ndarray, "3 3"] | None:
    """The rotation of a header's quaternion, of whatever length; None for the identity, which says nothing, and for zeros."""
    values = np.array(quaternion_wxyz, float)
    return rotation_of_matrix(matrix_from_quaternion(unit_quaternion(values))) if values.any() else None


def rotation_of_matrix(matrix: Float[ndarray, "3 3"]) -> Float[ndarray, "3 3"] | None:
    """The rotation of a header's matrix; None for the identity, which says nothing, and for what is no rotation."""
    if not np.isfinite(matrix).all():
        return None
    u, _, vt = np.linalg.svd(matrix)
    R = u @ vt
    if np.abs(R - matrix).max() > RIGID or np.linalg.det(R) < 0 or np.abs(R - np.eye(3)).max() < 1e-6:
        return None
    return R


def placed(raw: RawCloud, viewpoint: Float[ndarray, "3"] | None) -> RawCloud:
    """The cloud in the frame that its sensor's pose is in: as it is, or moved by that pose where the points are in the sensor's.

    Args:
        raw: as its file holds it.
        viewpoint: where the caller says that the sensor stood, in the frame that is wanted; None leaves it to the file. The origin
            asks for the sensor's own frame.
    Raises:
        Unreadable: the pose has a rotation, and the points may be in either frame, or in neither.
    """
    R, stood = raw.rotation, raw.viewpoints
    if R is None or stood is None or len(stood) != 1 or not np.isfinite(stood).all():
        return raw
    kept = replace(raw, rotation=None)
    if viewpoint is not None and not np.any(viewpoint):
        return kept
    middle = _middle(raw.points)
    if middle is None:
        return kept
    here, moved = _off(middle - stood[0], AXES @ R.T), _off(middle, AXES)
    first, other = (here, moved) if here[0] < moved[0] else (moved, here)
    if first[0] < STRAIGHT and other[0] > ASIDE and first[0] < other.min():  # the axis that PCL means goes before the others
        return _moved(kept, R, stood[0]) if first is moved else kept
    if (here.min() < AHEAD) != (moved.min() < AHEAD):
        return _moved(kept, R, stood[0]) if moved.min() < AHEAD else kept
    if viewpoint is not None:
        return kept
    x, y, z = (f"{value:g}" for value in stood[0])
    raise Unreadable(
        f"its header gives the pose of the sensor, at ({x}, {y}, {z}) and turned, and its points may be in the sensor's frame or in"
        " that of its pose: --viewpoint X Y Z, where the sensor stood, takes them as they are; else move them by the pose first"
    )


def _middle(points: Float[ndarray, "n 3"]) -> Float[ndarray, "3"] | None:
    """The median of the points that are finite and not zero; None where none is."""
    sample = points[:: max(1, len(points) // SAMPLE)]
    seen = sample[np.isfinite(sample).all(axis=1) & sample.any(axis=1)]
    return np.median(seen, axis=0) if len(seen) else None


def _off(way: Float[ndarray, "3"], axes: Float[ndarray, "k 3"]) -> Float[ndarray, "k"]:
    """Angles between the way to something and unit axes [rad]; a half turn where there is no way."""
    length = float(np.linalg.norm(way))
    return np.arccos(np.clip(axes @ way / length, -1.0, 1.0)) if length > 0 else np.full(len(axes), np.pi)


def _moved(raw: RawCloud, R: Float[ndarray, "3 3"], p: Float[ndarray, "3"]) -> RawCloud:
    with np.errstate(all="ignore"):
        blind = (raw.points == 0).all(axis=1)
        points = raw.points @ R.T + p
        points[blind] = np.nan  # no return
        normals = None if raw.normals is None else raw.normals @ R.T
    return replace(raw, points=points, normals=normals, notes=(*raw.notes, TURNED))
