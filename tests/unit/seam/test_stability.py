"""What the report says of the threshold: how far the seam moves when it does."""

from dataclasses import replace

import numpy as np
import pytest

from tests.clouds import groove_cloud
from tests.seams import found_seam, sine_seam
from weldsim.records import SeamFindings, Threshold
from weldsim.seam import stability
from weldsim.seam.config import SeamConfig
from weldsim.seam.find import find_seams
from weldsim.seam.stability import FACTORS, with_stability

KEYS = [f"{factor:g}" for factor in FACTORS]


@pytest.mark.parametrize(("method", "most"), [("profile", 1e-3), ("thesis", np.inf)])
def test_it_is_told_for_either_method(method, most: float) -> None:
    """A clear groove hardly moves by ours; by the published method it may well be lost."""
    made = groove_cloud(np.random.default_rng(1), curve="arc", noise="iid", table=False, size=(0.14, 0.10))
    config = SeamConfig(method=method)
    found = find_seams(made.cloud, config)
    told = with_stability(made.cloud, found, config)
    assert told.threshold is not None
    assert list(told.threshold.stability) == KEYS == ["0.7", "1.4"]
    assert all(0 <= move <= most for move in told.threshold.stability.values()), told.threshold.stability
    assert told.seams == found.seams
    assert replace(told.threshold, stability={}) == found.threshold


def test_nothing_found_has_no_stability() -> None:
    made = groove_cloud(np.random.default_rng(1), width=0.0)
    found = find_seams(made.cloud, SeamConfig())
    assert with_stability(made.cloud, found, SeamConfig()) is found


def test_movement_is_measured_and_a_lost_seam_is_infinitely_far(monkeypatch) -> None:
    """With a finder that shifts the seam by 0.4 mm at one factor and finds another line at the next."""
    known = sine_seam(np.random.default_rng(0))
    seam, shifted = (found_seam(known, np.full(len(known.s), error)) for error in (0.0, 4e-4))
    far = found_seam(known, np.full(len(known.s), 0.03))
    answers = {FACTORS[0]: (far, shifted), FACTORS[1]: (far,)}

    def finder(cloud, config, threshold_factor=1.0) -> SeamFindings:
        return SeamFindings(seams=answers[threshold_factor], region=np.zeros(1, int))

    monkeypatch.setattr(stability, "find_seams_profile", finder)
    found = SeamFindings(
        seams=(seam,), region=np.zeros(1, int), threshold=Threshold(name="depth", value=1e-3, unit="m", noise=1e-4)
    )
    cloud = groove_cloud(np.random.default_rng(0)).cloud
    told = with_stability(cloud, found, SeamConfig()).threshold
    assert told is not None
    assert told.stability[KEYS[0]] == pytest.approx(4e-4, rel=0.02)
    assert told.stability[KEYS[1]] == float("inf")
