"""The seam of one's own part: a text file of points on the groove's opening, in order."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import SceneError

COLUMNS = ("x", "y", "z", "nx", "ny", "nz", "width")
UNNAMED = {3: COLUMNS[:3], 4: ("x", "y", "z", "width"), 6: COLUMNS[:6], 7: COLUMNS}
MOST = 100_000  # lines


@dataclass(frozen=True, eq=False, kw_only=True)
class SeamFile:
    """What a seam file says.

    Attributes:
        points: (n, 3) of the opening, in order [m].
        normals: (n, 3) out of the surface, not of unit length perhaps; None where not given.
        width: (n,) between the lips [m]; None where not given.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"] | None
    width: Float[ndarray, "n"] | None


def read_seam_file(path: Path, scale: float) -> SeamFile:
    """The seam in a CSV file: x, y, z on each line, optionally nx, ny, nz (the surface's outward normal) and width.

    Columns may be named on the first line, then in any order; without names they are x y z, x y z width, x y z nx ny nz, or
    x y z nx ny nz width. Commas, semicolons or white space part them; what follows a # is a comment.

    Args:
        path: of the file.  scale: metres per unit of its lengths.
    Raises:
        SceneError: a file that is missing, no text, or malformed (with the line), or fewer than two different points.
    """
    rows, names = [], None
    for number, line in enumerate(_lines(path), start=1):
        cells = [cell for cell in re.split(r"[,;\s]+", line.partition("#")[0].strip()) if cell]
        if not cells:
            continue
        if names is None:
            names = _names(path, number, cells)
            if names[0] in cells:
                continue
        rows.append(_row(path, number, cells, names))
    if names is None or not rows:
        raise SceneError(f"{path}: no points; a seam needs two, x, y, z on each line", path=str(path))
    table = np.array(rows)
    moved = np.concatenate([[True], np.linalg.norm(np.diff(table[:, [names.index(c) for c in "xyz"]], axis=0), axis=1) > 0])
    table = table[moved]
    if len(table) < 2:
        raise SceneError(f"{path}: its points are all the same; a seam needs two", path=str(path))
    column = {name: table[:, i] for i, name in enumerate(names)}
    normals = np.stack([column[c] for c in ("nx", "ny", "nz")], axis=1) if "nx" in column else None
    if normals is not None and not (np.linalg.norm(normals, axis=1) > 1e-6).all():
        raise SceneError(f"{path}: a normal is zero", path=str(path), key="nx")
    width = column["width"] * scale if "width" in column else None
    if width is not None and not (width > 0).all():
        raise SceneError(f"{path}: a width is not positive", path=str(path), key="width")
    return SeamFile(points=np.stack([column[c] for c in "xyz"], axis=1) * scale, normals=normals, width=width)


def _lines(path: Path) -> list[str]:
    """The file's lines. Raises SceneError."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise SceneError(f"mesh.seam {path}: no such file", path=str(path), key="seam") from None
    except OSError as error:
        raise SceneError(f"mesh.seam {path}: cannot be read ({error.strerror})", path=str(path), key="seam") from None
    except UnicodeDecodeError:
        raise SceneError(f"mesh.seam {path}: is no text", path=str(path), key="seam") from None
    if len(lines) > MOST:
        raise SceneError(f"mesh.seam {path}: {len(lines)} lines; at most {MOST} are read", path=str(path), limit=MOST)
    return lines


def _names(path: Path, number: int, cells: list[str]) -> list[str]:
    """The columns' names: those on the first line where it has some, else by their number."""
    try:
        [float(cell) for cell in cells]
    except ValueError:
        named = [cell.strip("\"'").lower() for cell in cells]
        wrong = [name for name in named if name not in COLUMNS]
        complete = {"x", "y", "z"} <= set(named) and len({"nx", "ny", "nz"} & set(named)) in (0, 3)
        if wrong or not complete or len(set(named)) < len(named):
            raise SceneError(
                f"{path}, line {number}: columns {', '.join(cells)[:60]!r}; wanted are x, y, z, and perhaps nx, ny, nz and width",
                path=str(path),
                allowed=COLUMNS,
            ) from None
        cells[:] = named
        return named
    if len(cells) not in UNNAMED:
        raise SceneError(
            f"{path}, line {number}: {len(cells)} columns; wanted are 3 (x y z), 4 (and width), 6 (x y z nx ny nz) or 7",
            path=str(path),
            allowed=tuple(UNNAMED),
        )
    return list(UNNAMED[len(cells)])


def _row(path: Path, number: int, cells: list[str], names: list[str]) -> list[float]:
    if len(cells) != len(names):
        raise SceneError(f"{path}, line {number}: {len(cells)} columns, {len(names)} before", path=str(path), line=number)
    try:
        row = [float(cell) for cell in cells]
    except ValueError:
        raise SceneError(f"{path}, line {number}: {' '.join(cells)[:60]!r} are no numbers", path=str(path), line=number) from None
    if not np.isfinite(row).all():
        raise SceneError(f"{path}, line {number}: a number that is not finite", path=str(path), line=number)
    return row
