"""Known seams, found seams, paths and logs made in closed form, for tests of metrics and reports: no cloud, no simulator."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.records import ExecutionLog, KnownSeam, PointCloud, Seam, SeamFindings, Segment, TorchPath


def sine_seam(
    rng: np.random.Generator, *, length: float = 0.2, amplitude: float = 0.012, width: float = 0.014, depth: float = 0.008
) -> KnownSeam:
    """A V-groove along one sine on a plate at a random pose in front of the robot, sampled every 0.4 mm or so."""
    X = Transform(
        "BP", matrix_from_rotation_vector(rng.normal(size=3) * 0.3), np.array([0.0, -0.5, 0.2]) + rng.uniform(-0.1, 0.1, 3)
    )
    x = np.linspace(-length / 2, length / 2, 600)
    k = 2 * np.pi / length
    line = np.stack([x, amplitude * np.sin(k * x), 0 * x], axis=1)
    tangent = unit(np.stack([1 + 0 * x, amplitude * k * np.cos(k * x), 0 * x], axis=1))
    up = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    left = np.cross(up, tangent)
    return KnownSeam(
        opening_B=X.points(line),
        root_B=X.points(line - depth * up),
        left_B=X.points(line + width / 2 * left),
        right_B=X.points(line - width / 2 * left),
        tangents_B=X.vectors(tangent),
        bisectors_B=X.vectors(-up),
        s=arc_length(line),
        name="sine",
    )


def left_of(known: KnownSeam) -> Float[ndarray, "n 3"]:
    """Unit vectors across the seam in the parent surface, to the left of travel."""
    return np.cross(-known.bisectors_B, known.tangents_B)


def found_seam(known: KnownSeam, error: Float[ndarray, "n"], sigma: float = 2e-4, every: int = 4) -> Seam:
    """The known seam as a finder would return it, moved across by `error` [m]."""
    shift = (error[:, None] * left_of(known))[::every]
    points = known.opening_B[::every] + shift
    return Seam(
        points_B=points,
        s=arc_length(points),
        tangents_B=known.tangents_B[::every],
        normals_B=-known.bisectors_B[::every],
        left_B=known.left_B[::every] + shift,
        right_B=known.right_B[::every] + shift,
        sigma=np.full(len(points), sigma),
        width=0.014,
        depth=0.006,
        residual=3e-4,
        confidence=0.93,
    )


def torch_path(seam: Seam, speed: float = 6e-3) -> TorchPath:
    """The path along a seam: wire along minus the normal, x along travel, 0.1 mm apart."""
    n = max(2, round(seam.length / 1e-4) + 1)
    at = np.linspace(0.0, seam.s[-1], n)
    p, z, x = (np.stack([np.interp(at, seam.s, c) for c in v.T], axis=1) for v in (seam.points_B, -seam.normals_B, seam.tangents_B))
    z = unit(z)
    y = unit(np.cross(z, x))
    R = np.stack([np.cross(y, z), y, z], axis=2)
    return TorchPath(
        X_BT=Transform("BT", R, p),
        s=arc_length(p),
        speed=np.full(n, speed),
        arc_on=np.ones(n, bool),
        segments=(Segment.WELD,) * n,
    )


def weld_log(
    path: TorchPath,
    rng: np.random.Generator,
    *,
    jitter: float = 0.0,
    factor: float = 1.0,
    period: float = 0.008,
    slow: tuple[float, float, float] | None = None,
    dwell: tuple[float, float] | None = None,
) -> ExecutionLog:
    """A weld along `path` at `factor` times its speed, with approach and retract 20 mm above, and jitter [m] of the tip.

    Args:
        slow: from and to where it is slower or faster [m], and how many times the speed it has there.
        dwell: where it stands still with the arc on [m], and for how long [s].
    """
    speed = float(path.speed[0]) * factor
    a, b, share = slow or (0.0, 0.0, 1.0)
    at = np.arange(0.0, path.s[-1], 1e-5)
    t_at = np.concatenate([[0.0], np.cumsum(1e-5 / (speed * np.where((at >= a) & (at < b), share, 1.0)))[:-1]])
    if dwell is not None:
        at, t_at = np.insert(at, k := int(dwell[0] / 1e-5), at[k]), np.insert(t_at, k, t_at[k])
        t_at[k + 1 :] += dwell[1]
    s = np.interp(np.arange(0.0, t_at[-1] + 1e-5 / speed, period), t_at, at)
    p = np.stack([np.interp(s, path.s, c) for c in path.X_BT.p.T], axis=1)
    index = np.searchsorted(path.s, s).clip(0, len(path.s) - 1)
    R = path.X_BT.R[index]
    lead = np.linspace(1.0, 0.0, 60)[:, None] * -0.02
    p = np.concatenate([p[0] + lead * R[0, :, 2], p, p[-1] + lead[::-1] * R[-1, :, 2]])
    p = p + jitter * rng.normal(size=p.shape)
    R = np.concatenate([np.repeat(R[:1], 60, 0), R, np.repeat(R[-1:], 60, 0)])
    k = len(p)
    t = np.arange(k) * period
    on = np.zeros(k, bool)
    on[60:-60] = True
    q = np.stack([-1.2 + 0.4 * np.sin(t / t[-1] * (i + 1)) - 0.3 * i for i in range(6)], axis=1)
    return ExecutionLog(
        t=t,
        q_cmd=q,
        q_act=q + 1e-4 * rng.normal(size=q.shape),
        qd_act=np.gradient(q, t, axis=0),
        X_BT_act=Transform("BT", R, p),
        s_cmd=np.concatenate([np.zeros(60), s, np.full(60, s[-1])]),
        arc_on=on,
        segments=(Segment.APPROACH,) * 60 + (Segment.WELD,) * len(s) + (Segment.RETRACT,) * 60,
        period=period,
        robot="closed form",
    )


def plate_cloud(known: KnownSeam, rng: np.random.Generator, *, n: int = 40_000, noise: float = 3e-4) -> tuple[PointCloud, ndarray]:
    """Points on the plate around the seam with the groove cut in, coloured, and which of them lie in the groove."""
    up, mid = -known.bisectors_B[0], known.opening_B.mean(axis=0)
    along = unit((known.opening_B[-1] - known.opening_B[0])[None])[0]
    side = np.cross(up, along)
    u, v = rng.uniform(-0.14, 0.14, n), rng.uniform(-0.09, 0.09, n)
    flat = mid + u[:, None] * along + v[:, None] * side
    distance = np.abs(known.opening_B[None, ::6] - flat[:, None]) @ np.ones(3)
    nearest = known.opening_B[::6][distance.argmin(axis=1)]
    gap = np.linalg.norm(flat - nearest, axis=1)
    inside = gap < 0.007
    height = np.where(inside, -0.008 * (1 - gap / 0.007), 0.0) + noise * rng.normal(size=n)
    points = flat + height[:, None] * up
    colours = np.clip(np.where(inside, 0.35, 0.55)[:, None] + 0.03 * rng.normal(size=(n, 3)), 0, 1)
    return PointCloud(points=points, colours=colours, viewpoints=(mid + 0.4 * up)[None]), inside


def findings(seams: tuple[Seam, ...], inside: ndarray) -> SeamFindings:
    """What a finder would return for these seams, the region being the groove's own points."""
    return SeamFindings(seams=seams, region=inside.astype(np.int32) if seams else np.zeros(len(inside), np.int32))
