"""Scan views chosen from the part: few poses of the wrist camera that together see the groove's surroundings well.

What has to be seen comes from the part's nominal geometry, as a user knows it from the drawing: the surface about the
groove and how the part lies. This is knowledge for placing the camera alone; no seam finder ever receives it.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.counted import counted
from weldsim.errors import ViewError
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.scan.config import ScanConfig
from weldsim.scan.sight import Sight, make_sight

if TYPE_CHECKING:
    from weldsim.scene.world import World

SPACING = 0.008  # [m] between places to be seen
AIM = 0.06  # [m] between places aimed at
TILTS, HEADINGS, ROLLS, STANDOFFS = np.radians([0.0, 20.0, 38.0, 52.0]), 8, 8, (0.40, 0.36)
TWICE = 0.3  # what seeing a place a second time is worth: views are lined up by what they share
WIDE = np.radians(70.0)  # a surface is still shown, if not well, at this angle from its normal
LINK = 40  # places that two views must show for one to be lined up with the other
WORTH = 0.02  # share of the places that another view has to bring


@dataclass(frozen=True, eq=False, kw_only=True)
class ViewPlan:
    """Attributes: views, X_BC in the order in which they are taken; joints, (k, 6) [rad]; covered, share of the places seen;
    places, (n, 3) in B [m]; normals, (n, 3); seen, (n,) by how many views well."""

    views: tuple[Transform, ...]
    joints: Float[ndarray, "k 6"]
    covered: float
    places: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    seen: Int[ndarray, "n"]


def plan_views(world: "World", config: ScanConfig | None = None) -> ViewPlan:
    """The fewest views that greedy choice finds, reachable and clear, ordered so that the arm travels little.

    A place counts as seen when it is in the image, between the nearest and the farthest depth, within `incidence` of its
    normal and hidden by nothing.

    Raises:
        ViewError: places that no reachable view sees; the message says on which side of the part, and why.
    """
    config = config or ScanConfig()
    sight = make_sight(world)
    places, normals = groove_places(world, config.surroundings)
    candidates = _candidates(places, normals)
    sees = np.array([sight.sees(X, places, normals, config) for X in candidates])
    wide = replace(config, incidence=WIDE, farthest=1.5 * config.farthest, margin=0.0)
    shows = np.array([sight.sees(X, places, normals, wide) for X in candidates])
    chosen, tried = _cover(candidates, sees, sight, config)
    seen = np.zeros(len(places), bool)
    for k in chosen:
        seen |= sees[k]
    covered = float(seen.mean())
    if covered < config.coverage:
        raise _unseen(world, places, normals, seen, sees, tried, covered, config)
    _link(chosen, tried, candidates, shows, sight, config)
    taken = _needed(list(chosen), sees, shows, covered)
    order = [taken[i] for i in _order(np.array([chosen[k] for k in taken]), sight.home)]
    return ViewPlan(
        views=tuple(candidates[k] for k in order),
        joints=np.array([chosen[k] for k in order]),
        covered=covered,
        places=places,
        normals=normals,
        seen=sees[order].sum(axis=0),
    )


Chosen = dict[int, Float[ndarray, "6"]]  # joint angles by candidate


def _cover(
    candidates: list[Transform], sees: Bool[ndarray, "c n"], sight: Sight, config: ScanConfig
) -> tuple[Chosen, dict[int, str]]:
    """Candidates taken one by one, each the one that the arm can take and that adds most; and why others cannot be taken."""
    chosen: Chosen = {}
    tried: dict[int, str] = {}
    seen, least = np.zeros(sees.shape[1], np.int64), WORTH * sees.shape[1]
    while len(chosen) < config.most:
        new = (sees & (seen == 0)).sum(axis=1)
        gain = np.where(new >= least, new + TWICE * (sees & (seen == 1)).sum(axis=1), 0.0)
        gain[[*tried, *chosen]] = 0.0
        k = _first_in_reach(gain, candidates, sight, chosen, tried)
        if k is None:
            break
        seen = seen + sees[k]
    return chosen, tried


def _first_in_reach(
    gain: Float[ndarray, "c"], candidates: list[Transform], sight: Sight, chosen: Chosen, tried: dict[int, str]
) -> int | None:
    """The best candidate that the arm can take, now among the chosen; those that it cannot are noted with the reason."""
    for k in np.argsort(-gain, kind="stable"):
        if gain[k] <= 0:
            return None
        q = sight.reach(candidates[k])
        if not isinstance(q, str):
            chosen[int(k)] = q
            return int(k)
        tried[int(k)] = q
    return None


def _link(
    chosen: Chosen,
    tried: dict[int, str],
    candidates: list[Transform],
    shows: Bool[ndarray, "c n"],
    sight: Sight,
    config: ScanConfig,
) -> None:
    """Further views until each shares surface with the others: what shares none cannot be lined up."""
    while len(chosen) < config.most and len(parts := _islands(list(chosen), shows)) > 1:
        first = np.array([(shows & shows[k]).sum(axis=1) for k in parts[0]]).max(axis=0)
        others = np.array([(shows & shows[k]).sum(axis=1) for part in parts[1:] for k in part]).max(axis=0)
        gain = np.minimum(first, others).astype(float)
        gain[(gain < LINK) | np.isin(np.arange(len(gain)), [*tried, *chosen])] = 0.0
        if _first_in_reach(gain, candidates, sight, chosen, tried) is None:
            return


def _islands(views: list[int], shows: Bool[ndarray, "c n"]) -> list[list[int]]:
    """Views in groups that share at least LINK places, directly or through others."""
    left, out = list(views), []
    while left:
        group, edge = [], [left.pop(0)]
        while edge:
            k = edge.pop()
            group.append(k)
            near = [other for other in left if (shows[k] & shows[other]).sum() >= LINK]
            left = [other for other in left if other not in near]
            edge += near
        out.append(group)
    return out


def _needed(views: list[int], sees: Bool[ndarray, "c n"], shows: Bool[ndarray, "c n"], covered: float) -> list[int]:
    """The views without those that can be spared: nothing is then seen less, and no group falls apart."""
    count = len(_islands(views, shows))
    for k in list(views):
        fewer = [other for other in views if other != k]
        if fewer and sees[fewer].any(axis=0).mean() >= covered - 1e-9 and len(_islands(fewer, shows)) <= count:
            views = fewer
    return views


def groove_places(world: "World", reach: float) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Places of the part's surface within `reach` [m] of a groove, about SPACING apart, and their outward normals, in B; all of
    the surface that faces up where the part has no groove. What faces the table is left out."""
    from weldsim.scene.mesh_cache import cached_mesh

    mesh = cached_mesh(world.workpiece)
    points, normals = _sampled(mesh.vertices, mesh.faces[~mesh.groove])
    points, normals = world.X_BP.points(points), world.X_BP.vectors(normals)
    if mesh.groove.any():
        groove, _ = _sampled(mesh.vertices, mesh.faces[mesh.groove])
        near = KDTree(world.X_BP.points(groove)).query(points, distance_upper_bound=reach)[0] <= reach
    else:
        near = normals[:, 2] > 0.5
    near &= normals[:, 2] > -0.7
    # The flat ends in which a groove runs out are near it, but their normals lie along it: nothing of the seam is there.
    points, normals = points[near], normals[near]
    if mesh.groove.any():
        lines = np.concatenate([seam.opening_B for seam in world.known_seams]) if world.known_seams else points
        along = np.concatenate([seam.bisectors_B for seam in world.known_seams]) if world.known_seams else -normals
        nearest = np.asarray(KDTree(lines).query(points, k=min(40, len(lines)))[1]).reshape(len(points), -1)
        facing = -np.einsum("nkj,nj->nk", along[nearest], normals).T
        keep = facing.max(axis=0) > 0.5
        points, normals = points[keep], normals[keep]
    cell = np.floor(points / SPACING).astype(np.int64)
    _, first = np.unique(np.column_stack([cell, np.rint(2 * normals)]), axis=0, return_index=True)
    first.sort()
    return points[first], normals[first]


