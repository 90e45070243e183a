"""The loop over points that a rail is laid through, compiled by numba on first use and cached.

Import this module inside functions only: it brings numba in, which takes longer than the loop saves a short-lived process.
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
def normal_equations(design, weight, h, part, gram, right):
    """Adds each row's share to the normal equations of the part it belongs to.

    A row of B-splines is mostly zeros, which are passed over; and the sums come out alike on every processor.

    Args:
        design: (k, p).  weight, h: (k,).  part: (k,) from 0.  gram: (q, p, p), right: (q, p), zeros at first.
    """
    rows, size = design.shape
    held = np.empty(size, np.int64)
    for i in range(rows):
        w, q = weight[i], part[i]
        if w == 0.0:
            continue
        count = 0
        for a in range(size):
            if design[i, a] != 0.0:
                held[count] = a
                count += 1
        for one in range(count):
            a = held[one]
            scaled = design[i, a] * w
            right[q, a] += scaled * h[i]
            for other in range(one, count):
                gram[q, a, held[other]] += scaled * design[i, held[other]]
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
def blurred(v, x, wide, share, turn, changed, moved, depth, jacobian):
    """Adds what a blurred polyline's corners make of its depth and of how that changes: `weldsim.seam.profile.section.ramps`,
    summed over the corners.

    Args:
        v, turn: (s, g, 4) places [m] and changes of slope of the corners.  x: (g, w) [m].
        wide: (s, g) of the wider box [m].  share: (s,) of it that the narrower one has.
        changed, moved: (p, s, g, 4) how the turns change with p unknowns; the turns times how their corners move.
        depth: (s, g, w).  jacobian: (s, p + 2, g, w), the last two for the boxes' width and their share.
    """
    unknowns = len(changed)
    for s in range(v.shape[0]):
        for g in range(v.shape[1]):
            width, part = wide[s, g], share[s]
            narrow = part * width
            outer, inner = (width + narrow) / 2, (width - narrow) / 2
            scale = 1.0 / (width * narrow)
            for c in range(v.shape[2]):
                bend = turn[s, g, c]
                for k in range(x.shape[1]):
                    y = v[s, g, c] - x[g, k]
                    a, b = max(y + outer, 0.0), max(y + inner, 0.0)
                    e, f = max(y - inner, 0.0), max(y - outer, 0.0)
                    aa, bb, ee, ff = a * a, b * b, e * e, f * f
                    ramp = (a * aa - b * bb - e * ee + f * ff) * (scale / 6)
                    slope = (aa - bb - ee + ff) * (scale / 2)
                    over, under = (aa - ff) * (scale / 4), (bb - ee) * (scale / 4)
                    depth[s, g, k] += bend * ramp
                    for p in range(unknowns):
                        jacobian[s, p, g, k] += changed[p, s, g, c] * ramp + moved[p, s, g, c] * slope
                    jacobian[s, unknowns, g, k] += bend * (over * (1 + part) - under * (1 - part) - 2 * ramp / width)
                    jacobian[s, unknowns + 1, g, k] += bend * ((over + under) * width - ramp / part)
