"""Whether part and fixture can stand where a scene has them: on the table, whole, clear of the arm's base and of the Kinect."""

import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.mounts import X_WB
from weldsim.scene.cell import BASE_GEOM, TABLE

PART = ("part", "groove")  # drawn; what it collides with are boxes about it
FOOT = 0.002  # [m] what comes this near to the table rests on it
SUNK = 1e-4  # [m] into the table that is no more than rounding
INSIDE = 5e-4  # [m] two bodies may run into each other by this
COLUMN = 1.5  # [m] half the height of what the arm takes up over, and under, its base
HEADINGS = 16  # directions in which a clear place is looked for
STEP, FARTHEST = 0.01, 1.2  # [m] between places, and how far


@dataclass(frozen=True, eq=False, kw_only=True)
class Standing:
    """Part and fixture of a compiled scene as solids in B. Attribute: model, which has a body "fixture"."""

    model: Any

    def fault(self, move: Float[ndarray, "3"] | None = None) -> str | None:
        """Why they cannot stand where they are, or moved in B [m], in words; None where they can."""
        move = np.zeros(3) if move is None else move
        found = (self._in_the_way(move), self._off_table(move), self._sunk(move))
        return " and ".join(fault for fault in found if fault) or None

    def clear_place(self, move: Float[ndarray, "3"] | None = None) -> Float[ndarray, "2"] | None:
        """The nearest move along x and y [m], from where the scene has them, at which they can stand; None where there is none.

        Args:
            move: from which it is to be near [m].
        """
        start = np.zeros(3) if move is None else np.array(move, float)
        start[:2] = self._onto_table(start)
        for distance in np.arange(0.0, FARTHEST, STEP):
            for heading in 2 * np.pi * np.arange(HEADINGS if distance else 1) / HEADINGS - np.pi / 2:
                there = start + distance * np.array([np.cos(heading), np.sin(heading), 0.0])
                there = np.round(there, 3) + 0.0  # as it is told
                if self.fault(there) is None:
                    return there[:2]
        return None

    @property
    def height(self) -> float:
        """Of the lowest point of part and fixture above the table [m]."""
        return float(self._low[:, 2].min())

    @property
    def notes(self) -> tuple[str, ...]:
        """What is odd about how they stand, a clause each."""
        out = []
        if self.height > FOOT:
            out.append(f"the part hangs in the air, {1e3 * self.height:.0f} mm above the table: nothing stands under it")
        over = self._beyond(np.zeros(3), self._is_part).max()
        if over > 0 and not self._fits.all():
            size = " x ".join(f"{1e3 * side:.0f}" for side in np.ptp(TABLE, axis=0))
            out.append(f"the part is larger than the table ({size} mm) and reaches {1e3 * over:.0f} mm beyond its edge")
        return tuple(out)

    @cached_property
    def _geoms(self) -> Int[ndarray, "k"]:
        """Geoms of part and fixture that are there: what was taken away can neither be drawn nor touched."""
        root = self.model.body("fixture").id
        return np.array([g for g in range(self.model.ngeom) if self._below(int(self.model.geom_bodyid[g]), root)], int)

    def _below(self, body: int, root: int) -> bool:
        while body > 0:
            if body == root:
                return True
            body = int(self.model.body_parentid[body])
        return False

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(self.model.geom(int(g)).name for g in self._geoms)

    @cached_property
    def _is_part(self) -> Bool[ndarray, "k"]:
        return np.array([name in PART for name in self._names])

    @cached_property
    def _posed(self) -> tuple[Any, Any]:
        """A copy of the model, in which the arm's base is a column: nothing can stand over it either; and its state."""
        model = copy.copy(self.model)
        base = model.geom(BASE_GEOM).id
        model.geom_size[base, 1] = COLUMN
        model.geom_rbound[base] = np.hypot(model.geom_size[base, 0], COLUMN)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return model, data

    @property
    def _data(self) -> Any:
        return self._posed[1]

    @cached_property
    def _corners(self) -> list[Float[ndarray, "_ 3"]]:
        """Points of each geom in B whose hull holds it: corners of a box about it, or its own triangles'."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
        out = []
        for g in self._geoms:
            mesh = int(self.model.geom_dataid[g])
            if mesh >= 0:
                first = int(self.model.mesh_vertadr[mesh])
                local = self.model.mesh_vert[first : first + int(self.model.mesh_vertnum[mesh])]
            else:
                middle, half = self.model.geom_aabb[g, :3], self.model.geom_aabb[g, 3:]
                local = middle + signs * half
            R, p = self._data.geom_xmat[g].reshape(3, 3), self._data.geom_xpos[g]
            out.append(X_WB.inverse().points(np.asarray(local, float) @ R.T + p))
        return out

    @cached_property
    def _low(self) -> Float[ndarray, "k 3"]:
        return np.array([corners.min(axis=0) for corners in self._corners])

    @cached_property
    def _high(self) -> Float[ndarray, "k 3"]:
        return np.array([corners.max(axis=0) for corners in self._corners])

    @property
    def _fits(self) -> Bool[ndarray, "2"]:
        """Whether the part is no larger than the table, along x and y."""
        part = self._is_part
        return (self._high[part].max(axis=0) - self._low[part].min(axis=0))[:2] <= np.ptp(TABLE, axis=0)

    def _rests(self) -> Bool[ndarray, "k"]:
        """What stands on the table; where nothing does, the part, which would fall on it."""
        drawn = np.array([not name.endswith("_collision") and "_collision_" not in name for name in self._names])
        rests = drawn & (self._low[:, 2] < FOOT)
        return rests if rests.any() else self._is_part

    def _beyond(self, move: Float[ndarray, "3"], which: Bool[ndarray, "k"]) -> Float[ndarray, "2 2"]:
        """How far they reach beyond the table's edges [m]: rows low and high, columns x and y."""
        low, high = (self._low[which].min(axis=0) + move)[:2], (self._high[which].max(axis=0) + move)[:2]
        return np.array([TABLE[0] - low, high - TABLE[1]])

    def _off_table(self, move: Float[ndarray, "3"]) -> str | None:
        rests = self._rests()
        middle = (self._low[self._is_part].min(axis=0) + self._high[self._is_part].max(axis=0))[:2] / 2 + move[:2]
        worst: tuple[float, str] = (SUNK, "")
        for which, name in ((rests & self._is_part, "the part"), (rests & ~self._is_part, "what holds the part")):
            if not which.any():
                continue
            over = self._beyond(move, which)
            if name == "the part":
                over = np.where(self._fits | (middle < TABLE[0]) | (middle > TABLE[1]), over, 0.0)
            row, column = np.unravel_index(over.argmax(), over.shape)
            if over[row, column] > worst[0]:
                far = float(over[row, column])
                edge = f"{'xy'[column]} = {1e3 * TABLE[row, column]:.0f} mm"
                worst = (far, f"{name} stands {1e3 * far:.0f} mm beyond the table's edge at {edge}")
        return worst[1] or None

    def _onto_table(self, move: Float[ndarray, "3"]) -> Float[ndarray, "2"]:
        """The nearest move [m] that has all that rests on the table over it, where it fits."""
        over = np.maximum(self._beyond(move, self._rests()), 0.0)
        both = np.minimum(over[0], over[1]) > 0
        return np.where(both, move[:2], move[:2] + over[0] - over[1])

    def _sunk(self, move: Float[ndarray, "3"]) -> str | None:
        depth = -float(self._low[self._is_part, 2].min() + move[2])
        return f"the part lies {1e3 * depth:.1f} mm below the table's top" if depth > SUNK else None

    @cached_property
    def _around(self) -> Int[ndarray, "k"]:
        """What stands on the table or over it already: the arm's base, and the Kinect with its mast."""
        names = [self.model.geom(g).name for g in range(self.model.ngeom)]
        return np.array([g for g, name in enumerate(names) if name == BASE_GEOM or name.startswith("kinect_")], int)

    def _in_the_way(self, move: Float[ndarray, "3"]) -> str | None:
        """Who runs into the base or the Kinect, and how deep."""
        solid = np.array([g for g, part in zip(self._geoms, self._is_part, strict=True) if not part], int)
        at, bound = self._data.geom_xpos[solid] + X_WB.R @ move, self._posed[0].geom_rbound
        gap = np.linalg.norm(at[:, None] - self._data.geom_xpos[self._around][None], axis=2)
        near = np.argwhere(gap < bound[solid][:, None] + bound[self._around][None])
        deepest: tuple[float, str] = (INSIDE, "")
        span = np.zeros(6)
        for i, j in near:
            mine, theirs = int(solid[i]), int(self._around[j])
            kept = self._data.geom_xpos[mine].copy()
            self._data.geom_xpos[mine] = at[i]
            distance = mujoco.mj_geomDistance(self._posed[0], self._data, mine, theirs, 1.0, span)
            self._data.geom_xpos[mine] = kept
            if -distance > deepest[0]:
                what = "the arm's base" if self.model.geom(theirs).name == BASE_GEOM else "the Kinect and its mast"
                deepest = (-distance, f"{_told(self.model.geom(mine).name)} stands {-1e3 * distance:.0f} mm inside {what}")
        return deepest[1] or None


def _told(name: str) -> str:
    """What a geom belongs to, in words."""
    words = name.split("_")
    if words[0] == "clamp":
        return "_".join(words[: 3 if words[1] == "bolt" else 2])
    return "the part" if words[0] == "part" else "what the part stands on"
