"""What holds the part: step clamps, legs under a part above the table, a wedge under a tilted one, bolt heads as clutter."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull

from weldsim.errors import SceneError
from weldsim.frames import Transform
from weldsim.scene.config import FixtureConfig
from weldsim.scene.shapes import Body, Group, Spec, box, mesh_geom, rod
from weldsim.scene.workpieces.base import ClampPlace, Workpiece

BOLT_PLACES = ((-0.30, 0.33), (0.28, 0.30), (0.05, -0.30), (-0.33, -0.28), (0.34, -0.31), (0.0, 0.36))  # of length and width
CLAMPS = (0, 2, 4)
RAISED = 0.040  # [m] a part whose lowest corner is higher than this stands on legs
LEG = 0.020  # [m] half the width of a leg
STRAP = 0.012  # [m] thickness of a clamp's strap
HEEL = 0.073  # [m] from the part's edge to the middle of a clamp's heel


def add_fixture(spec: Spec, base: Body, part: Body, config: FixtureConfig, workpiece: Workpiece, X_BP: Transform) -> None:
    """Clamps and bolts in the part's body (frame P), what stands on the table in the base's (frame B).

    Raises:
        SceneError: a number of clamps that there are no places for, a clamp that reaches too far over the part or past its
            edge, bolts on a bent part or too many, or a name to be left out that nothing has.
    """
    raised = float(X_BP.points(workpiece.base_corners)[:, 2].min()) > RAISED
    if config.clamps not in CLAMPS:
        raise SceneError(f"fixture: clamps = {config.clamps}: must be one of {', '.join(map(str, CLAMPS))}", key="clamps")
    places = workpiece.clamp_places(config.clamps)
    _check_left_out(config, len(places))
    for i, place in enumerate(places):
        if f"clamp_{i}" in config.without:
            continue
        _check_overlap(config.overlap, place)
        _add_clamp(part, f"clamp_{i}", place, config.overlap, steps=not raised)
        if raised and config.stand:
            _add_post(base, f"clamp_{i}_post", X_BP, place)
    _add_bolts(part, config, workpiece.flat_top)
    if config.stand:
        add = _add_legs if raised else _add_wedge
        add(spec, base, X_BP, workpiece.base_corners)


def _check_overlap(overlap: float, place: ClampPlace) -> None:
    if not 0 < overlap <= place.limit:
        raise SceneError(
            f"fixture: a clamp's overlap of {overlap * 1e3:g} mm must be over 0 and at most {place.limit * 1e3:g} mm here",
            key="overlap",
            limit=place.limit,
        )


def _add_clamp(part: Body, name: str, place: ClampPlace, overlap: float, *, steps: bool) -> None:
    """A strap with its nose on the part and its heel on a step block or post, drawn down by a stud and nut."""
    body = part.add_body(name=name, pos=place.edge, quat=Transform("PS", place.R, place.edge).quaternion)
    foot = -place.thickness if steps else -0.020
    box(body, f"{name}_strap", (0.0, (0.075 - overlap) / 2, STRAP / 2), (0.0125, (0.075 + overlap) / 2, STRAP / 2), "clamp")
    box(body, f"{name}_nose", (0.0, -overlap / 2, STRAP + 0.002), (0.0125, overlap / 2, 0.002), "clamp")
    for i in range(3):
        height = -foot * (i + 1) / 3
        box(body, f"{name}_step_{i}", (0.0, 0.085 - 0.012 * i, foot + height / 2), (0.0125, 0.006, height / 2), "clamp")
    stud = 0.030
    rod(body, f"{name}_stud", (0.0, stud, foot), (0.0, stud, STRAP + 0.030), 0.005, "zinc")
    rod(body, f"{name}_washer", (0.0, stud, STRAP), (0.0, stud, STRAP + 0.0025), 0.012, "zinc")
    _add_hexagon(body, f"{name}_nut", (0.0, stud, STRAP + 0.0025), 0.0098, 0.010)
    half = (0.014, (0.091 + overlap) / 2, STRAP / 2 + 0.012)
    middle = (0.0, (0.091 - overlap) / 2, STRAP / 2 + 0.010)
    box(body, f"{name}_collision", middle, half, "collision", group=Group.COLLISION, collide=True)


def _add_post(base: Body, name: str, X_BP: Transform, place: ClampPlace) -> None:
    """A post on the table that carries a clamp's heel and stud, drawn as a column with a foot."""
    out = X_BP.R @ place.R
    under = X_BP.points(place.edge[None])[0] + out @ np.array([0.0, 0.055, -0.020])
    heading = np.arctan2(out[1, 1], out[0, 1])
    quat = [np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)]
    top = float(under[2])
    half = (0.036, 0.0125, top / 2)
    for suffix, size, group in (("", half, Group.SCENE), ("_collision", half, Group.COLLISION)):
        material, collide = ("collision", True) if suffix else ("frame", False)
        geom = box(base, f"{name}{suffix}", (under[0], under[1], top / 2), size, material, group=group, collide=collide)
        geom.quat = quat
    geom = box(base, f"{name}_foot", (under[0], under[1], 0.004), (0.048, 0.028, 0.004), "frame")
    geom.quat = quat


