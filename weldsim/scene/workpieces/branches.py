"""A plate whose groove branches: three arms that meet, the letter Y, or its stem alone (thesis table 6.8)."""

from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.quantity import REACH, TURN, Metre, Radian, require_within
from weldsim.scene.workpieces.base import LabelledMesh, SeamCurve
from weldsim.scene.workpieces.groove import GrooveConfig, GrooveSection, make_section
from weldsim.scene.workpieces.plate import FlatPlate, PlateConfig, check_depth
from weldsim.scene.workpieces.solid import ABOVE, SWEEP_STEP, Surface, block, cut, sweep


@dataclass(frozen=True)
class BranchesConfig:
    """Where the branches of a Y run over their plate, seen from above.

    Attributes:
        branches: 3, or 1 for the stem alone, from edge to edge.
        junction: where the branches meet, along x from the plate's middle [m].
        spread: angle between the two arms [rad].
    """

    branches: Literal[1, 3] = 3
    junction: Metre = 0.0
    spread: Radian = 2 * np.pi / 3

    def __post_init__(self) -> None:
        require_within(self, {"junction": REACH, "spread": TURN}, "branches")


@final
@dataclass(frozen=True)
class BranchedPlate(FlatPlate):
    """A plate with a stem that comes from its edge at -x along y = 0, and two arms that part from it at the junction.

    Travel runs up the stem and out along the arms. Each branch is a seam of its own that begins or ends at the junction.
    Near the junction the lips of neighbouring branches cut each other off, as they do at a plate edge; the samples there are
    those of the branch as it would be alone.

    Raises (by `make_branched_plate`): SceneError.
    """

    plate: PlateConfig
    groove: GrooveConfig
    section: GrooveSection
    shape: BranchesConfig

    @property
    def name(self) -> str:
        return "Y"

    @property
    def content(self) -> str:
        return repr(self)

    def directions(self) -> Float[ndarray, "k 2"]:
        """Unit vectors from the junction outwards: stem, left arm, right arm."""
        half = self.shape.spread / 2
        arms = np.array([[-1.0, 0.0], [np.cos(half), np.sin(half)], [np.cos(half), -np.sin(half)]])
        return arms[: self.shape.branches]

    def reach(self, direction: Float[ndarray, "2"]) -> float:
        """Length of a branch from the junction to the plate's edge, less the margin [m]."""
        x, y, _ = self.plate.half
        to_end = (np.copysign(x, direction[0]) - self.shape.junction) / direction[0] if abs(direction[0]) > 1e-12 else np.inf
        to_side = y / abs(direction[1]) if abs(direction[1]) > 1e-12 else np.inf
        return float(min(to_end, to_side)) - self.groove.margin

    def ends(self) -> list[tuple[str, Float[ndarray, "2"], Float[ndarray, "2"]]]:
        """Name, start and end of each branch along travel, seen from above [m]."""
        junction = np.array([self.shape.junction, 0.0])
        if self.shape.branches == 1:
            x = self.plate.length / 2 - self.groove.margin
            return [("Y", np.array([-x, 0.0]), np.array([x, 0.0]))]
        tips = [junction + self.reach(direction) * direction for direction in self.directions()]
        return [("Y stem", tips[0], junction), ("Y left arm", junction, tips[1]), ("Y right arm", junction, tips[2])]

    def seam_curves(self) -> tuple[SeamCurve, ...]:
        """The stem, and the arms where there are some."""
        return tuple(self._curve(name, start, end) for name, start, end in self.ends())

    def _curve(self, name: str, start: Float[ndarray, "2"], end: Float[ndarray, "2"]) -> SeamCurve:
        length = float(np.linalg.norm(end - start))
        n = int(np.ceil(length / SWEEP_STEP)) + 1
        s = np.linspace(0.0, length, n)
        tangent = np.append((end - start) / length, 0.0)
        centre = np.append(start, 0.0) + s[:, None] * tangent
        down = np.array([0.0, 0.0, -1.0])
        left = np.array([-tangent[1], tangent[0], 0.0]) * self.section.width / 2
        return SeamCurve(
            opening=centre + self.section.opening_depth * down,
            root=centre + self.section.depth * down,
            left=centre + left + self.section.misalignment * down,
            right=centre - left,
            tangents=np.tile(tangent, (n, 1)),
            bisectors=np.tile(down, (n, 1)),
            s=s,
            name=name,
        )

    def build_mesh(self) -> LabelledMesh:
        x, y, z = self.plate.half
        low = self.section.misalignment
        steps = [block((-x - ABOVE, 0.0, -low), (x + ABOVE, y + ABOVE, ABOVE))] if low > 0 else ()
        return cut(block((-x, -y, -2 * z), (x, y, 0.0)), [self._cutter(start, end) for _, start, end in self.ends()], steps)

    def _cutter(self, start: Float[ndarray, "2"], end: Float[ndarray, "2"]) -> Surface:
        """One branch's section swept along it: to the junction and no further, past the plate's edge."""
        along = (end - start) / np.linalg.norm(end - start)
        outline = self.section.outline(ABOVE)
        half = float(np.abs(outline[:, 0]).max())
        # The far lip of a branch that meets its edge aslant is cut off by as much as the groove is wide.
        slant = 1 / max(np.abs(along).max(), 0.5)
        past = 0.0 if self.groove.margin > 0 else (half + ABOVE) * slant + ABOVE
        first = start - past * along if self._leaves(start) else start
        last = end + past * along if self._leaves(end) else end
        ends = np.array([[*first, 0.0], [*last, 0.0]])
        right = np.array([along[1], -along[0], 0.0])
        return sweep(outline, ends, np.tile(right, (2, 1)), np.tile([0.0, 0.0, 1.0], (2, 1)))

    def _leaves(self, point: Float[ndarray, "2"]) -> bool:
        """Whether a branch goes on past this end of it."""
        return self.shape.branches == 1 or not np.allclose(point, [self.shape.junction, 0.0])


