"""Fewer and better points: crop, voxel grid, stray points, normals; and `prepare`, which applies a CloudConfig."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.cloud.config import CloudConfig
from weldsim.counted import counted
from weldsim.errors import CloudError
from weldsim.records import PointCloud


def prepare(cloud: PointCloud, config: CloudConfig) -> PointCloud:
    """The cloud cropped, then without stray points, then thinned, as the config says.

    Raises:
        CloudError: no point is left; `data` names the step.
    """
    steps = []
    if config.crop_min is not None and config.crop_max is not None:
        low, high = np.array(config.crop_min, float), np.array(config.crop_max, float)
        steps.append(("crop box", lambda points: crop(points, low, high)))
    if config.outlier_radius > 0:
        steps.append(("outlier_radius", lambda points: drop_sparse(points, config.outlier_radius, config.outlier_neighbours)))
    if config.voxel > 0:
        steps.append(("voxel", lambda points: voxel_grid(points, config.voxel)))
    for name, step in steps:
        before, cloud = len(cloud), step(cloud)
        if len(cloud) == 0:
            raise CloudError(f"{name}: none of {counted(before, 'point')} is left; change it in [cloud]", step=name, points=before)
    return cloud


def crop(cloud: PointCloud, low: Float[ndarray, "3"], high: Float[ndarray, "3"]) -> PointCloud:
    """The points within the box from corner `low` to corner `high` [m], faces included."""
    x, y, z = ((cloud.points >= low) & (cloud.points <= high)).T
    return cloud.select(x & y & z)


def voxel_grid(cloud: PointCloud, size: float) -> PointCloud:
    """One point for each occupied cube of edge `size` [m]: the mean of its points, normals and colours.

    The grid starts at the cloud's lower corner. A cube takes the viewpoint of its first point; pixels are lost.
    """
    if len(cloud) == 0:
        return cloud
    cell = np.floor((cloud.points - cloud.points.min(axis=0)) / size).astype(np.int64)
    counts = cell.max(axis=0) + 1
    if counts.astype(object).prod() >= 2**62:
        raise CloudError(f"voxel {size:g} m is too small for a cloud {np.ptp(cloud.points, axis=0).max():.3g} m wide", voxel=size)
    key = (cell[:, 0] * counts[1] + cell[:, 1]) * counts[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    members = np.diff(starts, append=len(key))[:, None]

    def mean(values: Float[ndarray, "n 3"]) -> Float[ndarray, "m 3"]:
        return np.add.reduceat(values[order], starts, axis=0) / members

    normals = None
    if cloud.normals is not None:
        total = mean(cloud.normals)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        # Normals that cancel, as on both faces of a thin sheet, leave the first one's.
        normals = np.where(length > 1e-6, total / np.where(length > 1e-6, length, 1.0), cloud.normals[order[starts]])
    return replace(
        cloud,
        points=mean(cloud.points),
        normals=normals,
        colours=None if cloud.colours is None else mean(cloud.colours),
        view=None if cloud.view is None else cloud.view[order[starts]],
        pixel=None,
    )


def drop_sparse(cloud: PointCloud, radius: float, neighbours: int) -> PointCloud:
    """The points with at least `neighbours` others within `radius` [m]: flying pixels and stray points are dropped."""
    if len(cloud) <= neighbours:
        return cloud.select(np.zeros(len(cloud), bool))
    tree = KDTree(cloud.points, balanced_tree=False, compact_nodes=False)
    # Finding the k nearest costs less than counting all within the radius where the cloud is dense.
    distance, _ = tree.query(cloud.points, k=neighbours + 1, distance_upper_bound=radius * (1 + 1e-12), workers=-1)
    return cloud.select(np.isfinite(distance[:, -1]))


def drop_outliers(cloud: PointCloud, neighbours: int = 16, factor: float = 3.0) -> PointCloud:
    """The points whose mean distance to their neighbours is at most `factor` robust standard deviations above the median.

    Median and median absolute deviation instead of mean and standard deviation: a cluster of stray points does not move
    the limit it is judged by. Use it where the spacing of the cloud is not known; `drop_sparse` where it is.
    """
    if len(cloud) <= neighbours:
        return cloud
    distance, _ = KDTree(cloud.points).query(cloud.points, k=neighbours + 1, workers=-1)
    spacing = distance[:, 1:].mean(axis=1)
    median = float(np.median(spacing))
    deviation = 1.4826 * float(np.median(np.abs(spacing - median)))
    return cloud.select(spacing <= median + factor * max(deviation, 0.1 * median))


def estimate_normals(cloud: PointCloud, neighbours: int = 24) -> PointCloud:
    """The cloud with unit normals: the direction of least spread of each point's neighbours, turned towards the camera
    that saw it (thesis eq 5.15-5.16), or up (+z) where no viewpoint is known.

    Raises:
        CloudError: fewer than three points.
    """
    n = len(cloud)
    if n < 3:
        raise CloudError(f"{counted(n, 'point')} {'has' if n == 1 else 'have'} no normals; three are needed", points=n)
    tree = KDTree(cloud.points)
    normals = np.empty((n, 3))
    for start in range(0, n, 50_000):  # in pieces: the neighbours of 300,000 points at once are 170 MB
        part = slice(start, start + 50_000)
        _, index = tree.query(cloud.points[part], k=min(neighbours, n), workers=-1)
        around = cloud.points[index]
        around = around - around.mean(axis=1, keepdims=True)
        normals[part] = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]
    origins = cloud.sight_origins()
    towards = np.broadcast_to([0.0, 0.0, 1.0], normals.shape) if origins is None else origins - cloud.points
    normals[np.einsum("ij,ij->i", normals, towards) < 0] *= -1
    return replace(cloud, normals=normals)
