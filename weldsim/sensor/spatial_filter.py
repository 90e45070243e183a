"""The smoothing that a RealSense driver offers: a recursive filter on disparity that stops at edges, compiled by numba.

After librealsense's 'spatial' filter (post-processing documentation; recursive after Gastal and Oliveira 2011): along each
row there and back, then along each column, `PASSES` times. Import this module inside functions only: it brings numba in.
"""

from typing import no_type_check

import numba
import numpy as np
from jaxtyping import Float32
from numpy import ndarray

ALPHA, PASSES = 0.5, 2  # weight of a pixel's own value, number of passes: the driver's defaults
DELTA = 20 / 32  # [px] neighbours this far apart are not mixed: the driver's default of 20 steps of disparity


def spatially_filtered(disparity: Float32[ndarray, "h w"]) -> Float32[ndarray, "h w"]:
    """The image smoothed; pixels without a disparity (NaN) stay, and stop the filter as edges do."""
    image = np.array(disparity, np.float32)
    for _ in range(PASSES):
        image = np.ascontiguousarray(image)
        _along_rows(image, np.float32(ALPHA), np.float32(DELTA))
        _along_columns(image, np.float32(ALPHA), np.float32(DELTA))
    return image


@numba.njit(cache=True, nogil=True)
@no_type_check
def _along_rows(image, alpha, delta):
    """Each row from left to right and back, in place."""
    height, width = image.shape
    rest = np.float32(1) - alpha
    for row in range(height):
        for back in range(2):
            column, step = (width - 1, -1) if back else (0, 1)
            before = image[row, column]  # as it was
            state = before
            for _ in range(width - 1):
                column += step
                value = image[row, column]
                if abs(value - before) < delta:  # false beside a NaN
                    state = value * alpha + state * rest
                    image[row, column] = state
                else:
                    state = value
                before = value


@numba.njit(cache=True, nogil=True)
@no_type_check
def _along_columns(image, alpha, delta):
    """Each column downwards and back, in place; whole rows at a time, as they lie in memory."""
    height, width = image.shape
    rest = np.float32(1) - alpha
    before, state = np.empty(width, np.float32), np.empty(width, np.float32)
    for back in range(2):
        row, step = (height - 1, -1) if back else (0, 1)
        before[:] = image[row]
        state[:] = image[row]
        for _ in range(height - 1):
            row += step
            for column in range(width):
                value = image[row, column]
                near = abs(value - before[column]) < delta
                mixed = value * alpha + state[column] * rest
                state[column] = mixed if near else value
                image[row, column] = state[column]
                before[column] = value