def _sampled(vertices: Float[ndarray, "n 3"], faces: Int[ndarray, "m 3"]) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"]]:
    """Places spread over triangles, four a square of SPACING, and their normals."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1) / 2
    rng = np.random.default_rng(0)
    pick = rng.choice(len(faces), int(np.clip(4 * area.sum() / SPACING**2, 500, 60_000)), p=area / area.sum())
    u, v = rng.random((2, len(pick), 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    return a[pick] + u * (b - a)[pick] + v * (c - a)[pick], unit(normal)[pick]


def _candidates(places: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"]) -> list[Transform]:
    """Cameras aimed at places AIM apart, along their normals and leaning from them, at several turns about the sight line."""
    cell = np.floor(places / AIM).astype(np.int64)
    _, aims = np.unique(np.column_stack([cell, np.rint(normals)]), axis=0, return_index=True)
    out = []
    for aim, tilt in product(np.sort(aims), TILTS):
        n = normals[aim]
        side = unit(np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0]))
        for heading in np.arange(HEADINGS if tilt > 0 else 1) * 2 * np.pi / HEADINGS:
            axis = matrix_from_rotation_vector(heading * n) @ side
            z = -(matrix_from_rotation_vector(tilt * axis) @ n)
            x = unit(np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z))
            R = np.stack([x, np.cross(z, x), z], axis=1)
            for roll, standoff in product(np.arange(ROLLS) * 2 * np.pi / ROLLS, STANDOFFS):
                out.append(Transform("BC", R @ matrix_from_rotation_vector(np.array([0.0, 0.0, roll])), places[aim] - standoff * z))
    return out


def _order(joints: Float[ndarray, "k 6"], home: Float[ndarray, "6"]) -> list[int]:
    """Always on to the view that is nearest in joint space."""
    left, at, order = list(range(len(joints))), home, []
    while left:
        nearest = min(left, key=lambda k: float(np.abs(joints[k] - at).max()))
        order.append(nearest)
        left.remove(nearest)
        at = joints[nearest]
    return order


def _unseen(
    world: "World",
    places: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    seen: Bool[ndarray, "n"],
    sees: Bool[ndarray, "c n"],
    refused: dict[int, str],
    covered: float,
    config: ScanConfig,
) -> ViewError:
    """Which side of the part is not seen and why."""
    missing = ~seen
    facing = np.rint(world.X_BP.inverse().vectors(normals[missing]))
    sides, count = np.unique(facing, axis=0, return_counts=True)
    side = sides[count.argmax()]
    names = [f"{'+' if value > 0 else '-'}{axis}" for value, axis in zip(side, "xyz", strict=True) if value]
    middle = places[missing].mean(axis=0)
    able = np.flatnonzero(sees[:, missing].any(axis=1))
    reasons = [refused[int(k)] for k in able if int(k) in refused]
    if not len(able):
        why = "no camera pose in range sees it unobstructed"
    elif reasons:
        tried = f"{len(reasons)} of {len(able)} camera poses that see it" if len(able) > 1 else "the one camera pose that sees it"
        why = f"{tried} {'was' if len(reasons) == 1 else 'were'} tried: " + max(set(reasons), key=reasons.count)
    else:
        why = f"more than {counted(config.most, 'view')} would be needed, or views that bring less than {WORTH:.0%}"
    return ViewError(
        f"scan: {1 - covered:.0%} of the groove's surroundings (limit {1 - config.coverage:.0%}) cannot be seen, most of it on the"
        f" part's {' '.join(names) or 'slanted'} side about ({middle[0]:.3f}, {middle[1]:.3f}, {middle[2]:.3f}) m in base: {why};"
        " turn or move the part, or give views by hand",
        position=tuple(middle),
        covered=covered,
        reason=why,
    )
