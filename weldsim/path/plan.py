"""plan_path: the torch path that welds a seam."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length, interpolate
from weldsim.errors import PathError
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.path.config import PathConfig
from weldsim.path.directions import limited, one_sided, smooth
from weldsim.path.interpolate import interpolate_poses
from weldsim.quantity import Metre
from weldsim.records import Seam, Segment, TorchPath

NODE: Metre = 1e-3  # between poses that get an orientation of their own; slerp fills in between
SHORTEST: Metre = 2e-3  # weld worth a path
MARGIN = 0.99  # of the turn limit: slerp of a pose that also rolls takes its axis along a slightly longer way
SLANT = np.cos(np.radians(20))  # wire nearer to travel than this has no side


def plan_path(seam: Seam, config: PathConfig | None = None) -> TorchPath:
    """The WELD along a seam: the tip on its points, the wire along its inward bisector, x along travel.

    The wire axis is minus the seam's normal, smoothed and limited in its turn, then leaned by work and travel angle about
    the seam point. Approach and retract belong to the cell and are added by motion planning. Around a ring the torch ends
    as it began.

    Args:
        seam: in B.
        config: process settings.
    Raises:
        PathError: the trims leave nothing to weld, or the seam's normal lies along its travel; `data`: length, s.
    """
    config = config or PathConfig()
    s, points, travel, wire = _nodes(*_trimmed(seam, config))
    around, middle = s, slice(None)
    if seam.closed and config.start_trim == config.end_trim == 0:
        around, travel, wire, middle = _three_rounds(s, travel, wire)
    wire = limited(around, smooth(around, wire, config.smoothing), MARGIN * config.turn_limit, ease=config.smoothing)[middle]
    travel = smooth(around, travel, config.smoothing)[middle]
    R = _frames(s, travel, wire) @ lean(config.work_angle, config.travel_angle)
    tip = points + (config.nominal_ctwd - config.ctwd) * R[:, :, 2]
    X_BT, at = interpolate_poses(Transform("BT", R, tip), config.step)
    n = len(X_BT)
    return TorchPath(
        X_BT=X_BT,
        s=at,
        speed=np.full(n, config.speed),
        arc_on=np.ones(n, bool),
        segments=(Segment.WELD,) * n,
        roll_free=config.roll_free,
        sigma=_sigma(seam, config, at / at[-1] if at[-1] > 0 else at),
    )


def plan_paths(
    seams: tuple[Seam, ...], config: PathConfig | None = None
) -> tuple[tuple[TorchPath | None, ...], dict[int, PathError]]:
    """The path along each seam, None where none can be laid, and why not, by the seam's index.

    Raises:
        PathError: there are seams and none of them allows a path.
    """
    paths: list[TorchPath | None] = []
    refused: dict[int, PathError] = {}
    for index, seam in enumerate(seams):
        try:
            paths.append(plan_path(seam, config))
        except PathError as error:
            paths.append(None)
            refused[index] = error
    if len(refused) < max(len(seams), 1):
        return tuple(paths), refused
    if len(refused) == 1:
        raise refused[0]
    listed = "; ".join(f"seam {index + 1}: {error}" for index, error in refused.items())
    raise PathError(f"no path along any of {len(seams)} seams: {listed}", **refused[0].data)


def lean(work_angle: float, travel_angle: float) -> Float[ndarray, "3 3"]:
    """R from the leaned torch to the upright one: the work angle about travel (x), then the travel angle about the new y."""
    across = matrix_from_rotation_vector(np.array([work_angle, 0.0, 0.0]))
    return across @ matrix_from_rotation_vector(np.array([0.0, travel_angle, 0.0]))


def _trimmed(seam: Seam, config: PathConfig) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Points [m], travel and wire directions between the trims, in the order of travel."""
    points, travel, wire = seam.points_B, seam.tangents_B, -seam.normals_B
    if config.reverse:
        points, travel, wire = points[::-1], -travel[::-1], wire[::-1]
    s = arc_length(points)
    start, end = config.start_trim, float(s[-1]) - config.end_trim
    if end - start < SHORTEST:
        left = max(end - start, 0.0)
        raise PathError(
            f"trims of {1e3 * config.start_trim:g} and {1e3 * config.end_trim:g} mm leave {1e3 * left:.1f} mm of a seam"
            f" {1e3 * s[-1]:.1f} mm long (least {1e3 * SHORTEST:g} mm)",
            length=float(s[-1]),
            limit=SHORTEST,
        )
    # A cut within a micrometre of a point would leave a step too short to have a direction.
    inside = s[(s > start + 1e-6) & (s < end - 1e-6)]
    at = np.concatenate([[start], inside, [end]])
    return interpolate(s, points, at), interpolate(s, travel, at), interpolate(s, wire, at)


def _nodes(
    points: Float[ndarray, "n 3"], travel: Float[ndarray, "n 3"], wire: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, "m"], Float[ndarray, "m 3"], Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """Arc length, points and unit directions, every chord cut into equal pieces of at most NODE; all given points are kept."""
    s = arc_length(points)
    pieces = np.maximum(np.ceil(np.diff(s) / NODE * (1 - 1e-9)).astype(int), 1)
    at = np.concatenate([*(np.linspace(a, b, k, endpoint=False) for a, b, k in zip(s[:-1], s[1:], pieces, strict=True)), s[-1:]])
    return at, interpolate(s, points, at), unit(interpolate(s, travel, at)), unit(interpolate(s, one_sided(wire), at))


def _three_rounds(
    s: Float[ndarray, "n"], travel: Float[ndarray, "n 3"], wire: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, "k"], Float[ndarray, "k 3"], Float[ndarray, "k 3"], slice]:
    """A ring travelled three times, and which part is the middle round: what is smoothed there knows no end."""
    n = len(s) - 1
    around = np.concatenate([s[:-1] - s[-1], s[:-1], s + s[-1]])
    travel, wire = (np.concatenate([v[:-1], v[:-1], v[:-1], v[:1]]) for v in (travel, wire))
    return around, travel, wire, slice(n, 2 * n + 1)


def _frames(s: Float[ndarray, "n"], travel: Float[ndarray, "n 3"], wire: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """R_BT: z along the wire, x along travel as far as it is square to the wire, y = z x x."""
    along = np.einsum("ij,ij->i", travel, wire)
    worst = int(np.abs(along).argmax())
    if abs(along[worst]) > SLANT:
        angle = np.degrees(np.arccos(abs(along[worst])))
        raise PathError(
            f"the seam's normal lies {angle:.0f} deg from its travel at s = {1e3 * s[worst]:.1f} mm (least 20 deg):"
            " no torch can stand there; scan again",
            s=float(s[worst]),
        )
    x = unit(travel - along[:, None] * wire)
    return np.stack([x, np.cross(wire, x), wire], axis=-1)


def _sigma(seam: Seam, config: PathConfig, share: Float[ndarray, "m"]) -> Float[ndarray, "m"] | None:
    """Standard deviation of the seam across travel at each pose [m], `share` of the way along the weld."""
    if seam.sigma is None:
        return None
    s = arc_length(seam.points_B)
    sigma = seam.sigma[::-1] if config.reverse else seam.sigma
    s = s[-1] - s[::-1] if config.reverse else s
    return np.interp(config.start_trim + share * (s[-1] - config.start_trim - config.end_trim), s, sigma)
