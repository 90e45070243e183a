"""Loops over points and cells, compiled by numba on first use and cached.

Import this module inside functions only: it brings numba in, which takes long.
"""

from typing import no_type_check

import numba
import numpy as np

_jit = numba.njit(cache=True, nogil=True, error_model="numpy")
STEPS = 4  # along the tangents, after which a point that still moves is looked for among all stations


@_jit
@no_type_check
def nearest_station(x, y, z, station, places, tangents, step):
    """The station nearest to a point, walking along the tangents from a guess."""
    last = len(places) - 1
    move = 0
    for _ in range(STEPS):
        along = (
            (x - places[station, 0]) * tangents[station, 0]
            + (y - places[station, 1]) * tangents[station, 1]
            + (z - places[station, 2]) * tangents[station, 2]
        )
        moved = min(max(station + int(np.rint(along / step)), 0), last)
        move, station = moved - station, moved
        if move == 0:
            return station
    if abs(move) > 1:
        least = np.inf
        for k in range(last + 1):
            dx, dy, dz = x - places[k, 0], y - places[k, 1], z - places[k, 2]
            distance = dx * dx + dy * dy + dz * dz
            if distance < least:
                least, station = distance, k
    return station


@_jit
@no_type_check
def stations_by_chord(points, places, tangents, chord, along_chord, step, out):
    """The nearest station of each point of a rail that never turns back on its chord.

    Args:
        points: (k, 3).  places, tangents: (m, 3) of the stations.  chord: (3,) unit; along_chord: (m,) of each station, increasing.
        out: (k,) stations.
    """
    last = len(places) - 1
    density = last / (along_chord[last] - along_chord[0])
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        at = (x - places[0, 0]) * chord[0] + (y - places[0, 1]) * chord[1] + (z - places[0, 2]) * chord[2]
        if at <= along_chord[0]:
            guess = 0
        elif at >= along_chord[last]:
            guess = last
        else:
            low = min(int((at - along_chord[0]) * density), last - 1)
            while along_chord[low] > at:
                low -= 1
            while along_chord[low + 1] <= at:
                low += 1
            guess = int(np.rint(low + (at - along_chord[low]) / (along_chord[low + 1] - along_chord[low])))
        out[i] = nearest_station(x, y, z, guess, places, tangents, step)


@_jit
@no_type_check
def coordinates(points, origins, station, places, t, e, n, step, s, x, h, slope, above):
    """Every point in a rail's coordinates, written into `s` to `above`; see `weldsim.seam.profile.rail.Strip`.

    Axes are interpolated between stations: without this, a curved rail's points jump by curvature * x * half a step.

    Args:
        origins: (k, 3) where the camera that saw each point stood, or (0, 3) where unknown.
    """
    last = len(places) - 1
    seen = len(origins) > 0
    for i in range(len(points)):
        j = station[i]
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        tx, ty, tz = t[j, 0], t[j, 1], t[j, 2]
        along = (px - places[j, 0]) * tx + (py - places[j, 1]) * ty + (pz - places[j, 2]) * tz
        k = min(j + 1, last) if along > 0 else max(j - 1, 0)
        u = min(abs(along) / step, 1.0)
        w = 1.0 - u
        bx, by, bz = places[j, 0] * w + places[k, 0] * u, places[j, 1] * w + places[k, 1] * u, places[j, 2] * w + places[k, 2] * u
        ex, ey, ez = e[j, 0] * w + e[k, 0] * u, e[j, 1] * w + e[k, 1] * u, e[j, 2] * w + e[k, 2] * u
        nx, ny, nz = n[j, 0] * w + n[k, 0] * u, n[j, 1] * w + n[k, 1] * u, n[j, 2] * w + n[k, 2] * u
        ox, oy, oz = px - bx, py - by, pz - bz
        s[i] = j * step + along
        x[i] = ox * ex + oy * ey + oz * ez
        h[i] = ox * nx + oy * ny + oz * nz
        if seen:
            cx, cy, cz = origins[i, 0], origins[i, 1], origins[i, 2]
            dx, dy, dz = px - cx, py - cy, pz - cz
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            if length > 0:
                dx, dy, dz = dx / length, dy / length, dz / length
            inward = max(-(dx * nx + dy * ny + dz * nz), 0.2)
            slope[i, 0] = (dx * tx + dy * ty + dz * tz) / inward
            slope[i, 1] = (dx * ex + dy * ey + dz * ez) / inward
            above[i] = (cx - bx) * nx + (cy - by) * ny + (cz - bz) * nz


