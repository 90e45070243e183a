"""The smooth surfaces of one view: small patches of its depth image that are flat, away from edges and grooves."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.errors import CloudError
from weldsim.records import PointCloud

SIDE = 8  # [px] of a patch: wider than the support window of a stereo matcher rounds an edge off
FILLED = 0.6  # share of its pixels a patch needs
ROUGHER, SMOOTH = 2.5, 1e-4  # a patch may be this many times rougher than the view's median, and this rough in any case [m]
TURNS = (0.45, 0.25, 0.18)  # [rad] normals this alike are averaged, pass by pass
LEVEL = 0.02  # share of the distance by which neighbours on one surface may lie out of each other's plane
FLOOR = 5e-5  # [m] least standard deviation of a patch


@dataclass(frozen=True, eq=False)
class Patches:
    """Attributes, in the camera's frame C:
    centres: (n, 3) mean of each patch's points [m].
    normals: (n, 3) unit, towards the camera, averaged over the surface around.
    sigma: (n,) standard deviation of the centre along the normal [m].
    spacing: (n,) distance to the next patch on the surface [m].
    """

    centres: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    sigma: Float[ndarray, "n"]
    spacing: Float[ndarray, "n"]

    def __len__(self) -> int:
        return len(self.centres)

    def select(self, keep: Bool[ndarray, "n"] | Int[ndarray, "m"]) -> "Patches":
        """The patches picked by a mask or by indices."""
        return Patches(self.centres[keep], self.normals[keep], self.sigma[keep], self.spacing[keep])


@dataclass(frozen=True, eq=False)
class Blocks:
    """The depth image cut into squares of SIDE pixels, h down and w across. Attributes:
    valid: (h, w) whether enough pixels returned.  centre, normal: (h, w, 3) in C.  rough: (h, w) rms distance from its plane [m].
    """

    valid: Bool[ndarray, "h w"]
    centre: Float[ndarray, "h w 3"]
    normal: Float[ndarray, "h w 3"]
    rough: Float[ndarray, "h w"]


def planar_patches(cloud: PointCloud) -> Patches:
    """The flat patches of an organised view, those next to an edge, a groove or a hole left out.

    A groove's walls take no part: a camera rounds them off, differently from each side, and whoever lines them up slides
    the groove. What is flat is decided by the view's own roughness.

    Raises:
        CloudError: the cloud does not know its pixels or its camera.
    """
    blocks = cut_in_blocks(cloud)
    z = blocks.centre[..., 2]
    scaled = blocks.rough[blocks.valid] / z[blocks.valid] ** 2  # noise of a stereo camera grows with the square
    limit = ROUGHER * float(np.median(scaled)) if scaled.size else 0.0
    flat = blocks.valid & (blocks.rough <= np.maximum(limit * z**2, SMOOTH))
    inner = flat.copy()
    for rows, columns in _around(1):
        inner &= _shifted(flat, rows, columns)
    normal = _smooth_normals(blocks, flat)
    sigma = _noise(blocks, normal, inner)
    pitch = SIDE * z / (cloud.intrinsics.fx if cloud.intrinsics else 1.0)
    facing = np.abs(np.einsum("hwi,hwi->hw", normal, blocks.centre)) / np.maximum(np.linalg.norm(blocks.centre, axis=-1), 1e-9)
    return Patches(
        centres=blocks.centre[inner],
        normals=normal[inner],
        sigma=sigma[inner],
        spacing=(pitch / np.maximum(facing, 0.2))[inner],
    )


def cut_in_blocks(cloud: PointCloud) -> Blocks:
    """The plane of each square of the depth image (moments of its points, least eigenvector). Raises CloudError."""
    if cloud.pixel is None or cloud.intrinsics is None or cloud.X_BC is None or cloud.X_BC.batch:
        raise CloudError("register: a view does not know its pixels and its one camera; give clouds as deprojected")
    height, width = cloud.intrinsics.height, cloud.intrinsics.width
    h, w = height // SIDE, width // SIDE
    local = (cloud.points - cloud.X_BC.p) @ cloud.X_BC.R
    filled = np.zeros(height * width)
    filled[cloud.pixel] = 1.0
    mask = _in_cells(filled.reshape(height, width), h, w)
    count = mask.sum(axis=-1)
    mean, offset = np.empty((h, w, 3)), []
    for axis in range(3):
        image = np.zeros(height * width)
        image[cloud.pixel] = local[:, axis]
        cells = _in_cells(image.reshape(height, width), h, w)
        mean[..., axis] = cells.sum(axis=-1) / np.maximum(count, 1)
        offset.append((cells - mean[..., axis, None]) * mask)
    covariance = np.empty((h, w, 3, 3))
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        covariance[..., i, j] = covariance[..., j, i] = np.einsum("hwk,hwk->hw", offset[i], offset[j]) / np.maximum(count, 1)
    values, vectors = np.linalg.eigh(covariance)
    normal = vectors[..., 0]
    normal = normal * -np.sign(np.einsum("hwi,hwi->hw", normal, mean))[..., None]
    # A patch seen so obliquely that it is a line has no plane.
    valid = (count >= FILLED * SIDE * SIDE) & (values[..., 1] > 4 * np.maximum(values[..., 0], 0.0))
    return Blocks(valid, mean, normal, np.sqrt(np.maximum(values[..., 0], 0.0)))


def _in_cells(image: Float[ndarray, "y x"], h: int, w: int) -> Float[ndarray, "h w k"]:
    """The pixels of each square, one after the other."""
    cut = image[: h * SIDE, : w * SIDE].reshape(h, SIDE, w, SIDE)
    return np.ascontiguousarray(cut.transpose(0, 2, 1, 3)).reshape(h, w, SIDE * SIDE)


def _around(reach: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1) if (i, j) != (0, 0)]


def _shifted(image: ndarray, rows: int, columns: int) -> ndarray:
    """The image moved by whole cells; what comes in at the border is zero (False)."""
    out = np.zeros_like(image)
    h, w = image.shape[:2]
    out[max(rows, 0) : h + min(rows, 0), max(columns, 0) : w + min(columns, 0)] = image[
        max(-rows, 0) : h + min(-rows, 0), max(-columns, 0) : w + min(-columns, 0)
    ]
    return out


def spread(image: Float[ndarray, "h w k"], reach: int = 1) -> Float[ndarray, "h w k"]:
    """The sum of each square and those within `reach` squares of it."""
    total = image.copy()
    for rows, columns in _around(reach):
        total += _shifted(image, rows, columns)
    return total


def _smooth_normals(blocks: Blocks, flat: Bool[ndarray, "h w"]) -> Float[ndarray, "h w 3"]:
    """Normals averaged over neighbours on the same surface, thrice: a patch's own is too noisy to tell sliding from noise."""
    normal = np.where(flat[..., None], blocks.normal, 0.0)
    reach = LEVEL * blocks.centre[..., 2]
    for turn in TURNS:
        total = normal.copy()
        for rows, columns in _around(2):
            other = _shifted(normal, rows, columns)
            alike = np.einsum("hwi,hwi->hw", normal, other) > np.cos(turn)
            offset = _shifted(blocks.centre, rows, columns) - blocks.centre
            alike &= np.abs(np.einsum("hwi,hwi->hw", offset, normal)) < reach
            total += np.where(alike[..., None], other, 0.0)
        length = np.linalg.norm(total, axis=-1, keepdims=True)
        normal = total / np.where(length > 0, length, 1.0)
    return normal


def _noise(blocks: Blocks, normal: Float[ndarray, "h w 3"], inner: Bool[ndarray, "h w"]) -> Float[ndarray, "h w"]:
    """Standard deviation of the centres along their normals, as the view's own scatter about its neighbours shows it."""
    total, count = np.zeros_like(blocks.centre), np.zeros(inner.shape)
    for rows, columns in _around(1):
        there = _shifted(inner, rows, columns)
        total += np.where(there[..., None], _shifted(blocks.centre, rows, columns), 0.0)
        count += there
    whole = inner & (count == 8)
    if whole.sum() < 9:
        whole = inner & (count > 0)
    z = blocks.centre[..., 2]
    away = np.einsum("hwi,hwi->hw", total / np.maximum(count, 1)[..., None] - blocks.centre, normal)
    scaled = np.abs(away[whole]) / z[whole] ** 2
    scale = 1.4826 * float(np.median(scaled)) if scaled.size else 0.0
    return np.maximum(scale * z**2, FLOOR)
