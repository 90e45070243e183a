"""Views lined up with each other: a small correction of each camera's pose and depth, estimated jointly.

What makes views disagree is known in kind and size: an offset of each view's depth, one mistake of the hand-eye
calibration that all views share in their cameras' frames, and little else. The corrections are the most probable ones
given that (maximum a posteriori): surfaces that views share are drawn together along their normals, and what surfaces do
not tell, such as sliding along a plane, keeps its most probable value given what they do tell. How large mistakes are in
this cell is told by the views too (empirical Bayes): where noise alone explains how they differ, hardly anything is moved.

No view sees where the base is: a motion of all views together stays unknown, and the corrections leave it at its most
probable value, about the mean of the views. `Registration.unseen` says how far off that may be.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree
from threadpoolctl import threadpool_limits

from weldsim.cloud.config import RegisterConfig
from weldsim.cloud.patches import Patches, planar_patches
from weldsim.errors import CloudError
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.records import PointCloud

DOF = 7  # of a view: translation, rotation vector, depth offset
NORMAL_ARM = 0.03  # [m] a difference of normals counts as so much distance when partners are sought
ALIKE = 0.90  # least cosine between the normals of partners (26 deg)
ROUNDS = (0.010, 0.004, 0.0015, 0.0007, 0.0007)  # [m] distance at which a pair keeps a quarter of its say, round by round
SLACK = 3e-4  # [m] surfaces as a camera shows them are wrong by this much beyond their noise
SHARED = 0.25  # what one pair tells to begin with: neighbours share their noise
CLUSTERS = (0.02, 0.05)  # [m] cubes whose pairs' distances are added up, to see how far noise is shared
SETTLING = 4  # steps with the weights found from that
SCALES = (0.03, 0.1, 0.2, 0.35, 0.6, 1.0, 1.7)  # sizes of mistakes that are compared, over those expected
ENOUGH = 30  # pairs without which a view counts as alone
MOST = 2500  # patches of a view that take part


@dataclass(frozen=True, kw_only=True)
class ViewCorrection:
    """What was changed about one view.

    Attributes:
        depth: added to its depth [m].
        shift_C: motion of its camera, in its own frame [m].  turn: angle of it [rad].
        pairs: patches that other views see too.
        before, after: rms distance of those from the other views' surfaces, weighed by their noise [m]; None where there are none.
    """

    depth: float
    shift_C: tuple[float, float, float]
    turn: float
    pairs: int
    before: float | None
    after: float | None


@dataclass(frozen=True, kw_only=True)
class Registration:
    """How views were lined up.

    Attributes:
        views: one a view, in order.
        before, after: rms distance between shared surfaces, weighed alike, all views [m]; None where no two views share any.
        unseen: standard deviation of where the whole then lies, along the three axes of the base [m]: what no view can see.
        alone: views that share too little with any other, and are changed by what the others tell of the hand-eye alone.
    """

    views: tuple[ViewCorrection, ...]
    before: float | None
    after: float | None
    unseen: tuple[float, float, float]
    alone: tuple[int, ...] = ()


def lines(found: Registration | None) -> tuple[str, ...]:
    """For people: what was corrected, in millimetres; nothing for a single view."""
    if found is None:
        return ()
    if found.before is None or found.after is None:
        return ("views share no surface and are left as they are",)
    out = [
        f"views lined up: surfaces that two of them show {1e3 * found.before:.2f} mm apart, then {1e3 * found.after:.2f} mm (rms)"
    ]
    for i, view in enumerate(found.views, start=1):
        shift = 1e3 * float(np.linalg.norm(view.shift_C))
        what = f"view {i}: depth {1e3 * view.depth:+.2f} mm, camera {shift:.2f} mm and {np.degrees(view.turn):.2f} deg"
        out.append(what + ("; shares too little with any other" if i - 1 in found.alone else ""))
    x, y, z = (1e3 * sigma for sigma in found.unseen)
    return (*out, f"where all of it lies no view can tell: {x:.1f}, {y:.1f}, {z:.1f} mm (standard deviation along x, y, z)")


@dataclass(frozen=True, eq=False)
class _View:
    """One view at some correction x. Attributes: X, its pose X_BC; centres, normals, (n, 3) of its patches in B; seen, (n, 3)
    centres in C; rays, (n, 3) how centres move in C with depth."""

    X: Transform
    centres: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    seen: Float[ndarray, "n 3"]
    rays: Float[ndarray, "n 3"]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Partners in two views a, b: their patches' rows, and what a pair may weigh at most [1/m2]."""

    a: int
    b: int
    in_a: Int[ndarray, "k"]
    in_b: Int[ndarray, "k"]
    weight: Float[ndarray, "k"]


