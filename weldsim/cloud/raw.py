"""What a file reader hands over: arrays as they stood in the file, not yet checked, scaled or cleaned."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.columns import UNITS, by_role, read_name
from weldsim.counted import counted

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}  # per unit of a cloud
MAX_POINTS = 50_000_000  # more is refused before anything is allocated: 1.2 GB of coordinates alone


class Unreadable(ValueError):  # noqa: N818 - a reason, turned into CloudFileError (which knows the path) by its caller
    """Why bytes are no cloud, in one clause."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RawCloud:
    """Arrays as a file holds them.

    Attributes:
        points: (n, 3) in the file's unit, possibly not finite.
        normals: (n, 3) of any length, or None.
        colours: (n, 3) in [0, 1], or None.
        viewpoints: (k, 3) where the cameras stood, in the file's unit; k = 0 when the file does not say.
        view: (n,) which viewpoint saw each point, or None.
        unit: of length, "m", "cm", "mm", "um", "in" or "ft", where the file says; None where it does not.
        numbered: whether what was read as x counts the rows.
        rotation: (3, 3) of the one sensor in the frame of its viewpoint, where the file gives one that is not the identity.
        notes: what was done to the points, one sentence each, for people.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"] | None = None
    colours: Float[ndarray, "n 3"] | None = None
    viewpoints: Float[ndarray, "k 3"] | None = None
    view: ndarray | None = None
    unit: str | None = None
    numbered: bool = False
    rotation: Float[ndarray, "3 3"] | None = None
    notes: tuple[str, ...] = ()


def check_count(count: int) -> None:
    """Raises Unreadable for a number of points that nobody means."""
    if count <= 0:
        raise Unreadable(f"it declares {counted(count, 'point')}")
    if count > MAX_POINTS:
        raise Unreadable(f"it declares {count} points (limit {MAX_POINTS}); crop or thin it first")


XYZ = [("x", "y", "z")]
NORMALS = [("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z")]
COLOURS = [("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue")]


def from_columns(
    columns: Mapping[str, ndarray],
    *,
    viewpoints: Float[ndarray, "k 3"] | None = None,
    rotation: Float[ndarray, "3 3"] | None = None,
    unit: str | None = None,
) -> RawCloud:
    """The cloud in named columns of equal length. Raises Unreadable when x, y or z is not among them."""

    def stack(choices: list[tuple[str, str, str]]) -> ndarray | None:
        for names in choices:
            if all(name in columns for name in names):
                out = np.empty((len(columns[names[0]]), 3))
                for axis, name in enumerate(names):
                    out[:, axis] = columns[name]
                return out
        return None

    points = stack(XYZ)
    if points is None:
        columns, unit = _renamed(columns, unit)
        points = stack(XYZ)
    assert points is not None
    colours = stack(COLOURS)
    if colours is not None:
        whole = all(columns[name].dtype.kind in "iu" for names in COLOURS for name in names if name in columns)
        colours = unit_colours(colours, whole=whole)
    return RawCloud(points=points, normals=stack(NORMALS), colours=colours, viewpoints=viewpoints, unit=unit, rotation=rotation)


def _renamed(columns: Mapping[str, ndarray], unit: str | None) -> tuple[dict[str, ndarray], str | None]:
    """The columns with what their names mean as names, posx or x_mm say, and the unit of length that these give.

    Raises:
        Unreadable: names without x, y and z, or with two of one, or axes in different units.
    """
    names = [read_name(name) for name in columns]
    try:
        found = by_role(names)
    except ValueError:
        raise Unreadable(f"it has no x, y and z among {', '.join(columns) or 'its fields'}") from None
    units = {names[found[axis]].unit for axis in XYZ[0]}
    scales = {UNITS.get(each or "") for each in units}
    said = next((name for name in METRES if scales == {METRES[name]}), None)
    if units != {None} and said is None:
        raise Unreadable(
            f"its x, y and z ({', '.join(names[found[axis]].text for axis in XYZ[0])}) are not in one unit that is known"
        )
    values = list(columns.values())
    rest = {name: column for i, (name, column) in enumerate(columns.items()) if i not in found.values()}
    return rest | {role: values[at] for role, at in found.items()}, said or unit


def unit_colours(colours: Float[ndarray, "n 3"], *, whole: bool = False) -> Float[ndarray, "n 3"]:
    """Colours in [0, 1] from values of 0 to 255 (`whole`, or any above 1), to 65535 (any above 255) or to 1; not finite is 0."""
    if not np.isfinite(colours).all():
        colours = np.nan_to_num(colours, nan=0.0, posinf=0.0, neginf=0.0)
    if whole or (colours.size and colours.max() > 1.0):
        colours = colours / (65_535.0 if colours.size and colours.max() > 255.0 else 255.0)
    return np.clip(colours, 0.0, 1.0)
