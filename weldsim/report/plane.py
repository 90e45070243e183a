"""The plane that a plan view is drawn in: seen along the surface normal, or unrolled along a seam that bends over edges."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import project
from weldsim.frames import Transform, unit
from weldsim.records import PointCloud, Seam
from weldsim.report.view import view_frame

BENT = np.deg2rad(50.0)  # a seam whose surface turns further from the view than this is seen edge-on


@dataclass(frozen=True, eq=False, kw_only=True)
class Seen:
    """All as seen along one direction. Attribute: X_BS, z towards who looks."""

    X_BS: Transform
    title: str = "Seen along the surface normal"

    def points(self, points_B: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Coordinates along, across and over the surface [m]."""
        return self.X_BS.inverse().points(points_B)

    def arrows(self, ends_B: Float[ndarray, "n 2 3"]) -> Float[ndarray, "n 2 3"]:
        """Short lines, each as it lies beside its first end."""
        return self.points(ends_B.reshape(-1, 3)).reshape(-1, 2, 3)


@dataclass(frozen=True, eq=False, kw_only=True)
class Unrolled:
    """Arc length of a seam, offset to its left, height over its parent surface. Attribute: seam."""

    seam: Seam
    title: str = "Unrolled along the seam"

    def points(self, points_B: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Beyond an end the seam goes on straight."""
        seam = self.seam
        _, foot, s = project(points_B, seam.points_B)
        along, left, normal = self._axes(s)
        offset = points_B - foot
        ahead = np.einsum("ij,ij->i", offset, along)
        beyond = ((s <= seam.s[0]) & (ahead < 0)) | ((s >= seam.s[-1]) & (ahead > 0))
        across, over = np.einsum("ij,ij->i", offset, left), np.einsum("ij,ij->i", offset, normal)
        return np.stack([s + np.where(beyond, ahead, 0.0), across, over], axis=1)

    def arrows(self, ends_B: Float[ndarray, "n 2 3"]) -> Float[ndarray, "n 2 3"]:
        first = self.points(ends_B[:, 0])
        axes = self._axes(first[:, 0])
        way = ends_B[:, 1] - ends_B[:, 0]
        return np.stack([first, first + np.stack([np.einsum("ij,ij->i", way, axis) for axis in axes], axis=1)], axis=1)

    def _axes(self, s: Float[ndarray, "n"]) -> tuple[ndarray, ndarray, ndarray]:
        """Along, to the left of and out of the surface at arc lengths s [m]."""
        seam = self.seam
        index = np.searchsorted(seam.s, s).clip(0, len(seam.s) - 1)
        along, normal = seam.tangents_B[index], seam.normals_B[index]
        return along, unit(np.cross(normal, along)), normal


Plane = Seen | Unrolled


def plane_of(cloud: PointCloud, seams: tuple[Seam, ...], welded: int = 0) -> Plane:
    """Where a picture shows a cloud: along the normal, unless a seam would be seen edge-on then."""
    X_BS = view_frame(cloud, seams)
    if seams and bent(seams, X_BS):
        return Unrolled(seam=seams[min(welded, len(seams) - 1)])
    return Seen(X_BS=X_BS) if seams else Seen(X_BS=X_BS, title="Seen along the cloud's normal")


def bent(seams: tuple[Seam, ...], X_BS: Transform) -> bool:
    """Whether the surface of a seam turns away from the view, over a tenth of its length or more."""
    return any(np.mean(seam.normals_B @ X_BS.R[:, 2] < np.cos(BENT)) > 0.1 for seam in seams)
