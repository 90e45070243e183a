"""Every scene that comes with weldsim, by our method, is held against its recorded figures: one seed each.

`weldsim regress` does the same for three seeds and for the published method too.
"""

import pytest

from weldsim.regression import default_golden, read_golden, regress
from weldsim.regression.text import sentence
from weldsim.scene.files import scene_names

pytestmark = pytest.mark.render

GOLDEN = read_golden(default_golden())


@pytest.mark.parametrize("scene", scene_names())
def test_a_scene_comes_out_as_recorded(scene):
    outcome = regress([scene], methods=("profile",), seeds=1, golden=GOLDEN)
    assert [row.judged for row in outcome.rows] == [True], f"{scene} has no recorded figures: weldsim regress --update"
    assert [sentence(deviation) for deviation in outcome.deviations] == []
