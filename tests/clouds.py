"""Test clouds with a seam known in closed form, seen by a pinhole camera: no simulator, a fraction of a second each.

`groove_cloud` casts one ray a pixel against a plate (box minus a swept V groove, optionally bent over a cylinder), the
table it lies on, clamps and bolts; then adds noise. Plate frame P: origin at the middle of the top face, x along the
seam, z out of the plate. The camera looks down at the plate with image x roughly along the seam.
"""

from typing import Literal, NamedTuple

import cv2
import manifold3d
import numpy as np
import open3d as o3d
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.curves import arc_length, interpolate, project, tangents
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics, KnownSeam, PointCloud
from weldsim.sensor.d415 import D415_NOISE
from weldsim.sensor.noise import disparity_noise

Curve = Literal["straight", "arc", "s"]
Noise = Literal["none", "iid", "d415"]
Surface = Literal["flat", "cylinder"]

TABLE, PLATE, GROOVE, CLAMP, BOLT, STRAY = range(6)  # labels

ARC_RADIUS = 0.30  # [m] of the 'arc' seam in the plate
S_AMPLITUDE = 0.015  # [m] of the 's' seam, one period over the plate
BASELINE = 0.055  # [m] D415
SUPPORT, SUPPORT_LIMIT = 11, 3.0  # [px] matching window, and the disparity step it does not average across
EDGE_STEP = 4.0  # [px] disparity step at which pixels are lost


class GrooveCloud(NamedTuple):
    """A cloud in B, its true seam (None for a plain plate), and what each point lies on (TABLE, PLATE, ...)."""

    cloud: PointCloud
    seam: KnownSeam | None
    labels: Int[ndarray, "n"]


class _Plate(NamedTuple):
    """The plate's measures [m]; `bend` maps flat coordinates onto the bent plate."""

    length: float
    breadth: float
    thickness: float
    surface: Surface
    bend_axis: Literal["along", "across"]
    bend_radius: float

    def bend(self, p: ndarray) -> ndarray:
        """Points (..., 3) of the flat plate, moved onto the cylinder (top face at bend_radius)."""
        if self.surface == "flat":
            return p
        i = 0 if self.bend_axis == "across" else 1
        out = np.array(p, float)
        angle, radius = p[..., i] / self.bend_radius, self.bend_radius + p[..., 2]
        out[..., i], out[..., 2] = radius * np.sin(angle), radius * np.cos(angle) - self.bend_radius
        return out


def groove_cloud(
    rng: np.random.Generator,
    *,
    width: float = 0.014,
    depth: float = 0.008,
    curve: Curve = "straight",
    root_gap: float = 0.0,
    margin: float | None = None,
    offset: float = 0.0,
    surface: Surface = "flat",
    bend_axis: Literal["along", "across"] = "across",
    bend_radius: float = 0.3,
    size: tuple[float, float] = (0.24, 0.225),
    thickness: float = 0.02,
    centre: tuple[float, float, float] = (0.0, -0.45, 0.02),
    yaw: float = 0.0,
    tilt: float = 0.0,
    standoff: float = 0.40,
    camera_tilt: float = 0.12,
    camera_azimuth: float = 0.6,
    table: bool = True,
    clamps: int = 0,
    bolts: int = 0,
    strays: int = 0,
    noise: Noise = "none",
    sigma: float = 0.0003,
    intrinsics: CameraIntrinsics = D415_640X480,
) -> GrooveCloud:
    """A plate with a V groove on a table, as one depth camera sees it.

    Args:
        width, depth: of the groove at the opening [m]; width 0 = plain plate, no seam.
        curve: line of the groove in the plate.  offset: its shift across the plate [m].
        root_gap: width of a slot through the plate at the root [m].
        margin: the groove ends this far inside the plate [m]; None = it runs out at both ends.
        surface, bend_axis, bend_radius: 'cylinder' bends the plate about an axis across or along the seam, convex up.
        size, thickness: of the plate [m].  centre: of its top face in B [m].
        yaw: of the plate about the vertical [rad].  tilt: of the plate about its x axis, table level [rad].
        standoff: camera to plate centre [m].  camera_tilt, camera_azimuth: lean of the optical axis [rad].
        clamps: 0 to 4, on the plate's corners.  bolts: hexagon heads on plate and table.  strays: outlying pixels.
        noise: 'iid' = Gaussian depth noise `sigma` [m]; 'd415' = support window, correlated disparity noise, steps.
    """
    plate = _Plate(*size, thickness, surface, bend_axis, bend_radius)
    line = _centre_line(curve, plate, margin, offset)
    X_BP = Transform("BP", _about(2, yaw) @ _about(0, tilt), np.asarray(centre, float))
    solids = [(_plate_solid(plate, line, width, depth, root_gap, margin), PLATE)]
    solids += [(_clamp(plate, i), CLAMP) for i in range(clamps)]
    solids += [(_bolt(plate, line, width, rng), BOLT) for _ in range(bolts)]
    X_BC = _look_at(X_BP, standoff, camera_tilt, camera_azimuth)
    z, labels, hit_B = _cast(X_BC, X_BP, solids, -thickness if table else None, tilt, plate, intrinsics)
    if width > 0:
        labels = _mark_groove(labels, hit_B, X_BP, plate, line, width)
    if noise == "iid":
        z = z + rng.normal(0.0, sigma, z.shape)
    elif noise == "d415":
        z = d415_depth(z, intrinsics.fx, rng)
    if strays:
        pick = rng.choice(np.flatnonzero(np.isfinite(z.ravel())), strays, replace=False)
        z.ravel()[pick] -= rng.uniform(0.01, 0.10, strays)
        labels.ravel()[pick] = STRAY
    pixel = np.flatnonzero(np.isfinite(z.ravel()))
    points_C = (intrinsics.rays() * z[..., None]).reshape(-1, 3)[pixel]
    cloud = PointCloud(points=X_BC.points(points_C), viewpoints=X_BC.p[None], pixel=pixel, intrinsics=intrinsics, X_BC=X_BC)
    seam = _known_seam(plate, line, width, depth, root_gap, X_BP, curve) if width > 0 else None
    return GrooveCloud(cloud, seam, labels.ravel()[pixel].astype(np.int64))


