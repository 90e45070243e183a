"""Flat plates: one with a straight or curved groove, and a plain one that has no seam."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import Metre
from weldsim.scene.workpieces.base import Box, LabelledMesh, SeamCurve, Workpiece
from weldsim.scene.workpieces.centre_line import CentreLine, CentreLineConfig, make_centre_line
from weldsim.scene.workpieces.groove import GrooveConfig, GrooveSection, make_section

SWEEP_STEP = 0.5e-3  # [m] between cross-sections: a chord leaves a 0.1 m arc by 0.3 um
ABOVE = 1e-3  # [m] the cutter stands proud of the surface, so that no faces coincide


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


class _Plate(Workpiece):
    """What a plate is whether grooved or not."""

    plate: PlateConfig

    def collision_boxes(self) -> tuple[Box, ...]:
        centre = np.array([0.0, 0.0, -self.plate.thickness / 2])
        return (Box(centre=centre, half=self.plate.half, R=np.eye(3)),)

    @property
    def base_corners(self) -> Float[ndarray, "k 3"]:
        x, y, _ = self.plate.half
        z = -self.plate.thickness
        return np.array([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])


@final
@dataclass(frozen=True)
class PlainPlate(_Plate):
    """A plate without a seam."""

    plate: PlateConfig

    @property
    def name(self) -> str:
        return "plain plate"

    @property
    def content(self) -> str:
        return repr(self)

    def build_mesh(self) -> LabelledMesh:
        vertices, faces, _ = _solid(_blank(self.plate.checked()))
        return LabelledMesh(vertices=vertices, faces=faces, groove=np.zeros(len(faces), bool))

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        return ()


@final
@dataclass(frozen=True)
class GroovePlate(_Plate):
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
                opening=centre,
                root=centre + self.section.depth * down,
                left=centre + self.section.width / 2 * left,
                right=centre - self.section.width / 2 * left,
                tangents=tangents,
                bisectors=np.array(down),
                s=s - s[0],
                name=self.name,
            ),
        )

    def build_mesh(self) -> LabelledMesh:
        import manifold3d

        vertices, faces = self._cutter()
        cutter = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces.astype(np.uint64)))
        if cutter.status() != manifold3d.Error.NoError:
            raise SceneError(f"groove: its swept solid is not closed ({cutter.status()}); use a larger radius", key="radius")
        cutter = cutter.as_original()
        vertices, faces, origin = _solid(_blank(self.plate) - cutter)
        return LabelledMesh(vertices=vertices, faces=faces, groove=origin == cutter.original_id())

    def _cutter(self) -> tuple[Float[ndarray, "n 3"], Int[ndarray, "m 3"]]:
        """The material the groove removes: its section swept along the line, run out past the edges along the end tangents."""
        x = self.stations()
        centres = np.column_stack([x, self.line.y(x)])
        tangents = self.line.tangents(x)
        outline = self.section.outline(ABOVE)
        if self.groove.margin == 0:
            half = float(np.abs(outline[:, 0]).max())
            reach = (half * np.abs(tangents[[0, -1], 1]) + ABOVE) / tangents[[0, -1], 0]
            first, last = centres[0] - reach[0] * tangents[0], centres[-1] + reach[1] * tangents[-1]
            centres = np.vstack([first, centres, last])
            tangents = np.vstack([tangents[:1], tangents, tangents[-1:]])
        return sweep(outline, centres, tangents)


def sweep(
    outline: Float[ndarray, "k 2"], centres: Float[ndarray, "n 2"], tangents: Float[ndarray, "n 2"]
) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """Vertices [m] and outward faces of a convex outline (across, up) carried along a planar line, closed by flat ends.

    Args:
        outline: counter-clockwise, across = to the left of travel counted negative, so that it is seen from behind.
        centres, tangents: of the line in the plane z = 0.
    """
    n, k = len(centres), len(outline)
    right = np.column_stack([tangents[:, 1], -tangents[:, 0]])
    ring = centres[:, None, :] + outline[None, :, :1] * right[:, None, :]
    vertices = np.concatenate([ring, np.broadcast_to(outline[None, :, 1:], (n, k, 1))], axis=2).reshape(-1, 3)
    a = (np.arange(n - 1)[:, None] * k + np.arange(k)[None, :]).ravel()
    b = (np.arange(n - 1)[:, None] * k + (np.arange(k)[None, :] + 1) % k).ravel()
    sides = np.concatenate([np.column_stack([a, b + k, b]), np.column_stack([a, a + k, b + k])])
    fan = np.column_stack([np.zeros(k - 2, int), np.arange(1, k - 1), np.arange(2, k)])
    return vertices, np.concatenate([sides, fan, fan[:, ::-1] + (n - 1) * k])


def make_groove_plate(plate: PlateConfig, groove: GrooveConfig, centre_line: CentreLineConfig) -> GroovePlate:
    """The grooved plate, with every contradiction refused.

    Raises:
        SceneError: a groove deeper than the plate, wider than it, leaving it sideways, ending before it starts, or bent tighter
            than half its width.
    """
    plate = plate.checked()
    section = make_section(groove)
    if section.depth >= plate.thickness:
        raise SceneError(
            f"groove: depth {section.depth * 1e3:g} mm reaches through the plate, {plate.thickness * 1e3:g} mm thick;"
            " make the groove shallower or the plate thicker",
            key="depth",
            limit=plate.thickness,
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
            f" use more than {section.width * 500:g} mm",
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


def _blank(plate: PlateConfig) -> Any:
    """The plate before its groove, as a solid of the library that loads late."""
    import manifold3d

    x, y, z = 2 * plate.half
    return manifold3d.Manifold.cube((x, y, z)).translate((-x / 2, -y / 2, -z)).as_original()


def _solid(manifold: Any) -> tuple[Float[ndarray, "n 3"], Int[ndarray, "m 3"], Int[ndarray, "m"]]:
    """Vertices, faces, and which original solid each face came from."""
    mesh = manifold.to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    run = np.asarray(mesh.run_index).astype(np.int64) // 3
    origin = np.repeat(np.asarray(mesh.run_original_id).astype(np.int64), np.diff(run))
    return np.ascontiguousarray(np.asarray(mesh.vert_properties)[:, :3]), faces, origin
