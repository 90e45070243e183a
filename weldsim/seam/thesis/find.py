"""find_seams_thesis: chapter 5 of the thesis from cloud to ordered seam, unattended.

What makes the published program crash or run for ever (too few points, an ordering that revisits points) ends here in a
`Rejection`; its statistical behaviour is left as published. Where its operator chooses a groove, every groove is returned,
the one of most points first. It knows no lips, width, deviation or confidence: those fields stay empty.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.counted import counted
from weldsim.curves import arc_length
from weldsim.errors import CloudError
from weldsim.records import PointCloud, Rejection, Seam, SeamFindings, Threshold
from weldsim.seam.thesis import axes, boundary, clusters, descriptor, midpoints, mls, normals, order, thin, threshold, voxel
from weldsim.seam.thesis.config import ThesisConfig

FEWEST_POINTS = 13  # the published program crashes below this


def find_seams_thesis(cloud: PointCloud, config: ThesisConfig) -> SeamFindings:
    """Seams by the published method, that of most groove points first; none, with the reason, where it fails.

    Args:
        cloud: in B; viewpoints turn the normals (without them, up is towards the camera).
    Raises:
        CloudError: the cloud is not in the robot base.
    """
    if cloud.frame != "B":
        raise CloudError(f"the cloud is in frame {cloud.frame}; the seam finder wants the robot base B", frame=cloud.frame)
    if len(cloud) < FEWEST_POINTS:
        return _nothing(cloud, f"{counted(len(cloud), 'point')}; the method needs {FEWEST_POINTS}")
    points, cube, sight = reduce_cloud(cloud, config)
    if len(points) < FEWEST_POINTS:
        return _nothing(
            cloud,
            f"{counted(len(points), 'point')} after the {config.voxel * 1e3:g} mm voxel grid; the method needs {FEWEST_POINTS}",
        )
    turned = normals.normals_towards(points, sight, config.normal_radius)
    gradient = descriptor.gradient(points, turned, config.descriptor_radius, config.descriptor)
    limit = threshold.choose(gradient, config.descriptor) if config.threshold is None else config.threshold
    groove = np.flatnonzero(gradient > limit)
    rank = clusters.euclidean_clusters(points[groove], config.cluster_radius)
    seams, rejected, region = [], [], np.zeros(len(points), np.int64)
    sizes = np.bincount(rank)
    for k in np.flatnonzero(sizes >= config.cluster_size):
        member = groove[rank == k]
        seam = trace_seam(points[member], None if sight is None else sight[member], config)
        if isinstance(seam, Seam):
            seams.append(seam)
            region[member] = len(seams)
        else:
            rejected.append(seam)
    if len(sizes) == 0:
        rejected.append(_reject(points, f"no point's descriptor is above {limit:.3g}"))
    elif sizes[0] < config.cluster_size:
        largest = points[groove[rank == 0]]
        rejected.append(_reject(largest, f"largest cluster has {counted(int(sizes[0]), 'point')} (limit {config.cluster_size})"))
    used = Threshold(
        name="gradient descriptor",
        value=limit,
        unit="rad^4" if config.descriptor == "thesis" else "1",
        noise=float(np.median(gradient)),
    )
    return SeamFindings(seams=tuple(seams), region=region[cube], rejected=tuple(rejected), threshold=used, method="thesis")


def reduce_cloud(
    cloud: PointCloud, config: ThesisConfig
) -> tuple[Float[ndarray, "m 3"], Int[ndarray, "n"], Float[ndarray, "m 3"] | None]:
    """Voxel centroids smoothed by moving least squares (m, 3) [m], each cloud point's voxel, and where the camera that
    saw each voxel stood."""
    points, cube = voxel.voxel_centroids(cloud.points, config.voxel)
    origins, sight = cloud.sight_origins(), None
    if origins is not None:
        sight = np.empty_like(points)
        sight[cube[::-1]] = origins[::-1]  # the first point of each voxel speaks for it
    return (mls.smooth(points, config.mls_radius) if config.mls_radius > 0 else points), cube, sight


def trace_seam(groove: Float[ndarray, "n 3"], sight: Float[ndarray, "n 3"] | None, config: ThesisConfig) -> Seam | Rejection:
    """The ordered seam of one groove region, or why there is none (thesis 5.2.1-5.2.4).

    Args:
        groove: points of the region [m].  sight: where the camera that saw each stood [m], or None.
    """
    edge = groove[boundary.boundary(groove, config.boundary_normal_radius, config.boundary_radius, config.boundary_angle)]
    raw = midpoints.midpoints(edge, config.partner_start, config.partner_limit, config.partner_angle)
    if len(raw) == 0:
        return _reject(
            groove, f"none of {counted(len(edge), 'boundary point')} has a partner within {config.partner_limit * 1e3:g} mm"
        )
    knots = thin.thin(raw, config.thin_radius, config.thin_passes, config.thin_voxel)
    walk = order.walk_both_ways(knots, config.order_radius)
    line = knots[walk][config.end_cut : len(walk) - config.end_cut]
    if len(line) < 2:
        return _reject(
            groove,
            f"{counted(len(walk), 'ordered path point')}; {2 * config.end_cut + 2} are needed to cut {config.end_cut} a side",
        )
    outward = axes.plane_normals(line, groove, config.axis_radius)
    origin = None if sight is None else np.broadcast_to(sight.mean(axis=0), line.shape)
    return Seam(
        points_B=line,
        s=arc_length(line),
        tangents_B=axes.travel(line),
        normals_B=normals.towards(line, outward, origin),
        reference="opening",
    )


def _reject(points: ndarray, reason: str) -> Rejection:
    """A refusal placed at the middle of the points it is about."""
    if len(points) == 0:
        return Rejection(position_B=(0.0, 0.0, 0.0), length=0.0, reason=reason)
    x, y, z = (float(value) for value in points.mean(axis=0))
    return Rejection(position_B=(x, y, z), length=float(np.linalg.norm(np.ptp(points, axis=0))), reason=reason)


def _nothing(cloud: PointCloud, reason: str) -> SeamFindings:
    region = np.zeros(len(cloud), np.int64)
    return SeamFindings(seams=(), region=region, rejected=(_reject(cloud.points, reason),), method="thesis")
