"""The rest of a seam that was begun before: from a little before where the weld was stopped."""

import re
import shlex
from pathlib import Path

from weldsim.errors import InputError
from weldsim.motion.cut import cut_path
from weldsim.quantity import Metre
from weldsim.records import TorchPath, WeldProgress

FROM = re.compile(r"-from-\d+$")  # what a run directory of a rest ends in
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


def way_on(words: list[str], far: WeldProgress, path: TorchPath, folder: Path, begun: Metre | None = None) -> str:
    """How to go on with a weld that was stopped, in words: the command that welds the rest, or that there is none.

    Args:
        words: of the command that welds the seam, without where from and where to.  far: how far the weld came.
        path: it was on.  folder: its run directory.  begun: where it was itself to go on from [m].
    """
    left = float(path.s[path.weld][-1]) - far.s_to
    if left < SHORTEST:
        return f"{1e3 * left:.1f} mm of the seam are left, too little to go on with"
    if far.welded <= 0:
        again = [*words, *([] if begun is None else ["--from", f"{1e3 * begun:.10g} mm"]), "--out", str(folder)]
        return f"nothing of it is welded; to weld it: {shlex.join(again)}"
    tenths = int(far.s_to * 1e4 + 1e-6)  # rounded up, a gap would be left
    beside = folder.with_name(f"{FROM.sub('', folder.name)}-from-{1e3 * far.s_to:.0f}")
    rest = [*words, "--from", f"{tenths / 10:g} mm", "--out", str(beside)]
    return f"to go on from there: {shlex.join(rest)}"
