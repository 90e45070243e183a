"""A cloud as an image in which planes are affine: the chart every coarse search works on.

Seen from a viewpoint, inverse depth is affine in image coordinates on any plane, whatever its tilt, and a stereo
camera averages over windows of just this image; so the chart's height is z0^2 / z - z0, metres towards the camera.
Without a viewpoint the chart is orthographic along the cloud's thinnest direction.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.frames import unit
from weldsim.records import PointCloud

COARSE_PITCH = 0.0013  # [m] wanted size of a chart cell on the surface
MAX_CELLS = 1_500_000


@dataclass(frozen=True, eq=False)
class Chart:
    """Attributes:
    height: (h, w) metres towards the viewer, 0 at the mean depth; 0 where not valid.
    valid: (h, w) cells that hold data.
    cell: (n,) flat cell index of each point, -1 outside.
    pitch: size of a cell on a surface facing the viewer at mean depth [m].
    axes: (3, 3) rows: image u, image v, viewing direction (away from the viewer), in the cloud's frame.
    origin: viewpoint, or a point far away for an orthographic chart [m].
    depth0: mean depth [m]; infinity-like charts are orthographic when `perspective` is false.
    corner: image coordinates of cell (0, 0)'s corner, in units of depth ratio (perspective) or metres.
    step: cell size in those units.
    """

    height: Float[ndarray, "h w"]
    valid: Bool[ndarray, "h w"]
    cell: Int[ndarray, "n"]
    pitch: float
    axes: Float[ndarray, "3 3"]
    origin: Float[ndarray, "3"]
    depth0: float
    corner: Float[ndarray, "2"]
    step: float
    perspective: bool

    def to_space(self, u: Float[ndarray, "k"], v: Float[ndarray, "k"], height: Float[ndarray, "k"]) -> Float[ndarray, "k 3"]:
        """Points in the cloud's frame at cell coordinates (u, v) (cell centres at whole numbers) and chart height."""
        a = self.corner[0] + (u + 0.5) * self.step
        b = self.corner[1] + (v + 0.5) * self.step
        if self.perspective:
            z = self.depth0**2 / (height + self.depth0)
            local = np.stack([a * z, b * z, z], axis=1)
        else:
            local = np.stack([a, b, self.depth0 - height], axis=1)
        return self.origin + local @ self.axes


def make_chart(cloud: PointCloud) -> Chart:
    """The chart of a cloud, seen from its (mean) viewpoint or along its thinnest direction."""
    points = cloud.points
    middle = points.mean(axis=0)
    perspective = len(cloud.viewpoints) == 1
    if len(cloud.viewpoints):
        origin = cloud.viewpoints.mean(axis=0)
        forward = unit(middle - origin)
    else:
        forward = -_thin_direction(cloud)
        origin = middle - forward
    if not perspective:
        origin = middle - forward * np.linalg.norm(middle - origin)
    axes = _axes(forward)
    local = (points - origin) @ axes.T
    z = local[:, 2]
    front = z > 1e-3
    depth0 = float(np.median(z[front])) if front.any() else 1.0
    safe = np.where(front, z, depth0)
    uv = local[:, :2] / safe[:, None] if perspective else local[:, :2].copy()
    height = depth0**2 / safe - depth0 if perspective else depth0 - z
    scale = depth0 if perspective else 1.0
    step = _cell_size(uv, scale)
    low, high = np.quantile(uv, [0.0005, 0.9995], axis=0)
    corner = low - 2 * step
    shape = np.ceil((high + 2 * step - corner) / step).astype(int)
    index = np.floor((uv - corner) / step).astype(np.int64)
    inside = front & (index >= 0).all(axis=1) & (index < shape).all(axis=1)
    cell = np.where(inside, index[:, 1] * shape[0] + index[:, 0], -1)
    size = int(shape[0] * shape[1])
    count = np.bincount(cell[inside], minlength=size)
    total = np.bincount(cell[inside], weights=height[inside], minlength=size)
    image = np.divide(total, count, out=np.zeros(size), where=count > 0).reshape(shape[1], shape[0])
    valid = (count > 0).reshape(shape[1], shape[0])
    image, valid = _fill_pinholes(image, valid)
    return Chart(image, valid, cell, step * scale, axes, origin, depth0, corner, step, perspective)


def _thin_direction(cloud: PointCloud) -> Float[ndarray, "3"]:
    """Direction in which the cloud is thinnest, turned towards the cloud's normals if it has any, else upwards."""
    sample = cloud.points[:: max(1, len(cloud.points) // 20_000)]
    centre, weight = sample.mean(axis=0), np.ones(len(sample))
    normal = np.array([0.0, 0.0, 1.0])
    for _ in range(6):  # reweighted so that a table or a clamp does not tilt the part's own plane
        centre = weight @ sample / weight.sum()
        offset = sample - centre
        normal = np.linalg.eigh((offset * weight[:, None]).T @ offset)[1][:, 0]
        distance = offset @ normal
        scale = max(1.4826 * float(np.median(np.abs(distance))), 1e-5)
        weight = 1.0 / (1.0 + (distance / (2 * scale)) ** 2)
    if cloud.normals is not None:
        return normal if float(np.mean(cloud.normals @ normal)) >= 0 else -normal
    leading = normal[2] if abs(normal[2]) > 0.05 else -normal[1]
    return normal if leading >= 0 else -normal


def _axes(forward: Float[ndarray, "3"]) -> Float[ndarray, "3 3"]:
    """Rows u, v, forward: right-handed."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(forward[0]) < 0.8 else np.array([0.0, 1.0, 0.0])
    v = unit(np.cross(forward, helper))
    return np.stack([np.cross(v, forward), v, forward])


def _cell_size(uv: Float[ndarray, "n 2"], scale: float) -> float:
    """Cell size in units of uv: COARSE_PITCH, or coarser where the cloud is sparser."""
    low, high = np.quantile(uv, [0.001, 0.999], axis=0)
    extent = np.maximum(high - low, 1e-9)
    coarse = max(float(extent.max()) / 128, 1e-12)
    occupied = len(np.unique(np.floor((uv - low) / coarse).astype(np.int64) @ np.array([1, 100_003])))
    spacing = np.sqrt(occupied * coarse**2 / len(uv))
    step = max(COARSE_PITCH / scale, 1.5 * spacing)
    return float(max(step, np.sqrt(np.prod(extent + 4 * step) / MAX_CELLS)))


def _fill_pinholes(image: Float[ndarray, "h w"], valid: Bool[ndarray, "h w"]) -> tuple[Float[ndarray, "h w"], Bool[ndarray, "h w"]]:
    """Empty cells with at least 5 of 8 neighbours holding data take their mean."""
    for _ in range(2):
        weight = valid.astype(np.float64)
        count = cv2.boxFilter(weight, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
        total = cv2.boxFilter(image * weight, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
        fill = ~valid & (count >= 5)
        image = np.where(fill, total / np.maximum(count, 1), image)
        valid = valid | fill
    return image, valid