def two_grooves(seed: int = 0) -> PointCloud:
    """A level plate with two V-grooves 14 mm wide along x, one 280 mm long, the other 110 mm, seen from above."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(-0.14, 0.1401, 0.0008), np.arange(-0.11, 0.1101, 0.0008))
    v = np.maximum(0.0, 1 - np.abs(y - 0.05) / 0.007) + np.maximum(0.0, 1 - np.abs(y + 0.05) / 0.007) * (np.abs(x) < 0.055)
    points = np.stack([x, y - 0.5, 0.02 - 0.008 * v + 1e-4 * rng.normal(size=x.shape)], axis=-1).reshape(-1, 3)
    return PointCloud(points=points, viewpoints=np.array([[0.0, -0.5, 0.45]]))


def d415_depth(z: Float[ndarray, "h w"], fx: float, rng: np.random.Generator) -> Float[ndarray, "h w"]:
    """Depth [m] as an active-stereo camera would report it: averaged over the support window, the noise of a measured D415 that
    doubles over relief within the window, 1/32 px and 1 mm steps, NaN at depth steps."""
    valid = np.isfinite(z)
    d = np.where(valid, fx * BASELINE / np.where(valid, z, 1.0), 0.0)
    window = np.ones((SUPPORT, SUPPORT), np.uint8)
    low = cv2.erode(np.where(valid, d, 1e6), window)
    high = cv2.dilate(np.where(valid, d, -1e6), window)
    small = np.ones((3, 3), np.uint8)
    step = cv2.dilate(np.where(valid, d, -1e6), small) - cv2.erode(np.where(valid, d, 1e6), small)
    count = cv2.boxFilter(valid.astype(float), -1, (SUPPORT, SUPPORT), normalize=False, borderType=cv2.BORDER_CONSTANT)
    mean = cv2.boxFilter(d, -1, (SUPPORT, SUPPORT), normalize=False, borderType=cv2.BORDER_CONSTANT) / np.maximum(count, 1)
    rows, cols = np.nonzero(valid & ((high - d > SUPPORT_LIMIT) | (d - low > SUPPORT_LIMIT)))
    mean[rows, cols] = _limited_mean(d, valid, rows, cols)
    left = np.where(valid, d - mean, 0.0)
    relief = cv2.dilate(left, window) - cv2.erode(left, window)
    field = disparity_noise(D415_NOISE, (z.shape[0], z.shape[1]), 0.0, rng, rng)
    d = mean + field * (1 + np.clip(relief / 0.8, 0, 1))
    d = np.round(d * 32) / 32
    out = np.round(fx * BASELINE / np.maximum(d, 1e-3) * 1e3) / 1e3
    out[~valid | (step >= EDGE_STEP)] = np.nan
    return out


def _limited_mean(d: ndarray, valid: ndarray, rows: ndarray, cols: ndarray) -> ndarray:
    """Support mean at the pixels given, over those neighbours within SUPPORT_LIMIT of the pixel's own disparity."""
    total, count = np.zeros(len(rows)), np.zeros(len(rows))
    half = SUPPORT // 2
    for i in range(-half, half + 1):
        for j in range(-half, half + 1):
            r, c = np.clip(rows + i, 0, d.shape[0] - 1), np.clip(cols + j, 0, d.shape[1] - 1)
            near = valid[r, c] & (np.abs(d[r, c] - d[rows, cols]) <= SUPPORT_LIMIT)
            total += np.where(near, d[r, c], 0.0)
            count += near
    return total / count


