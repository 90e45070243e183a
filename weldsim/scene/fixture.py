"""What holds the part: step clamps on its long sides, bolt heads as clutter, and a wedge under a tilted part."""

import numpy as np
from scipy.spatial import ConvexHull

from weldsim.errors import SceneError
from weldsim.frames import Transform
from weldsim.scene.config import FixtureConfig
from weldsim.scene.shapes import Body, Group, Spec, box, mesh_geom, rod
from weldsim.scene.workpieces.plate import PlateConfig

BOLT_PLACES = ((-0.30, 0.33), (0.28, 0.30), (0.05, -0.30), (-0.33, -0.28), (0.34, -0.31), (0.0, 0.36))  # of length and width


def add_clamps(part: Body, config: FixtureConfig, plate: PlateConfig) -> None:
    """Step clamps and bolts, in the part's body (frame P)."""
    limit = min(plate.width / 4, 0.045)
    if config.clamps and not 0 < config.overlap <= limit:
        raise SceneError(
            f"fixture: a clamp's overlap of {config.overlap * 1e3:g} mm must be over 0 and at most {limit * 1e3:g} mm here",
            key="overlap",
            limit=limit,
        )
    if not 0 <= config.bolts <= len(BOLT_PLACES):
        raise SceneError(f"fixture: {config.bolts} bolts; at most {len(BOLT_PLACES)}", key="bolts", limit=len(BOLT_PLACES))
    across = {0: (), 2: ((0.0, 1), (0.0, -1)), 4: ((-0.3, 1), (0.3, 1), (-0.3, -1), (0.3, -1))}[config.clamps]
    for i, (along, side) in enumerate(across):
        _add_clamp(part, f"clamp_{i}", along * plate.length, side, config.overlap, plate)
    for i, (u, v) in enumerate(BOLT_PLACES[: config.bolts]):
        _add_bolt(part, f"clamp_bolt_{i}", u * plate.length, v * plate.width)


def _add_clamp(part: Body, name: str, x: float, side: int, overlap: float, plate: PlateConfig) -> None:
    """A strap with its nose on the plate and its heel on a step block, drawn down by a stud and nut."""
    edge, thick = plate.width / 2, 0.012

    def y(distance: float) -> float:
        """Distance outwards from the plate's edge."""
        return side * (edge + distance)

    box(part, f"{name}_strap", (x, y((0.075 - overlap) / 2), thick / 2), (0.0125, (0.075 + overlap) / 2, thick / 2), "clamp")
    box(part, f"{name}_nose", (x, y(-overlap / 2), thick + 0.002), (0.0125, overlap / 2, 0.002), "clamp")
    for i in range(3):
        height = plate.thickness * (i + 1) / 3
        box(
            part, f"{name}_step_{i}", (x, y(0.085 - 0.012 * i), -plate.thickness + height / 2), (0.0125, 0.006, height / 2), "clamp"
        )
    stud = y(0.030)
    rod(part, f"{name}_stud", (x, stud, -plate.thickness), (x, stud, thick + 0.030), 0.005, "zinc")
    rod(part, f"{name}_washer", (x, stud, thick), (x, stud, thick + 0.0025), 0.012, "zinc")
    _add_hexagon(part, f"{name}_nut", (x, stud, thick + 0.0025), 0.0098, 0.010)
    box(
        part,
        f"{name}_collision",
        (x, y((0.091 - overlap) / 2), thick / 2 + 0.010),
        (0.014, (0.091 + overlap) / 2, thick / 2 + 0.012),
        "collision",
        group=Group.COLLISION,
        collide=True,
    )


def _add_bolt(part: Body, name: str, x: float, y: float) -> None:
    rod(part, f"{name}_washer", (x, y, 0.0), (x, y, 0.002), 0.010, "zinc")
    _add_hexagon(part, f"{name}_head", (x, y, 0.002), 0.0075, 0.0055)
    rod(part, f"{name}_collision", (x, y, 0.0), (x, y, 0.008), 0.011, "collision", group=Group.COLLISION, collide=True)


def _add_hexagon(part: Body, name: str, foot: tuple[float, float, float], radius: float, height: float) -> None:
    """A hexagon of corner radius `radius`, as three boxes turned by 60 deg."""
    for i in range(3):
        angle = i * np.pi / 3
        half = (radius / 2, radius * np.sqrt(3) / 2, height / 2)
        geom = box(part, f"{name}_{i}", (foot[0], foot[1], foot[2] + height / 2), half, "zinc")
        geom.quat = [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]


def add_wedge(spec: Spec, base: Body, X_BP: Transform, corners: np.ndarray) -> None:
    """A block between the table and the underside of a tilted part, in the base's body (frame B)."""
    upper = X_BP.points(corners * [0.9, 0.9, 1.0])
    if upper[:, 2].max() < 1e-4:
        return
    lower = upper * [1.0, 1.0, 0.0]
    vertices = np.vstack([upper - [0.0, 0.0, 1e-5], lower])
    hull = ConvexHull(vertices, qhull_options="QJ")
    faces = hull.simplices.copy()
    outward = np.einsum(
        "ij,ij->i",
        np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]),
        hull.equations[:, :3],
    )
    faces[outward < 0] = faces[outward < 0][:, ::-1]
    mesh_geom(spec, base, "wedge", vertices, faces, "wedge")
