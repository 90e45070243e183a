"""ThesisConfig: the constants of the published method, each with its source.

"thesis" = printed in chapter 5; "code" = read off the author's published program; "ours" = neither says.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from weldsim.errors import ConfigError
from weldsim.quantity import Metre, Radian, require_within

Descriptor = Literal["thesis", "code"]

RANGES = {
    "voxel": (1e-4, 0.05),
    "mls_radius": (0.0, 0.1),
    "normal_radius": (2e-4, 0.1),
    "descriptor_radius": (2e-4, 0.1),
    "cluster_radius": (2e-4, 0.1),
    "cluster_size": (1, 10_000_000),
    "boundary_normal_radius": (2e-4, 0.1),
    "boundary_radius": (2e-4, 0.1),
    "boundary_angle": (0.01, 6.3),
    "partner_start": (1e-4, 0.1),
    "partner_limit": (1e-4, 1.0),
    "partner_angle": (1e-3, 1.6),
    "thin_radius": (2e-4, 0.1),
    "thin_passes": (1, 10_000),
    "thin_voxel": (1e-4, 0.1),
    "order_radius": (2e-4, 1.0),
    "end_cut": (0, 10_000),
    "axis_radius": (2e-4, 0.5),
}


@dataclass(frozen=True, kw_only=True)
class ThesisConfig:
    """Settings of `find_seams_thesis`. Raises ConfigError for a radius or count outside its range."""

    voxel: Metre = 0.001
    """Edge of the cubes whose points are averaged before anything else (code)."""

    mls_radius: Metre = 0.005
    """Neighbourhood of the moving-least-squares smoothing (thesis 5.1.2 prints none; ours). 0 switches it off."""

    normal_radius: Metre = 0.010
    """Neighbourhood of the PCA normals (code; thesis eq 5.4-5.13)."""

    descriptor: Descriptor = "code"
    """"code": variance of n_c . n_j, then its variance. "thesis": variances of the angles theta and beta (eq 5.17-5.22),
    then their variance (eq 5.23). The code's is the default because it is what the author ran, and the stronger
    baseline: angles grow with the root of the dot product, so sensor noise stands higher in the printed form."""

    descriptor_radius: Metre = 0.010
    """Radius r of both variances (code)."""

    threshold: float | None = None
    """Descriptor above which a point is groove [1; rad^4 for "thesis"]. The operator types it there (code: useful values
    near 1e-10 to 1e-8); None = half the median of what Otsu's cut calls groove, see `threshold.choose`."""

    cluster_radius: Metre = 0.002
    """Groove points nearer than this belong to one groove (code)."""

    cluster_size: int = 500
    """Fewest points of a groove, after `voxel` (code)."""

    boundary_normal_radius: Metre = 0.005
    """Neighbourhood of the normals that the boundary test looks along (code)."""

    boundary_radius: Metre = 0.010
    """Neighbourhood of the boundary test (code)."""

    boundary_angle: Radian = np.pi / 2
    """A point is boundary when its neighbours, seen along the normal, leave a sector wider than this empty (code)."""

    partner_start: Metre = 0.001
    """First radius, and growth, of the search for the opposite edge (thesis 5.2.2; code)."""

    partner_limit: Metre = 0.050
    """Last radius of that search (code)."""

    partner_angle: Radian = 5 * np.pi / 180
    """Tolerance epsilon of eq 5.31 about a right angle to the edge's tangent (code)."""

    thin_radius: Metre = 0.003
    """Neighbourhood of the centroid passes (code; thesis eq 5.33)."""

    thin_passes: int = 50
    """Number of centroid passes (thesis 5.2.3; code)."""

    thin_voxel: Metre = 0.003
    """Edge of the cubes that merge the thinned points (code)."""

    order_radius: Metre = 0.030
    """The walk stops when nothing ahead is this near (code; the thesis prints 0.01 m)."""

    end_cut: int = 3
    """Points dropped at each end of the ordered line (code)."""

    axis_radius: Metre = 0.012
    """Groove points within this of a path point fit the plane whose normal is the wire axis (thesis 5.2.4; the code
    uses a ball of 0.1 m)."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "thesis")
        if self.threshold is not None and not self.threshold > 0:
            raise ConfigError(f"thesis.threshold = {self.threshold:g}: must be positive", key="threshold", value=self.threshold)