def _about(axis: int, angle: float) -> ndarray:
    return matrix_from_rotation_vector(angle * np.eye(3)[axis])


def _centre_line(curve: Curve, plate: _Plate, margin: float | None, offset: float) -> Float[ndarray, "n 3"]:
    """The opening's line in flat plate coordinates, from one plate end (or margin) to the other, 0.25 mm apart."""
    x = np.linspace(-1, 1, 2001) * plate.length / 2
    if curve == "arc":
        sagitta = ARC_RADIUS - np.sqrt(ARC_RADIUS**2 - (plate.length / 2) ** 2)
        y = np.sqrt(ARC_RADIUS**2 - x**2) - ARC_RADIUS + sagitta / 2
    else:
        y = S_AMPLITUDE * np.sin(2 * np.pi * x / plate.length) if curve == "s" else np.zeros_like(x)
    line = np.stack([x, y + offset, np.zeros_like(x)], axis=1)
    s = arc_length(line)
    cut = margin or 0.0
    return interpolate(s, line, np.linspace(cut, s[-1] - cut, int(np.ceil((s[-1] - 2 * cut) / 0.25e-3)) + 1))


def _side(line: ndarray) -> ndarray:
    """Unit vectors to the left of the line, in the flat plate."""
    return np.cross([0.0, 0.0, 1.0], tangents(line))


def _plate_solid(
    plate: _Plate, line: ndarray, width: float, depth: float, root_gap: float, margin: float | None
) -> manifold3d.Manifold:
    """Box minus swept groove, refined and bent."""
    solid = manifold3d.Manifold.cube((plate.length, plate.breadth, plate.thickness), True).translate((0, 0, -plate.thickness / 2))
    if width > 0:
        if margin is None:  # run the tool out beyond the plate, along the end tangents
            t = tangents(line)
            line = np.concatenate([[line[0] - 0.03 * t[0]], line, [line[-1] + 0.03 * t[-1]]])
        rise = 0.25  # above the face the flanks go on, so that the lips are where the flanks cut it
        half, gap = width / 2, root_gap / 2
        section = [
            (half + rise * (half - gap), rise * depth),
            (gap, -depth),
            (-gap, -depth),
            (-half - rise * (half - gap), rise * depth),
        ]
        solid -= _sweep(line, section if root_gap > 0 else [section[0], (0.0, -depth), section[3]])
        if root_gap > 0:
            solid -= _sweep(line, [(gap, 0.0), (gap, -2 * plate.thickness), (-gap, -2 * plate.thickness), (-gap, 0.0)])
    if plate.surface == "cylinder":
        solid = solid.refine_to_length(0.003).warp_batch(plate.bend)
    return solid


