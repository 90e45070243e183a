"""The seams of a cloud as they can be seen, and what people should know of where they were found."""

from collections.abc import Callable

import numpy as np

from weldsim.cloud.visible import Side, sides
from weldsim.records import PointCloud, Seam, SeamFindings

BELOW = -0.15  # [m] a seam so far below the robot's base lies under the table on which the arm stands
DOWN = -0.5  # z of the outward normal of a seam that an arm on a table would have to weld overhead
OPPOSITE = -0.8  # cosine between a seam's outward normals and the way to the frame's origin: seen from there, it is behind
CAMERA_FRAME = 0.1  # [m] from the origin of the base no camera stands: the cloud is in the camera's own frame


def search(cloud: PointCloud, find: Callable[[PointCloud], SeamFindings]) -> tuple[PointCloud, SeamFindings, tuple[str, ...]]:
    """The cloud that was searched, its seams, and notes for people, one sentence each.

    What lies behind other points as seen from the viewpoint is left out. Without a viewpoint a cloud with two surfaces is
    searched as it is, and from either side; what gives the best seam is kept.

    Args:
        cloud: in B.  find: a seam finder.
    """
    seen = sides(cloud)
    tries = seen if len(seen) == 1 else (Side(cloud), *seen)
    found = [(side, find(side.cloud)) for side in tries]
    side, findings = max(found, key=lambda each: _worth(each[1]))
    notes = [*cloud.notes, *([side.note] if side.note else [])]
    return side.cloud, findings, tuple(notes + _places(side.cloud, findings.seams))


def _worth(findings: SeamFindings) -> float:
    return max(((0.1 + seam.confidence) * seam.length for seam in findings.seams), default=0.0)


def _places(cloud: PointCloud, seams: tuple[Seam, ...]) -> list[str]:
    """What is odd about where seams lie, for clouds that are in their camera's frame rather than the robot's."""
    notes = []
    own_frame = len(cloud.viewpoints) > 0 and float(np.linalg.norm(cloud.viewpoints, axis=1).max()) < CAMERA_FRAME
    if own_frame:
        notes.append("the camera stood at the origin: the path is in the camera's own frame, not in the robot's base")
    for number, seam in enumerate(seams, 1):
        z = float(np.median(seam.points_B[:, 2]))
        if z < BELOW:
            notes.append(
                f"seam {number} lies {-z:.2f} m below the robot's base: is the cloud in the base's frame, z up, or its camera's?"
            )
        elif not len(cloud.viewpoints) and _faces_away(seam):
            notes.append(
                f"seam {number} faces away from the origin: where the cloud is in its camera's own frame, the torch would come from"
                " behind the part"
            )
        elif not own_frame and float(seam.normals_B[:, 2].mean()) < DOWN:
            notes.append(
                f"seam {number} faces down: the torch would come from below; is z up in the cloud, and its viewpoint right?"
            )
    return notes


def _faces_away(seam: Seam) -> bool:
    """Whether a camera at the origin would have to look through the surface to see the seam."""
    middle, outward = seam.points_B.mean(axis=0), seam.normals_B.mean(axis=0)
    return float(outward @ -middle) < OPPOSITE * float(np.linalg.norm(middle)) * float(np.linalg.norm(outward))