def register(
    clouds: Sequence[PointCloud], config: RegisterConfig | None = None
) -> tuple[tuple[PointCloud, ...], Registration | None]:
    """The clouds with poses and depths corrected, and what was corrected; a single cloud is returned as it is, with None.

    Args:
        clouds: one a view, in B, organised (each with `pixel`, `intrinsics` and `X_BC`).
        config: how large the mistakes are expected to be.
    Raises:
        CloudError: a view that does not know its pixels.
    """
    config = config or RegisterConfig()
    if len(clouds) < 2 or not config.enabled:
        return tuple(clouds), None
    patches = [_thinned(planar_patches(cloud)) for cloud in clouds]
    # Matrices of a few dozen rows: threads of the BLAS library would spend their time waiting for each other.
    with threadpool_limits(1, user_api="blas"):
        return _lined_up(clouds, patches, config)


def _lined_up(
    clouds: Sequence[PointCloud], patches: list[Patches], config: RegisterConfig
) -> tuple[tuple[PointCloud, ...], Registration]:
    poses = [cloud.X_BC for cloud in clouds if cloud.X_BC is not None]
    prior = _prior(len(clouds), config)
    x = np.zeros((len(clouds), DOF))
    start = views = _views(patches, poses, x)
    pairs, information = [], prior
    for scale in ROUNDS:
        pairs = _partners(patches, views, 3 * scale)
        for _ in range(2):
            information, pull = _normal_equations(views, pairs, scale, prior, x)
            x = x + np.linalg.solve(information, pull).reshape(x.shape)
            views = _views(patches, poses, x)
    factor = max(_overdispersion(views, pairs, size) for size in CLUSTERS)
    pairs = [replace(p, weight=p.weight / factor) for p in pairs]
    scaled = _scaled_prior(views, pairs, prior, x, config)
    for _ in range(SETTLING):
        information, pull = _normal_equations(views, pairs, ROUNDS[-1], scaled, x)
        x = x + np.linalg.solve(information, pull).reshape(x.shape)
        views = _views(patches, poses, x)
    moved = tuple(_corrected(cloud, view.X, float(row[6])) for cloud, view, row in zip(clouds, views, x, strict=True))
    return moved, _registration(start, views, x, pairs, information - scaled + prior)


