"""What a window matcher does to a disparity image: average over its support, trouble at edges; fields for holes and speckle.

The pieces of the parametric D415 model, each a pure function on arrays. Disparity 0 stands for no surface.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int, UInt8
from numpy import ndarray
from numpy.random import Generator

PATCH = 4  # [px] length over which an edge is displaced or dropped as one piece


def support_average(
    disparity: Float32[ndarray, "h w"], window: int, step: float
) -> tuple[Float32[ndarray, "h w"], Float32[ndarray, "h w"]]:
    """Mean disparity over each pixel's window, over one surface only, and relief there: what the window holds besides a plane.

    Pixels of the window that differ from the middle one by `step` or more belong to another surface and are left out; away
    from such edges the mean is a box filter. Relief is the range (max - min) over the window of the difference between
    disparity and mean [px]: 0 on any plane, since disparity is linear in the image of a plane, however it is tilted.
    """
    kernel = np.ones((window, window), np.uint8)
    mean = cv2.blur(disparity, (window, window), borderType=cv2.BORDER_REPLICATE)
    mixed = np.flatnonzero((_range(disparity, kernel) >= step) & (disparity > 0))
    if mixed.size:
        mean.reshape(-1)[mixed] = _average_of_own_surface(disparity, mixed, window, step)
    return mean, _range(np.where(disparity > 0, disparity - mean, np.float32(0)), kernel)


def _range(image: Float32[ndarray, "h w"], kernel: UInt8[ndarray, "k k"]) -> Float32[ndarray, "h w"]:
    """Greatest less least of the image over the kernel around each pixel."""
    high = cv2.dilate(image, kernel, borderType=cv2.BORDER_REPLICATE)
    return high - cv2.erode(image, kernel, borderType=cv2.BORDER_REPLICATE)


def _average_of_own_surface(
    disparity: Float32[ndarray, "h w"], pixels: Int[ndarray, "n"], window: int, step: float
) -> Float32[ndarray, "n"]:
    """Mean over the window of each listed pixel, of the values within `step` of its own."""
    width = disparity.shape[1]
    before, after = window // 2, window - 1 - window // 2
    padded = cv2.copyMakeBorder(disparity, before, after, before, after, cv2.BORDER_REPLICATE).reshape(-1)
    stride = width + window - 1
    corner = pixels // width * stride + pixels % width
    own = disparity.reshape(-1)[pixels]
    total, count = np.zeros_like(own), np.zeros_like(own)
    for row in range(window):
        for column in range(window):
            # Differences from the middle pixel are small numbers, so that float32 sums stay exact to 1e-5 px.
            difference = padded[corner + (row * stride + column)] - own
            same = np.abs(difference) < step
            total += difference * same
            count += same
    return own + total / count


def correlated_field(rng: Generator, shape: tuple[int, int], length: float) -> Float32[ndarray, "h w"]:
    """A Gaussian field of mean 0 and variance 1 whose correlation falls to 1/e at `length` [px].

    White noise blurred by a Gaussian of deviation s has correlation exp(-r^2 / 4 s^2), so s is half the length.
    """
    deviation = length / 2
    reach = max(1, round(3 * deviation))
    kernel = cv2.getGaussianKernel(2 * reach + 1, deviation, cv2.CV_32F)
    kernel /= np.linalg.norm(kernel)
    white = rng.standard_normal((shape[0] + 2 * reach, shape[1] + 2 * reach), dtype=np.float32)
    smooth = cv2.sepFilter2D(white, cv2.CV_32F, kernel, kernel)
    return np.ascontiguousarray(smooth[reach:-reach, reach:-reach])


def near_edges(disparity: Float32[ndarray, "h w"], step: float, reach: int) -> Int[ndarray, "n"]:
    """Flat indices of the pixels within `reach` of a disparity step of at least `step`."""
    around = np.ones((3, 3), np.uint8)
    edge = (cv2.dilate(disparity, around) - cv2.erode(disparity, around)) >= step
    if reach > 1:
        edge = cv2.dilate(edge.astype(np.uint8), np.ones((2 * reach - 1, 2 * reach - 1), np.uint8))
    return np.flatnonzero(edge)


def patches(rng: Generator, shape: tuple[int, int], pixels: Int[ndarray, "n"]) -> Float32[ndarray, "n"]:
    """Standard normal numbers at the listed pixels, one for each PATCH x PATCH block of the image."""
    coarse = rng.standard_normal((-(-shape[0] // PATCH), -(-shape[1] // PATCH)), dtype=np.float32)
    return coarse[pixels // shape[1] // PATCH, pixels % shape[1] // PATCH]


def jitter_edges(
    rng: Generator, disparity: Float32[ndarray, "h w"], edges: Int[ndarray, "n"], sigma: float
) -> Float32[ndarray, "h w"]:
    """The image with its edges displaced by about `sigma` px either way, a patch at a time."""
    height, width = disparity.shape
    rows = edges // width + np.rint(sigma * patches(rng, disparity.shape, edges)).astype(int)
    columns = edges % width + np.rint(sigma * patches(rng, disparity.shape, edges)).astype(int)
    out = disparity.copy()
    out.reshape(-1)[edges] = disparity[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return out


def hidden_from_right(disparity: Float32[ndarray, "h w"], step: float) -> Bool[ndarray, "h w"]:
    """Pixels of the left (depth) image that the right imager does not see: outside its image, or behind something.

    A surface point at column u of the left image lies at u - d of the right one; the nearest there (largest d) wins.
    """
    height, width = disparity.shape
    column = np.arange(width, dtype=np.float32) + 0.5 - disparity
    outside = column < 0
    cell = np.clip(column, 0, width - 1).astype(np.intp)
    cell += np.arange(height, dtype=np.intp)[:, None] * width
    nearest = np.zeros(height * width, np.float32)
    keep = ~outside.reshape(-1)
    np.maximum.at(nearest, cell.reshape(-1)[keep], disparity.reshape(-1)[keep])
    # A surface turned towards the right imager leaves columns without a sample: fill gaps of two.
    nearest = cv2.morphologyEx(nearest.reshape(height, width), cv2.MORPH_CLOSE, np.ones((1, 3), np.uint8))
    return outside | (disparity < nearest.reshape(-1)[cell] - step)


def left_of(rng: Generator, hidden: Bool[ndarray, "h w"], width: float) -> Int[ndarray, "n"]:
    """Flat indices of about `width` pixels to the left of each hidden run, a patch of rows alike.

    Runs that begin at the image's border have nothing to their left.
    """
    columns = hidden.shape[1]
    ends = np.flatnonzero(hidden[:, 1:] & ~hidden[:, :-1])
    ends += ends // (columns - 1)  # of the whole image: the pixel left of the run
    wide = np.maximum(width + 0.5 * patches(rng, (hidden.shape[0], columns), ends), 0.0)
    reach = np.arange(int(wide.max(initial=0.0)) + 2)
    pixels = ends[:, None] - reach
    lost = (reach + 0.5 < wide[:, None]) & (pixels >= (ends // columns * columns)[:, None])
    return pixels[lost]


def mixed_rims(
    rng: Generator, disparity: Float32[ndarray, "h w"], seen: Bool[ndarray, "h w"], step: float, share: float
) -> tuple[Int[ndarray, "n"], Float32[ndarray, "n"]]:
    """Flat indices of pixels on the nearer side of a step that show neither of its surfaces, and what they show [px].

    At a share of the places where a row or a column crosses a step of at least `step` between two surfaces, any disparity
    between theirs; places not `seen` are left out.
    """
    indices, values = [], []
    flat, places = disparity.reshape(-1), seen.reshape(-1)
    for axis, stride in ((1, 1), (0, disparity.shape[1])):
        first, second = (disparity[:, :-1], disparity[:, 1:]) if axis else (disparity[:-1], disparity[1:])
        at = np.flatnonzero((np.abs(second - first) >= step) & (np.minimum(first, second) > 0))
        at += at // (disparity.shape[1] - 1) if axis else 0
        near = np.where(flat[at] > flat[at + stride], at, at + stride)
        far = 2 * at + stride - near
        chosen = (rng.random(len(at)) < share) & places[near]
        near, far = near[chosen], far[chosen]
        indices.append(near)
        values.append(flat[far] + rng.random(len(near), dtype=np.float32) * (flat[near] - flat[far]))
    return np.concatenate(indices), np.concatenate(values)
