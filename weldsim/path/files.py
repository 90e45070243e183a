"""Torch paths as files: the JSON schema `weldsim.path/1` and CSV with UR poses.

A document holds the WELD poses of each seam (air moves, approach and retract belong to a cell, not to a workpiece).
Lengths are metres, angles radians, `position` and `quaternion_wxyz` are X_BT: the torch tip (wire tip at nominal
stick-out) in the robot base as the controller reports it. Everything but `timing` depends on input, config and seed
alone, so `path_text(document, timing=False)` is the same bytes for the same inputs.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.counted import counted
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.mounts import X_FT
from weldsim.output import write_whole
from weldsim.quantity import MetrePerSecond
from weldsim.records import MILLIMETRE_SPAN, Seam, Segment, TorchPath
from weldsim.rounded import rounded

SCHEMA = "weldsim.path/1"
DECIMALS = 9  # a nanometre, a nanoradian: below any sensor, above the rounding noise of another machine
QUATERNION_TOLERANCE = 1e-6
SHORTEST = 1e-6  # [m] of a path
MOST_OFF = 2.0  # by which factor s may differ from the way along the positions: those of a bend may be few


def path_document(
    seams: tuple[Seam, ...],
    paths: tuple[TorchPath | None, ...],
    timing: dict[str, float],
    source: dict[str, Any],
    config_digest: str,
    *,
    numbers: tuple[int, ...] | None = None,
    refused: Mapping[int, str] | None = None,
) -> dict[str, Any]:
    """The `weldsim.path/1` document of seams and the torch paths along them, as plain lists and numbers.

    Args:
        seams: best first.  paths: one for each seam, in the same order, None where it has none.
        timing: seconds a stage, kept under the one key `timing`.
        source: what was planned from (file name, points, viewpoint); kept under `input`.
        config_digest: of the resolved config.
        numbers: of the seams among all that were found; 1, 2, ... by default.
        refused: why a seam has no path, by its place in `seams`; kept under `refused` with its id and length.
    Raises:
        InputError: seams and paths that do not pair up.
    """
    if len(seams) != len(paths):
        raise InputError(
            f"path document: {counted(len(seams), 'seam')} and {counted(len(paths), 'torch path')}; each seam needs one",
            seams=len(seams),
        )
    named = numbers or range(1, len(seams) + 1)
    entries = list(zip(named, seams, paths, strict=True))
    reasons = refused or {}
    return {
        "schema": SCHEMA,
        "frame": "base",
        "units": {"length": "m", "angle": "rad"},
        "seams": [_seam_entry(number, seam, path) for number, seam, path in entries if path is not None],
        "refused": [
            {"id": f"seam-{number}", "length": round(seam.length, DECIMALS), "reason": reasons.get(i, "no path")}
            for i, (number, seam, path) in enumerate(entries)
            if path is None
        ],
        "timing": {stage: round(float(seconds), 6) for stage, seconds in timing.items()},
        "input": source,
        "config_digest": config_digest,
    }


def path_text(document: dict[str, Any], *, timing: bool = True) -> str:
    """The document as JSON text, one pose a line; without the run times when `timing` is false (for comparisons)."""
    kept = dict(document) if timing else {**document, "timing": {}}
    seams = kept.pop("seams")
    head = json.dumps(rounded(kept), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    body = ",\n".join(_seam_text(seam) for seam in seams)
    return f'{head[:-1]},\n"seams":[{body}]}}\n'


def write_path_json(path: Path | str, document: dict[str, Any]) -> Path:
    """The file written, whole or not at all. Raises OutputError."""
    return write_whole(path, path_text(document))


def write_path_csv(path: Path | str, document: dict[str, Any], *, tool: Literal["torch", "tool0"] = "torch") -> Path:
    """The CSV written: seam, s, x, y, z, rx, ry, rz [m, rad], a UR pose a row in the controller's base.

    Args:
        document: a `weldsim.path/1` document.
        tool: which frame the poses are of: "torch" for programs that call set_tcp (the header gives its argument),
            "tool0" for programs whose TCP is the bare flange.
    Raises:
        OutputError: the file cannot be written.
    """
    tcp = ",".join(f"{v:.6f}" for v in (*X_FT.p, *X_FT.rotation_vector)) if tool == "torch" else "0,0,0,0,0,0"
    what = "torch tip (TCP)" if tool == "torch" else "tool0 (bare flange)"
    lines = [
        f"# {SCHEMA}: poses of the {what} in the UR controller's base; position [m], rotation vector [rad], 0 <= angle <= pi",
        f"# run with set_tcp(p[{tcp}])",
        "seam,s,x,y,z,rx,ry,rz",
    ]
    for seam, torch in zip(document["seams"], torch_paths(document), strict=True):
        X = torch.X_BT if tool == "torch" else torch.X_BT @ X_FT.inverse()
        table = np.column_stack([torch.s, X.p, X.rotation_vector])
        lines += [f"{seam['id']}," + ",".join(map(_fixed, row)) for row in table]
    return write_whole(path, "\n".join(lines) + "\n")


def read_path_json(path: Path | str) -> dict[str, Any]:
    """The `weldsim.path/1` document in a file, checked.

    Raises:
        InputError: no such file, no JSON, another schema, frame or unit, a seam with fewer than two poses, a number
            that is not finite, a quaternion that is not of unit length, coordinates that look like millimetres.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        document = json.loads(text)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})", path=str(path)) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no JSON ({error})", path=str(path)) from error
    check_document(document, where=str(path))
    return document


