"""The charts of a cloud and what is read from all of them: coarse lines, and the points around a line.

A cloud of one view has one chart. A cloud of several has one for each, of its own points: only in the view that took
them are planes affine, and no single direction sees every face of a part. A cloud without viewpoints has one along its
thinnest direction, and one for each further direction that much of its surface faces.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.curves import arc_length, project
from weldsim.frames import unit
from weldsim.records import PointCloud, Threshold
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.chart import Chart, chart_along, chart_from, make_chart
from weldsim.seam.profile.facing import facing_directions, front_layer
from weldsim.seam.profile.valley import CoarseLine, trace_valleys, valley_images

SURROUNDINGS = 0.042  # [m] points within this of a coarse line take part in its fit
MOST_VIEWS = 24  # more than these share one chart
FEWEST_POINTS = 300  # in a view that has a chart of its own
GRAZING = 0.15  # cosine to the normal under which a sight line says nothing about a surface
FACING = 0.5  # cosine to the normal from which on a chart shows whether a surface dips
DEEPEST = 0.020  # [m] below the surface, down to which a point may lie in a groove
AHEAD = 4  # points of a line to either side that tell which way it leads
STRETCH = 0.010  # [m] of a line over which the same views are used
FEWEST_IN_STRETCH = 20  # points near such a stretch that a view must have to cover it
NEAR_LINE = 0.006  # [m] to either side of a line: what lies there tells where the groove is
CROSSING = 0.6  # [rad] between the sight lines of two views from which on they cross
SAME_LINE = 0.006  # [m] a coarse line this close to a stronger one, over most of its length, is the same
MOST_LINES = 24


@dataclass(frozen=True, eq=False)
class Atlas:
    """Attributes:
    cloud: all points.
    charts: in the order of the views or directions.
    members: for each chart, the indices of the points it was made of; None = all.
    """

    cloud: PointCloud
    charts: tuple[Chart, ...]
    members: tuple[Int[ndarray, "_"] | None, ...]

    def coarse_lines(self, config: ProfileConfig, factor: float) -> tuple[list[CoarseLine], Threshold]:
        """Coarse lines of all charts, each groove's once, the strongest first; and the first chart's threshold.

        Args:
            factor: multiplies every threshold.
        """
        images = [valley_images(chart, config, factor) for chart in self.charts]
        first = images[0][0]
        threshold = Threshold(name="valley depth along 25 mm", value=first.threshold, unit="m", noise=first.noise)
        if len(self.charts) == 1:
            return trace_valleys(images[0], config), threshold
        lines = [line for each in images for line in trace_valleys(each, config)]
        lines.sort(key=lambda line: -line.evidence * line.level)
        kept: list[CoarseLine] = []
        for line in lines:
            if not any(_same(line, other) for other in kept) and len(kept) < MOST_LINES:
                kept.append(line)
        return kept, threshold

    def facing(self, point: Float[ndarray, "3"], normal: Float[ndarray, "3"]) -> tuple[Chart, ...]:
        """The charts seen from above the surface at a point [m] with this outward normal."""
        if len(self.charts) == 1:
            return self.charts
        sights = (unit(c.origin - point) if c.perspective else -c.axes[2] for c in self.charts)
        return tuple(c for c, sight in zip(self.charts, sights, strict=True) if float(sight @ normal) > FACING)

    def around(self, line: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], most: int) -> Int[ndarray, "m"]:
        """Indices of the points within SURROUNDINGS of a line, thinned at random to `most`.

        Of several views each gives the points that lie near the line in space and that it saw from above the surface the
        line lies on.

        Args:
            line: (k, 3) [m].  normals: (k, 3) unit, outward, of the surface around it.
        """
        parts = []
        for chart, members in zip(self.charts, self.members, strict=True):
            near = _near(chart, line)
            parts.append(near if members is None else members[near])
        index = (
            parts[0] if len(parts) == 1 else self._near_in_space(_union(parts, disjoint=self.cloud.view is not None), line, normals)
        )
        if len(index) <= most:
            return index
        return index[np.sort(np.argpartition(self._rank[index], most)[:most])]

    @cached_property
    def _rank(self) -> Float[ndarray, "n"]:
        """By which points are left out where there are more than enough.

        Random: an even stride would beat against the rows of a depth image. And a point of the cloud keeps it, whatever else is
        near: with one point more or less around a line, a draw among them would be another sample.
        """
        return np.random.default_rng(0).random(len(self.cloud))

    def within_reach(self, line: Float[ndarray, "k 3"]) -> Int[ndarray, "m"]:
        """Indices of all points, of whatever view, that may lie within SURROUNDINGS of a line (k, 3) [m], and of some more."""
        low, high = line.min(axis=0) - SURROUNDINGS, line.max(axis=0) + SURROUNDINGS
        return np.flatnonzero(_inside(self.cloud.points, low, high))

    def sight_origins(self, index: Int[ndarray, "m"]) -> Float[ndarray, "m 3"] | None:
        """Where the cameras stood that saw these points (m, 3) [m], or None where unknown."""
        origins = self.cloud.sight_origins()
        return None if origins is None else origins[index]

    def _near_in_space(
        self, index: Int[ndarray, "j"], line: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"]
    ) -> Int[ndarray, "m"]:
        """Those of the points that lie near a line in space and were seen from above its surface, by the views best there.

        A point in the groove belongs to the stretch at which its sight line enters it: where one view takes over from
        another that looks aslant along the groove, its bottom would else be seen by neither.
        """
        points = self.cloud.points[index]
        low, high = line.min(axis=0) - 1.3 * SURROUNDINGS, line.max(axis=0) + 1.3 * SURROUNDINGS
        box = _inside(points, low, high)
        index, points = index[box], points[box]
        distance, nearest = KDTree(line).query(points, distance_upper_bound=1.3 * SURROUNDINGS)
        near = np.isfinite(distance)
        index, points, nearest = index[near], points[near], np.asarray(nearest)[near]
        view = self.cloud.view
        if view is None or len(self.cloud.viewpoints) == 0:
            return index
        sight = self.cloud.viewpoints[view[index]] - points
        rise = np.einsum("ij,ij->i", sight, normals[nearest])
        above = rise > GRAZING * np.linalg.norm(sight, axis=1)
        index, nearest, sight = index[above], nearest[above], sight[above] / rise[above, None]
        offset = self.cloud.points[index] - line[nearest]
        below = -np.einsum("ij,ij->i", offset, normals[nearest])
        below = np.where((below > 0) & (below < DEEPEST), below, 0.0)
        stretch, across = _places(line, normals, nearest, offset + below[:, None] * sight)
        allowed = _views_by_stretch(self.cloud.viewpoints, view[index], stretch, across, line, normals)
        return index[allowed[view[index], stretch]]


def make_atlas(cloud: PointCloud) -> Atlas:
    """The charts of a cloud: one for each view, or for each direction its surface faces where no view is known."""
    if cloud.view is not None and 1 < len(cloud.viewpoints) <= MOST_VIEWS:
        members = [np.flatnonzero(cloud.view == view) for view in range(len(cloud.viewpoints))]
        seen = [(view, index) for view, index in enumerate(members) if len(index) >= FEWEST_POINTS]
        if len(seen) > 1:
            charts = tuple(chart_from(cloud.points[index], cloud.viewpoints[view]) for view, index in seen)
            return Atlas(cloud, charts, tuple(index for _, index in seen))
    main = make_chart(cloud)
    if len(cloud.viewpoints) == 0:
        further = facing_directions(cloud, -main.axes[2])
        if further:
            parts = [front_layer(cloud.points, outward) for outward in (-main.axes[2], *further)]
            charts = tuple(
                chart_along(cloud.points[index], -outward) for index, outward in zip(parts, (-main.axes[2], *further), strict=True)
            )
            return Atlas(cloud, charts, tuple(parts))
    return Atlas(cloud, (main,), (None,))


def _near(chart: Chart, line: Float[ndarray, "k 3"]) -> Int[ndarray, "m"]:
    """Which of a chart's points lie within SURROUNDINGS of a line as the chart sees it."""
    local = (line - chart.origin) @ chart.axes.T
    before = local[:, 2] > 1e-3
    if not before.any():
        return np.zeros(0, np.int64)
    local = local[before]
    uv = local[:, :2] / local[:, 2:] if chart.perspective else local[:, :2]
    pitch = chart.step * float(local[:, 2].min()) if chart.perspective else chart.step
    far = np.ones(chart.valid.shape, np.uint8)
    place = ((uv - chart.corner) / chart.step).astype(int)
    limit = np.array(far.shape[::-1]) - 1
    outside = np.abs(place - np.clip(place, 0, limit)).max(axis=1) * pitch > SURROUNDINGS
    column, row = np.clip(place, 0, limit)[~outside].T
    far[row, column] = 0
    if len(row) == 0:
        return np.zeros(0, np.int64)
    near: Bool[ndarray, "h w"] = cv2.distanceTransform(far, cv2.DIST_L2, 3) < SURROUNDINGS / pitch
    return np.flatnonzero(np.concatenate([near.ravel(), [False]])[chart.cell])


