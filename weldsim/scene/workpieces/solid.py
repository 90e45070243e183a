"""Solids: outlines carried along lines, and the one boolean that workpieces need, by manifold3d (which loads late)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.errors import SceneError
from weldsim.scene.workpieces.base import LabelledMesh

ABOVE = 1e-3  # [m] cutters stand proud of the surface, so that no faces coincide
SWEEP_STEP = 0.5e-3  # [m] between cross-sections: a chord leaves a 0.1 m arc by 0.3 um

Surface = tuple[Float[ndarray, "_ 3"], Int[ndarray, "_ 3"]]
"""Vertices [m] and outward faces of a closed surface."""


def sweep(
    outline: Float[ndarray, "k 2"], centres: Float[ndarray, "n 3"], right: Float[ndarray, "n 3"], up: Float[ndarray, "n 3"]
) -> Surface:
    """A convex outline carried along a line and closed by flat ends.

    Args:
        outline: (across, up) [m], counter-clockwise as seen from behind, across positive to the right of travel.
        centres: of the line [m].
        right, up: unit vectors at each centre that across and up stand for; right x up points back along travel.
    """
    n, k = len(centres), len(outline)
    ring = centres[:, None, :] + outline[None, :, :1] * right[:, None, :] + outline[None, :, 1:] * up[:, None, :]
    a = (np.arange(n - 1)[:, None] * k + np.arange(k)[None, :]).ravel()
    b = (np.arange(n - 1)[:, None] * k + (np.arange(k)[None, :] + 1) % k).ravel()
    sides = np.concatenate([np.column_stack([a, b + k, b]), np.column_stack([a, a + k, b + k])])
    fan = np.column_stack([np.zeros(k - 2, int), np.arange(1, k - 1), np.arange(2, k)])
    return ring.reshape(-1, 3), np.concatenate([sides, fan, fan[:, ::-1] + (n - 1) * k])


def block(low: Sequence[float] | Float[ndarray, "3"], high: Sequence[float] | Float[ndarray, "3"]) -> Surface:
    """The box between two corners [m]."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    outline = np.array([[-y1, z0], [-y0, z0], [-y0, z1], [-y1, z1]])
    ends = np.array([[x0, 0.0, 0.0], [x1, 0.0, 0.0]])
    return sweep(outline, ends, np.tile([0.0, -1.0, 0.0], (2, 1)), np.tile([0.0, 0.0, 1.0], (2, 1)))


def cut(blank: Surface, grooves: Sequence[Surface], steps: Sequence[Surface] = ()) -> LabelledMesh:
    """The blank without the grooves and steps; faces that a groove left are labelled so.

    Raises:
        SceneError: a solid that is not closed (a groove bent too tightly).
    """
    solid = _manifold(blank, "the blank")
    for step in steps:
        solid = solid - _manifold(step, "its lower side")
    cutters = [_manifold(groove, "its swept solid") for groove in grooves]
    for cutter in cutters:
        solid = solid - cutter
    vertices, faces, origin = _parts(solid)
    return LabelledMesh(vertices=vertices, faces=faces, groove=_among(origin, [cutter.original_id() for cutter in cutters]))


def extrude(outline: Float[ndarray, "k 2"], low: float, high: float) -> Surface:
    """A simple polygon (x, y) [m], counter-clockwise, from z = low to z = high [m]."""
    import manifold3d

    solid = manifold3d.Manifold.extrude(manifold3d.CrossSection([outline]), high - low).translate((0.0, 0.0, low))
    vertices, faces, _ = _parts(solid)
    return vertices, faces


def _manifold(surface: Surface, what: str) -> Any:
    """A solid of the library that loads late."""
    import manifold3d

    vertices, faces = surface
    solid = manifold3d.Manifold(manifold3d.Mesh64(np.array(vertices, float), np.array(faces, np.uint64)))
    if solid.status() != manifold3d.Error.NoError:
        raise SceneError(f"groove: {what} is not closed ({solid.status()}); use a larger radius", key="radius")
    return solid.as_original()


def _parts(solid: Any) -> tuple[Float[ndarray, "n 3"], Int[ndarray, "m 3"], Int[ndarray, "m"]]:
    """Vertices, faces, and which original solid each face came from."""
    mesh = solid.to_mesh64()
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    run = np.asarray(mesh.run_index).astype(np.int64) // 3
    origin = np.repeat(np.asarray(mesh.run_original_id).astype(np.int64), np.diff(run))
    return np.array(mesh.vert_properties)[:, :3].copy(), faces, origin


def _among(origin: Int[ndarray, "m"], known: Sequence[int]) -> Bool[ndarray, "m"]:
    return np.isin(origin, np.asarray(known, np.int64))
