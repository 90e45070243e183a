"""The smooth surfaces of one view: small patches of its depth image that are flat, away from edges and grooves."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.errors import CloudError
from weldsim.frames import unit
from weldsim.records import PointCloud

SIDE = 8  # [px] of a patch: wider than the support window of a stereo matcher rounds an edge off
FILLED = 0.6  # share of its pixels a patch needs
ROUGHER, SMOOTH = 2.5, 1e-4  # a patch may be this many times rougher than the view's median, and this rough in any case [m]
TURNS = (0.45, 0.25, 0.18)  # [rad] normals this alike are averaged, pass by pass
LEVEL = 0.02  # share of the distance by which neighbours on one surface may lie out of each other's plane
SIGMAS, BEND = (
    3.0,
    1e-4,
)  # neighbours either side have their middle this near to a patch: in its sigmas, or in metres for bent parts
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
    valid: (h, w) whether enough pixels returned.  centre: (h, w, 3) on the square's plane, in C [m].
    plane: (h, w, 3) of that plane p in C: plane @ p = 1 [1/m].  rough: (h, w) rms distance of the points from it [m].
    """

    valid: Bool[ndarray, "h w"]
    centre: Float[ndarray, "h w 3"]
    plane: Float[ndarray, "h w 3"]
    rough: Float[ndarray, "h w"]

    @property
    def normal(self) -> Float[ndarray, "h w 3"]:
        """Unit normals towards the camera; zero where not valid."""
        return np.where(self.valid[..., None], -unit(self.plane), 0.0)


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
    inner &= _straight(blocks, normal, sigma)
    pitch = SIDE * z / (cloud.intrinsics.fx if cloud.intrinsics else 1.0)
    facing = np.abs(np.einsum("hwi,hwi->hw", normal, blocks.centre)) / np.maximum(np.linalg.norm(blocks.centre, axis=-1), 1e-9)
    return Patches(
        centres=blocks.centre[inner],
        normals=normal[inner],
        sigma=sigma[inner],
        spacing=(pitch / np.maximum(facing, 0.2))[inner],
    )


def cut_in_blocks(cloud: PointCloud) -> Blocks:
    """The plane of each square of the depth image.

    On a plane inverse depth is affine in image coordinates, which are free of noise: fitted so, the plane is not tilted by
    noise along the line of sight, as the least eigenvector of the points' covariance is.

    Raises:
        CloudError: the cloud does not know its pixels or its one camera.
    """
    camera, X_BC = cloud.intrinsics, cloud.X_BC
    if cloud.pixel is None or camera is None or X_BC is None or X_BC.batch:
        raise CloudError("register: a view does not know its pixels and its one camera; give clouds as deprojected")
    h, w = camera.height // SIDE, camera.width // SIDE
    inverse = np.zeros(camera.height * camera.width)
    inverse[cloud.pixel] = 1.0 / ((cloud.points - X_BC.p) @ X_BC.R[:, 2])
    d = _in_cells(inverse.reshape(camera.height, camera.width), h, w)
    seen = (d > 0).astype(float)
    x = (np.arange(w * SIDE) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(h * SIDE) + 0.5 - camera.cy) / camera.fy
    grid_x = _in_cells(np.broadcast_to(x, (h * SIDE, w * SIDE)), h, w)
    grid_y = _in_cells(np.broadcast_to(y[:, None], (h * SIDE, w * SIDE)), h, w)
    count = seen.sum(axis=-1)
    some = np.maximum(count, 1)
    mean = [np.einsum("hwk,hwk->hw", values, seen) / some for values in (grid_x, grid_y, d)]
    u, v, r = ((values - m[..., None]) * seen for values, m in zip((grid_x, grid_y, d), mean, strict=True))
    uu, uv, vv, ur, vr, rr = (np.einsum("hwk,hwk->hw", p, q) for p, q in ((u, u), (u, v), (v, v), (u, r), (v, r), (r, r)))
    determinant = uu * vv - uv**2
    valid = (count >= FILLED * SIDE * SIDE) & (mean[2] > 0)
    safe = np.where(valid, determinant, 1.0)
    b, c = (vv * ur - uv * vr) / safe, (uu * vr - uv * ur) / safe
    plane = np.stack([b, c, mean[2] - b * mean[0] - c * mean[1]], axis=-1)
    z = 1.0 / np.where(valid, mean[2], 1.0)
    left = np.sqrt(np.maximum(rr - b * ur - c * vr, 0.0) / some)  # rms of inverse depth
    length = np.maximum(np.linalg.norm(plane, axis=-1), 1e-9)
    # A step in inverse depth moves a point along its ray; the plane's value there changes by z times as much.
    rough = left * z / length
    centre = np.stack([mean[0] * z, mean[1] * z, z], axis=-1)
    return Blocks(valid, centre, np.where(valid[..., None], plane, 0.0), rough)


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
    plane = np.where(flat[..., None], blocks.plane, 0.0)
    reach = LEVEL * blocks.centre[..., 2]
    for turn in TURNS:
        normal, total, count = unit(plane), plane.copy(), flat.astype(float)
        for rows, columns in _around(2):
            alike = np.einsum("hwi,hwi->hw", normal, _shifted(normal, rows, columns)) > np.cos(turn)
            offset = _shifted(blocks.centre, rows, columns) - blocks.centre
            alike &= np.abs(np.einsum("hwi,hwi->hw", offset, normal)) < reach
            total += np.where(alike[..., None], _shifted(plane, rows, columns), 0.0)
            count += alike
        plane = total / np.maximum(count, 1.0)[..., None]  # planes, not unit normals: their noise has mean zero
    return -unit(plane)


def _straight(blocks: Blocks, normal: Float[ndarray, "h w 3"], sigma: Float[ndarray, "h w"]) -> Bool[ndarray, "h w"]:
    """Where the surface goes on straight to either side: the middle of a groove's wall is flat, but not its surroundings."""
    straight = np.ones(sigma.shape, bool)
    for reach in (1, 2):
        limit = np.maximum(SIGMAS * sigma, BEND * reach**2)
        for rows, columns in ((0, 1), (1, 0), (1, 1), (1, -1)):
            ahead, back = ((rows * reach * sign, columns * reach * sign) for sign in (1, -1))
            middle = (_shifted(blocks.centre, *ahead) + _shifted(blocks.centre, *back)) / 2
            known = _shifted(blocks.valid, *ahead) & _shifted(blocks.valid, *back)
            straight &= ~known | (np.abs(np.einsum("hwi,hwi->hw", middle - blocks.centre, normal)) < limit)
    return straight


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
