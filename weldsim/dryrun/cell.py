"""The cell that a dry run is held in: a scene of the twin, or arm and table alone."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.frames import Transform
from weldsim.motion.collision import CellCollision
from weldsim.mounts import X_WB

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

FIXTURE = "fixture"  # the body that carries the part and what holds it


@dataclass(frozen=True, eq=False, kw_only=True)
class Cell:
    """Attributes: name; model, compiled; collision, its check; q_start, where the arm stands [rad]; has_part; arm, whose joint
    angles model and collision take; left_out, clamps and bolts that the scene leaves out; place, where the scene has the part
    in B [m], None without a scene."""

    name: str
    model: Any
    collision: CellCollision
    q_start: Float[ndarray, "6"]
    has_part: bool
    arm: Arm = UR5
    left_out: tuple[str, ...] = ()
    place: tuple[float, float] | None = None

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
        return replace(self, model=model, collision=CellCollision(model))

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
        SceneError: a scene that contradicts itself.
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
