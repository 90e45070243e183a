"""Writes the arm's visual meshes: turned bodies with rounded edges, in the modified DH frame of each link.

Run `python assets/ur5/make_meshes.py`; the files in meshes/ are its output. Dimensions are our own, chosen by eye about the
published joint offsets; nothing is taken from a manufacturer's model.
"""

import os
from pathlib import Path

import numpy as np

SEGMENTS = 36
SHARP = np.radians(35)  # a profile corner that turns by more is an edge

X, Y, Z = np.eye(3)


def filleted(profile: list[tuple[float, float]], radius: float, steps: int = 4) -> np.ndarray:
    """The profile (r, z) with its inner corners rounded."""
    points = np.array(profile, float)
    out = [points[0]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        a, b = before - corner, after - corner
        reach = min(radius, 0.45 * np.linalg.norm(a), 0.45 * np.linalg.norm(b))
        start, end = corner + reach * a / np.linalg.norm(a), corner + reach * b / np.linalg.norm(b)
        u = np.linspace(0, 1, steps)[:, None]
        out.extend((1 - u) ** 2 * start + 2 * u * (1 - u) * corner + u**2 * end)
    return np.array([*out, points[-1]])


def turned(profile: np.ndarray, origin: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and faces of a profile (r, z), z ascending on the outside, turned about an axis."""
    edges = np.diff(profile, axis=0)
    flat = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    rows: list[tuple[np.ndarray, np.ndarray]] = []
    for i in range(len(edges)):
        for end in (0, 1):
            j = i + end - 1 + end  # the segment on the other side of this end
            other = flat[j] if 0 <= j < len(flat) else flat[i]
            smooth = np.arccos(np.clip(flat[i] @ other, -1, 1)) < SHARP
            normal = flat[i] + other if smooth else flat[i]
            rows.append((profile[i + end], normal / np.linalg.norm(normal)))
    angles = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    u = np.cross(axis, X if abs(axis[0]) < 0.9 else Y)
    radial = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * np.cross(axis, u)
    vertices = np.concatenate([origin + r * radial + z * axis for (r, z), _ in rows])
    normals = np.concatenate([nr * radial + nz * axis for _, (nr, nz) in rows])
    here = np.arange(SEGMENTS)
    after = (here + 1) % SEGMENTS
    faces = []
    for strip in range(0, len(rows), 2):
        # Where the profile is smooth, a strip begins on the row where the one before it ended.
        shared = strip > 0 and np.allclose(rows[strip][1], rows[strip - 1][1])
        a, b = (strip - shared) * SEGMENTS, (strip + 1) * SEGMENTS
        if rows[strip][0][0] > 1e-9:
            faces.append(np.column_stack([a + here, a + after, b + after]))
        if rows[strip + 1][0][0] > 1e-9:
            faces.append(np.column_stack([a + here, b + after, b + here]))
    triangles = np.concatenate(faces)
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], normals[used], triangles.reshape(-1, 3)


def drum(origin, axis, radius: float, low: float, high: float, fillet: float = 0.004):
    """A closed cylinder with rounded rims, from `low` to `high` along the axis."""
    profile = filleted([(0, low), (radius, low), (radius, high), (0, high)], fillet)
    return turned(profile, np.asarray(origin, float), np.asarray(axis, float))


def lid(origin, axis, radius: float, low: float, high: float):
    """A flat cap with a generous rim."""
    profile = filleted([(0, low), (radius, low), (radius, (low + high) / 2), (radius - 0.012, high), (0, high)], 0.007)
    return turned(profile, np.asarray(origin, float), np.asarray(axis, float))


def tube(origin, axis, radius: float, low: float, high: float, collar: float):
    """A tube between two collars that widen towards its ends."""
    ends = 0.022
    profile = filleted(
        [
            (0, low),
            (collar, low),
            (collar, low + ends * 0.5),
            (radius, low + ends),
            (radius, high - ends),
            (collar, high - ends * 0.5),
            (collar, high),
            (0, high),
        ],
        0.006,
    )
    return turned(profile, np.asarray(origin, float), np.asarray(axis, float))


ORIGIN = np.zeros(3)
ELBOW, WRIST = np.array([-0.425, 0, 0]), np.array([-0.39225, 0, 0])

PARTS = {
    "base_grey": [
        turned(filleted([(0, 0), (0.0755, 0), (0.0755, 0.011), (0.0715, 0.013), (0.0650, 0.046), (0, 0.046)], 0.003), ORIGIN, Z),
    ],
    "base_dark": [drum(ORIGIN, Z, 0.0585, 0.040, 0.0515, 0.001)],
    "shoulder_grey": [drum(ORIGIN, Z, 0.0600, -0.0380, 0.0, 0.004), drum(ORIGIN, -Y, 0.0600, -0.0580, 0.0720, 0.010)],
    "shoulder_blue": [lid(ORIGIN, Y, 0.0575, 0.0560, 0.0690)],
    "upper_arm_grey": [
        drum(ORIGIN, Z, 0.0600, 0.0760, 0.1880, 0.010),
        drum(ELBOW, Z, 0.0600, 0.0760, 0.1880, 0.010),
        tube((0, 0, 0.1340), -X, 0.0470, 0.0480, 0.3770, 0.0535),
    ],
    "upper_arm_blue": [lid(ORIGIN, Z, 0.0575, 0.1860, 0.1990), lid(ELBOW, Z, 0.0575, 0.1860, 0.1990)],
    "upper_arm_dark": [drum(ORIGIN, Z, 0.0570, 0.0700, 0.0780, 0.001), drum(ELBOW, Z, 0.0540, 0.0700, 0.0780, 0.001)],
    "forearm_grey": [
        drum(ORIGIN, Z, 0.0560, -0.0400, 0.0720, 0.009),
        drum(WRIST, Z, 0.0410, -0.0260, 0.0580, 0.007),
        tube((0, 0, 0.0160), -X, 0.0375, 0.0420, 0.3600, 0.0435),
    ],
    "forearm_blue": [lid(ORIGIN, -Z, 0.0535, 0.0380, 0.0510), lid(WRIST, -Z, 0.0390, 0.0240, 0.0350)],
    "forearm_dark": [drum(WRIST, Z, 0.0375, 0.0560, 0.0640, 0.001)],
    "wrist_1_grey": [drum(ORIGIN, Z, 0.0410, -0.0460, 0.0400, 0.007), drum(ORIGIN, -Y, 0.0400, 0.0, 0.0460, 0.004)],
    "wrist_1_blue": [lid(ORIGIN, Z, 0.0390, 0.0380, 0.0490)],
    "wrist_1_dark": [drum(ORIGIN, -Y, 0.0370, 0.0440, 0.0510, 0.001)],
    "wrist_2_grey": [drum(ORIGIN, Z, 0.0410, -0.0450, 0.0400, 0.007), drum(ORIGIN, Y, 0.0400, 0.0, 0.0440, 0.004)],
    "wrist_2_blue": [lid(ORIGIN, Z, 0.0390, 0.0380, 0.0490)],
    "wrist_2_dark": [drum(ORIGIN, Y, 0.0360, 0.0420, 0.0480, 0.001)],
    "wrist_3_aluminium": [
        turned(
            filleted([(0, -0.0350), (0.0375, -0.0350), (0.0375, -0.0080), (0.0315, -0.0060), (0.0315, 0), (0, 0)], 0.0025),
            ORIGIN,
            Z,
        )
    ],
}


def write_obj(path: Path, solids: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
    """One OBJ file with every solid and its normals, written whole or not at all."""
    lines, first = ["# written by make_meshes.py"], 1
    for vertices, normals, faces in solids:
        lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices.round(5) + 0.0]
        lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in normals.round(3) + 0.0]
        lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in faces + first]
        first += len(vertices)
    temporary = path.with_suffix(".part")
    temporary.write_text("\n".join(lines) + "\n")
    os.replace(temporary, path)


def main(folder: Path = Path(__file__).parent / "meshes") -> None:
    folder.mkdir(exist_ok=True)
    for name, solids in PARTS.items():
        write_obj(folder / f"{name}.obj", solids)


if __name__ == "__main__":
    main()