def check_document(document: Any, *, where: str = "path document") -> None:
    """Nothing, when `document` obeys `weldsim.path/1`. Raises InputError naming the place, value and limit otherwise."""
    _need(isinstance(document, dict), where, "holds no JSON object")
    _need(document.get("schema") == SCHEMA, where, f"schema {document.get('schema')!r}, expected {SCHEMA!r}")
    _need(document.get("frame") == "base", where, f"frame {document.get('frame')!r}, expected 'base'")
    _need(document.get("units") == {"length": "m", "angle": "rad"}, where, "units must be m and rad")
    seams = document.get("seams")
    _need(isinstance(seams, list), where, "seams is no list")
    for i, seam in enumerate(seams):
        _check_seam(seam, f"{where}: seams[{i}]")


def torch_paths(document: dict[str, Any], *, speed: MetrePerSecond = 6e-3) -> tuple[TorchPath, ...]:
    """The WELD path of each seam of a checked document; `speed` [m/s] where the seam names none."""
    out = []
    for seam in document["seams"]:
        poses = seam["poses"]
        n = len(poses)
        out.append(
            TorchPath(
                X_BT=Transform.from_quaternion("BT", _column(poses, "quaternion_wxyz"), _column(poses, "position")),
                s=_column(poses, "s"),
                speed=np.full(n, float(seam.get("speed", speed))),
                arc_on=np.ones(n, bool),
                segments=(Segment.WELD,) * n,
            )
        )
    return tuple(out)


def _seam_entry(number: int, seam: Seam, path: TorchPath) -> dict[str, Any]:
    weld = path.weld
    poses = zip(
        _numbers(path.s[weld] - path.s[weld.start]),
        _numbers(path.X_BT.p[weld]),
        _numbers(path.X_BT.quaternion[weld]),
        strict=True,
    )
    return {
        "id": f"seam-{number}",
        "joint": seam.joint,
        "reference": seam.reference,
        "closed": seam.closed,
        "length": round(seam.length, DECIMALS),
        "width": round(float(seam.width), DECIMALS),
        **({"step": round(float(seam.step), DECIMALS)} if seam.step else {}),
        "confidence": round(float(seam.confidence), DECIMALS),
        # One speed for a seam: a weave's faster tip is made by the path, its travel speed is the median.
        "speed": round(float(np.median(path.speed[weld])), DECIMALS),
        "points": _numbers(seam.points_B),
        "sigma": [] if seam.sigma is None else _numbers(seam.sigma),
        "gaps": [_numbers(np.array(gap)) for gap in seam.gaps],
        "poses": [{"s": s, "position": p, "quaternion_wxyz": q} for s, p, q in poses],
    }


