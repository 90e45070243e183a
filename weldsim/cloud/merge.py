"""Clouds of several views as one."""

from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from weldsim.errors import CloudError
from weldsim.frames import Transform
from weldsim.records import PointCloud


def merge(clouds: Sequence[PointCloud]) -> PointCloud:
    """The points of all clouds, in order, each with the viewpoint that saw it; a single cloud is returned as it is.

    Normals, colours and pixels are kept where every cloud has them; a pixel then is one of its view's image, and X_BC is a
    batch, one pose a view.

    Raises:
        CloudError: no cloud, different frames, or one of several clouds without exactly one viewpoint.
    """
    if len(clouds) == 1:
        return clouds[0]
    if not clouds:
        raise CloudError("merge: no cloud was given", clouds=0)
    for i, cloud in enumerate(clouds):
        if cloud.frame != clouds[0].frame:
            raise CloudError(f"merge: cloud {i} is in frame {cloud.frame}, cloud 0 in {clouds[0].frame}", index=i)
        if len(cloud.viewpoints) != 1:
            raise CloudError(f"merge: cloud {i} has {len(cloud.viewpoints)} viewpoints, one is needed", index=i)
    normals = [cloud.normals for cloud in clouds if cloud.normals is not None]
    colours = [cloud.colours for cloud in clouds if cloud.colours is not None]
    cameras = [cloud.X_BC for cloud in clouds if cloud.X_BC is not None and not cloud.X_BC.batch]
    pixels = [cloud.pixel for cloud in clouds if cloud.pixel is not None]
    kinds = {astuple(cloud.intrinsics) for cloud in clouds if cloud.intrinsics is not None}
    imaged = len(cameras) == len(pixels) == len(clouds) and len(kinds) == 1
    return PointCloud(
        points=np.concatenate([cloud.points for cloud in clouds]),
        frame=clouds[0].frame,
        normals=np.concatenate(normals) if len(normals) == len(clouds) else None,
        colours=np.concatenate(colours) if len(colours) == len(clouds) else None,
        viewpoints=np.concatenate([cloud.viewpoints for cloud in clouds]),
        view=np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds]),
        pixel=np.concatenate(pixels) if imaged else None,
        intrinsics=clouds[0].intrinsics if imaged else None,
        X_BC=Transform("BC", np.stack([X.R for X in cameras]), np.stack([X.p for X in cameras])) if imaged else None,
    )
