"""Flat plates: one with a straight or curved groove, and a plain one that has no seam."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import SIZE, Metre, require_within
from weldsim.scene.workpieces.base import Box, ClampPlace, LabelledMesh, SeamCurve, Workpiece, edge_places
from weldsim.scene.workpieces.centre_line import CentreLine, CentreLineConfig, make_centre_line
from weldsim.scene.workpieces.groove import GrooveConfig, GrooveSection, make_section
from weldsim.scene.workpieces.solid import ABOVE, SWEEP_STEP, Surface, block, cut, extrude, sweep

GROWING = 1.15 ** np.arange(30)  # times the least radius: radii that are tried in the place of one that is too small


@dataclass(frozen=True)
class PlateConfig:
    """A rectangular plate; P's origin is the middle of its upper face, x along its length.

    Attributes:
        length: along x [m].
        width: along y [m].
        thickness: along z [m].
    """

    length: Metre = 0.240
    width: Metre = 0.225
    thickness: Metre = 0.020

    def __post_init__(self) -> None:
        require_within(self, {"length": SIZE, "width": SIZE, "thickness": SIZE}, "plate")

    def checked(self) -> "PlateConfig":
        """Itself. Raises SceneError for a size that is not positive or over 2 m."""
        for key in ("length", "width", "thickness"):
            value = getattr(self, key)
            if not 0 < value <= 2.0:
                raise SceneError(f"plate: {key} {value * 1e3:g} mm must be over 0 and at most 2000 mm", key=key, limit=2.0)
        return self

    @property
    def half(self) -> Float[ndarray, "3"]:
        return np.array([self.length, self.width, self.thickness]) / 2


class FlatPlate(Workpiece):
    """What a plate is whatever is cut into it."""

    plate: PlateConfig

    def collision_boxes(self) -> tuple[Box, ...]:
        centre = np.array([0.0, 0.0, -self.plate.thickness / 2])
        return (Box(centre=centre, half=self.plate.half, R=np.eye(3)),)

    @property
    def base_corners(self) -> Float[ndarray, "k 3"]:
        x, y, _ = self.plate.half
        z = -self.plate.thickness
        return np.array([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])

    @property
    def flat_top(self) -> tuple[float, float]:
        return self.plate.length, self.plate.width

    def clamp_places(self, count: int) -> tuple[ClampPlace, ...]:
        return edge_places(count, self.plate.length, self.plate.width, self.plate.thickness)


@final
@dataclass(frozen=True)
class PlainPlate(FlatPlate):
    """A plate without a seam."""

    plate: PlateConfig

    @property
    def name(self) -> str:
        return "plain plate"

    @property
    def content(self) -> str:
        return repr(self)

    def build_mesh(self) -> LabelledMesh:
        vertices, faces = _blank(self.plate.checked())
        return LabelledMesh(vertices=vertices, faces=faces, groove=np.zeros(len(faces), bool))

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        return ()


@final
@dataclass(frozen=True)
class GroovePlate(FlatPlate):
    """A plate with one groove, its cross-section constant and square to the centre line.

    Raises (by `make_groove_plate`): SceneError.
    """

    plate: PlateConfig
    groove: GrooveConfig
    section: GrooveSection
    line: CentreLine

    @property
    def name(self) -> str:
        return "groove plate"

    @property
    def content(self) -> str:
        return repr(self)

    @property
    def end(self) -> float:
        """|x| at which the groove's centre line ends [m]."""
        return self.plate.length / 2 - self.groove.margin

    def stations(self) -> Float[ndarray, "n"]:
        """x of the cross-sections [m], at most SWEEP_STEP apart along the line."""
        x = np.linspace(-self.end, self.end, 2001)
        s = self.line.arc_length(x)
        n = int(np.ceil((s[-1] - s[0]) / SWEEP_STEP)) + 1
        stations = np.interp(np.linspace(s[0], s[-1], n), s, x)
        stations[[0, -1]] = -self.end, self.end
        return stations

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        """The groove's seam. Near a plate edge that the line meets at an angle, one lip ends before the centre line does and
        the other after it; the samples there are those of the groove before the plate was cut off."""
        x = self.stations()
        n = len(x)
        centre = np.stack([x, self.line.y(x), np.zeros(n)], axis=1)
        tangents = np.column_stack([self.line.tangents(x), np.zeros(n)])
        left = np.column_stack([-tangents[:, 1], tangents[:, 0], np.zeros(n)])
        down = np.broadcast_to(np.array([0.0, 0.0, -1.0]), (n, 3))
        s = self.line.arc_length(x)
        return (
            SeamCurve(
                opening=centre + self.section.opening_depth * down,
                root=centre + self.section.depth * down,
                left=centre + self.section.width / 2 * left + self.section.misalignment * down,
                right=centre - self.section.width / 2 * left,
                tangents=tangents,
                bisectors=np.array(down),
                s=s - s[0],
                name=self.name,
            ),
        )

    def build_mesh(self) -> LabelledMesh:
        return cut(_blank(self.plate), [self._cutter()], [self._lower_side()] if self.section.misalignment > 0 else ())

    def _cutter(self) -> Surface:
        """The material the groove removes: its section swept along the line, run out past the edges along the end tangents."""
        centres, tangents = self._centres()
        outline = self.section.outline(ABOVE)
        if self.groove.margin == 0:
            half = float(np.abs(outline[:, 0]).max())
            centres, tangents = _run_out(centres, tangents, (half * np.abs(tangents[[0, -1], 1]) + ABOVE) / tangents[[0, -1], 0])
        right = np.column_stack([tangents[:, 1], -tangents[:, 0]])
        flat = np.zeros((len(centres), 1))
        up = np.tile([0.0, 0.0, 1.0], (len(centres), 1))
        return sweep(outline, np.hstack([centres, flat]), np.hstack([right, flat]), up)

    def _lower_side(self) -> Surface:
        """What the left of the line lacks where it lies lower than the right, from edge to edge."""
        centres, tangents = self._centres()
        reach = (np.full(2, self.groove.margin + ABOVE)) / tangents[[0, -1], 0]
        line, _ = _run_out(centres, tangents, reach)
        far = self.plate.width
        outline = np.vstack([line, [[line[-1, 0], far], [line[0, 0], far]]])
        return extrude(outline, -self.section.misalignment, ABOVE)

    def _centres(self) -> tuple[Float[ndarray, "n 2"], Float[ndarray, "n 2"]]:
        """The centre line and its unit tangents, seen from above."""
        x = self.stations()
        return np.column_stack([x, self.line.y(x)]), self.line.tangents(x)


