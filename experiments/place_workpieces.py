"""Where the thesis's workpieces stood: least-squares fits of arc, U and line to its true points.

    WELDSIM_DATA=... python experiments/place_workpieces.py

The tables' y is negative where the cell's table is, so they are in the controller's base B, whose workspace is at y < 0.
Prints the figures that scenes/cylinder.toml, cuboid.toml and y.toml hold, rounded to a millimetre, with the greatest
distance of a true point from the seam that is placed so.
"""

import json
import os
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares


def arc(points: np.ndarray) -> str:
    """An arc of radius 0.30 m in a plane of constant y (table 6.4)."""

    def residuals(p: np.ndarray, radius: float) -> np.ndarray:
        return np.concatenate([np.hypot(points[:, 0] - p[0], points[:, 2] - p[1]) - radius, points[:, 1] - p[2]])

    free = least_squares(lambda p: residuals(p, p[3]), [0.0, -0.08, -0.5, 0.3]).x
    x, z, y = least_squares(lambda p: residuals(p, 0.30), [0.0, -0.08, -0.5]).x
    x, y, top = np.round([x, y, z + 0.30], 3)
    worst = np.hypot(*residuals(np.array([x, top - 0.30, y]), 0.30).reshape(2, -1)).max()
    return f"radius {free[3] * 1e3:.0f} mm when free; 300 mm: crest at {show(x, y, top)}, worst point {worst * 1e3:.1f} mm"


def inverted_u(points: np.ndarray) -> str:
    """Three sides of a rectangle in a plane of constant y (table 6.6)."""

    def residuals(p: np.ndarray) -> np.ndarray:
        left, right, y, top = p
        sides = [points[:, 0] - left, points[:, 0] - right, points[:, 2] - top]
        nearest = np.take_along_axis(np.array(sides), np.abs(sides).argmin(axis=0)[None], axis=0)[0]
        return np.concatenate([nearest, points[:, 1] - y])

    left, right, y, top = least_squares(residuals, [-0.21, 0.21, -0.58, 0.42]).x
    length, x, y, top = np.round([right - left, (left + right) / 2, y, top], 3)
    worst = np.hypot(*residuals(np.array([x - length / 2, x + length / 2, y, top])).reshape(2, -1)).max()
    low = points[:, 2].min()
    size = f"length {length * 1e3:.0f} mm, lowest point at z {low * 1e3:.0f} mm"
    return f"{size}: top at {show(x, y, top)}, worst point {worst * 1e3:.1f} mm"


def line(points: np.ndarray) -> str:
    """A straight line in the plane x = constant (table 6.8)."""
    middle = points.mean(axis=0)
    direction = np.linalg.svd(points[:, 1:] - middle[1:])[2][0]
    slope = np.round(np.degrees(np.arctan(direction[1] / direction[0])), 1)
    middle = np.round(middle, 3)
    direction = np.array([0.0, np.cos(np.radians(slope)), np.sin(np.radians(slope))])
    worst = np.linalg.norm(np.cross(points - middle, direction), axis=1).max()
    along = (points - middle) @ direction
    return (
        f"slope {slope:.1f} deg, from {along.min() * 1e3:.0f} to {along.max() * 1e3:.0f} mm along it: middle at {show(*middle)},"
        f" worst point {worst * 1e3:.1f} mm"
    )


def show(x: float, y: float, z: float) -> str:
    """A point in millimetres."""
    return f"({x * 1e3:.0f}, {y * 1e3:.0f}, {z * 1e3:.0f}) mm"


if __name__ == "__main__":
    tables = json.loads((Path(os.environ["WELDSIM_DATA"]) / "thesis_tables.json").read_text())
    for name, table, fit in (
        ("cylinder", "cylinder_path_6_4", arc),
        ("cuboid", "cuboid_path_6_6", inverted_u),
        ("y", "y_path_6_8", line),
    ):
        print(f"{name}: {fit(np.array(tables[table]['true']))}")