def _check_left_out(config: FixtureConfig, clamps: int) -> None:
    names = [*(f"clamp_{i}" for i in range(clamps)), *(f"clamp_bolt_{i}" for i in range(config.bolts))]
    unknown = [name for name in config.without if name not in names]
    if unknown:
        there = ", ".join(names) or "no clamp and no bolt"
        raise SceneError(f"fixture: without {unknown[0]!r}: this scene has {there}", key="without", name=unknown[0])


def _add_bolts(part: Body, config: FixtureConfig, top: tuple[float, float] | None) -> None:
    count = config.bolts
    if not 0 <= count <= len(BOLT_PLACES):
        raise SceneError(f"fixture: {count} bolts; at most {len(BOLT_PLACES)}", key="bolts", limit=len(BOLT_PLACES))
    if count and top is None:
        raise SceneError("fixture: bolts stand on a level surface, and this part has none; use bolts = 0", key="bolts", limit=0)
    for i, (u, v) in enumerate(BOLT_PLACES[:count]):
        if f"clamp_bolt_{i}" in config.without:
            continue
        x, y = u * top[0], v * top[1]  # type: ignore[index] - refused above
        name = f"clamp_bolt_{i}"
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


def _add_wedge(spec: Spec, base: Body, X_BP: Transform, corners: Float[ndarray, "k 3"]) -> None:
    """A block between the table and the underside of a tilted part."""
    upper = X_BP.points(corners * [0.9, 0.9, 1.0])
    if upper[:, 2].max() < 1e-4:
        return
    lower = upper * [1.0, 1.0, 0.0]
    _add_hull(spec, base, "wedge", np.vstack([upper - [0.0, 0.0, 1e-5], lower]), "wedge")


def _add_legs(spec: Spec, base: Body, X_BP: Transform, corners: Float[ndarray, "k 3"]) -> None:
    """A square leg under each corner of the underside, cut to its slope, and what a leg is to collide with."""
    feet = X_BP.points(corners)
    middle, normal = feet.mean(axis=0), X_BP.R[:, 2]
    inwards = middle[:2] - feet[:, :2]
    feet_xy = feet[:, :2] + inwards * np.minimum(1.0, 1.6 * LEG / np.linalg.norm(inwards, axis=1, keepdims=True))
    square = LEG * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for i, foot in enumerate(feet_xy):
        outline = foot + square
        height = feet[i, 2] - ((outline - feet[i, :2]) @ normal[:2]) / normal[2] - 1e-5
        upper = np.column_stack([outline, height])
        _add_hull(spec, base, f"stand_{i}", np.vstack([upper, upper * [1.0, 1.0, 0.0]]), "frame")
        top = float(height.min()) - 0.001
        centre, half = (foot[0], foot[1], top / 2), (LEG, LEG, top / 2)
        box(base, f"stand_{i}_collision", centre, half, "collision", group=Group.COLLISION, collide=True)


def _add_hull(spec: Spec, base: Body, name: str, vertices: Float[ndarray, "n 3"], material: str) -> None:
    """The convex hull of points in B, drawn."""
    hull = ConvexHull(vertices, qhull_options="QJ")
    faces = hull.simplices.copy()
    outward = np.einsum(
        "ij,ij->i",
        np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]),
        hull.equations[:, :3],
    )
    faces[outward < 0] = faces[outward < 0][:, ::-1]
    mesh_geom(spec, base, name, vertices, faces, material)