def make_branched_plate(plate: PlateConfig, groove: GrooveConfig, shape: BranchesConfig) -> BranchedPlate:
    """The plate with its Y.

    Raises:
        SceneError: a groove through the plate or wider than it, a misalignment under three branches (no two plates make it),
            arms too near each other or to the stem, or a branch that ends before it starts.
    """
    plate, section = plate.checked(), make_section(groove)
    check_depth(section, plate)
    if section.width >= plate.width:
        raise SceneError(
            f"groove: width {section.width * 1e3:g} mm is wider than the plate, {plate.width * 1e3:g} mm",
            key="width",
            limit=plate.width,
        )
    part = BranchedPlate(plate, groove, section, shape)
    if shape.branches == 3:
        if section.misalignment > 0:
            raise SceneError(
                "groove: a misalignment needs one branch; three plates that meet have none of one kind", key="misalignment"
            )
        if not np.radians(40) <= shape.spread <= np.radians(170):
            limit = (np.radians(40), np.radians(170))
            raise SceneError(f"branches: spread {np.degrees(shape.spread):g} deg must be 40 to 170 deg", key="spread", limit=limit)
    if abs(shape.junction) >= plate.length / 2:
        raise SceneError(
            f"branches: junction {shape.junction * 1e3:g} mm from the plate's middle lies off the plate,"
            f" {plate.length * 1e3:g} mm long; move the junction or make the plate longer",
            key="junction",
            limit=plate.length / 2,
        )
    for name, start, end in part.ends():
        length = float((end - start) @ (part.directions()[0] * -1.0)) if "arm" not in name else float(np.linalg.norm(end - start))
        if length < 2 * section.width:
            raise SceneError(
                f"branches: {name} is {max(length, 0.0) * 1e3:.0f} mm long, at least {section.width * 2e3:g} mm (twice the groove's"
                " width) is needed; move the junction, or make the plate larger, the groove narrower or its margin smaller",
                key="junction",
                limit=2 * section.width,
            )
    return part
