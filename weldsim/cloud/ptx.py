"""PTX scans, as laser scanners write them: their size, the scanner's pose, then x y z intensity and perhaps r g b.

Each scan has ten lines before its points: columns, rows, the scanner's position, its three axes, and a 4x4 matrix whose
rows multiply from the right (the last one is the translation). Points lie in the scanner's own frame; 0 0 0 is no return.
"""

import re

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.raw import RawCloud, Unreadable, check_count
from weldsim.cloud.table import parse_table

_START = re.compile(rb"(?:\xef\xbb\xbf)?\s*\d{1,9}[ \t]*\r?\n[ \t]*\d{1,9}[ \t]*\r?\n")
_WIDTHS = (3, 3, 3, 3, 4, 4, 4, 4)  # numbers on the lines of the pose
_RIGID = 1e-3  # by which a printed rotation may be off


def is_ptx(data: bytes) -> bool:
    """Whether the bytes begin with two lines of one whole number each."""
    return _START.match(data) is not None


def read_ptx(data: bytes) -> RawCloud:
    """The points of every scan in the PTX file `data`, in the frame that the poses are in, each scanner a viewpoint.

    Raises:
        Unreadable: lines of the pose that are none, a matrix that is no rigid transform, or fewer points than promised.
    """
    data = data.removeprefix(b"\xef\xbb\xbf").lstrip().replace(b"\r\n", b"\n")
    points, viewpoints, views, start = [], [], [], 0
    while start < len(data) and data[start:].strip():
        count, matrix, start = _pose(data, start)
        end = start
        for _ in range(count):
            end = data.find(b"\n", end) + 1
            if end == 0:
                end = len(data)
                break
        table = parse_table(data[start:end], columns=3, rows=count)
        table[(table == 0).all(axis=1)] = np.nan
        views.append(np.full(count, len(points)))
        points.append(table @ matrix[:3, :3] + matrix[3, :3])
        viewpoints.append(matrix[3, :3])
        start = end
    one = len(points) == 1
    return RawCloud(points=np.concatenate(points), viewpoints=np.array(viewpoints), view=None if one else np.concatenate(views))


def _pose(data: bytes, start: int) -> tuple[int, Float[ndarray, "4 4"], int]:
    """How many points a scan has, its matrix (rows from the right), and where its points begin."""
    lines = data[start : start + 4096].split(b"\n")[:10]
    try:
        rows = [[float(word) for word in line.replace(b",", b".").split()] for line in lines]
    except ValueError:
        rows = []
    if [len(row) for row in rows] != [1, 1, *_WIDTHS] or not np.isfinite(np.concatenate(rows)).all():
        raise Unreadable(
            "it begins as a PTX (two counts), but the scanner's position, axes and 4x4 matrix do not follow: delete the lines above"
            " its points if these are in the robot base"
        )
    count = int(rows[0][0]) * int(rows[1][0])
    check_count(count)
    matrix = np.array(rows[6:])
    if np.abs(matrix[:, 3] - [0, 0, 0, 1]).max() > 1e-6:  # columns from the left, as some write it
        matrix = matrix.T
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    off = max(float(np.abs(u @ vt - matrix[:3, :3]).max()), float(np.abs(matrix[:, 3] - [0, 0, 0, 1]).max()))
    if off > _RIGID or np.linalg.det(u @ vt) < 0:
        raise Unreadable("the matrix in its PTX header is no rigid transform")
    matrix[:3, :3] = u @ vt
    return count, matrix, start + sum(len(line) + 1 for line in lines)
