"""A cloud as an image in which planes are affine: the chart every coarse search works on.

Seen from a viewpoint, inverse depth is affine in image coordinates on any plane, whatever its tilt, and a stereo
camera averages over windows of just this image; so the chart's height is z0^2 / z - z0, metres towards the camera.
Without a viewpoint the chart is orthographic along the cloud's thinnest direction.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.frames import unit
from weldsim.records import PointCloud

COARSE_PITCH = 0.0013  # [m] wanted size of a chart cell on the surface
MAX_CELLS = 1_500_000
TAIL = 0.0005  # of the points may lie beyond the chart, at each edge
SAMPLE_STRIDE = 16
BLOCKS = 128  # along the longer side, in which the density of the points is counted
FEWEST_BLOCKS = 30
SPARSE_SHARE = 0.1  # of the blocks are sparser than what counts as sparse
CELL_SPACINGS = 0.8  # size of a cell over the usual spacing of the points
SPARSE = 0.6  # spacing over cell size from which on cells stay empty by chance
WIDEST_GAP = 1.5  # radius, in spacings, of the widest gap that randomly sampled surfaces leave (one in a thousand)
FILL_SIGMA = 0.6  # of the weights with which heights between such points are averaged, in spacings
SLOPE_SIGMA = 1.5  # the same for slopes


@dataclass(frozen=True, eq=False)
class Scattered:
    """The points of a sparse chart, summed cell by cell.

    Attributes:
        number: (h, w) points in each cell.
        height: (h, w) sum of their chart heights [m].
        u, v: (h, w) sums of their offsets from the cells' centres [cells].
        spacing: between the points where they are sparse [cells].
    """

    number: Float[ndarray, "h w"]
    height: Float[ndarray, "h w"]
    u: Float[ndarray, "h w"]
    v: Float[ndarray, "h w"]
    spacing: float

    def levelled(self, along_rows: float, along_columns: float) -> Float[ndarray, "h w"]:
        """Height at each cell's centre above a plane through the chart's corner with these slopes [m/cell]: the mean of
        the points around, weighted by distance. A mean of heights above a plane is never above all of them."""
        v, u = np.indices(self.number.shape)
        above = self.height - along_columns * (self.u + self.number * u) - along_rows * (self.v + self.number * v)
        return self._mean(above)

    def _mean(self, sums: Float[ndarray, "h w"]) -> Float[ndarray, "h w"]:
        """Mean over the points around each cell [unit of `sums`], 0 where there is none."""
        total, number = (cv2.GaussianBlur(one, (0, 0), FILL_SIGMA * self.spacing) for one in (sums, self.number))
        return np.where(number > 1e-3, total / np.maximum(number, 1e-3), 0.0)

    def heights(self, squares: Float[ndarray, "5 h w"]) -> tuple[Float[ndarray, "h w"], Bool[ndarray, "h w"]]:
        """Heights at the cells' centres, and the cells that have one.

        A point lies anywhere in its cell, and on a tilted surface that alone looks like noise as large as the cell; and
        cells stay empty by chance. So each point is carried to the centre with the slope of a wider window. A gap wider
        than a sampled surface leaves by chance stays empty.

        Args:
            squares: over the points of each cell, the sums of u^2, v^2, u v, u h, v h.
        """
        reach = max(1, round(WIDEST_GAP * self.spacing))
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        known = cv2.copyMakeBorder((self.number > 0).astype(np.uint8), reach, reach, reach, reach, cv2.BORDER_CONSTANT, value=0)
        valid = cv2.morphologyEx(known, cv2.MORPH_CLOSE, disc)[reach:-reach, reach:-reach] > 0
        # Sums about the cells' centres, as sums about the chart's corner, whose spread a window can tell.
        v0, u0 = np.indices(self.number.shape).astype(float)
        n, h, u, v = self.number, self.height, self.u + u0 * self.number, self.v + v0 * self.number
        uu, vv, uv, uh, vh = squares
        uu, vv = uu + 2 * u0 * self.u + u0**2 * n, vv + 2 * v0 * self.v + v0**2 * n
        uv = uv + u0 * self.v + v0 * self.u + u0 * v0 * n
        uh, vh = uh + u0 * h, vh + v0 * h
        wide = SLOPE_SIGMA * self.spacing
        n, h, u, v, uu, vv, uv, uh, vh = (cv2.GaussianBlur(one, (0, 0), wide) for one in (n, h, u, v, uu, vv, uv, uh, vh))
        n = np.maximum(n, 1e-9)
        loose = 0.05 * n * self.spacing**2  # a few points in a row say nothing about the slope across them
        suu, svv, suv = uu - u * u / n + loose, vv - v * v / n + loose, uv - u * v / n
        suh, svh = uh - u * h / n, vh - v * h / n
        det = suu * svv - suv**2
        slope_u, slope_v = (svv * suh - suv * svh) / det, (suu * svh - suv * suh) / det
        away_u, away_v = (self._mean(a + at * self.number) - at for a, at in ((self.u, u0), (self.v, v0)))
        image = self._mean(self.height) - slope_u * away_u - slope_v * away_v
        return np.where(valid, image, 0.0), valid


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
    scattered: where the points are so sparse that their places within the cells matter; None where they are not.
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
    scattered: Scattered | None = None

    def based_at(self, depth: float) -> "Chart":
        """The same chart with heights and lengths true at another depth [m] from the viewpoint."""
        if not self.perspective:
            return self
        ratio = depth / self.depth0
        height = np.where(self.valid, ratio**2 * (self.height + self.depth0) - depth, 0.0)
        scattered = self.scattered
        if scattered is not None:
            total = ratio**2 * (scattered.height + scattered.number * self.depth0) - scattered.number * depth
            scattered = replace(scattered, height=total)
        return replace(self, height=height, pitch=self.step * depth, depth0=depth, scattered=scattered)

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

    def heights(self, points: Float[ndarray, "k 3"]) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"]]:
        """Chart height of points in space [m], and that of the surface seen in the same direction, NaN without data."""
        local = (points - self.origin) @ self.axes.T
        z = np.maximum(local[:, 2], 1e-3)
        uv = local[:, :2] / z[:, None] if self.perspective else local[:, :2]
        own = self.depth0**2 / z - self.depth0 if self.perspective else self.depth0 - z
        h, w = self.valid.shape
        column, row = np.floor((uv - self.corner) / self.step).astype(np.int64).T
        inside = (column >= 0) & (column < w) & (row >= 0) & (row < h)
        column, row = np.clip(column, 0, w - 1), np.clip(row, 0, h - 1)
        return own, np.where(inside & self.valid[row, column], self.height[row, column], np.nan)


def make_chart(cloud: PointCloud) -> Chart:
    """The chart of a whole cloud, seen from its (mean) viewpoint or along its thinnest direction."""
    if len(cloud.viewpoints) == 1:
        return chart_from(cloud.points, cloud.viewpoints[0])
    if len(cloud.viewpoints):
        away = _middle(cloud.points) - cloud.viewpoints.mean(axis=0)
        return chart_along(cloud.points, unit(away), float(np.linalg.norm(away)))
    return chart_along(cloud.points, -_thin_direction(cloud))


def chart_from(points: Float[ndarray, "n 3"], viewpoint: Float[ndarray, "3"]) -> Chart:
    """The chart of points as a camera at `viewpoint` [m] sees them."""
    axes = _axes(unit(_middle(points) - viewpoint))
    x, y, z = axes @ (points - viewpoint).T
    front = z > 1e-3
    depth0 = _usual(z, front)
    safe = np.where(front, z, depth0)
    return _chart(x / safe, y / safe, depth0**2 / safe - depth0, front, axes, viewpoint, depth0, perspective=True)


def chart_along(points: Float[ndarray, "n 3"], forward: Float[ndarray, "3"], distance: float = 1.0) -> Chart:
    """The orthographic chart of points seen along `forward` (3,) unit, from a plane `distance` [m] before their middle."""
    axes = _axes(forward)
    origin = _middle(points) - distance * forward
    x, y, z = axes @ (points - origin).T
    front = z > 1e-3
    depth0 = _usual(z, front)
    return _chart(x, y, depth0 - z, front, axes, origin, depth0, perspective=False)


def _usual(depth: Float[ndarray, "n"], front: Bool[ndarray, "n"]) -> float:
    """Median depth of the points in front [m]; 1 m where there is none."""
    return float(np.median(depth if front.all() else depth[front])) if front.any() else 1.0


def _middle(points: Float[ndarray, "n 3"]) -> Float[ndarray, "3"]:
    """Mean of the points [m], by column: reducing along axis 0 is slow."""
    return np.array([column.mean() for column in points.T])


def _chart(
    u: Float[ndarray, "n"],
    v: Float[ndarray, "n"],
    height: Float[ndarray, "n"],
    front: Bool[ndarray, "n"],
    axes: Float[ndarray, "3 3"],
    origin: Float[ndarray, "3"],
    depth0: float,
    *,
    perspective: bool,
) -> Chart:
    """The chart of points at image coordinates (u, v) with chart heights [m]; those not in `front` are left out."""
    from weldsim.seam.profile import native

    scale = depth0 if perspective else 1.0
    low, high = np.array([_tails(u, TAIL), _tails(v, TAIL)]).T
    step, sparse = _cell_size(u, v, low, high, scale)
    corner = low - 2 * step
    columns, rows = np.ceil((high + 2 * step - corner) / step).astype(int)
    u, v = (u - corner[0]) / step, (v - corner[1]) / step
    shape = (int(rows), int(columns))
    cell, count, total = np.empty(len(u), np.int64), np.zeros(shape), np.zeros(shape)
    native.sort_into_cells(u, v, height, front, cell, count, total)
    image = np.divide(total, count, out=np.zeros(shape), where=count > 0)
    valid = count > 0
    scattered = None
    if sparse > SPARSE * step:
        inside = cell >= 0
        at, u, v, height = cell[inside], u[inside] % 1.0 - 0.5, v[inside] % 1.0 - 0.5, height[inside]
        each = (u, v, u * u, v * v, u * v, u * height, v * height)
        sums = [np.bincount(at, weights=values, minlength=count.size).reshape(shape) for values in each]
        scattered = Scattered(count, total, sums[0], sums[1], sparse / step)
        image, valid = scattered.heights(np.stack(sums[2:]))
    else:
        image, valid = _fill_pinholes(image, valid)
    return Chart(image, valid, cell, step * scale, axes, origin, depth0, corner, step, perspective, scattered)


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


def _tails(values: Float[ndarray, "n"], share: float) -> tuple[float, float]:
    """The quantiles `share` and 1 - `share`, exactly; sought only among the values beyond wider ones of a sample."""
    sample = np.sort(values[::SAMPLE_STRIDE])
    wide = int(4 * share * len(sample))
    below, above = values[values <= sample[wide]], values[values >= sample[-1 - wide]]
    if min(len(below), len(above)) < share * len(values) + 2:  # a sample that is not like the rest, or all of a few
        low, high = np.quantile(values, [share, 1 - share])
        return float(low), float(high)
    place = share * (len(values) - 1)
    return _ranked(below, place), -_ranked(-above, place)


def _ranked(values: Float[ndarray, "k"], place: float) -> float:
    """The value at a place in the order of size, from 0, between the two about it where it is no whole number."""
    first = int(place)
    one, other = np.sort(np.partition(values, first + 1)[: first + 2])[-2:]
    return float(one + (place - first) * (other - one))


def _cell_size(
    u: Float[ndarray, "n"], v: Float[ndarray, "n"], low: Float[ndarray, "2"], high: Float[ndarray, "2"], scale: float
) -> tuple[float, float]:
    """Cell size, COARSE_PITCH or coarser where the cloud is sparser, and the spacing of points where they are sparse, both
    in units of uv.

    A table seen at a flat angle is dense in the chart: it must not decide for a part that is not. So the spacing is that
    of a lower quantile of the blocks that lie wholly within the data.
    """
    from weldsim.seam.profile import native

    extent = np.maximum(high - low, 1e-9)
    block = max(float(extent.max()) / BLOCKS, 1e-12)
    count = np.zeros((BLOCKS + 2, BLOCKS + 2), np.int64)
    native.count_blocks(u, v, float(low[0]), float(low[1]), block, count)
    within = cv2.erode((count > 0).astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0) > 0
    spacing = sparse = block * float(np.sqrt(np.count_nonzero(count) / len(u)))
    if np.count_nonzero(within) >= FEWEST_BLOCKS:
        usual, low_count = np.quantile(count[within], [0.5, SPARSE_SHARE])
        spacing, sparse = block / float(np.sqrt(usual)), block / float(np.sqrt(low_count))
    step = max(COARSE_PITCH / scale, CELL_SPACINGS * spacing)
    return float(max(step, np.sqrt(np.prod(extent + 4 * step) / MAX_CELLS))), sparse


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