def _thinned(patches: Patches) -> Patches:
    return patches.select(np.arange(0, len(patches), -(-len(patches) // MOST))) if len(patches) > MOST else patches


def _views(patches: list[Patches], poses: list[Transform], x: Float[ndarray, "v 7"]) -> list[_View]:
    """Patches as corrected views show them: deeper along their rays, then moved with the camera."""
    out = []
    for p, X_BC, row in zip(patches, poses, x, strict=True):
        z = p.centres[:, 2:]
        rays = p.centres / z
        seen = p.centres + row[6] * rays
        # A plane seen obliquely turns when all depths grow alike: n is carried by the inverse transpose of the change.
        tilt = row[6] / z[:, 0] ** 2 * np.einsum("ij,ij->i", p.centres, p.normals)
        normals = unit(p.normals + tilt[:, None] * np.array([0.0, 0.0, 1.0]))
        X = X_BC @ Transform("CC", matrix_from_rotation_vector(row[3:6]), row[:3])
        out.append(_View(X, X.points(seen), X.vectors(normals), seen, rays))
    return out


def _scaled_prior(
    views: list[_View], pairs: list[_Pairs], prior: Float[ndarray, "n n"], x: Float[ndarray, "v 7"], config: RegisterConfig
) -> Float[ndarray, "n n"]:
    """The prior with depth offsets and poses as far off as is likeliest here: both scales by marginal likelihood.

    About x, where the pull of the data balances the prior, minus its log likelihood is x' H x / 2 - h' x.
    """
    information, _ = _normal_equations(views, pairs, ROUNDS[-1], prior, x)
    data = information - prior
    _, pull = _normal_equations(views, pairs, ROUNDS[-1], np.zeros_like(prior), x)
    h = data @ x.ravel() + pull

    def likelihood(candidate: Float[ndarray, "n n"]) -> float:
        total = data + candidate
        return 0.5 * float(np.linalg.slogdet(candidate)[1] - np.linalg.slogdet(total)[1] + h @ np.linalg.solve(total, h))

    candidates = [_prior(len(views), config, offsets, poses) for offsets in SCALES for poses in SCALES]
    return max(candidates, key=likelihood)


def _prior(count: int, c: RegisterConfig, offsets: float = 1.0, poses: float = 1.0) -> Float[ndarray, "n n"]:
    """Inverse covariance of all views' mistakes: their own, and one that they share in their cameras' frames.

    Args:
        offsets, poses: factors on the standard deviations of the depths' offsets and of everything else.
    """
    own = np.diag(np.array([*[poses * c.view_sigma] * 3, *[poses * c.view_turn] * 3, offsets * c.offset_sigma]) ** 2)
    shared = np.diag(np.array([*[poses * c.hand_eye_sigma] * 3, *[poses * c.hand_eye_turn] * 3, 0.0]) ** 2)
    return np.linalg.inv(np.kron(np.eye(count), own) + np.kron(np.ones((count, count)), shared))


def _partners(patches: list[Patches], views: list[_View], reach: float) -> list[_Pairs]:
    """For every two views, patches of one with the nearest patch of the other that faces the same way, each way round."""
    features = [np.column_stack([view.centres, NORMAL_ARM * view.normals]) for view in views]
    trees = [KDTree(f) if len(f) else None for f in features]
    found = []
    for a, b in combinations(range(len(views)), 2):
        seen = []
        for here, there in ((a, b), (b, a)):
            tree = trees[there]
            if tree is None or not len(features[here]):
                continue
            gap = float(patches[here].spacing.max())
            index = np.asarray(tree.query(features[here], distance_upper_bound=reach + gap)[1])
            rows = np.flatnonzero(index < len(features[there]))
            seen.append(np.column_stack([rows, index[rows]])[:, :: 1 if here == a else -1])
        i, j = (np.unique(np.concatenate(seen), axis=0) if seen else np.zeros((0, 2), np.int64)).T
        r, m = _distance(views[a], views[b], i, j)
        apart = views[b].centres[j] - views[a].centres[i]
        aside = np.linalg.norm(apart - r[:, None] * m, axis=1)
        keep = (aside < np.maximum(patches[a].spacing[i], patches[b].spacing[j])) & (np.abs(r) < reach)
        keep &= np.einsum("ij,ij->i", views[a].normals[i], views[b].normals[j]) > ALIKE
        i, j = i[keep], j[keep]
        weight = SHARED / (patches[a].sigma[i] ** 2 + patches[b].sigma[j] ** 2 + SLACK**2)
        found.append(_Pairs(a, b, i, j, weight))
    return found


def _distance(a: _View, b: _View, i: Int[ndarray, "k"], j: Int[ndarray, "k"]) -> tuple[Float[ndarray, "k"], Float[ndarray, "k 3"]]:
    """How far patch j of b lies above patch i of a [m], along their mean normal, and that normal in B (symmetric point to
    plane: right to second order on curved surfaces too)."""
    m = unit(a.normals[i] + b.normals[j])
    return np.einsum("ij,ij->i", b.centres[j] - a.centres[i], m), m


def _row(view: _View, m: Float[ndarray, "k 3"], i: Int[ndarray, "k"]) -> Float[ndarray, "k 7"]:
    """How patches move along m with the correction of their view."""
    m_C = m @ view.X.R
    return np.column_stack([m_C, np.cross(view.seen[i], m_C), np.einsum("ij,ij->i", view.rays[i], m_C)])


def _normal_equations(
    views: list[_View], pairs: list[_Pairs], scale: float, prior: Float[ndarray, "n n"], x: Float[ndarray, "v 7"]
) -> tuple[Float[ndarray, "n n"], Float[ndarray, "n"]]:
    """Gauss-Newton matrix and right-hand side at x, pairs that disagree weighed down (Geman-McClure)."""
    matrix, pull = prior.copy(), -prior @ x.ravel()
    for p in pairs:
        if not len(p.in_a):
            continue
        a, b = views[p.a], views[p.b]
        r, m = _distance(a, b, p.in_a, p.in_b)
        w = p.weight * (scale**2 / (scale**2 + r**2)) ** 2
        J = np.hstack([-_row(a, m, p.in_a), _row(b, m, p.in_b)])
        at = np.concatenate([np.arange(DOF) + DOF * p.a, np.arange(DOF) + DOF * p.b])
        matrix[np.ix_(at, at)] += J.T @ (w[:, None] * J)
        pull[at] -= J.T @ (w * r)
    return matrix, pull


def _overdispersion(views: list[_View], pairs: list[_Pairs], size: float) -> float:
    """Variance of the pull of all pairs within cubes of `size` [m], over what independent pairs of their weights would have;
    at least 1. A depth camera's error is alike over centimetres: a thousand pairs there tell little more than one.
    """
    squares = total = 0.0
    for p in pairs:
        if len(p.in_a):
            r, _ = _distance(views[p.a], views[p.b], p.in_a, p.in_b)
            cube = np.floor(views[p.a].centres[p.in_a] / size).astype(np.int64)
            _, which = np.unique(cube, axis=0, return_inverse=True)
            squares += float((np.bincount(which.ravel(), weights=p.weight * r) ** 2).sum())
            total += float(p.weight.sum())
    return max(1.0, squares / total) if total else 1.0


def _registration(
    start: list[_View], views: list[_View], x: Float[ndarray, "v 7"], pairs: list[_Pairs], information: Float[ndarray, "n n"]
) -> Registration:
    was = [_distance(start[p.a], start[p.b], p.in_a, p.in_b)[0] for p in pairs]
    now = [_distance(views[p.a], views[p.b], p.in_a, p.in_b)[0] for p in pairs]

    def rms(distances: list[Float[ndarray, "_"]], which: Sequence[int]) -> float | None:
        squares, total = (
            sum(float(pairs[k].weight @ distances[k] ** 2) for k in which),
            sum(float(pairs[k].weight.sum()) for k in which),
        )
        return float(np.sqrt(squares / total)) if total else None

    corrections = []
    for i, row in enumerate(x):
        mine = [k for k, p in enumerate(pairs) if i in (p.a, p.b)]
        corrections.append(
            ViewCorrection(
                depth=float(row[6]),
                shift_C=(float(row[0]), float(row[1]), float(row[2])),
                turn=float(np.linalg.norm(row[3:6])),
                pairs=sum(len(now[k]) for k in mine),
                before=rms(was, mine),
                after=rms(now, mine),
            )
        )
    return Registration(
        views=tuple(corrections),
        before=rms(was, range(len(pairs))),
        after=rms(now, range(len(pairs))),
        unseen=_unseen(views, information),
        alone=tuple(i for i, view in enumerate(corrections) if view.pairs < ENOUGH),
    )


def _unseen(views: list[_View], information: Float[ndarray, "n n"]) -> tuple[float, float, float]:
    """Standard deviation of the views' mean motion at the middle of what they see [m], along B's axes."""
    middle = np.concatenate([view.centres for view in views]).mean(axis=0)
    blocks = []
    for view in views:
        x, y, z = view.X.inverse().points(middle[None])[0]
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        blocks.append(view.X.R @ np.column_stack([np.eye(3), -cross, [x / z, y / z, 1.0]]))
    mean = np.hstack(blocks) / len(views)
    sigma = np.sqrt(np.diag(mean @ np.linalg.solve(information, mean.T)))
    return float(sigma[0]), float(sigma[1]), float(sigma[2])


def _corrected(cloud: PointCloud, X_BC: Transform, depth: float) -> PointCloud:
    """The cloud with `depth` [m] added to every pixel's, as seen from another pose of its camera."""
    before = cloud.X_BC
    if before is None:
        raise CloudError("register: a view does not know its camera")
    local = (cloud.points - before.p) @ before.R
    local *= 1.0 + depth / local[:, 2:]
    return replace(
        cloud,
        points=X_BC.points(local),
        normals=None if cloud.normals is None else (X_BC @ before.inverse()).vectors(cloud.normals),
        viewpoints=X_BC.p[None],
        X_BC=X_BC,
    )
