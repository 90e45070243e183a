"""What a scene is made of: the contents of one TOML file of `scenes/`."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from weldsim.counted import counted
from weldsim.errors import SceneError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.quantity import REACH, SIZE, TURN, Metre, Radian, require_within
from weldsim.scene.views import CameraPoseConfig, ViewConfig
from weldsim.scene.workpieces.base import Workpiece
from weldsim.scene.workpieces.branches import BranchesConfig, make_branched_plate
from weldsim.scene.workpieces.centre_line import CentreLineConfig
from weldsim.scene.workpieces.cuboid import CuboidConfig, make_cuboid
from weldsim.scene.workpieces.cylinder import CylinderConfig, make_cylinder
from weldsim.scene.workpieces.groove import GrooveConfig
from weldsim.scene.workpieces.plate import PlainPlate, PlateConfig, make_groove_plate
from weldsim.scene.workpieces.user_mesh import MeshConfig, make_user_mesh
from weldsim.schema import HIDDEN
from weldsim.settings import Given

__all__ = [
    "CameraPoseConfig",
    "FixtureConfig",
    "MaterialConfig",
    "PartPoseConfig",
    "SceneConfig",
    "ViewConfig",
    "make_workpiece",
    "part_pose",
]

Finish = Literal["matte", "mill_scale", "ground", "black"]
WorkpieceKind = Literal["groove_plate", "plain_plate", "cylinder", "cuboid", "y", "mesh"]


@dataclass(frozen=True)
class PartPoseConfig:
    """Where the part lies on the table, in the robot base B (table top z = 0).

    Attributes:
        x: of P's origin: the middle of its upper face, or of a cylinder's crest [m].
        y: of the same [m].
        z: of the same [m]; None takes `clearance`.
        clearance: between the table and its lowest corner [m].
        yaw: about the vertical [rad].
        tilt: of its upper face from the horizontal [rad].
        tilt_heading: direction about the vertical, from B's x, towards which the face leans down [rad].
    """

    x: Metre = 0.0
    y: Metre = -0.45
    z: Metre | None = None
    clearance: Metre = 0.0
    yaw: Radian = 0.0
    tilt: Radian = 0.0
    tilt_heading: Radian = 0.0

    def __post_init__(self) -> None:
        ranges = {"x": REACH, "y": REACH, "clearance": REACH, "yaw": TURN, "tilt": TURN, "tilt_heading": TURN}
        require_within(self, ranges if self.z is None else {**ranges, "z": REACH}, "pose")


@dataclass(frozen=True)
class FixtureConfig:
    """What holds the part.

    Attributes:
        stand: whether a part that is held above the table has legs under it, or hangs in the air.
        clamps: step clamps on the part's long sides: 0, 2 or 4; one's own part has none.
        overlap: of each clamp's nose over the part [m].
        bolts: bolt heads standing on the part's level surface, as clutter: 0 to 6.
        without: clamps and bolts that are left out, as reports name them: "clamp_2", "clamp_bolt_0".
    """

    stand: bool = True
    clamps: Literal[0, 2, 4] = 4
    overlap: Metre = 0.018
    bolts: int = 0
    without: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.clamps not in (0, 2, 4):
            raise SceneError(f"fixture: {counted(self.clamps, 'clamp')}; 0, 2 or 4 can be placed", key="clamps", limit=4)
        require_within(self, {"overlap": SIZE}, "fixture")


@dataclass(frozen=True)
class MaterialConfig:
    """How the part looks.

    Attributes:
        finish: what a camera sees: dusted matte, mill scale, ground steel, or black.
        red: of its colour, 0 to 1.
        green: of its colour, 0 to 1.
        blue: of its colour, 0 to 1.
    """

    finish: Finish = "matte"
    red: float = 0.56
    green: float = 0.57
    blue: float = 0.58


@dataclass(frozen=True)
class LimitsConfig:
    """What a weld of this scene must keep to where that is not what welds in general must: corners are rounded, say.

    Attributes:
        mean: cross-track distance from the known seam, mean [m].
        p95: the same, 95th percentile [m].
        max: the same, greatest [m].
        ends: length that may be left unwelded at either end, or welded beyond it [m].
        least_speed: share of the asked welding speed to which joint limits may slow the weld in places: round an edge, say,
            where the wire swings from one face to the next.
        reason: why, in a clause; a figure that keeps these limits and not the general ones is told in amber with it.
    """

    mean: Metre | None = None
    p95: Metre | None = None
    max: Metre | None = None
    ends: Metre | None = None
    least_speed: float | None = None
    reason: str | None = None

    def __post_init__(self) -> None:
        given = (name for name, value in vars(self).items() if value is not None and name != "reason")
        # Lengths of error no larger than `report` takes them.
        most = {"mean": 0.1, "p95": 0.1, "max": 0.1}
        require_within(self, {name: (0.0, most.get(name, 1.0)) for name in given}, "limits")


@dataclass(frozen=True)
class SceneConfig:
    """One scene.

    Attributes:
        name: what it is called.
        title: one line for people.
        workpiece: which kind of part.
        plate: dimensions of a plate, grooved, plain or with a Y.
        cylinder: dimensions of a cylinder.
        cuboid: dimensions of a cuboid.
        mesh: files of one's own part.
        groove: its groove's cross-section.
        centre_line: where the groove of a groove plate runs.
        branches: where those of a Y run.
        pose: where it lies.
        fixture: what holds it.
        material: how it looks.
        views: where the wrist camera scans from, in order; one at least.
        limits: of the verdict, in place of the general ones.
        given: where each value came from that the scene's file or the command line gave; what is not in it is a default.
    """

    name: str = "scene"
    title: str = ""
    workpiece: WorkpieceKind = "groove_plate"
    plate: PlateConfig = field(default_factory=PlateConfig)
    cylinder: CylinderConfig = field(default_factory=CylinderConfig)
    cuboid: CuboidConfig = field(default_factory=CuboidConfig)
    mesh: MeshConfig | None = None
    groove: GrooveConfig = field(default_factory=GrooveConfig)
    centre_line: CentreLineConfig = field(default_factory=CentreLineConfig)
    branches: BranchesConfig = field(default_factory=BranchesConfig)
    pose: PartPoseConfig = field(default_factory=PartPoseConfig)
    fixture: FixtureConfig = field(default_factory=FixtureConfig)
    material: MaterialConfig = field(default_factory=MaterialConfig)
    views: tuple[ViewConfig, ...] = (ViewConfig(),)
    limits: LimitsConfig = field(default_factory=LimitsConfig)
    given: Given = field(default_factory=dict, compare=False, repr=False, metadata=HIDDEN)


READS: dict[WorkpieceKind, tuple[str, ...]] = {
    "plain_plate": ("plate",),
    "groove_plate": ("plate", "groove", "centre_line"),
    "cylinder": ("cylinder", "groove"),
    "cuboid": ("cuboid", "groove"),
    "y": ("plate", "groove", "branches"),
    "mesh": ("mesh",),
}
"""The tables that make the shape of each kind of part."""
SHAPES = {table for tables in READS.values() for table in tables}


def refuse_idle(config: SceneConfig) -> None:
    """Nothing, when everything that was asked for of the scene changes something.

    Raises:
        SceneError: the command line sets a size of another kind of part; clamps or bolts asked for on one's own part; a height
            and a clearance that both say how high the part lies.
    """
    reads, given = READS[config.workpiece], config.given
    for key, source in given.items():
        table = key.partition(".")[0]
        if source.kind == "command line" and table in SHAPES and table not in reads:
            raise SceneError(
                f'scene.{key} changes nothing here: workpiece = "{config.workpiece}" reads {", ".join(reads)}', key=key
            )
    if config.workpiece == "mesh" and config.fixture.clamps and "fixture.clamps" in given:
        raise SceneError("fixture.clamps: one's own part has none; leave it out, or give 0", key="fixture.clamps")
    if config.pose.z is not None and {"pose.z", "pose.clearance"} <= set(given):
        raise SceneError("pose.z and pose.clearance both say how high the part lies; give one", key="pose.clearance")


def make_workpiece(config: SceneConfig) -> Workpiece:
    """The part that `config` describes.

    Raises:
        SceneError: dimensions that contradict each other, or a file that cannot be used.
    """
    if config.mesh is not None and config.workpiece != "mesh":
        raise SceneError(f'[mesh] is given, but workpiece = "{config.workpiece}"; write workpiece = "mesh"', key="workpiece")
    match config.workpiece:
        case "plain_plate":
            return PlainPlate(config.plate.checked())
        case "groove_plate":
            return make_groove_plate(config.plate, config.groove, config.centre_line)
        case "cylinder":
            return make_cylinder(config.cylinder, config.groove)
        case "cuboid":
            return make_cuboid(config.cuboid, config.groove)
        case "y":
            return make_branched_plate(config.plate, config.groove, config.branches)
        case "mesh":
            if config.mesh is None:
                raise SceneError('workpiece = "mesh": give a table [mesh] with file and units', key="mesh")
            return make_user_mesh(config.mesh)


def part_pose(config: PartPoseConfig, workpiece: Workpiece) -> Transform:
    """X_BP: the part with its origin at the given height, or lifted so that its lowest corner is `clearance` above the table.

    Raises:
        SceneError: a tilt of 60 deg or more, or a corner below the table.
    """
    if abs(config.tilt) >= np.pi / 3:
        raise SceneError(f"pose: tilt {np.degrees(config.tilt):g} deg must be under 60 deg", key="tilt", limit=np.pi / 3)
    if config.clearance < 0:
        raise SceneError(
            f"pose: clearance {config.clearance * 1e3:g} mm would sink the part into the table", key="clearance", limit=0.0
        )
    c, s = np.cos(config.tilt_heading), np.sin(config.tilt_heading)
    lean = matrix_from_rotation_vector(config.tilt * np.array([-s, c, 0.0]))
    R = lean @ matrix_from_rotation_vector(np.array([0.0, 0.0, config.yaw]))
    lowest = float((workpiece.base_corners @ R.T)[:, 2].min())
    if config.z is None:
        return Transform("BP", R, np.array([config.x, config.y, config.clearance - lowest]))
    if config.z + lowest < -1e-9:
        raise SceneError(
            f"pose: z {config.z * 1e3:g} mm puts the part's lowest corner {-(config.z + lowest) * 1e3:.1f} mm below the table;"
            f" use {-lowest * 1e3:.1f} mm or more",
            key="z",
            limit=-lowest,
        )
    return Transform("BP", R, np.array([config.x, config.y, config.z]))
