"""One's own recorded clouds against a line that is known to be their seam, by the definitions of the regression.

    from weldsim import read_cloud
    from weldsim.regression.recorded import figures_of_cloud, read_known_seam

    cloud = read_cloud("scan.ply", viewpoint=(0.0, -0.45, 0.5))
    known = read_known_seam("seam.csv")
    print(figures_of_cloud("my scan", cloud, known).judged())

`seam.csv` has a point of the groove's opening on each line, in order, x, y, z [m] in the frame of the cloud; optionally
three more columns, the outward unit normal of the surface there, without which the wire axis is not judged.
"""

from pathlib import Path

import numpy as np

from weldsim.cloud.files import LengthUnit, read_cloud
from weldsim.config import CellConfig
from weldsim.counted import counted
from weldsim.curves import arc_length, resample, tangents
from weldsim.errors import InputError
from weldsim.frames import unit
from weldsim.pipeline import Finder, plan
from weldsim.records import KnownSeam, PointCloud
from weldsim.regression.figures import Figures, figures_of

STEP = 0.5e-3  # [m] between the points of a known seam


def read_known_seam(path: str | Path, *, unit_of_length: LengthUnit = "m") -> KnownSeam:
    """The known seam in a text file of points (or any cloud file that keeps their order), expressed in its own frame.

    Lips and root are not known and stand at the opening; without normals the bisectors are a placeholder at right angles
    to the line.

    Raises:
        CloudFileError, CloudError: the file is no list of points in that unit.  InputError: fewer than two different points.
    """
    read = read_cloud(path, unit=unit_of_length)
    moved = np.concatenate([[True], np.linalg.norm(np.diff(read.points, axis=0), axis=1) > 1e-9])
    points = read.points[moved]
    if len(points) < 2:
        raise InputError(f"{path}: {counted(len(points), 'different point')}; a seam needs two", path=str(path))
    line = resample(points, STEP)
    along = tangents(line)
    if read.normals is None:
        inward = np.cross(along, np.eye(3)[np.abs(along).min(axis=0).argmin()])
    else:
        s, at = arc_length(points), arc_length(line)
        inward = -np.stack([np.interp(at, s, column) for column in read.normals[moved].T], axis=1)
    inward = unit(inward - np.einsum("ij,ij->i", inward, along)[:, None] * along)
    return KnownSeam(
        opening_B=line,
        root_B=line,
        left_B=line,
        right_B=line,
        tangents_B=along,
        bisectors_B=inward,
        s=arc_length(line),
        name=Path(path).stem,
    )


def figures_of_cloud(
    name: str,
    cloud: PointCloud,
    known: KnownSeam,
    config: CellConfig | None = None,
    *,
    find: Finder | None = None,
    has_axes: bool = False,
) -> Figures:
    """The figures of the plan on a recorded cloud, to be compared or recorded like those of a scene.

    Args:
        name: what to call it.  cloud: in B.  known: its seam.  config: settings.
        find: a finder of the caller's own.  has_axes: whether `known` was read with normals.
    Raises:
        CloudError, PathError: see `weldsim.pipeline.plan`.
    """
    config = config or CellConfig()
    result = plan(cloud, config, find=find)
    return figures_of(name, result.findings.method, 0, result, (known,), config, has_axes=has_axes)