@_jit
@no_type_check
def held_columns(design, held):
    """The columns in which each row of design (k, p) is not zero, into held (k, q), -1 after the last of them; q is as many as
    the fullest row has."""
    for i in range(len(design)):
        count = 0
        for a in range(design.shape[1]):
            if design[i, a] != 0.0:
                held[i, count] = a
                count += 1
        held[i, count:] = -1


@_jit
@no_type_check
def normal_equations(design, held, weight, h, part, gram, right):
    """Adds each row's share to the normal equations of the part it belongs to.

    A row of B-splines is mostly zeros, which are passed over; and the sums come out alike on every processor.

    Args:
        design: (k, p).  held: of `held_columns`.  weight, h: (k,).  part: (k,) from 0.  gram: (q, p, p), right: (q, p), zeros
            at first.
    """
    size, most = design.shape[1], held.shape[1]
    for i in range(len(design)):
        w, q = weight[i], part[i]
        if w == 0.0:
            continue
        for one in range(most):
            a = held[i, one]
            if a < 0:
                break
            scaled = design[i, a] * w
            right[q, a] += scaled * h[i]
            for other in range(one, most):
                b = held[i, other]
                if b < 0:
                    break
                gram[q, a, b] += scaled * design[i, b]
    for q in range(len(gram)):
        for a in range(size):
            for b in range(a):
                gram[q, a, b] = gram[q, b, a]


@_jit
@no_type_check
def profiles(row, column, shifts, known, values, total, count):
    """Sums of the values known over each block's samples along the line, at each shift, and their number.

    Args:
        row, column: (m, a, w) cells of the samples.  shifts: (q, 2) rows and columns.
        known, values: (h + 2, w + 2) with a border of empty cells.  total, count: (q, m, w).
    """
    last_row, last_column = known.shape[0] - 1, known.shape[1] - 1
    blocks, along, across = row.shape
    for k in range(len(shifts)):
        for m in range(blocks):
            for x in range(across):
                total[k, m, x] = count[k, m, x] = 0.0
            for a in range(along):
                for x in range(across):
                    i = min(max(row[m, a, x] + shifts[k, 0] + 1, 0), last_row)
                    j = min(max(column[m, a, x] + shifts[k, 1] + 1, 0), last_column)
                    total[k, m, x] += values[i, j]
                    count[k, m, x] += known[i, j]


@_jit
@no_type_check
def count_blocks(u, v, low_u, low_v, block, count):
    """Adds the points of each square block to count (b + 2, b + 2), whose border takes what lies outside.

    Args:
        u, v: (n,).  low_u, low_v: where the blocks begin.  block: their side.
    """
    last = len(count) - 1
    for i in range(len(u)):
        a = min(max(int(np.floor((u[i] - low_u) / block)) + 1, 0), last)
        b = min(max(int(np.floor((v[i] - low_v) / block)) + 1, 0), last)
        count[a, b] += 1


@_jit
@no_type_check
def sort_into_cells(u, v, height, front, cell, count, total):
    """The flat index of each point's cell into cell (n,), -1 outside; and the number and heights of the points of each cell
    added to count and total (h, w).

    Args:
        u, v: (n,) column and row, in cells.  height: (n,).  front: (n,) which points count.
    """
    rows, columns = count.shape
    for i in range(len(u)):
        column, row = np.floor(u[i]), np.floor(v[i])
        if front[i] and 0 <= column < columns and 0 <= row < rows:
            a, b = int(row), int(column)
            cell[i] = a * columns + b
            count[a, b] += 1.0
            total[a, b] += height[i]
        else:
            cell[i] = -1
