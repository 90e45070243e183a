"""The rest of a seam that was begun before: from a little before where the weld was stopped."""

from weldsim.errors import InputError
from weldsim.motion.cut import cut_path
from weldsim.quantity import Metre
from weldsim.records import TorchPath

SHORTEST: Metre = 2e-3  # of seam worth a weld


def rest_of(path: TorchPath, s: Metre, overlap: Metre, name: str) -> TorchPath:
    """The path from `overlap` before arc length `s` on, with the arc lengths of the whole; all of it where that is its beginning.

    Args:
        path: of the whole seam.  s: up to where it was welded [m].  overlap: welded once more [m].  name: of the seam.
    Raises:
        InputError: s is not on the seam, or leaves nothing to be welded.
    """
    begin, end = float(path.s[path.weld][0]), float(path.s[path.weld][-1])
    if not begin - 1e-9 <= s <= end + 1e-9:
        raise InputError(
            f"--from {1e3 * s:g} mm: {name} goes from {1e3 * begin:g} to {1e3 * end:.1f} mm", value=s, limit=(begin, end)
        )
    if end - s < SHORTEST:
        raise InputError(
            f"--from {1e3 * s:g} mm: {1e3 * (end - s):.1f} mm of {name} are left, less than {1e3 * SHORTEST:g} mm;"
            " there is nothing to weld",
            value=s,
            limit=end - SHORTEST,
        )
    start = s - overlap
    return path if start <= begin + 1e-6 else cut_path(path, (start,))[1]