def _seam_text(seam: dict[str, Any]) -> str:
    """One seam as JSON, each pose on its own line so that files can be compared by eye."""
    poses = ",\n".join(json.dumps(pose, allow_nan=False, separators=(",", ":")) for pose in seam["poses"])
    rest = {key: value for key, value in seam.items() if key != "poses"}
    head = json.dumps(rest, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return f'{head[:-1]},"poses":[\n{poses}\n]}}'


def _numbers(values: ndarray) -> list[Any]:
    """Lists rounded to `DECIMALS`, with no negative zero (its sign differs between machines)."""
    return (np.round(values, DECIMALS) + 0.0).tolist()


def _fixed(value: float) -> str:
    return f"{round(float(value), DECIMALS) + 0.0:.{DECIMALS}f}"


def _column(poses: list[dict[str, Any]], key: str) -> ndarray:
    return np.array([pose[key] for pose in poses], dtype=float)


def _need(condition: bool, where: str, message: str) -> None:
    if not condition:
        raise InputError(f"{where}: {message}", where=where)


def _check_seam(seam: Any, where: str) -> None:
    _need(isinstance(seam, dict), where, "is no object")
    _need(isinstance(seam.get("id"), str), where, f"id {seam.get('id')!r} is no text")
    speed = seam.get("speed", 1.0)
    _need(type(speed) in (int, float) and math.isfinite(speed) and speed > 0, where, f"speed {speed!r} m/s is not positive")
    points = _array(seam.get("points"), (3,), f"{where}.points")
    _need(len(points) >= 2, where, f"{counted(len(points), 'point')}; a seam needs two")
    _array(seam.get("sigma", []), (), f"{where}.sigma")
    _array(seam.get("gaps", []), (2,), f"{where}.gaps")
    poses = seam.get("poses")
    _need(isinstance(poses, list) and all(isinstance(pose, dict) for pose in poses), where, "poses is no list of objects")
    _need(len(poses) >= 2, where, f"{counted(len(poses), 'pose')}; a path needs two")
    position = _array([pose.get("position") for pose in poses], (3,), f"{where}.position")
    quaternion = _array([pose.get("quaternion_wxyz") for pose in poses], (4,), f"{where}.quaternion_wxyz")
    s = _array([pose.get("s") for pose in poses], (), f"{where}.s")
    _need(bool((np.diff(s) >= 0).all()), where, "s decreases along the poses")
    for name, values in (("points", points), ("position", position)):
        span = float(np.ptp(values, axis=0).max())
        _need(
            span <= MILLIMETRE_SPAN, f"{where}.{name}", f"spans {span:.4g} m (limit {MILLIMETRE_SPAN:g} m): looks like millimetres"
        )
    way = float(np.linalg.norm(np.diff(position, axis=0), axis=1).sum())
    _need(way > SHORTEST, where, f"all {len(poses)} poses are in one place; a path has a length")
    told = float(s[-1] - s[0])
    _need(
        way / MOST_OFF <= told <= MOST_OFF * way,
        where,
        f"s goes over {told:.4g} m, the positions over {way:.4g} m (limit {MOST_OFF:g} times); s is the arc length in metres",
    )
    defect = np.abs(np.linalg.norm(quaternion, axis=1) - 1.0)
    worst = int(defect.argmax())
    _need(
        bool(defect[worst] <= QUATERNION_TOLERANCE),
        f"{where}.poses[{worst}]",
        f"quaternion length is off 1 by {defect[worst]:.2g} (limit {QUATERNION_TOLERANCE:g})",
    )


def _array(values: Any, tail: tuple[int, ...], where: str) -> Float[ndarray, "..."]:
    """An array of finite numbers, shape (n, *tail)."""
    try:
        array = np.array(values)
        numeric = array.dtype.kind in "iuf" or array.size == 0
    except (ValueError, OverflowError):  # ragged lists
        array, numeric = np.empty(()), False
    shaped = array.size == 0 if array.ndim == 1 and not len(array) else array.shape[1:] == tail and array.ndim == 1 + len(tail)
    _need(numeric and shaped, where, f"must be a list of {'numbers' if not tail else f'{tail[0]} numbers each'}")
    array = array.astype(float).reshape(-1, *tail)
    bad = int((~np.isfinite(array)).sum())
    _need(bad == 0, where, f"{counted(bad, 'value')} {'is' if bad == 1 else 'are'} not finite")
    return array
