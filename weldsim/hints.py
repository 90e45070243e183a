"""What may keep a seam from being found, and what to do: each remedy was tried on the very cloud, and found one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.cloud.files import check_plannable
from weldsim.cloud.filters import prepare
from weldsim.config import CellConfig
from weldsim.curves import project
from weldsim.errors import CloudError
from weldsim.frames import unit
from weldsim.records import PointCloud, Rejection, SeamFindings
from weldsim.seam.config import ProfileConfig
from weldsim.seam.find import find_seams
from weldsim.search import CAMERA_FRAME, search

THINNED = 0.002  # [m] between points, from which on narrow grooves do not show
ACROSS = 5  # points that a groove needs across its width; found at sweeps over the straight and the curved twin: three to six
WIDEST = 0.014  # [m] of the groove that the spacing needed is told for
NEAREST = 0.1  # [m] before a depth camera: nearer, it sees nothing
FLATTEST = 0.25  # sine of the angle between sight and surface: flatter, it sees no groove
STAND_OFF = 0.45  # [m] of the viewpoint that is tried in place of one that cannot be
AHEAD = 0.8  # cosine to the z axis, along which a camera looks in its own frame, of the way to the middle of its cloud
FARTHEST = 2.0  # [m] from a camera at the origin to a cloud in its own frame
NARROWER = (("max_width", "side_band"), ("side_band",))  # settings of the finder that are tried together on a narrow part
NARROW = {
    "max_width": 0.018,
    "side_band": 0.010,
}  # [m] what they are then; found at sweeps over land of 10 to 16 mm beside a groove
SAME = 0.010  # [m] between the middle of a refused candidate and a seam that is the same
OWN_FRAME = "; with --viewpoint 0 0 0 one is: the cloud looks like one in its camera's own frame, and so would be the path"


@dataclass(frozen=True)
class _Plane:
    """The plane that most of a cloud lies in: its middle [m], and its normal, upwards."""

    middle: Float[ndarray, "3"]
    normal: Float[ndarray, "3"]


def hint(cloud: PointCloud, config: CellConfig, rejected: Sequence[Rejection] = (), *, imaged: bool = False) -> str:
    """What to do about a cloud in which no seam was found, one clause after `; `; empty where nothing that was tried helps.

    A viewpoint that may be right is never doubted: without it a groove's place is off by millimetres.

    Args:
        cloud: as it was read, before `config.cloud` was applied.  rejected: candidates that were refused in it.
        imaged: whether from a depth image, whose viewpoint is right.
    """
    if config.cloud.voxel > 0 and _finds(cloud, replace(config, cloud=replace(config.cloud, voxel=0.0))):
        return f"; without cloud.voxel = {config.cloud.voxel * 1e3:g} mm a seam is found: make it smaller, or leave it out"
    if told := _of_limits(cloud, config):
        return told
    told = "" if imaged else _of_viewpoint(cloud, config) if len(cloud.viewpoints) == 1 else _of_frame(cloud, config)
    return told or hint_of_sides(cloud, config, rejected) or _of_spacing(cloud)


def hint_of_sides(cloud: PointCloud, config: CellConfig, rejected: Sequence[Rejection]) -> str:
    """With which settings a groove is found where a candidate was refused for the surface beside it: on a narrow part it is read
    past the part's edges. One clause after `; `; empty where none that was tried helps.

    Args:
        cloud, rejected: as for `hint`.
    """
    profile = config.seam.profile
    refused = [one.position_B for one in rejected if one.sideless and one.length >= profile.min_length]
    if not refused or config.seam.method != "profile":
        return ""
    for names in NARROWER:
        narrower = {name: NARROW[name] for name in names if NARROW[name] < getattr(profile, name)}
        if len(narrower) < len(names) or narrower.get("max_width", profile.max_width) <= profile.min_width:
            continue
        found = _found(cloud, replace(config, seam=replace(config.seam, profile=replace(profile, **narrower))))
        if found is not None and any(project(np.array(refused), seam.points_B)[0].min() < SAME for seam in found.seams):
            settings = " ".join(f'--set seam.profile.{name}="{value * 1e3:g} mm"' for name, value in narrower.items())
            then = replace(profile, **narrower)
            reach, before = ((0.5 * each.max_width + each.side_band) * 1e3 for each in (then, profile))
            how = f"the surface beside it is then read out to {reach:.0f} mm from its middle, not {before:.0f} mm"
            return f"; a groove is found with {settings}: {how}"
    return ""


def _of_limits(cloud: PointCloud, config: CellConfig) -> str:
    """Which of the finder's settings, if any, keep a seam from being found that is found with their defaults."""
    usual, own = ProfileConfig(), config.seam.profile
    changed = [f"seam.profile.{name}" for name, value in vars(own).items() if value != getattr(usual, name)]
    if config.seam.method != "profile" or not changed:
        return ""
    if not _finds(cloud, replace(config, seam=replace(config.seam, profile=usual))):
        return ""
    return f"; with the default{'' if len(changed) == 1 else 's'} of {' and '.join(changed)} a seam is found"


