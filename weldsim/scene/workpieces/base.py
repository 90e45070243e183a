"""What a workpiece is to the rest of the scene: a labelled solid, the seams it truly has, and simple bodies to collide with."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.errors import RecordError
from weldsim.frames import Transform, read_only, unit
from weldsim.records import KnownSeam

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False, kw_only=True)
class LabelledMesh:
    """A closed triangle mesh in the part frame P, each face known to belong to a groove or to the parent surface.

    Attributes:
        vertices: (n, 3) [m].
        faces: (m, 3) indices, counter-clockwise seen from outside.
        groove: (m,) True on the walls and the bottom of a groove.
    """

    vertices: Float[ndarray, "n 3"]
    faces: Int[ndarray, "m 3"]
    groove: Bool[ndarray, "m"]

    def __post_init__(self) -> None:
        if self.faces.size and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise RecordError("LabelledMesh.faces: an index names no vertex", field="faces")
        for name in ("vertices", "faces", "groove"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def part(self, *, groove: bool) -> tuple[Float[ndarray, "k 3"], Int[ndarray, "j 3"]]:
        """Vertices and faces of the groove's surface alone, or of everything but it (both are open surfaces)."""
        faces = self.faces[self.groove == groove]
        used, index = np.unique(faces, return_inverse=True)
        return self.vertices[used], index.reshape(-1, 3)

    def to_trimesh(self) -> "trimesh.Trimesh":
        """The whole solid as a trimesh, vertices untouched."""
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)


@dataclass(frozen=True, eq=False, kw_only=True)
class Box:
    """A box to collide with, in P.

    Attributes:
        centre: (3,) [m].  half: (3,) half edge lengths [m].  R: (3, 3) orientation in P.
    """

    centre: Float[ndarray, "3"]
    half: Float[ndarray, "3"]
    R: Float[ndarray, "3 3"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ClampPlace:
    """Where a step clamp can hold the part, in P.

    Attributes:
        edge: (3,) a point of the upper surface at the part's edge [m].
        R: (3, 3) x along the edge, y outwards from the part, z out of the surface.
        thickness: of the part there [m].  limit: how far over the part the clamp may reach [m].
    """

    edge: Float[ndarray, "3"]
    R: Float[ndarray, "3 3"]
    thickness: float
    limit: float


def edge_places(count: int, length: float, width: float, thickness: float) -> tuple[ClampPlace, ...]:
    """Clamps on the two long sides of a flat top, `length` along x and `width` along y [m]: one a side, or two."""
    across = {0: (), 2: ((0.0, 1), (0.0, -1)), 4: ((-0.3, 1), (0.3, 1), (-0.3, -1), (0.3, -1))}[count]
    limit = min(width / 4, 0.045)
    return tuple(
        ClampPlace(
            edge=np.array([along * length, side * width / 2, 0.0]),
            R=np.diag([float(side), float(side), 1.0]),
            thickness=thickness,
            limit=limit,
        )
        for along, side in across
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class SeamCurve:
    """A true seam in the part frame P, sampled from its closed form.

    Attributes:
        opening, root, left, right: (n, 3) [m].  tangents: (n, 3) unit, along travel.
        bisectors: (n, 3) unit, inward; the parent surface's outward normal, on either side of a groove, is their opposite.
        s: (n,) arc length of the opening [m].  name: workpiece and branch.
    """

    opening: Float[ndarray, "n 3"]
    root: Float[ndarray, "n 3"]
    left: Float[ndarray, "n 3"]
    right: Float[ndarray, "n 3"]
    tangents: Float[ndarray, "n 3"]
    bisectors: Float[ndarray, "n 3"]
    s: Float[ndarray, "n"]
    name: str

    @property
    def normals(self) -> Float[ndarray, "n 3"]:
        """(n, 3) unit, out of the face that the groove is cut into."""
        return -self.bisectors

    def in_base(self, X_BP: Transform) -> KnownSeam:
        """The same seam expressed in the robot base."""
        return KnownSeam(
            opening_B=X_BP.points(self.opening),
            root_B=X_BP.points(self.root),
            left_B=X_BP.points(self.left),
            right_B=X_BP.points(self.right),
            tangents_B=unit(X_BP.vectors(self.tangents)),
            bisectors_B=unit(X_BP.vectors(self.bisectors)),
            s=self.s,
            name=self.name,
        )


class Workpiece(ABC):
    """A part in its own frame P: origin on the surface to be welded, z outwards, x along the nominal travel."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What it is called in reports."""

    @property
    @abstractmethod
    def content(self) -> str:
        """Text that is equal for equal geometry: the key under which its mesh is cached."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What people should know of how it was made, one sentence each."""
        return ()

    @abstractmethod
    def build_mesh(self) -> LabelledMesh:
        """The solid, computed afresh."""

    @abstractmethod
    def seam_curves(self) -> tuple[SeamCurve, ...]:
        """The true seams in P, in closed form; none for a part that has none."""

    @abstractmethod
    def collision_boxes(self) -> tuple[Box, ...]:
        """Boxes that cover the part."""

    @property
    @abstractmethod
    def base_corners(self) -> Float[ndarray, "k 3"]:
        """Corners of the convex outline of its underside [m], in P: what it rests on."""

    @property
    def flat_top(self) -> tuple[float, float] | None:
        """Length along x and width along y [m] of a level upper face about P's origin; None where it is bent."""
        return None

    @abstractmethod
    def clamp_places(self, count: int) -> tuple[ClampPlace, ...]:
        """Where 0, 2 or 4 clamps hold it."""

    @property
    def seams_are_known(self) -> bool:
        """Whether somebody knows where the seams are, or that there are none."""
        return True

    @property
    def region_is_known(self) -> bool:
        """Whether somebody knows which of its surface lies in a groove."""
        return self.seams_are_known

    def known_seams(self, X_BP: Transform) -> tuple[KnownSeam, ...]:
        """The true seams expressed in the robot base."""
        return tuple(curve.in_base(X_BP) for curve in self.seam_curves())
