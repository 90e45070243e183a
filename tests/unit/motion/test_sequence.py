"""Several paths in sequence: each starts where the last one ended, the arm comes home once, a path that cannot be is named."""

from dataclasses import replace

import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.motion.config import MotionConfig
from weldsim.motion.sequence import plan_sequence
from weldsim.records import Segment, TorchPath


def line(x: float, y: float = -0.48) -> TorchPath:
    return torch_path(flat_curve("line", 0.02) + np.array([x, y, 0.06]), np.array([0.0, 0.0, -1.0]), speed=0.02)


@pytest.mark.parametrize("home", [True, False])
def test_each_starts_where_the_last_one_ended(home: bool) -> None:
    paths = [line(-0.1), line(0.0), line(0.1)]
    plans = plan_sequence(paths, START, MotionConfig(return_home=home))
    q = START
    for path, plan in zip(paths, plans, strict=True):
        trajectory = plan.trajectory
        assert np.abs(trajectory.q[0] - q).max() < 1e-9
        q = trajectory.q[-1]
        weld = [i for i, segment in enumerate(trajectory.segments) if segment == Segment.WELD]
        assert trajectory.s[weld[-1]] == pytest.approx(path.s[-1])
        assert (trajectory.arc_on <= np.array([segment == Segment.WELD for segment in trajectory.segments])).all()
    assert (np.abs(q - START).max() < 1e-9) == home
    between = plans[0].trajectory.segments
    assert between[-1] != Segment.AIR  # it does not go home after each


def test_the_path_that_cannot_be_welded_is_named() -> None:
    far = line(0.0)
    far = replace(far, X_BT=Transform("BT", far.X_BT.R, far.X_BT.p + np.array([0.0, -1.0, 0.0])))
    with pytest.raises(MotionError, match=r"^seam 2: "):
        plan_sequence([line(0.0), far], START, names=["seam 1", "seam 2"])
    with pytest.raises(MotionError, match=r"^(?!path 1)"):
        plan_sequence([far], START)
