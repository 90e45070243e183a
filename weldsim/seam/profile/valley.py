"""Where a chart dips between two higher sides: the coarse search for grooves.

A closing (dilation, then erosion) fills every valley narrower than its window and leaves planes of any tilt, steps and
outer edges alone; what it filled is the valley image. The threshold is chosen from that image's own background.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from weldsim.curves import interpolate
from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.chart import Chart

MAX_LINES = 16
MOST_BRANCHES = 12  # of one valley that are traced
LINE = 0.025  # [m] length over which a valley is averaged along itself
STEEPEST = 100.0  # steeper slopes are counted as this
MODE_REACH = 0.35  # slopes this far from a mode, either way, belong to it
MODE_SHARE = 0.10  # of the cells that a slope must have to get a valley image of its own
MOST_MODES = 3
PLANE_REACH = 0.016  # [m] about a line's cell, over which its surface is taken as plane
FAR = 10.0  # [m] stands for "no material" in the closing


@dataclass(frozen=True, eq=False)
class ValleyImage:
    """Attributes:
    chart: with heights and lengths true at the usual depth of this slope.
    depth: (h, w) how far the closed surface lies above the measured one [m], 0 where not valid.
    lined: (h, w) the same averaged along the best of twelve short straight lines through each cell [m].
    lid: (h, w) the closed surface [m, chart height]: the parent surface across a groove.
    around: (h, w) cells of the slope this image was made for.
    threshold: `lined` that counts as valley [m].  low: down to which a valley already found goes on [m].
    noise: robust standard deviation of `lined` over the chart [m].
    """

    chart: Chart
    depth: Float[ndarray, "h w"]
    lined: Float[ndarray, "h w"]
    lid: Float[ndarray, "h w"]
    around: Bool[ndarray, "h w"]
    threshold: float
    low: float
    noise: float


def valley_images(chart: Chart, config: ProfileConfig, factor: float = 1.0) -> list[ValleyImage]:
    """The valley image of each slope that much of the chart has, the commonest first.

    A groove on a part tilted far from the table has no lowest line as the table sees it; so heights are taken off the
    part's own slope, and the part's own background sets the threshold, times `factor`.
    """
    slope = local_slope(chart)
    images = []
    for mode in _slope_modes(slope.reshape(-1, 2)[np.flatnonzero(chart.valid)[::3]]):
        within = chart.valid & _alike(slope, mode)
        # A table far behind the part must not decide what a millimetre is: a groove would seem wider than it is.
        usual = chart.depth0**2 / (chart.depth0 + float(np.median(chart.height[within]))) if within.any() else chart.depth0
        ratio = usual / chart.depth0
        images.append(_valley_image(chart.based_at(usual), mode * ratio, within, config, factor))
    return images


def _valley_image(
    chart: Chart, slope: Float[ndarray, "2"], within: Bool[ndarray, "h w"], config: ProfileConfig, factor: float
) -> ValleyImage:
    """The valley image of the cells `within`, heights taken off a slope [1, along rows and columns]."""
    valid = chart.valid
    h, w = valid.shape
    plane = chart.pitch * (slope[0] * np.arange(h)[:, None] + slope[1] * np.arange(w)[None, :])
    if chart.scattered is None:
        flat = chart.height - plane
    else:
        flat = np.where(valid, chart.scattered.levelled(*(chart.pitch * slope)), 0.0)
    flat = _without_spikes(flat, valid)
    sigma = 0.0013 / chart.pitch
    weight = cv2.GaussianBlur(valid.astype(np.float64), (0, 0), sigma)
    smooth = cv2.GaussianBlur(np.where(valid, flat, 0.0), (0, 0), sigma) / np.maximum(weight, 1e-6)
    # A Gaussian straddles depth steps; near one, the measured value is kept.
    smooth = np.where(np.abs(smooth - flat) > 0.003, flat, smooth)
    size = max(3, round(config.search_width / chart.pitch) | 1)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    border = size
    # In single precision, where a closing costs a quarter: heights to 10 nm.
    shallow = np.where(valid, smooth, -FAR).astype(np.float32)
    padded = cv2.copyMakeBorder(shallow, border, border, border, border, cv2.BORDER_CONSTANT, value=-FAR)
    closed = cv2.erode(cv2.dilate(padded, disc), disc, borderType=cv2.BORDER_CONSTANT, borderValue=FAR)
    lid = np.where(valid, smooth + (closed[border:-border, border:-border] - shallow), smooth)
    depth = np.where(valid, np.maximum(lid - smooth, 0.0), 0.0)
    lined = _along_lines(depth, valid, LINE / chart.pitch)
    background = lined[within] if within.any() else lined[valid]
    middle = float(np.median(background))
    noise = 1.4826 * float(np.median(np.abs(background - middle)))
    threshold = max(middle + config.detection_factor * noise, 0.6 * config.min_depth) * factor
    low = max(middle + 0.55 * config.detection_factor * noise, 0.3 * config.min_depth) * factor
    around = cv2.morphologyEx(within.astype(np.uint8), cv2.MORPH_CLOSE, disc) > 0  # with the grooves that cross it
    return ValleyImage(chart, depth, lined, lid + plane, around & valid, threshold, low, noise)


def _along_lines(depth: Float[ndarray, "h w"], valid: Bool[ndarray, "h w"], length: float) -> Float[ndarray, "h w"]:
    """Greatest mean of `depth` over straight lines of `length` cells through each cell: noise fades, grooves stay."""
    half = max(2, round(length / 4))  # at half the resolution, which loses nothing over such lengths
    h, w = depth.shape
    small = (max(1, w // 2), max(1, h // 2))
    image = cv2.resize(depth.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    known = cv2.resize(valid.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    best = np.zeros_like(image)
    for angle in np.arange(12) * np.pi / 12:
        kernel: ndarray = np.zeros((2 * half + 1, 2 * half + 1), np.uint8)
        reach = np.array([np.cos(angle), np.sin(angle)]) * half
        ends = np.rint(half + np.array([-reach, reach])).astype(int)
        cv2.line(kernel, (int(ends[0, 0]), int(ends[0, 1])), (int(ends[1, 0]), int(ends[1, 1])), 1)
        kernel = kernel / kernel.sum(dtype=float)
        share = cv2.filter2D(known, -1, kernel, borderType=cv2.BORDER_CONSTANT)
        mean = cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_CONSTANT) / np.maximum(share, 0.6)
        best = np.maximum(best, mean)
    best = cv2.resize(best, (w, h), interpolation=cv2.INTER_LINEAR)
    return np.where(valid, best, 0.0).astype(float)


def _without_spikes(height: Float[ndarray, "h w"], valid: Bool[ndarray, "h w"]) -> Float[ndarray, "h w"]:
    """Heights with lone cells far off their surroundings (stray points) set to the local median."""
    filled = np.where(valid, height, cv2.medianBlur(np.where(valid, height, -FAR).astype(np.float32), 5))
    median = cv2.medianBlur(filled.astype(np.float32), 5)
    return np.where(valid & (np.abs(height - median) > 0.003) & (median > -0.5 * FAR), median, height)


def local_slope(chart: Chart) -> Float[ndarray, "h w 2"]:
    """Slope of the chart at each cell along rows and columns [1], over about 10 mm; infinite where not measured."""
    h, w = chart.valid.shape
    reach = max(1, min(round(0.005 / chart.pitch), h // 4, w // 4))
    out = np.full((h, w, 2), np.inf)
    height = np.where(chart.valid, chart.height, np.nan)
    out[reach:-reach, :, 0] = (height[2 * reach :] - height[: -2 * reach]) / (2 * reach)
    out[:, reach:-reach, 1] = (height[:, 2 * reach :] - height[:, : -2 * reach]) / (2 * reach)
    return np.where(np.isfinite(out), out / chart.pitch, np.inf)


def _slope_modes(slopes: Float[ndarray, "n 2"]) -> list[Float[ndarray, "2"]]:
    """The slopes that a share of at least MODE_SHARE of the cells have, the commonest first, at most MOST_MODES."""
    known = slopes[np.isfinite(slopes[:, 0]) & np.isfinite(slopes[:, 1])]
    if len(known) == 0:
        return [np.zeros(2)]
    modes: list[Float[ndarray, "2"]] = []
    left = known
    while len(modes) < MOST_MODES and len(left) >= MODE_SHARE * len(known):
        bins = np.floor(np.clip(left, -STEEPEST, STEEPEST) / (MODE_REACH / 2)).astype(np.int64)
        bins -= bins.min(axis=0)
        keys = bins[:, 0] * (int(bins[:, 1].max()) + 1) + bins[:, 1]
        centre = _median(left[keys == np.bincount(keys).argmax()])
        near = _alike(left, centre)
        if near.any():
            centre = _median(left[near])
            near = _alike(left, centre)
        if modes and np.count_nonzero(near) < MODE_SHARE * len(known):
            break
        modes.append(centre)
        left = left[~_alike(left, centre)]
    return modes


def _alike(slopes: Float[ndarray, "*n 2"], mode: Float[ndarray, "2"]) -> Bool[ndarray, "*n"]:
    """Which slopes belong to a mode."""
    return (np.abs(slopes[..., 0] - mode[0]) < MODE_REACH) & (np.abs(slopes[..., 1] - mode[1]) < MODE_REACH)


def _median(slopes: Float[ndarray, "n 2"]) -> Float[ndarray, "2"]:
    return np.array([np.median(column) for column in slopes.T])  # by column: along axis 0 it is slow


@dataclass(frozen=True, eq=False)
class CoarseLine:
    """A valley's centre line before refinement.

    Attributes:
        points: (k, 3) on the lid, in the cloud's frame [m].
        normals: (k, 3) unit, outward, of the surface around it.
        evidence: valley depth integrated along it [m^2].
        level: fraction of it with surface at one level on both sides; tails without are cut off.
    """

    points: Float[ndarray, "k 3"]
    normals: Float[ndarray, "k 3"]
    evidence: float
    level: float


def trace_valleys(images: list[ValleyImage], config: ProfileConfig) -> list[CoarseLine]:
    """Coarse centre lines, one for each elongated valley of each image, the strongest first."""
    lines = [line for valleys in images for line in _trace(valleys, config)]
    lines.sort(key=lambda line: -line.evidence * line.level)
    return lines[:MAX_LINES]


def _trace(valleys: ValleyImage, config: ProfileConfig) -> list[CoarseLine]:
    """Coarse centre lines, one for each elongated valley of an image."""
    chart = valleys.chart
    seeds = (valleys.lined > valleys.threshold) & valleys.around
    extent = (valleys.around & (valleys.lined > valleys.low) & (valleys.depth > 0.4 * valleys.lined)).astype(np.uint8)
    if config.min_width / chart.pitch >= 3:  # cell-wide threads run along the steps of outer edges
        extent = cv2.morphologyEx(extent, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    number, labels, stats, _ = cv2.connectedComponentsWithStats(extent, connectivity=8)
    minimum = config.min_length / chart.pitch
    lines = []
    for label in range(1, number):
        x, y, w, h, area = stats[label]
        if np.hypot(w, h) < 0.8 * minimum or area < minimum:
            continue
        window = np.s_[y : y + h, x : x + w]
        mask = labels[window] == label
        if np.count_nonzero(seeds[window] & mask) < 0.25 * minimum:
            continue
        lines += [
            np.add(line, (x, y)) for line in _centre_lines(mask, valleys.depth[window], minimum, config.min_width / chart.pitch)
        ]
    out = []
    for line in lines:
        column, row = np.rint(line).astype(int).T
        points = chart.to_space(line[:, 0], line[:, 1], valleys.lid[row, column])
        level = _level_sides(chart, line)
        # A path may lead along one groove, through the moat about the plate, and back along another.
        runs = [
            run
            for run in _runs(level, round(0.020 / chart.pitch))
            if (run.stop - run.start) * chart.pitch >= 0.6 * config.min_length
        ]
        for keep in runs or [slice(0, len(line))]:  # without any it stays a candidate only to be named among the refused
            evidence = chart.pitch * float(valleys.lined[row[keep], column[keep]].sum())
            out.append(CoarseLine(points[keep], _normals(valleys, line[keep]), evidence, float(level[keep].mean())))
    return out


def _normals(valleys: ValleyImage, line: Float[ndarray, "k 2"]) -> Float[ndarray, "k 3"]:
    """Outward normals of the closed surface along a line, from planes fitted to it around a few of its cells."""
    chart = valleys.chart
    reach = max(2, round(PLANE_REACH / chart.pitch))
    stride = max(1, reach // 8)
    marks = np.unique(np.linspace(0, len(line) - 1, max(2, min(9, round(len(line) / reach)))).round().astype(int))
    found = []
    for u, v in line[marks].round().astype(int):
        rows, columns = np.mgrid[max(v - reach, 0) : v + reach + 1 : stride, max(u - reach, 0) : u + reach + 1 : stride]
        inside = (rows < chart.valid.shape[0]) & (columns < chart.valid.shape[1])
        rows, columns = rows[inside], columns[inside]
        use = valleys.around[rows, columns]
        design = np.stack([columns - u, rows - v, np.ones(len(rows))], axis=1)[use].astype(float)
        height = valleys.lid[rows[use], columns[use]]
        plane = np.zeros(3)
        if len(height) >= 6:
            plane = np.linalg.lstsq(design, height, rcond=None)[0]
        corners = chart.to_space(
            u + np.array([0.0, 1.0, 0.0]), v + np.array([0.0, 0.0, 1.0]), plane[2] + np.array([0.0, *plane[:2]])
        )
        normal = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
        found.append(-normal if normal @ chart.axes[2] > 0 else normal)
    return unit(interpolate(marks.astype(float), np.array(found), np.arange(len(line), dtype=float)))


def _runs(level: Bool[ndarray, "k"], bridge: int) -> list[slice]:
    """Stretches of true cells, gaps of up to `bridge` cells bridged."""
    index = np.flatnonzero(level)
    if len(index) == 0:
        return []
    cuts = np.flatnonzero(np.diff(index) > bridge)
    starts, stops = np.concatenate([[0], cuts + 1]), np.concatenate([cuts, [len(index) - 1]])
    return [slice(int(index[a]), int(index[b]) + 1) for a, b in zip(starts, stops, strict=True)]


def _level_sides(chart: Chart, line: Float[ndarray, "k 2"]) -> Bool[ndarray, "k"]:
    """Which of a line's cells have surface on both sides that lies in one plane across it."""
    reach = min(4, max(1, len(line) // 4))
    ahead = line[np.minimum(np.arange(len(line)) + reach, len(line) - 1)] - line[np.maximum(np.arange(len(line)) - reach, 0)]
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
    h, w = chart.valid.shape
    level = np.zeros(len(line), bool)
    for near in (0.010, 0.014, 0.018, 0.022):
        heights = []
        good = np.ones(len(line), bool)
        for side in (-1, 1):
            for offset in (near, near + 0.008):
                column, row = np.rint(line + side * across * offset / chart.pitch).astype(int).T
                inside = (column >= 0) & (column < w) & (row >= 0) & (row < h)
                column, row = np.clip(column, 0, w - 1), np.clip(row, 0, h - 1)
                good &= inside & chart.valid[row, column]
                heights.append(chart.height[row, column])
        a, b, c, d = heights  # left near, left far, right near, right far
        gap, run = 2 * near, 0.008
        tilt = np.abs((a - b) / run - (d - c) / run)
        step = np.abs((a - c) + ((a - b) + (d - c)) / (2 * run) * gap)
        level |= good & (tilt < 0.6) & (step < 0.008)
    return level


def _pixel_length(line: Float[ndarray, "k 2"]) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _centre_lines(
    mask: Bool[ndarray, "h w"], depth: Float[ndarray, "h w"], minimum: float, clearance: float
) -> list[Float[ndarray, "k 2"]]:
    """Paths (column, row) along a mask's middle: the longest geodesic first, then what it left over (branches)."""
    lines: list[Float[ndarray, "k 2"]] = []
    remaining = mask.copy()
    for _ in range(MOST_BRANCHES):
        number, labels, stats, _ = cv2.connectedComponentsWithStats(remaining.astype(np.uint8), connectivity=8)
        if number < 2:
            break
        label = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
        part = labels == label
        if stats[label, cv2.CC_STAT_AREA] < minimum:
            break
        path, reach = _longest_path(part, depth)
        if _pixel_length(path) >= 0.8 * minimum:
            lines.append(path)
        blot = np.ones_like(mask, np.uint8)
        blot[np.rint(path[:, 1]).astype(int), np.rint(path[:, 0]).astype(int)] = 0
        near = cv2.distanceTransform(blot, cv2.DIST_L2, 3) <= max(1.3 * reach, clearance)
        remaining &= ~(near & part)
        remaining &= ~part | ~near
    return lines


def _longest_path(part: Bool[ndarray, "h w"], depth: Float[ndarray, "h w"]) -> tuple[Float[ndarray, "k 2"], float]:
    """The longest geodesic of a connected mask, drawn to its deep middle, as (column, row), and its half width [cells]."""
    rows, columns = np.nonzero(part)
    index = np.full(part.shape, -1)
    index[rows, columns] = np.arange(len(rows))
    inner = cv2.distanceTransform(np.pad(part, 1).astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1]
    clipped = np.where(part, depth, 0.0)
    merit = inner / max(float(inner.max()), 1e-9) * np.minimum(clipped / max(float(np.quantile(clipped[part], 0.9)), 1e-9), 1.0)
    starts, ends, lengths = [], [], []
    h, w = part.shape
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = np.s_[0 : h - dr, max(0, -dc) : w - max(0, dc)]
        b = np.s_[dr:h, max(0, dc) : w - max(0, -dc)]
        both = (index[a] >= 0) & (index[b] >= 0)
        starts.append(index[a][both])
        ends.append(index[b][both])
        lengths.append(np.full(int(both.sum()), np.hypot(dr, dc)))
    i, j, d = np.concatenate(starts), np.concatenate(ends), np.concatenate(lengths)
    n = len(rows)
    # Both ways of every step, built once: an undirected search would turn the graph over at every call.
    both_ways = coo_matrix((np.tile(np.arange(1, len(d) + 1), 2), (np.append(i, j), np.append(j, i))), (n, n)).tocsr()
    step = np.asarray(both_ways.data, dtype=np.int64) - 1
    plain = csr_matrix((d[step], both_ways.indices, both_ways.indptr), (n, n))
    first = int(np.argmax(_finite(dijkstra(plain, indices=0))))
    second = int(np.argmax(_finite(dijkstra(plain, indices=first))))
    cost = d / (0.05 + (merit[rows[i], columns[i]] + merit[rows[j], columns[j]]) / 2) ** 2
    weighted = csr_matrix((cost[step], both_ways.indices, both_ways.indptr), (n, n))
    _, before = dijkstra(weighted, indices=first, return_predecessors=True)
    order = [second]
    while order[-1] != first and before[order[-1]] >= 0:
        order.append(int(before[order[-1]]))
    path = np.array(order[::-1])
    reach = float(np.median(inner[rows[path], columns[path]]))
    return np.stack([columns[path], rows[path]], axis=1).astype(float), reach


def _finite(distance: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
    return np.where(np.isfinite(distance), distance, -1.0)
