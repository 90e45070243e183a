"""Whether a cloud's size and place fit its unit and the robot: each refusal says what to do, and has tried it."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.cloud.raw import METRES, RawCloud
from weldsim.counted import counted
from weldsim.errors import CloudError
from weldsim.records import MILLIMETRE_SPAN, PointCloud

NAMES = {"m": "metres", "mm": "millimetres", "cm": "centimetres", "um": "micrometres", "in": "inches", "ft": "feet"}
PROPOSED = ("mm", "cm", "in", "um")  # units that a cloud too wide in metres may be in
MIN_SPAN = 0.005  # [m] a cloud smaller than this was scaled down twice, or shows no weld
MAX_GRAIN = 0.0002  # [m] between neighbouring coordinates of a file in single precision
WHOLE = 2.0**23  # from here on single precision holds whole numbers alone
FARTHEST = 3.0  # [m] from the base to the nearest point of a cloud: no arm of a welding cell reaches so far
FARTHEST_CAMERA = 5.0  # [m] from the cloud, or from the base with the cloud seen from there: depth cameras see no groove so far
NEAREST_CAMERA = 0.25  # [m] from the base: nearer, the arm is in its way
ROOM_SPACING = 0.05  # [m] between neighbouring points below which a scan of over 5 m may be one of a room, in metres
USUAL_SPACING = 0.8e-3  # [m] between neighbouring points of scans of parts
FEW = 3.0  # times the usual spacing above which whole numbers may be counts of a smaller unit
LEAST_PART, MOST_PART = 0.02, MILLIMETRE_SPAN  # [m] span of what another unit must give to be proposed
REACH = ((-1.5, -1.5, -0.5), (1.5, 1.5, 1.5))  # [m] corners of the box about the base that is proposed to crop to
FEWEST_IN_REACH = 100  # points there for it to be proposed


def check_grain(path: str, points: Float[ndarray, "n 3"], scale: float) -> None:
    """Raises CloudError where single precision, so far from the origin, leaves less than the shape of a groove."""
    reach = float(np.abs(points).max())
    grain = float(np.spacing(np.float32(min(reach, 1e30)))) * scale
    if grain <= MAX_GRAIN or (reach < WHOLE and _are_whole(points)):
        return
    if (points.astype(np.float32) == points).all():
        raise CloudError(
            f"{path}: its single-precision coordinates reach {reach * scale:.3g} m, where they lie {grain * 1e3:.2g} mm apart"
            f" (limit {MAX_GRAIN * 1e3:g} mm): subtract the offset before saving, or save doubles",
            path=path,
            grain=grain,
            limit=MAX_GRAIN,
        )


def _are_whole(points: Float[ndarray, "n 3"]) -> bool:
    """Whether all coordinates are whole numbers, as counts of a sensor are."""
    return bool((points == np.round(points)).all())


def check_extent(path: str, points: Float[ndarray, "n 3"], unit: str, dropped: int, raw: RawCloud) -> None:
    """Raises CloudError when the extent shows that the unit is wrong, or that the cloud must be cropped.

    Args:
        points: (n, 3) [m], read in `unit`.  dropped: points that were not finite, or zero.  raw: what the file said of itself.
    """
    span = float(np.ptp(points, axis=0).max())
    left_out = f" ({counted(dropped, 'point')}, not finite or zero, left out)" if dropped else ""
    if span > MILLIMETRE_SPAN:
        advice = _too_wide(points, unit, span, raw)
        raise CloudError(
            f"{path}: spans {span:.4g} m read in {unit} (limit {MILLIMETRE_SPAN:g} m){left_out}; {advice}", path=path, span=span
        )
    if unit != "m" and 0 < span < MIN_SPAN:
        meant = next((name for name in ("m", *PROPOSED) if LEAST_PART <= span / METRES[unit] * METRES[name] <= MOST_PART), "m")
        advice = f"it looks like {NAMES[meant]}: pass --units {meant}"
        advice = "its header names that unit: correct it" if raw.unit is not None else advice
        raise CloudError(
            f"{path}: spans {span * 1e3:.3g} mm read in {unit} (least {MIN_SPAN * 1e3:g} mm){left_out}; {advice}",
            path=path,
            span=span,
        )


def check_extent_of_array(name: str, points: Float[ndarray, "n 3"]) -> None:
    """Raises CloudError for an array of points that is not in metres, or must be cropped. Args: name, what to call it."""
    span = float(np.ptp(points, axis=0).max())
    if span <= MILLIMETRE_SPAN:
        return
    spacing = _spacing(points)
    meant = " or ".join(f"{NAMES[unit]} (times {METRES[unit]:g})" for unit in _units_of_part(span, spacing))
    advice = f"it looks like {meant}; metres are wanted" if spacing >= ROOM_SPACING and meant else "crop it to the workpiece"
    if spacing < ROOM_SPACING and meant:
        advice += f"; or give metres if its numbers are {meant}"
    raise CloudError(f"{name}: spans {span:.4g} m (limit {MILLIMETRE_SPAN:g} m): {advice}", span=span)


def check_box(box: Sequence[Sequence[float]] | Float[ndarray, "2 3"]) -> Float[ndarray, "2 3"]:
    """Lower and upper corner [m] of a crop box. Raises CloudError for what is none."""
    try:
        corners = np.array(box, float)
    except (TypeError, ValueError):
        corners = np.zeros(0)
    if corners.shape != (2, 3) or np.isnan(corners).any() or (corners[0] >= corners[1]).any():
        raise CloudError(f"crop {box!r:.100}: a lower and an upper corner, x, y, z in metres each, are needed", crop=box)
    return corners


def cropped_to(box: Sequence[Sequence[float]] | Float[ndarray, "2 3"], points: Float[ndarray, "n 3"]) -> Bool[ndarray, "n"]:
    """Which points (n,) lie in a box given by its corners, edges included."""
    low, high = np.array(box[0], float), np.array(box[1], float)
    x, y, z = ((points >= low) & (points <= high)).T
    return x & y & z


def _too_wide(points: Float[ndarray, "n 3"], unit: str, span: float, raw: RawCloud) -> str:
    """What to do about a cloud of more than MILLIMETRE_SPAN."""
    if raw.numbered:
        return "what was read as x counts the rows: name the columns in a first line (id x y z, say)"
    low, high = np.percentile(points[:: max(1, len(points) // 20_000)], [2, 98], axis=0)
    bulk = float((high - low).max())
    if bulk <= MILLIMETRE_SPAN / 2:
        return f"96 % of the points lie within {bulk:.3g} m: remove the stray ones{_crop(points)}"
    spacing = _spacing(points)
    guesses = _units_of_part(span, spacing) if unit == "m" else []
    if raw.unit == "m" and guesses and spacing >= ROOM_SPACING:
        return f"its header says metres, but it looks like {' or '.join(NAMES[guess] for guess in guesses)}: correct the header"
    if raw.unit is None and guesses:
        if METRES[guesses[0]] > MAX_GRAIN and spacing * METRES[guesses[0]] > FEW * USUAL_SPACING and _are_whole(points):
            return (
                "its coordinates are whole numbers, counts of a sensor perhaps: multiply them by the length of one count; as"
                f" {NAMES[guesses[0]]} (--units {guesses[0]}) they are too coarse for the shape of a groove"
            )
        if spacing < ROOM_SPACING:
            return f"crop it to the workpiece{_crop(points)}; or pass --units {guesses[0]} if its numbers are {NAMES[guesses[0]]}"
        if len(guesses) == 1:
            return f"it looks like {NAMES[guesses[0]]}: pass --units {guesses[0]}"
        sizes = " or ".join(f"--units {guess}, which makes it {span * METRES[guess]:.3g} m" for guess in guesses)
        return f"it looks like {' or '.join(NAMES[guess] for guess in guesses)}: pass {sizes}"
    return f"crop it to the workpiece{_crop(points)}" + ("" if unit == "m" else ", or correct its unit")


def _crop(points: Float[ndarray, "n 3"]) -> str:
    """The option that keeps what the arm can reach, where there is something; else nothing."""
    if int(cropped_to(REACH, points).sum()) < FEWEST_IN_REACH:
        return ""
    low, high = ("[" + ",".join(f"{value:g}" for value in corner) + "]" for corner in REACH)
    return f" (--set cloud.crop_min={low} --set cloud.crop_max={high} keeps what an arm at the origin reaches)"


def _units_of_part(span: float, spacing: float) -> list[str]:
    """The units in which points of this span and spacing, both read in metres, are most like the scan of a part, likeliest first:
    one, or centimetres and inches, which are too much alike for a guess."""
    fits = [name for name in PROPOSED if LEAST_PART <= span * METRES[name] <= MOST_PART]
    if spacing < ROOM_SPACING:
        fits = [name for name in fits if spacing * METRES[name] > 0.1 * USUAL_SPACING]
    fits.sort(key=lambda name: abs(np.log(spacing * METRES[name] / USUAL_SPACING)))
    return [name for name in fits[:2] if name in fits[:1] or {name, fits[0]} == {"cm", "in"}]


def _spacing(points: Float[ndarray, "n 3"]) -> float:
    """Median distance from a point to its nearest neighbour that lies elsewhere [m]: rounded numbers put many in one place."""
    from scipy.spatial import KDTree  # reading a good cloud never needs it

    points = np.unique(points, axis=0)
    looks = points[:: max(1, len(points) // 2_000)]
    distance, _ = KDTree(points).query(looks, k=2)
    return max(float(np.median(distance[:, 1])), 1e-9)


def check_viewpoints(path: str, points: Float[ndarray, "n 3"], viewpoints: Float[ndarray, "k 3"], *, option: bool) -> None:
    """Raises CloudError where a camera stood so far from the cloud that its position must be in another unit or frame.

    Args:
        points: (n, 3) [m].  viewpoints: (k, 3) [m].  option: whether --viewpoint gave it, rather than the file.
    """
    if len(viewpoints) == 0 or _nearest(points) > FARTHEST:  # such a cloud is itself what is wrong: see check_reach
        return
    low, high = points.min(axis=0), points.max(axis=0)
    away = np.linalg.norm(viewpoints - np.clip(viewpoints, low, high), axis=1)
    worst = int(away.argmax())
    if away[worst] <= FARTHEST_CAMERA:
        return
    shown = " ".join(f"{value:g}" for value in viewpoints[worst])
    name = f"--viewpoint {shown}" if option else f"{path}: the viewpoint in it, ({shown.replace(' ', ', ')}) m,"
    advice = "is it in the cloud's frame?" if option else "--viewpoint X Y Z says where the camera stood, in metres"
    if (told := meant_metres(viewpoints[worst])) is not None:
        x, y, z = (f"{value:.6g}" for value in told[1])
        advice = f"it looks like {told[0]}; it is in metres whatever the cloud's unit: --viewpoint {x} {y} {z}"
    raise CloudError(
        f"{name} is {away[worst]:.4g} m from the cloud (limit {FARTHEST_CAMERA:g} m): {advice}",
        path=path,
        distance=float(away[worst]),
        limit=FARTHEST_CAMERA,
    )


def meant_metres(position: Float[ndarray, "3"]) -> tuple[str, Float[ndarray, "3"]] | None:
    """The unit that a camera's position, far too large in metres, looks like, and the position in metres; None for no unit."""
    away = float(np.linalg.norm(position))
    for unit, meant in (("mm", "millimetres"), ("cm", "centimetres"), ("in", "inches")):
        if NEAREST_CAMERA <= away * METRES[unit] <= MILLIMETRE_SPAN / 2:
            return meant, position * METRES[unit]
    return None


def check_reach(cloud: PointCloud) -> None:
    """Raises CloudError for a cloud in the robot base that lies where no arm reaches."""
    if not len(cloud):
        return
    nearest = _nearest(cloud.points)
    if nearest > FARTHEST:
        raise CloudError(
            f"the cloud's nearest point is {nearest:.4g} m from the robot's base (limit {FARTHEST:g} m): nothing an arm reaches;"
            " its points must be in the frame of the robot's base, in metres",
            distance=nearest,
            limit=FARTHEST,
        )


def _nearest(points: Float[ndarray, "n 3"]) -> float:
    """Distance of the nearest point from the base [m]."""
    return float(np.sqrt(np.einsum("ij,ij->i", points, points).min()))