def _sweep(line: ndarray, section: list[tuple[float, float]]) -> manifold3d.Manifold:
    """The solid swept by a polygon (across, up), clockwise seen along the line, with flat ends."""
    side, k, n = _side(line), len(section), len(line)
    ring = np.array(section)
    vertices = line[:, None] + ring[None, :, :1] * side[:, None] + np.stack([0 * ring[:, 0], 0 * ring[:, 0], ring[:, 1]], 1)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(k), indexing="ij")
    a, b, c, d = i * k + j, i * k + (j + 1) % k, (i + 1) * k + j, (i + 1) * k + (j + 1) % k
    faces = [np.stack([a, d, b], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    fan = np.array([[0, m, m + 1] for m in range(1, k - 1)])
    faces += [fan, fan[:, ::-1] + (n - 1) * k]
    mesh = manifold3d.Mesh(vertices.reshape(-1, 3).astype(np.float32), np.concatenate(faces).astype(np.uint32))
    solid = manifold3d.Manifold(mesh)
    if solid.volume() < 0 or solid.is_empty():
        raise ValueError(f"sweep is no solid: {solid.status()}, volume {solid.volume()}")
    return solid


def _clamp(plate: _Plate, i: int) -> manifold3d.Manifold:
    """A clamp's jaw, 45 x 30 x 15 mm, gripping corner i of the plate by 25 mm."""
    sx, sy = (1, -1)[i % 2], (1, -1)[(i // 2) % 2]
    x, y = sx * (plate.length / 2 - 0.03), sy * (plate.breadth / 2 - 0.0025)
    foot = plate.bend(np.array([x, y, 0.0]))
    return manifold3d.Manifold.cube((0.030, 0.045, 0.017), True).translate((foot[0], foot[1], foot[2] + 0.0065))


def _bolt(plate: _Plate, line: ndarray, width: float, rng: np.random.Generator) -> manifold3d.Manifold:
    """A hexagon head, 17 mm across corners and 7 mm high, clear of the groove."""
    while True:
        x, y = rng.uniform(-0.45, 0.45, 2) * (plate.length, plate.breadth)
        if np.hypot(*(line[:, :2] - (x, y)).T).min() > width / 2 + 0.015:
            break
    foot = plate.bend(np.array([x, y, 0.0]))
    head = manifold3d.Manifold.cylinder(0.009, 0.0085, circular_segments=6).rotate((0, 0, float(rng.uniform(0, 60))))
    return head.translate((foot[0], foot[1], foot[2] - 0.002))


def _look_at(X_BP: Transform, standoff: float, tilt: float, azimuth: float) -> Transform:
    """Camera above the plate's centre looking down, image x along base x, leaning by `tilt` towards `azimuth`."""
    lean = matrix_from_rotation_vector(tilt * np.array([-np.sin(azimuth), np.cos(azimuth), 0.0]))
    R = lean @ np.diag([1.0, -1.0, -1.0])
    return Transform("BC", R, X_BP.p - standoff * R[:, 2])


def _cast(
    X_BC: Transform,
    X_BP: Transform,
    solids: list[tuple[manifold3d.Manifold, int]],
    table: float | None,
    tilt: float,
    plate: _Plate,
    intrinsics: CameraIntrinsics,
) -> tuple[Float[ndarray, "h w"], Int[ndarray, "h w"], Float[ndarray, "h w 3"]]:
    """Exact z-depth (NaN = nothing hit), label and hit point of every pixel."""
    scene, label_of = o3d.t.geometry.RaycastingScene(), []
    meshes = [
        (X_BP.points(np.asarray(m.to_mesh().vert_properties, float)[:, :3]), m.to_mesh().tri_verts, label) for m, label in solids
    ]
    if table is not None:  # under the plate's lowest corner
        z = float(meshes[0][0][:, 2].min())
        corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 1.5 + [X_BP.p[0], X_BP.p[1], z]
        meshes.append((corners, np.array([[0, 1, 2], [0, 2, 3]]), TABLE))
    for vertices, faces, label in meshes:
        scene.add_triangles(o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(np.asarray(faces).astype(np.uint32)))
        label_of.append(label)
    directions = intrinsics.rays() @ X_BC.R.T
    rays = np.concatenate([np.broadcast_to(X_BC.p, directions.shape), directions], axis=-1).astype(np.float32)
    hits = scene.cast_rays(o3d.core.Tensor(rays))
    z = hits["t_hit"].numpy().astype(float)
    z[np.isinf(z)] = np.nan
    geometry = hits["geometry_ids"].numpy()
    labels = np.append(label_of, -1)[np.where(geometry < len(label_of), geometry, len(label_of)).astype(int)]
    return z, labels, X_BC.p + directions * z[..., None]


def _mark_groove(labels: ndarray, hit_B: ndarray, X_BP: Transform, plate: _Plate, line: ndarray, width: float) -> ndarray:
    """Labels with GROOVE where the plate was hit below its parent surface, inside the lips."""
    on_plate = labels == PLATE
    p = X_BP.inverse().points(hit_B[on_plate])
    if plate.surface == "cylinder":
        i = 0 if plate.bend_axis == "across" else 1
        r = np.hypot(p[:, i], p[:, 2] + plate.bend_radius)
        angle = np.arctan2(p[:, i], p[:, 2] + plate.bend_radius)
        p[:, i], p[:, 2] = angle * plate.bend_radius, r - plate.bend_radius
    distance, _, s = project(p * [1, 1, 0], line)
    inside = (distance < width / 2) & (p[:, 2] < -2e-5) & (s >= 0)
    out = labels.copy()
    out[on_plate] = np.where(inside, GROOVE, PLATE)
    return out


def _known_seam(
    plate: _Plate, line: ndarray, width: float, depth: float, root_gap: float, X_BP: Transform, curve: Curve
) -> KnownSeam:
    side = _side(line)
    left, right = (X_BP.points(plate.bend(line + sign * width / 2 * side)) for sign in (1, -1))
    toes = [X_BP.points(plate.bend(line + sign * root_gap / 2 * side - [0, 0, depth])) for sign in (1, -1)]
    opening = (left + right) / 2
    inward = -unit(unit(left - toes[0]) + unit(right - toes[1]))
    return KnownSeam(
        opening_B=opening,
        root_B=(toes[0] + toes[1]) / 2,
        left_B=left,
        right_B=right,
        tangents_B=tangents(opening),
        bisectors_B=inward,
        s=arc_length(opening),
        name=f"plate/{curve}",
    )
