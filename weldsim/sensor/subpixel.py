"""Fractions of disparity by least squares over a window, compiled by numba on first use and cached.

Import this module inside functions only: it brings numba in.
"""

from typing import no_type_check

import numba
import numpy as np


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
@no_type_check
def refine(left, right, coarse, half, iterations, most_step, least_correlation, least_contrast, out):
    """Writes to `out` the disparity [px] that makes each window of `left` agree best with `right`; NaN stays where none does.

    Args:
        left, right: (h, w) float32 images, smooth.  coarse: (h, w) float32, NaN for no match: where to begin.
        half: the window reaches this far either way [px].  iterations: steps of Gauss-Newton on the disparity, brightness
            and contrast of each window being free.
        most_step: farthest from `coarse` [px].  least_correlation: zero-mean normalised, of the windows at the end.
        least_contrast: standard deviation of either window [DN].  out: (h, w) float32, NaN to begin with.
    """
    height, width = left.shape
    for row in range(height):
        top, bottom = max(row - half, 0), min(row + half, height - 1)
        for column in range(width):
            start = coarse[row, column]
            if not start > 0:
                continue
            disparity = start
            correlation = np.float32(0)
            for step in range(iterations + 1):
                # The window is where both images have pixels, one spare on each side for cubic interpolation.
                whole = int(np.floor(-disparity))
                first = max(column - half, -whole + 1, 0)
                last = min(column + half, width - 1, width - 3 - whole)
                if last - first < half:
                    correlation = np.float32(0)
                    break
                f = np.float32(-disparity - whole)
                # Catmull-Rom weights of the four pixels about the point, and their derivatives.
                w0 = np.float32(0.5) * f * (-1 + f * (2 - f))
                w1 = np.float32(0.5) * (2 + f * f * (3 * f - 5))
                w2 = np.float32(0.5) * f * (1 + f * (4 - 3 * f))
                w3 = np.float32(0.5) * f * f * (f - 1)
                g0 = np.float32(0.5) * (-1 + f * (4 - 3 * f))
                g1 = np.float32(0.5) * f * (9 * f - 10)
                g2 = np.float32(0.5) * (1 + f * (8 - 9 * f))
                g3 = np.float32(0.5) * f * (3 * f - 2)
                sl = sr = sg = sll = srr = sgg = slr = slg = srg = np.float32(0)
                for y in range(top, bottom + 1):
                    for x in range(first, last + 1):
                        k = x + whole
                        a, b, c, d = right[y, k - 1], right[y, k], right[y, k + 1], right[y, k + 2]
                        p = left[y, x]
                        r = w0 * a + w1 * b + w2 * c + w3 * d
                        g = g0 * a + g1 * b + g2 * c + g3 * d
                        sl += p
                        sr += r
                        sg += g
                        sll += p * p
                        srr += r * r
                        sgg += g * g
                        slr += p * r
                        slg += p * g
                        srg += r * g
                n = np.float32((bottom - top + 1) * (last - first + 1))
                vl, vr, vg = sll - sl * sl / n, srr - sr * sr / n, sgg - sg * sg / n
                lr, lg, rg = slr - sl * sr / n, slg - sl * sg / n, srg - sr * sg / n
                floor = n * least_contrast * least_contrast
                if vl <= floor or vr <= floor or vg <= 0:
                    correlation = np.float32(0)
                    break
                correlation = lr / np.sqrt(vl * vr)
                if step == iterations:
                    break
                # left = contrast * (right - shift * slope) + brightness, least squares in contrast and contrast * shift.
                determinant = vr * vg - rg * rg
                contrast = (lr * vg - lg * rg) / determinant
                moved = (lg * vr - lr * rg) / determinant
                if not contrast > 0:
                    correlation = np.float32(0)
                    break
                disparity -= moved / contrast
                if not abs(disparity - start) <= most_step:
                    correlation = np.float32(0)
                    break
            if correlation >= least_correlation:
                out[row, column] = disparity