def _places(
    line: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], nearest: Int[ndarray, "m"], offset: Float[ndarray, "m 3"]
) -> tuple[Int[ndarray, "m"], Float[ndarray, "m"]]:
    """On which stretch of a line points lie, the first beyond its beginning and the last beyond its end; and how far to its
    left [m].

    Args:
        line, normals: as in `Atlas.around`.  nearest: (m,) point of the line nearest to each.  offset: (m, 3) from there [m].
    """
    at = np.arange(len(line))
    ahead = unit(line[np.minimum(at + AHEAD, len(line) - 1)] - line[np.maximum(at - AHEAD, 0)])
    along = arc_length(line)[nearest] + np.einsum("ij,ij->i", offset, ahead[nearest])
    across = np.einsum("ij,ij->i", offset, np.cross(normals, ahead)[nearest])
    stretch = np.floor(along / STRETCH).astype(int)
    return stretch - stretch.min(initial=0), across


def _views_by_stretch(
    viewpoints: Float[ndarray, "v 3"],
    view: Int[ndarray, "m"],
    stretch: Int[ndarray, "m"],
    across: Float[ndarray, "m"],
    line: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
) -> Bool[ndarray, "v b"]:
    """Which views' points are used on each stretch of a line: of the views that cover it the best, and those beside it.

    A groove looks different from the left and from the right: its far wall is hidden, and a stereo camera blurs along its
    own image. Points of sight lines that cross are two pictures of it, whose mean is the picture of another groove.
    Where an image ends aslant across the groove, its view shows the plate on one side only, and covers that stretch no more;
    nor does one that shows the plate, and of the groove hardly anything.

    Args:
        viewpoints: [m].  view, stretch, across: (m,) of each point near the line, and how far to its left [m].
    """
    stretches = int(stretch.max(initial=0)) + 1
    parts = [across > 0, across <= 0, np.abs(across) < NEAR_LINE]
    count = np.stack([np.bincount((view * stretches + stretch)[part], minlength=stretches * len(viewpoints)) for part in parts], 1)
    count = count.reshape(len(viewpoints), stretches, len(parts)).astype(float)
    # Of the groove most stretches may show little, where a better view's points replaced others: its usual is its best.
    high = np.array([0.5, 0.5, 0.9])
    usual = np.array(
        [[np.quantile(part[part > 0], q) if part.any() else np.inf for part, q in zip(each.T, high, strict=True)] for each in count]
    )[:, None]
    covered = (count >= np.maximum(0.5 * usual, 0.5 * FEWEST_IN_STRETCH)).all(axis=2)
    away = viewpoints - line.mean(axis=0)
    distance = np.linalg.norm(away, axis=1)
    sight = away / distance[:, None]
    # Long, straight down and near, in that order of what a depth camera's accuracy owes to a view.
    score = covered.sum(axis=1) * np.maximum(sight @ unit(normals.mean(axis=0)), 0.1) / distance
    best = np.where(covered, score[:, None], -np.inf).argmax(axis=0)
    beside = sight @ sight[best].T > np.cos(CROSSING)
    return np.where(covered.any(axis=0), beside, True)


def _inside(points: Float[ndarray, "n 3"], low: Float[ndarray, "3"], high: Float[ndarray, "3"]) -> Bool[ndarray, "n"]:
    """Which points lie within the box from corner `low` to corner `high` [m]."""
    x, y, z = ((column > least) & (column < most) for column, least, most in zip(points.T, low, high, strict=True))
    return x & y & z  # by column: reducing along axis 1 is slow


def _union(parts: list[Int[ndarray, "_"]], *, disjoint: bool) -> Int[ndarray, "j"]:
    """All indices of the parts, each once, in order."""
    every = np.concatenate(parts)
    return np.sort(every) if disjoint else np.unique(every)


def _same(line: CoarseLine, stronger: CoarseLine) -> bool:
    """Whether most of a line runs along a stronger one."""
    distance, _, _ = project(line.points, stronger.points)
    along = float(np.mean(distance < SAME_LINE)) > 0.7
    return along and float(line.normals.mean(axis=0) @ stronger.normals.mean(axis=0)) > 0.5
