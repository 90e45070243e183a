"""The cell that a dry run is held in: a scene of the twin, or arm and table alone."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.frames import Transform
from weldsim.motion.collision import CellCollision
from weldsim.mounts import X_WB
from weldsim.scene.cell import BASE_GEOM
from weldsim.scene.standing import Standing

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

FIXTURE = "fixture"  # the body that carries the part and what holds it


@dataclass(frozen=True, eq=False, kw_only=True)
class Cell:
    """Attributes: name; model, compiled; collision, its check; q_start, where the arm stands [rad]; has_part; arm, whose joint
    angles model and collision take; left_out, clamps and bolts that the scene leaves out; place, where the part is in B [m],
    None without a scene; shift, by how much that is not where the scene has it [m]; notes, what is odd about how it stands;
    seams, of the part as the scene has it, the openings in B [m]."""

    name: str
    model: Any
    collision: CellCollision
    q_start: Float[ndarray, "6"]
    has_part: bool
    arm: Arm = UR5
    left_out: tuple[str, ...] = ()
    place: tuple[float, float] | None = None
    shift: tuple[float, float] = (0.0, 0.0)
    notes: tuple[str, ...] = ()
    seams: tuple[Float[ndarray, "_ 3"], ...] = ()

    def fitted(self, arm: Arm) -> "Cell":
        """The cell with another arm in it, its links where that arm's joints have them; itself where it is the same.

        Args:
            arm: with the torch of this one.
        """
        if (arm.dh == self.arm.dh).all():
            return self
        from weldsim.scene.fitted import fitted_model

        model = fitted_model(self.model, arm)
        return replace(self, model=model, collision=CellCollision(model), arm=arm)

    def moved(self, move: Float[ndarray, "3"]) -> "Cell":
        """A cell with the part and its fixture moved in B [m]; itself where there is no part."""
        if not self.has_part:
            return self
        import copy

        model = copy.copy(self.model)
        # On top of where the cell's own model has it.
        body = model.body(FIXTURE).id
        model.body_pos[body] = self.model.body_pos[body] + X_WB.R @ move
        place = None if self.place is None else _plus(self.place, move)
        seams = tuple(seam + move for seam in self.seams)
        return replace(self, model=model, collision=CellCollision(model), place=place, shift=_plus(self.shift, move), seams=seams)

    def misplaced(self, move: Float[ndarray, "3"], points_B: Float[ndarray, "n 3"] | None = None) -> str | None:
        """Why part and fixture cannot be moved by so much in B [m], in words: into the arm's base, beside the table; else None.

        Args:
            points_B: the seam where it is [m], which stands for the part in a cell that has none.
        """
        if self._standing is not None:
            return self._standing.fault(move)
        if points_B is None:
            return None
        aside = np.linalg.norm(points_B[:, :2] + move[:2], axis=1)
        return "the seam lies over the arm's base" if aside.min() < float(self.model.geom(BASE_GEOM).size[0]) else None

    def clear_place(self, move: Float[ndarray, "3"]) -> Float[ndarray, "2"] | None:
        """The nearest move to one that is not possible [m]; None where there is none, or no part."""
        return None if self._standing is None else self._standing.clear_place(move)

    @cached_property
    def _standing(self) -> Standing | None:
        return Standing(model=self.model) if self.has_part else None

    def without(self, body: str) -> "Cell":
        """A cell in which a clamp or bolt, with what belongs to it, has been taken away."""
        import copy

        model = copy.copy(self.model)
        for geom in range(model.ngeom):
            if model.geom(geom).name.startswith(f"{body}_"):
                model.geom_contype[geom] = model.geom_conaffinity[geom] = 0
        return replace(self, model=model, collision=CellCollision(model))


def scene_cell(scene: "SceneConfig", q_start: Float[ndarray, "6"] | None = None) -> Cell:
    """The scene, the arm where its last view holds the camera unless said otherwise.

    Raises:
        SceneError: a scene that contradicts itself, or a part that cannot stand where it is.
    """
    from weldsim.scene.world import build_world

    world = build_world(scene)
    return Cell(
        name=scene.name,
        model=world.model,
        collision=CellCollision(world.model),
        q_start=world.start_joints() if q_start is None else q_start,
        has_part=True,
        left_out=scene.fixture.without,
        place=(scene.pose.x, scene.pose.y),
        notes=world.notes,
        seams=tuple(seam.opening_B for seam in world.known_seams),
    )


def empty_cell(q_start: Float[ndarray, "6"] | None = None) -> Cell:
    """Arm, torch, camera and table, nothing on it."""
    from weldsim.scene.cell import new_cell
    from weldsim.scene.config import MaterialConfig
    from weldsim.scene.quiet import keep_quiet
    from weldsim.scene.tool import add_tool
    from weldsim.scene.world import HOME

    keep_quiet()
    spec = new_cell(MaterialConfig())
    add_tool(spec.body("wrist_3_link"))
    model = spec.compile()
    return Cell(
        name="empty",
        model=model,
        collision=CellCollision(model),
        q_start=np.array(HOME, float) if q_start is None else q_start,
        has_part=False,
    )


def shifted(X_BT: Transform, move: Float[ndarray, "3"]) -> Transform:
    """The poses moved in B [m]."""
    return Transform("BT", X_BT.R, X_BT.p + move)


def _plus(place: tuple[float, float], move: Float[ndarray, "3"]) -> tuple[float, float]:
    return (place[0] + float(move[0]), place[1] + float(move[1]))
