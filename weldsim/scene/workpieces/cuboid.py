"""A box with one groove over three of its faces, an inverted U: the thesis's cuboid (table 6.6)."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.frames import unit
from weldsim.quantity import SIZE, Metre, require_within
from weldsim.scene.workpieces.base import Box, ClampPlace, LabelledMesh, SeamCurve, Workpiece, edge_places
from weldsim.scene.workpieces.groove import GrooveConfig, GrooveSection, make_section
from weldsim.scene.workpieces.solid import ABOVE, SWEEP_STEP, Surface, block, cut, sweep


@dataclass(frozen=True)
class CuboidConfig:
    """A box; P's origin is the middle of its upper face, x along its length.

    Attributes:
        length: along x: between the two side faces that the groove runs down [m].
        width: along y [m].
        height: along z [m].
    """

    length: Metre = 0.420
    width: Metre = 0.200
    height: Metre = 0.330

    def __post_init__(self) -> None:
        require_within(self, {"length": SIZE, "width": SIZE, "height": SIZE}, "cuboid")

    @property
    def half(self) -> Float[ndarray, "3"]:
        return np.array([self.length, self.width, self.height]) / 2


@final
@dataclass(frozen=True)
class Cuboid(Workpiece):
    """A box whose groove climbs the face at -x, crosses the upper face, and descends the face at +x, in the plane y = 0.

    The corner convention: the known seam is the sharp polyline on the parent surface. The opening turns by 90 deg in one
    sample that lies on the box's edge; before and after it tangent and bisector are those of the face that the sample is on,
    and the sample itself has their middle (45 deg), as have its lips, which meet on the edge. The root turns where the two
    bottoms meet, depth inside of both faces; the samples within that of the edge share it, for nothing of the groove lies
    straight below them. With a misalignment every line turns on the bisecting plane of the edge in the same way, and within half
    of it from the edge the opening is not the very middle of the lips.

    Raises (by `make_cuboid`): SceneError.
    """

    body: CuboidConfig
    groove: GrooveConfig
    section: GrooveSection

    @property
    def name(self) -> str:
        return "cuboid"

    @property
    def content(self) -> str:
        return repr(self)

    def line(self, depth: float) -> Float[ndarray, "4 3"]:
        """Corners of the inverted U that lies `depth` [m] inside of the three faces, in the plane y = 0."""
        x, bottom = self.body.length / 2 - depth, -self.body.height + self.groove.margin
        return np.array([[-x, 0.0, bottom], [-x, 0.0, -depth], [x, 0.0, -depth], [x, 0.0, bottom]])

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        """The one seam over three faces; see the class for its corners."""
        section = self.section
        corners = self.line(section.opening_depth)
        sides = np.diff(corners, axis=0)
        lengths = np.linalg.norm(sides, axis=1)
        counts = np.ceil(lengths / SWEEP_STEP).astype(int)
        pieces = [corners[i] + np.linspace(0, 1, n + 1)[:-1, None] * sides[i] for i, n in enumerate(counts)]
        opening = np.vstack([*pieces, corners[-1:]])
        along = sides / lengths[:, None]
        tangents = np.vstack([np.repeat(along, counts, axis=0), along[-1:]])
        turns = np.cumsum(counts)[:2]
        tangents[turns] = unit(along[:2] + along[1:])
        inwards = np.cross([0.0, 1.0, 0.0], tangents)
        starts = np.concatenate([[0.0], np.cumsum(lengths)])
        s = np.concatenate([starts[i] + np.linspace(0, 1, n + 1)[:-1] * lengths[i] for i, n in enumerate(counts)])
        left = np.array([0.0, section.width / 2, 0.0])
        return (
            SeamCurve(
                opening=opening,
                root=self._under(opening, turns, section.depth),
                left=self._under(opening, turns, section.misalignment) + left,
                right=self._under(opening, turns, 0.0) - left,
                tangents=tangents,
                bisectors=inwards,
                s=np.append(s, starts[-1]),
                name=self.name,
            ),
        )

    def _under(self, opening: Float[ndarray, "n 3"], turns: ndarray, depth: float) -> Float[ndarray, "n 3"]:
        """The samples of the opening moved square to their face onto the U that lies `depth` inside, none past its corners."""
        corners, points = self.line(depth), opening.copy()
        first, last = turns
        points[:first, 0], points[last + 1 :, 0] = corners[0, 0], corners[3, 0]
        points[first : last + 1, 2] = corners[1, 2]
        points[:, 2] = np.minimum(points[:, 2], corners[1, 2])
        points[:, 0] = np.clip(points[:, 0], corners[1, 0], corners[2, 0])
        points[turns] = corners[1:3]
        return points

    def build_mesh(self) -> LabelledMesh:
        x, y, z = self.body.half
        low = self.section.misalignment
        steps = []
        if low > 0:
            far = y + ABOVE
            steps = [
                block((-x - ABOVE, 0.0, -low), (x + ABOVE, far, ABOVE)),
                block((-x - ABOVE, 0.0, -2 * z - ABOVE), (-x + low, far, ABOVE)),
                block((x - low, 0.0, -2 * z - ABOVE), (x + ABOVE, far, ABOVE)),
            ]
        return cut(block((-x, -y, -2 * z), (x, y, 0.0)), self._cutters(), steps)

    def _cutters(self) -> list[Surface]:
        """The section swept over each face, past its edges."""
        corners = self.line(0.0)
        past = ABOVE if self.groove.margin == 0 else 0.0
        runs = ((0, 1, (past, ABOVE)), (1, 2, (ABOVE, ABOVE)), (2, 3, (ABOVE, past)))
        outline, cutters = self.section.outline(ABOVE), []
        for i, j, (before, after) in runs:
            along = (corners[j] - corners[i]) / np.linalg.norm(corners[j] - corners[i])
            up = np.cross(along, [0.0, 1.0, 0.0])
            ends = np.stack([corners[i] - before * along, corners[j] + after * along])
            cutters.append(sweep(outline, ends, np.tile([0.0, -1.0, 0.0], (2, 1)), np.tile(up, (2, 1))))
        return cutters

    def collision_boxes(self) -> tuple[Box, ...]:
        return (Box(centre=np.array([0.0, 0.0, -self.body.height / 2]), half=self.body.half, R=np.eye(3)),)

    @property
    def base_corners(self) -> Float[ndarray, "k 3"]:
        x, y, _ = self.body.half
        z = -self.body.height
        return np.array([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])

    @property
    def flat_top(self) -> tuple[float, float]:
        return self.body.length, self.body.width

    def clamp_places(self, count: int) -> tuple[ClampPlace, ...]:
        return edge_places(count, self.body.length, self.body.width, self.body.height)


def make_cuboid(body: CuboidConfig, groove: GrooveConfig) -> Cuboid:
    """The grooved box.

    Raises:
        SceneError: a size that is not positive or over 2 m, a groove that is wider than the box, meets itself inside, or ends
            before it starts.
    """
    for key in ("length", "width", "height"):
        value = getattr(body, key)
        if not 0 < value <= 2.0:
            raise SceneError(f"cuboid: {key} {value * 1e3:g} mm must be over 0 and at most 2000 mm", key=key, limit=2.0)
    section = make_section(groove)
    if section.width >= body.width:
        raise SceneError(
            f"groove: width {section.width * 1e3:g} mm is wider than the cuboid, {body.width * 1e3:g} mm",
            key="width",
            limit=body.width,
        )
    deepest = min(body.length / 2, body.height)
    if section.depth >= deepest:
        raise SceneError(
            f"groove: depth {section.depth * 1e3:g} mm cuts the cuboid in two; use less than {deepest * 1e3:g} mm",
            key="depth",
            limit=deepest,
        )
    if groove.margin >= body.height - section.depth - section.width:
        longest = body.height - section.depth - section.width
        raise SceneError(
            f"groove: margin {groove.margin * 1e3:g} mm leaves no groove on a side {body.height * 1e3:g} mm high;"
            f" use less than {longest * 1e3:g} mm",
            key="margin",
            limit=longest,
        )
    return Cuboid(body, groove, section)
