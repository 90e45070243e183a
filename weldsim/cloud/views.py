"""Several views as one cloud: lined up, without double walls, merged."""

from collections.abc import Sequence

import numpy as np

from weldsim.cloud.config import RegisterConfig
from weldsim.cloud.merge import merge
from weldsim.cloud.register import Registration, register
from weldsim.cloud.walls import double_walls
from weldsim.records import PointCloud


def merge_views(clouds: Sequence[PointCloud], config: RegisterConfig | None = None) -> tuple[PointCloud, Registration | None]:
    """One cloud in B from organised views of it, and how they were lined up; a single view is returned as it is, with None.

    Of several views what is far away is dropped first; then they are lined up, and what they still show twice is dropped.

    Raises:
        CloudError: no cloud, or one that does not know its pixels.
    """
    config = config or RegisterConfig()
    if len(clouds) > 1:
        clouds = [_near(cloud, config.farthest) for cloud in clouds]
    views, found = register(clouds, config)
    if len(views) > 1 and config.double_walls:
        views = tuple(view.select(~double) for view, double in zip(views, double_walls(views), strict=True))
    return merge(views), found


def _near(cloud: PointCloud, farthest: float) -> PointCloud:
    """The points no deeper than `farthest` [m] in their camera."""
    if cloud.X_BC is None:
        return cloud
    return cloud.select((cloud.points - cloud.X_BC.p) @ cloud.X_BC.R[:, 2] <= farthest)


def dropped(clouds: Sequence[PointCloud], merged: PointCloud) -> tuple[int, ...]:
    """How many points of each view the merged cloud has not."""
    if merged.view is None:
        return tuple(len(cloud) - len(merged) for cloud in clouds)
    kept = np.bincount(merged.view, minlength=len(clouds))
    return tuple(len(cloud) - int(number) for cloud, number in zip(clouds, kept, strict=True))