def _of_viewpoint(cloud: PointCloud, config: CellConfig) -> str:
    """Where the camera cannot have stood where it is said, and from where a seam is found."""
    (stood,) = cloud.viewpoints
    if float(np.linalg.norm(stood)) < CAMERA_FRAME:  # the camera's own frame has no upper side
        return ""
    plane = _plane(cloud)
    reason = _impossible(stood, cloud, plane)
    beside = float((stood - plane.middle) @ plane.normal) * float(-plane.middle @ plane.normal) > 0  # the origin's side
    if (reason is not None or beside) and _is_seen_from_origin(cloud, plane, config):
        return f"{OWN_FRAME}; --viewpoint is where the camera stood in the frame of the cloud"
    if reason is None:
        return ""
    other = plane.middle + STAND_OFF * plane.normal
    if not _finds(replace(cloud, viewpoints=other[None], view=None), config):
        return ""
    x, y, z = (f"{value:.3f}" for value in other)
    told = "({:.3f}, {:.3f}, {:.3f})".format(*stood)
    return f"; the viewpoint {told} m {reason}: is that where the camera stood? From --viewpoint {x} {y} {z} a groove is seen"


def _impossible(stood: Float[ndarray, "3"], cloud: PointCloud, plane: _Plane) -> str | None:
    """Why no camera saw the cloud from there; None where one may have."""
    nearest = float(KDTree(cloud.points).query(stood)[0])
    if nearest < NEAREST:
        return f"is {nearest * 1e3:.0f} mm from the cloud, under {NEAREST * 1e3:.0f} mm"
    rise = float(unit(stood - plane.middle) @ plane.normal)
    if rise < -FLATTEST:
        return "lies below the surface that it saw"
    if rise < FLATTEST:
        return (
            f"sees the surface at {np.degrees(np.arcsin(max(rise, 0.0))):.0f} deg, under {np.degrees(np.arcsin(FLATTEST)):.0f} deg"
        )
    return None


def _of_frame(cloud: PointCloud, config: CellConfig) -> str:
    """Whether the cloud is in the frame of the camera that saw it."""
    return OWN_FRAME if not len(cloud.viewpoints) and _is_seen_from_origin(cloud, _plane(cloud), config) else ""


def _is_seen_from_origin(cloud: PointCloud, plane: _Plane, config: CellConfig) -> bool:
    """Whether the cloud lies before a camera at the origin, as in a camera's own frame, and a seam is found from there."""
    nearest = float(np.sqrt(np.einsum("ij,ij->i", cloud.points, cloud.points).min()))
    sight = unit(plane.middle)
    if not NEAREST < nearest < FARTHEST or abs(float(sight[2])) < AHEAD or abs(float(sight @ plane.normal)) < FLATTEST:
        return False
    return _finds(replace(cloud, viewpoints=np.zeros((1, 3)), view=None), config)


def _of_spacing(cloud: PointCloud) -> str:
    """Whether the points lie too far apart for narrow grooves, and how near they must be."""
    spacing = _spacing(cloud.points)
    if spacing < THINNED:
        return ""
    needed = f"one of {WIDEST * 1e3:.0f} mm needs them {WIDEST / ACROSS * 1e3:.1f} mm apart"
    if spacing <= WIDEST / ACROSS:
        needed = f"one under {spacing * ACROSS * 1e3:.0f} mm does not"
    return (
        f"; its points lie {spacing * 1e3:.1f} mm apart, and a groove shows with {ACROSS} across its width: {needed};"
        " thin it less, or scan from nearer"
    )


def _spacing(points: Float[ndarray, "n 3"]) -> float:
    """Distance between points of a square grid that is as dense as the cloud's surface [m], from the eighth neighbours."""
    looks = points[:: max(1, len(points) // 2_000)]
    distance, _ = KDTree(points).query(looks, k=9)
    return float(np.median(distance[:, -1]) * np.sqrt(np.pi / 8))


def _plane(cloud: PointCloud) -> _Plane:
    """The plane of most points, found again without those that lie off it."""
    points = cloud.points[:: max(1, len(cloud) // 20_000)]
    kept = np.ones(len(points), bool)
    middle, normal = points.mean(axis=0), np.array([0.0, 0.0, 1.0])
    for _ in range(6):
        middle = points[kept].mean(axis=0)
        normal = np.linalg.eigh(np.cov((points[kept] - middle).T))[1][:, 0]
        off = np.abs((points - middle) @ normal)
        kept = off <= max(2.5 * float(np.median(off)), 1e-5)
    leading = normal[2] if abs(normal[2]) > 0.05 else -normal[1]
    return _Plane(middle, normal if leading >= 0 else -normal)


def _finds(cloud: PointCloud, config: CellConfig) -> bool:
    """Whether a seam is found in the cloud as `weldsim plan` would look for it."""
    found = _found(cloud, config)
    return found is not None and bool(found.seams)


def _found(cloud: PointCloud, config: CellConfig) -> SeamFindings | None:
    """What `weldsim plan` would find in the cloud; None where it would not look."""
    try:
        cloud = prepare(cloud, config.cloud)
        check_plannable(cloud)
    except CloudError:
        return None
    return search(cloud, lambda each: find_seams(each, config.seam))[1]
