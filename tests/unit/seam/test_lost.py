"""Why a coarse line carries no groove: each cause has its own reason, with the figure and the limit that are true of it."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from tests.clouds import groove_cloud
from weldsim.records import Rejection
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.find import find_seams_profile
from weldsim.seam.profile.lost import no_sides, not_followed, short
from weldsim.seam.profile.parent import Parent
from weldsim.seam.profile.track import Track

CONFIG = ProfileConfig()
WIDTH = 0.014


def longest_refused(config: ProfileConfig = CONFIG, *, land: float | None = None, **made) -> Rejection:
    """The longest candidate that is refused in a cloud without a seam.

    Args:
        land: of the plate on each side of the groove [m].
    """
    size = {} if land is None else {"size": (0.24, WIDTH + 2 * land)}
    found = find_seams_profile(groove_cloud(np.random.default_rng(0), width=WIDTH, **size, **made).cloud, config)
    assert not found.seams
    return max(found.rejected, key=lambda one: one.length)


def test_land_that_ends_within_the_band_is_told_by_what_lies_beside_it() -> None:
    """The table is 20 mm below: of 8 mm of land a surface is read that is the table; of more, one that is neither."""
    table = longest_refused(land=0.008)
    depth = re.search(r"from 14 to 36 mm off its middle passes ([\d.]+) mm below it, over 3 mm", table.reason)
    assert depth is not None
    assert float(depth[1]) == pytest.approx(20.0, abs=0.3)
    mixed = [longest_refused(land=land) for land in (0.012, 0.014)]
    assert "higher than the other, over the 3 mm of seam.profile.max_side_step" in mixed[0].reason
    assert re.search(r"the two sides are [\d.]+ deg apart, over 51.6 deg", mixed[1].reason)
    assert all(one.sideless for one in (table, *mixed))


def parent(support: tuple[float, float], step: float = 0.0, angle: float = 0.0) -> Parent:
    """One that is alike at all stations."""
    m = 40
    flat = {"a": np.zeros(m), "b": np.zeros(m), "c": 0.0, "hilo": 0.0, "noise": 1e-4, "rms": 1e-4, "sigma": 1e-4}
    sides = {"step": np.full(m, step), "angle": np.full(m, angle), "support": np.tile(support, (m, 1))}
    return Parent(**flat, **sides, cells=np.zeros((0, 2)))


@pytest.mark.parametrize(
    ("beside", "says"),
    [
        (parent((1.0, 0.1)), "there is hardly any of it on one side"),
        (parent((0.0, 0.1), np.inf, np.inf), "there is hardly any of it on either side"),
        (parent((1.0, 1.0), 0.0051), "one side is 5.1 mm higher than the other, over the 3 mm of seam.profile.max_side_step"),
        (parent((1.0, 1.0), 0.0, 0.5), "the two sides are 28.6 deg apart, over the 17.2 deg of seam.profile.max_side_angle"),
    ],
)
def test_what_is_wrong_with_the_sides_is_told(beside: Parent, says: str) -> None:
    lost = no_sides(beside, CONFIG, (0.014, 0.036), short(0.005, 0.021))
    length = "5.0 mm of it, under 21 mm (0.7 of seam.profile.min_length)"
    assert lost.reason == f"surface at one level on both sides over {length}: from 14 to 36 mm off its middle {says}"
    assert lost.sides


def test_cross_sections_too_far_apart_are_told_with_their_setting() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        longest_refused(ProfileConfig(station_step=0.02))
        refused = longest_refused(ProfileConfig(station_step=0.02), size=(0.16, 0.2))
    told = re.search(r"(\d+) cross-sections along it at the 20 mm of seam.profile.station_step, under 12", refused.reason)
    assert told is not None
    assert int(told[1]) < 12
    assert not refused.sideless


def test_too_few_points_and_a_depth_that_is_not_there_are_told_apart() -> None:
    m = 40
    flanked, none = np.ones(m, bool), np.zeros(m)
    track = Track(none, none, np.full(m, np.nan), np.full(m, np.nan), 3, 3, 1.0)
    assert (
        "enough points at a groove's depth at 0 of its cross-sections, under 12" in not_followed(track, flanked, 0.008, 12).reason
    )
    flat = replace(track, amplitude=np.full(m, 0.1), weight=np.where(np.arange(m) < 5, 1.0, 0.0))
    assert not_followed(flat, flanked, 0.008, 12).reason == (
        "a groove of its mean depth, 8.0 mm, shows at 5 of its cross-sections, under 12"
    )


def test_a_candidate_refused_for_other_reasons_has_its_sides() -> None:
    refused = longest_refused(ProfileConfig(max_width=0.010))
    assert "seam.profile.max_width" in refused.reason
    assert not refused.sideless