def _run_out(
    centres: Float[ndarray, "n 2"], tangents: Float[ndarray, "n 2"], reach: Float[ndarray, "2"]
) -> tuple[Float[ndarray, "m 2"], Float[ndarray, "m 2"]]:
    """The line carried on straight by reach[0] before its start and reach[1] after its end [m], tangents with it."""
    first, last = centres[0] - reach[0] * tangents[0], centres[-1] + reach[1] * tangents[-1]
    return np.vstack([first, centres, last]), np.vstack([tangents[:1], tangents, tangents[-1:]])


def make_groove_plate(plate: PlateConfig, groove: GrooveConfig, centre_line: CentreLineConfig) -> GroovePlate:
    """The grooved plate, with every contradiction refused.

    Raises:
        SceneError: a groove deeper than the plate, wider than it, leaving it sideways, ending before it starts, or bent tighter
            than half its width.
    """
    plate = plate.checked()
    section = make_section(groove)
    check_depth(section, plate)
    if section.width >= plate.length:
        raise SceneError(
            f"groove: width {section.width * 1e3:g} mm is wider than the plate is long, {plate.length * 1e3:g} mm",
            key="width",
            limit=plate.length,
        )
    if 2 * groove.margin >= plate.length - section.width:
        raise SceneError(
            f"groove: margins of {groove.margin * 1e3:g} mm leave no groove on a plate {plate.length * 1e3:g} mm long;"
            f" use less than {(plate.length - section.width) * 500:g} mm",
            key="margin",
            limit=(plate.length - section.width) / 2,
        )
    line = make_centre_line(centre_line, plate.length)
    if line.smallest_radius <= section.width / 2:
        raise SceneError(
            f"centre line: radius {line.smallest_radius * 1e3:g} mm is under half the groove's width {section.width * 1e3:g} mm;"
            f" {_radius_that_fits(plate, groove, centre_line, section.width / 2)}",
            key="radius",
            limit=section.width / 2,
        )
    part = GroovePlate(plate, groove, section, line)
    curve = part.seam_curves()[0]
    side = float(max(np.abs(curve.left[:, 1]).max(), np.abs(curve.right[:, 1]).max()))
    if side >= plate.width / 2:
        raise SceneError(
            f"groove: its lip comes to {side * 1e3:.1f} mm from the plate's middle, but the plate ends at {plate.width * 500:g} mm;"
            " make the groove narrower, the plate wider, or the line less bent or offset",
            key="width",
            limit=plate.width / 2,
        )
    return part


def _radius_that_fits(plate: PlateConfig, groove: GrooveConfig, centre_line: CentreLineConfig, least: Metre) -> str:
    """Which radius of the line is wide enough, and leaves the groove on the plate, in words. Args: least, it must be over [m]."""
    for radius in np.ceil(least * 1e3 + 0.5) * 1e-3 * GROWING:
        bent = replace(centre_line, radius=float(np.round(radius, 3)))
        try:
            if make_centre_line(bent, plate.length).smallest_radius <= least:
                continue
            make_groove_plate(plate, groove, bent)
        except SceneError:
            continue
        return f"use {1e3 * np.round(radius, 3):.0f} mm or more"
    return "make the groove narrower, or bend the line less"


def check_depth(section: GrooveSection, plate: PlateConfig) -> None:
    """Nothing, when the groove leaves some of the plate under it. Raises SceneError."""
    if section.depth >= plate.thickness:
        raise SceneError(
            f"groove: depth {section.depth * 1e3:g} mm reaches through the plate, {plate.thickness * 1e3:g} mm thick;"
            " make the groove shallower or the plate thicker",
            key="depth",
            limit=plate.thickness,
        )


def _blank(plate: PlateConfig) -> Surface:
    """The plate before its groove."""
    x, y, z = plate.half
    return block((-x, -y, -2 * z), (x, y, 0.0))
