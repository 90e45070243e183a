"""Double walls: where two views show one surface in two places, the better-seen one is kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.cloud.patches import SIDE, Blocks, cut_in_blocks, spread
from weldsim.errors import CloudError
from weldsim.frames import Transform, unit
from weldsim.records import CameraIntrinsics, PointCloud

REACH = 0.008  # [m] surfaces further apart along the line of sight are different ones
SIGMAS = 2.0  # a mean disagreement beyond so many standard deviations of a single point is no noise
WAVES = 3.0  # nor is one beyond so many of what squares of the same two views disagree by: noise is alike over several squares
LEAST = 5e-4  # [m] disagreements smaller than this are left alone
BETTER = 1.15  # times as well seen, to be preferred
STEP = 0.01  # share of the depth that differs between neighbouring pixels at an edge
STRIDE = 2  # [px] every so many pixels are compared, each way


@dataclass(frozen=True, eq=False)
class _Image:
    """A view for comparison. Attributes: X its pose X_BC; camera; depth (h w) corrected z [m], NaN = none; blocks; quality (h w)
    of each block, resolution on the surface [1/m]; noise, scatter of depth over z squared [1/m]."""

    X: Transform
    camera: CameraIntrinsics
    depth: Float[ndarray, "h w"]
    blocks: Blocks
    quality: Float[ndarray, "bh bw"]
    noise: float


def double_walls(clouds: Sequence[PointCloud]) -> list[Bool[ndarray, "_"]]:
    """For each cloud, which of its points are a worse-seen copy of a surface that another view shows elsewhere.

    Compared by squares of the depth image: each square's points are looked up in the other view's image. Where the mean
    distance between the two surfaces is beyond noise, and beyond what these two views disagree by everywhere, the view that
    sees the surface better (nearer, less obliquely) is right and the square is marked in the other. Where they agree, both stay.

    Args:
        clouds: organised views in B, lined up.
    Raises:
        CloudError: a view that does not know its pixels.
    """
    if len(clouds) < 2:
        return [np.zeros(len(cloud), bool) for cloud in clouds]
    images = [_image(cloud) for cloud in clouds]
    marked = [np.zeros(image.quality.shape, bool) for image in images]
    for i, image in enumerate(images):
        for j, other in enumerate(images):
            if i != j:
                marked[i] |= _worse(image, other)
    return [_by_point(mask, cloud) for mask, cloud in zip(marked, clouds, strict=True)]


def _image(cloud: PointCloud) -> _Image:
    blocks, camera, X = cut_in_blocks(cloud), cloud.intrinsics, cloud.X_BC
    if cloud.pixel is None or camera is None or X is None:
        raise CloudError("double walls: a view does not know its pixels")
    depth = np.full(camera.height * camera.width, np.nan)
    depth[cloud.pixel] = (cloud.points - X.p) @ X.R[:, 2]
    depth = _without_edges(depth.reshape(camera.height, camera.width))
    # A square in a groove or on an edge is judged by the surface around it.
    normal = unit(spread(blocks.normal))
    distance = np.maximum(np.linalg.norm(blocks.centre, axis=-1), 1e-9)
    facing = np.abs(np.einsum("hwi,hwi->hw", normal, blocks.centre)) / distance
    z = np.maximum(blocks.centre[..., 2], 1e-9)
    rough = blocks.rough[blocks.valid] / np.maximum(facing, 0.1)[blocks.valid] / z[blocks.valid] ** 2
    return _Image(X, camera, depth, blocks, facing / distance, float(np.median(rough)) if rough.size else 0.0)


def _without_edges(depth: Float[ndarray, "h w"]) -> Float[ndarray, "h w"]:
    """The image without the pixels beside a step: what lies under them depends on which of the two is met."""
    edge = np.zeros(depth.shape, bool)
    with np.errstate(invalid="ignore"):
        across = np.abs(np.diff(depth, axis=1)) > STEP * depth[:, 1:]
        down = np.abs(np.diff(depth, axis=0)) > STEP * depth[1:]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return np.where(edge, np.nan, depth)


def _worse(image: _Image, other: _Image) -> Bool[ndarray, "bh bw"]:
    """Squares of `image` whose surface `other` shows elsewhere, and sees better."""
    h, w = image.quality.shape
    rows = np.arange(STRIDE // 2, h * SIDE, STRIDE)
    columns = np.arange(STRIDE // 2, w * SIDE, STRIDE)
    z = image.depth[np.ix_(rows, columns)]
    at = np.flatnonzero(np.isfinite(z.ravel()))
    row, column = rows[at // len(columns)], columns[at % len(columns)]
    z = z.ravel()[at]
    a, b = image.camera, other.camera
    X = other.X.inverse() @ image.X
    seen = X.points(np.column_stack([(column + 0.5 - a.cx) / a.fx * z, (row + 0.5 - a.cy) / a.fy * z, z]))
    front = seen[:, 2] > 1e-3
    depth = np.where(front, seen[:, 2], 1.0)
    u = np.floor(b.fx * seen[:, 0] / depth + b.cx).astype(np.int64)
    v = np.floor(b.fy * seen[:, 1] / depth + b.cy).astype(np.int64)
    bh, bw = other.quality.shape
    inside = front & (u >= 0) & (v >= 0) & (u < bw * SIDE) & (v < bh * SIDE)
    u, v = np.where(inside, u, 0), np.where(inside, v, 0)
    gap = depth - other.depth[v, u]
    close = inside & (np.abs(gap) < REACH)
    mine = (row // SIDE) * w + column // SIDE
    theirs = other.quality[v // SIDE, u // SIDE]
    close &= theirs > BETTER * image.quality.ravel()[mine]
    # Along the other's line of sight, foreshortened to the distance between the surfaces.
    square = theirs * np.maximum(np.linalg.norm(seen, axis=1), 1e-9)
    gap = np.where(close, gap * square, 0.0)
    count = np.bincount(mine[close], minlength=h * w)
    mean = np.bincount(mine[close], weights=gap[close], minlength=h * w) / np.maximum(count, 1)
    sigma = np.hypot(
        image.noise * image.blocks.centre[..., 2].ravel() ** 2, other.noise * np.median(depth[close]) ** 2 if close.any() else 0
    )
    enough = count >= 0.5 * (SIDE / STRIDE) ** 2
    waves = 1.4826 * float(np.median(np.abs(mean[enough] - np.median(mean[enough])))) if enough.any() else 0.0
    return (enough & (np.abs(mean) > np.maximum(SIGMAS * sigma, max(WAVES * waves, LEAST)))).reshape(h, w)


def _by_point(mask: Bool[ndarray, "bh bw"], cloud: PointCloud) -> Bool[ndarray, "n"]:
    if cloud.pixel is None or cloud.intrinsics is None:
        return np.zeros(len(cloud), bool)
    row, column = np.divmod(cloud.pixel, cloud.intrinsics.width)
    row, column = row // SIDE, column // SIDE
    h, w = mask.shape
    inside = (row < h) & (column < w)
    return inside & mask[np.minimum(row, h - 1), np.minimum(column, w - 1)]
