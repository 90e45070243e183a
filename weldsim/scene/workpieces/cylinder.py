"""A rolled plate, a piece of a horizontal cylinder, with a groove around it: the thesis's cylinder (table 6.4)."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import SIZE, TURN, Metre, Radian, require_within
from weldsim.scene.workpieces.base import Box, ClampPlace, LabelledMesh, SeamCurve, Workpiece
from weldsim.scene.workpieces.groove import GrooveConfig, GrooveSection, make_section
from weldsim.scene.workpieces.solid import ABOVE, SWEEP_STEP, Surface, cut, sweep

FACETS = 12  # boxes to collide with, along the arc


@dataclass(frozen=True)
class CylinderConfig:
    """A piece of a cylinder whose axis is horizontal, along P's y; P's origin is on the middle of its crest.

    Attributes:
        radius: of its outer surface [m].
        thickness: of its wall [m].
        length: along the axis [m].
        span: angle of the whole arc about the axis [rad].
    """

    radius: Metre = 0.300
    thickness: Metre = 0.020
    length: Metre = 0.200
    span: Radian = 64 / 180 * np.pi

    def __post_init__(self) -> None:
        require_within(self, {"radius": SIZE, "thickness": SIZE, "length": SIZE, "span": TURN}, "cylinder")


@final
@dataclass(frozen=True)
class Cylinder(Workpiece):
    """A rolled plate with one groove around it in the plane y = 0, open at both straight edges.

    Raises (by `make_cylinder`): SceneError.
    """

    shell: CylinderConfig
    groove: GrooveConfig
    section: GrooveSection

    @property
    def name(self) -> str:
        return "cylinder"

    @property
    def content(self) -> str:
        return repr(self)

    @property
    def end(self) -> float:
        """Angle from the crest at which the groove ends [rad]."""
        return self.shell.span / 2 - self.groove.margin / self.shell.radius

    def point(self, angle: Float[ndarray, "*n"], depth: float = 0.0) -> Float[ndarray, "*n 3"]:
        """Points `depth` [m] under the surface, in the plane of the groove, at angles [rad] from the crest."""
        r = self.shell.radius - depth
        return np.stack([r * np.sin(angle), np.zeros_like(angle), r * np.cos(angle) - self.shell.radius], axis=-1)

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        """The groove's seam: arcs about the axis, the opening of radius less half the misalignment."""
        angle = _angles(self.end, self.shell.radius)
        out = _out(angle)
        left = np.array([0.0, self.section.width / 2, 0.0])
        return (
            SeamCurve(
                opening=self.point(angle, self.section.opening_depth),
                root=self.point(angle, self.section.depth),
                left=self.point(angle, self.section.misalignment) + left,
                right=self.point(angle) - left,
                tangents=np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=1),
                bisectors=-out,
                s=(self.shell.radius - self.section.opening_depth) * (angle - angle[0]),
                name=self.name,
            ),
        )

    def build_mesh(self) -> LabelledMesh:
        shell, half = self.shell, self.shell.span / 2
        wall = np.array([[-1, -1], [1, -1], [1, 0], [-1, 0]]) * [shell.length / 2, shell.thickness]
        past = half + ABOVE / shell.radius
        low = self.section.misalignment
        # Left of travel is +y, across is positive to the right.
        step = np.array([[-shell.length / 2 - ABOVE, -low], [0.0, -low], [0.0, ABOVE], [-shell.length / 2 - ABOVE, ABOVE]])
        groove = self._arc(self.section.outline(ABOVE), past if self.groove.margin == 0 else self.end)
        return cut(self._arc(wall, half), [groove], [self._arc(step, past)] if low > 0 else ())

    def _arc(self, outline: Float[ndarray, "k 2"], half: float) -> Surface:
        """An outline carried along the arc to `half` [rad] on both sides of the crest, at the same angles every time."""
        inner = _angles(self.shell.span / 2, self.shell.radius)
        angle = inner[np.abs(inner) < half - 1e-9]
        angle = np.array([-half, *angle, half])
        return sweep(outline, self.point(angle), np.tile([0.0, -1.0, 0.0], (len(angle), 1)), _out(angle))

    def collision_boxes(self) -> tuple[Box, ...]:
        """Boxes within the wall, chord by chord."""
        shell, width = self.shell, self.shell.span / FACETS
        middle = (np.arange(FACETS) + 0.5) * width - shell.span / 2
        chord = shell.radius * np.cos(width / 2)  # the boxes' outer faces touch the surface at their edges
        inner = shell.radius - shell.thickness
        half = np.array([inner * np.tan(width / 2), shell.length / 2, (chord - inner) / 2])
        return tuple(
            Box(centre=self.point(np.array(a), shell.radius - (chord + inner) / 2), half=half, R=_frame(a))
            for a in middle
            if chord > inner
        )

    @property
    def base_corners(self) -> Float[ndarray, "k 3"]:
        """The lower corners of the two straight edges."""
        x, _, z = self.point(np.array(self.shell.span / 2), self.shell.thickness)
        y = self.shell.length / 2
        return np.array([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])

    def clamp_places(self, count: int) -> tuple[ClampPlace, ...]:
        """On the curved edges: at the crest, or well to both sides of it."""
        angles = {0: (), 2: (0.0,), 4: (-0.3 * self.shell.span, 0.3 * self.shell.span)}[count]
        places = []
        for side in (1.0, -1.0):
            for a in angles:
                R = _frame(a) @ np.diag([side, side, 1.0])
                edge = self.point(np.array(a)) + np.array([0.0, side * self.shell.length / 2, 0.0])
                places.append(ClampPlace(edge=edge, R=R, thickness=self.shell.thickness, limit=min(self.shell.length / 4, 0.045)))
        return tuple(places)


