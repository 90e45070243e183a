"""The neighbourhood loops of the thesis method, compiled by numba on first use and cached.

Import this module inside functions only: it brings numba in. Every kernel works on points `first` to `last` of a
`CellGrid` (arguments `points` to `limit` are its fields, `limit` the squared radius) and writes its outputs in place.
"""

from typing import no_type_check

import numba
import numpy as np

_jit = numba.njit(cache=True, nogil=True, error_model="numpy")


@_jit
@no_type_check
def gather(x, y, z, points, start, shape, origin, scale, reach, limit, buffer):
    """Number of points within the radius of (x, y, z), their indices in `buffer`, the point itself included."""
    ix, iy, iz = int((x - origin[0]) * scale), int((y - origin[1]) * scale), int((z - origin[2]) * scale)
    x0, x1 = max(ix - reach, 0), min(ix + reach, shape[0] - 1)
    count = 0
    for kz in range(max(iz - reach, 0), min(iz + reach, shape[2] - 1) + 1):
        for ky in range(max(iy - reach, 0), min(iy + reach, shape[1] - 1) + 1):
            row = (kz * shape[1] + ky) * shape[0]
            for j in range(start[row + x0], start[row + x1 + 1]):
                dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                if dx * dx + dy * dy + dz * dz <= limit:
                    buffer[count] = j
                    count += 1
    return count


@_jit
@no_type_check
def covariances(first, last, points, start, shape, origin, scale, reach, limit, count, mean, covariance):
    """Count, centroid and scatter about it [m2] of each neighbourhood (thesis eq 5.5-5.8)."""
    buffer = np.empty(len(points), np.int64)
    for i in range(first, last):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        n = gather(x, y, z, points, start, shape, origin, scale, reach, limit, buffer)
        sx = sy = sz = xx = xy = xz = yy = yz = zz = 0.0
        for m in range(n):
            j = buffer[m]
            dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
            sx, sy, sz = sx + dx, sy + dy, sz + dz
            xx, xy, xz = xx + dx * dx, xy + dx * dy, xz + dx * dz
            yy, yz, zz = yy + dy * dy, yz + dy * dz, zz + dz * dz
        sx, sy, sz = sx / n, sy / n, sz / n
        count[i] = n
        mean[i, 0], mean[i, 1], mean[i, 2] = x + sx, y + sy, z + sz
        c = covariance[i]
        c[0, 0], c[1, 1], c[2, 2] = xx / n - sx * sx, yy / n - sy * sy, zz / n - sz * sz
        c[0, 1] = c[1, 0] = xy / n - sx * sy
        c[0, 2] = c[2, 0] = xz / n - sx * sz
        c[1, 2] = c[2, 1] = yz / n - sy * sz


@_jit
@no_type_check
def solve_spd(A, b, n):
    """Solve A x = b in place (x in b) for symmetric positive definite A; False when it is singular."""
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                if total <= 1e-12 * (1e-300 + abs(A[i, i])):
                    return False
                A[i, i] = np.sqrt(total)
            else:
                A[i, j] = total / A[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]
    return True


@_jit
@no_type_check
def mls(first, last, points, start, shape, origin, scale, reach, limit, count, mean, axes, out):
    """Each point moved onto the weighted quadratic through its neighbourhood, over the PCA plane `axes` (columns u, v, n)."""
    buffer = np.empty(len(points), np.int64)
    A, b, f = np.empty((6, 6)), np.empty(6), np.empty(6)
    size = np.sqrt(limit)
    for i in range(first, last):
        for k in range(3):
            out[i, k] = points[i, k]
        if count[i] < 3:
            continue
        R = axes[i]
        height = 0.0
        for k in range(3):
            height += (points[i, k] - mean[i, k]) * R[k, 2]
        foot_x, foot_y, foot_z = points[i, 0] - height * R[0, 2], points[i, 1] - height * R[1, 2], points[i, 2] - height * R[2, 2]
        lift = 0.0
        if count[i] >= 6:
            A[:], b[:] = 0.0, 0.0
            n = gather(points[i, 0], points[i, 1], points[i, 2], points, start, shape, origin, scale, reach, limit, buffer)
            for m in range(n):
                j = buffer[m]
                dx, dy, dz = points[j, 0] - foot_x, points[j, 1] - foot_y, points[j, 2] - foot_z
                u = (dx * R[0, 0] + dy * R[1, 0] + dz * R[2, 0]) / size
                v = (dx * R[0, 1] + dy * R[1, 1] + dz * R[2, 1]) / size
                h = dx * R[0, 2] + dy * R[1, 2] + dz * R[2, 2]
                w = np.exp(-(dx * dx + dy * dy + dz * dz) / limit)
                f[0], f[1], f[2], f[3], f[4], f[5] = 1.0, u, v, u * u, u * v, v * v
                for r in range(6):
                    b[r] += w * f[r] * h
                    for c in range(r + 1):
                        A[r, c] += w * f[r] * f[c]
            if solve_spd(A, b, 6):
                lift = b[0]
        out[i, 0], out[i, 1], out[i, 2] = foot_x + lift * R[0, 2], foot_y + lift * R[1, 2], foot_z + lift * R[2, 2]


