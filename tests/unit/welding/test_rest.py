"""The rest of a seam: from the overlap before where it was stopped to its end, with the arc lengths of the whole."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.errors import InputError
from weldsim.records import WeldProgress
from weldsim.welding.rest import rest_of, way_on

PATH = torch_path(flat_curve("arc", 0.25, step=0.003) + np.array([0.0, -0.5, 0.1]), np.array([0.0, 0.0, -1.0]))
END = float(PATH.s[-1])


def far(s: float, welded: float | None = None) -> WeldProgress:
    return WeldProgress(
        length=END, s_from=0.0, s_to=s, welded=s if welded is None else welded, arc=True, position_B=(0.0, 0.0, 0.0)
    )


@pytest.mark.parametrize("s", [0.0301, 0.1, END - 0.0021])
def test_the_rest_begins_the_overlap_before_and_ends_where_the_seam_does(s: float) -> None:
    rest = rest_of(PATH, s, 0.005, "seam-1")
    assert rest.s[0] == pytest.approx(s - 0.005, abs=1e-9)
    assert rest.s[-1] == END
    place = np.array([np.interp(s - 0.005, PATH.s, column) for column in PATH.X_BT.p.T])
    assert np.linalg.norm(rest.X_BT.p[0] - place) < 1e-9
    assert rest.arc_on.all()
    assert rest_of(PATH, s, 0.0, "seam-1").s[0] == pytest.approx(s)


@pytest.mark.parametrize("s", [0.0, 0.003, 0.005])
def test_where_hardly_anything_is_welded_all_of_it_is(s: float) -> None:
    assert rest_of(PATH, s, 0.005, "seam-1") is PATH


@pytest.mark.parametrize(("s", "says"), [(-0.001, "goes from 0 to"), (END + 0.001, "goes from 0 to"), (END - 0.001, "are left")])
def test_what_is_not_on_the_seam_or_leaves_nothing_is_refused(s: float, says: str) -> None:
    with pytest.raises(InputError, match=says):
        rest_of(PATH, s, 0.005, "seam-1")


def test_the_way_on_can_be_followed_and_leaves_no_gap() -> None:
    text = way_on(["weldsim", "execute", "my path.json"], far(0.06938), PATH, Path("runs/my job"))
    words = shlex.split(text.partition(": ")[2])
    assert words == ["weldsim", "execute", "my path.json", "--from", "69.3 mm", "--out", "runs/my job-from-69"]
    again = way_on(["weldsim"], far(0.12), PATH, Path("runs/my job-from-69"))
    assert again.endswith("--from '120 mm' --out 'runs/my job-from-120'")
    assert "too little" in way_on(["weldsim"], far(END - 0.001), PATH, Path("out"))
    begun = way_on(["weldsim"], far(0.064, welded=0.0), PATH, Path("out"), 0.069)
    assert begun == "nothing of it is welded; to weld it: weldsim --from '69 mm' --out out"