def make_cylinder(shell: CylinderConfig, groove: GrooveConfig) -> Cylinder:
    """The grooved rolled plate.

    Raises:
        SceneError: a size that is not positive or over 2 m, a wall as thick as the radius, more than a half turn of arc, a
            groove through the wall, wider than the part, or ending before it starts.
    """
    for key in ("radius", "thickness", "length"):
        value = getattr(shell, key)
        if not 0 < value <= 2.0:
            raise SceneError(f"cylinder: {key} {value * 1e3:g} mm must be over 0 and at most 2000 mm", key=key, limit=2.0)
    if not np.radians(5) <= shell.span <= np.pi:
        raise SceneError(
            f"cylinder: span {np.degrees(shell.span):g} deg must be 5 to 180 deg", key="span", limit=(np.radians(5), np.pi)
        )
    if shell.thickness > shell.radius / 2:
        raise SceneError(
            f"cylinder: thickness {shell.thickness * 1e3:g} mm must be at most half the radius {shell.radius * 1e3:g} mm",
            key="thickness",
            limit=shell.radius / 2,
        )
    section = make_section(groove)
    if section.depth >= shell.thickness:
        raise SceneError(
            f"groove: depth {section.depth * 1e3:g} mm reaches through the wall, {shell.thickness * 1e3:g} mm thick;"
            " make the groove shallower or the wall thicker",
            key="depth",
            limit=shell.thickness,
        )
    if section.width >= shell.length:
        raise SceneError(
            f"groove: width {section.width * 1e3:g} mm is wider than the cylinder, {shell.length * 1e3:g} mm long",
            key="width",
            limit=shell.length,
        )
    arc = shell.radius * shell.span
    if 2 * groove.margin >= arc - section.width:
        raise SceneError(
            f"groove: margins of {groove.margin * 1e3:g} mm leave no groove on an arc {arc * 1e3:.0f} mm long;"
            f" use less than {(arc - section.width) * 500:.0f} mm",
            key="margin",
            limit=(arc - section.width) / 2,
        )
    return Cylinder(shell, groove, section)


def _angles(half: float, radius: float) -> Float[ndarray, "n"]:
    """Angles [rad] from -half to half, at most SWEEP_STEP apart on the surface."""
    return np.linspace(-half, half, max(3, int(np.ceil(2 * half * radius / SWEEP_STEP)) + 1))


def _out(angle: Float[ndarray, "n"]) -> Float[ndarray, "n 3"]:
    """Unit normals out of the surface."""
    return np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)


def _frame(angle: float) -> Float[ndarray, "3 3"]:
    """x along travel, y along the axis, z out of the surface at an angle from the crest."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