@_jit
@no_type_check
def normal_variance(first, last, points, start, shape, origin, scale, reach, limit, normals, as_angle, out):
    """Variance over each neighbourhood of theta_j = arccos(n_c . n_j) (eq 5.17, 5.20), or of n_c . n_j itself."""
    buffer = np.empty(len(points), np.int64)
    for i in range(first, last):
        n = gather(points[i, 0], points[i, 1], points[i, 2], points, start, shape, origin, scale, reach, limit, buffer)
        total = square = 0.0
        for m in range(n):
            j = buffer[m]
            value = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
            # Counted from parallel normals, where the figures are small and differences of squares stay exact.
            value = np.arccos(min(1.0, max(-1.0, value))) if as_angle else 1.0 - value
            total += value
            square += value * value
        out[i] = max(square / n - (total / n) ** 2, 0.0)


@_jit
@no_type_check
def value_variance(first, last, points, start, shape, origin, scale, reach, limit, values, out):
    """Variance of `values` over each neighbourhood (eq 5.20, 5.23)."""
    buffer = np.empty(len(points), np.int64)
    for i in range(first, last):
        n = gather(points[i, 0], points[i, 1], points[i, 2], points, start, shape, origin, scale, reach, limit, buffer)
        total = square = 0.0
        for m in range(n):
            value = values[buffer[m]] - values[i]
            total += value
            square += value * value
        out[i] = max(square / n - (total / n) ** 2, 0.0)


@_jit
@no_type_check
def widest_gap(first, last, points, start, shape, origin, scale, reach, limit, u, v, out):
    """Widest empty sector [rad] around each point, its neighbours seen in the plane of u and v."""
    buffer = np.empty(len(points), np.int64)
    angle = np.empty(len(points))
    for i in range(first, last):
        n = gather(points[i, 0], points[i, 1], points[i, 2], points, start, shape, origin, scale, reach, limit, buffer)
        k = 0
        for m in range(n):
            j = buffer[m]
            if j == i:
                continue
            dx, dy, dz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
            a, b = dx * u[i, 0] + dy * u[i, 1] + dz * u[i, 2], dx * v[i, 0] + dy * v[i, 1] + dz * v[i, 2]
            if a != 0.0 or b != 0.0:
                angle[k] = np.arctan2(b, a)
                k += 1
        if k == 0:
            out[i] = 2 * np.pi
            continue
        ordered = np.sort(angle[:k])
        gap = ordered[0] + 2 * np.pi - ordered[k - 1]
        for m in range(1, k):
            gap = max(gap, ordered[m] - ordered[m - 1])
        out[i] = gap


@_jit
@no_type_check
def centroids(first, last, points, start, shape, origin, scale, reach, limit, out):
    """Centroid of each neighbourhood (eq 5.33)."""
    buffer = np.empty(len(points), np.int64)
    for i in range(first, last):
        n = gather(points[i, 0], points[i, 1], points[i, 2], points, start, shape, origin, scale, reach, limit, buffer)
        sx = sy = sz = 0.0
        for m in range(n):
            j = buffer[m]
            sx, sy, sz = sx + points[j, 0], sy + points[j, 1], sz + points[j, 2]
        out[i, 0], out[i, 1], out[i, 2] = sx / n, sy / n, sz / n


@_jit
@no_type_check
def partners(points, step, limit, tolerance, out):
    """Index of each boundary point's partner on the other edge, -1 for none (thesis 5.2.2, eq 5.28-5.31).

    The radius grows by `step`; at each radius the tangent is the longest chord among the neighbours, and the nearest
    neighbour at a right angle to it (sine of the deviation below `tolerance`) is the partner.
    """
    n = len(points)
    near, distance = np.empty(n, np.int64), np.empty(n)
    for i in range(n):
        out[i] = -1
        k = 0
        for j in range(n):
            d2 = (points[j, 0] - points[i, 0]) ** 2 + (points[j, 1] - points[i, 1]) ** 2 + (points[j, 2] - points[i, 2]) ** 2
            if d2 <= limit * limit:
                near[k], distance[k] = j, np.sqrt(d2)
                k += 1
        order = np.argsort(distance[:k], kind="mergesort")
        tx = ty = tz = longest = 0.0
        inside, radius = 0, step
        while radius <= limit * (1 + 1e-9) and out[i] < 0:
            while inside < k and distance[order[inside]] <= radius:
                p = points[near[order[inside]]]
                for m in range(inside):
                    q = points[near[order[m]]]
                    dx, dy, dz = p[0] - q[0], p[1] - q[1], p[2] - q[2]
                    chord = dx * dx + dy * dy + dz * dz
                    if chord > longest:
                        longest, tx, ty, tz = chord, dx, dy, dz
                inside += 1
            if longest > 0:
                length = np.sqrt(longest)
                for m in range(inside):
                    j = near[order[m]]
                    d = distance[order[m]]
                    if d == 0:
                        continue
                    dot = (
                        (points[j, 0] - points[i, 0]) * tx + (points[j, 1] - points[i, 1]) * ty + (points[j, 2] - points[i, 2]) * tz
                    )
                    if abs(dot) < tolerance * d * length:
                        out[i] = j
                        break
            radius += step
