"""One camera's window lies on a surface the wider, the farther it is: blur over distance is what several grooves have in common."""

from dataclasses import replace

import numpy as np
import pytest

from weldsim.records import PointCloud
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import make_atlas
from weldsim.seam.profile.find import _search
from weldsim.seam.profile.join import Piece
from weldsim.seam.profile.window import at_one_window

CONFIG = ProfileConfig()
EYE = np.array([0.0, -0.5, 0.45])
ASIDE = np.array([0.7, -0.5, 0.1])  # another viewpoint, from which the groove was not seen


@pytest.fixture(scope="module")
def piece() -> Piece:
    """A V-groove 12 mm wide and 100 mm long on a plate, seen from EYE without blur or noise."""
    x, y = np.meshgrid(np.arange(-0.05, 0.05, 0.0008), np.arange(-0.06, 0.06, 0.0008))
    below = 0.007 * np.maximum(1 - np.abs(y) / 0.006, 0.0)
    atlas = make_atlas(PointCloud(points=np.stack([x, y - 0.5, 0.02 - below], axis=-1).reshape(-1, 3), viewpoints=EYE[None]))
    ((only,), _) = _search(atlas, atlas.coarse_lines(CONFIG, 1.0)[0], CONFIG)
    return only


def seen(piece: Piece, blur: float, times: float = 1.0) -> Piece:
    """The piece as if measured with a blur [m], `times` as far from EYE as it was."""
    rail = replace(piece.fit.rail, points=EYE + times * (piece.fit.rail.points - EYE))
    return replace(piece, fit=replace(piece.fit, rail=rail, section=replace(piece.fit.section, blur=blur)))


def blurs(pieces: list[Piece], *viewpoints: np.ndarray) -> list[float]:
    return [each.fit.section.blur for each in at_one_window(pieces, np.reshape(viewpoints, (-1, 3)), CONFIG)]


def test_blurs_in_proportion_to_distance_are_one_window(piece: Piece) -> None:
    pieces = [seen(piece, 0.004), seen(piece, 0.006, 1.5), seen(piece, 0.003, 0.75)]
    assert all(now is was for now, was in zip(at_one_window(pieces, EYE[None], CONFIG), pieces, strict=True))


def test_two_of_one_blur_get_what_their_distances_ask_for(piece: Piece) -> None:
    """Of 4 mm at 1 and at 1.5 times the distance the mean is 4 * (1 + 2/3) / 2 mm at 1."""
    pieces = [seen(piece, 0.004), seen(piece, 0.004, 1.5)]
    for viewpoints in ((EYE,), (EYE, ASIDE), (ASIDE, EYE)):
        assert blurs(pieces, *viewpoints) == pytest.approx([0.004 * 5 / 6, 0.005])
    assert blurs(pieces) == [0.004, 0.004], "the distances are unknown"


def test_the_many_count_more_than_the_odd_one_and_the_alien_keeps_its_own(piece: Piece) -> None:
    usual = [seen(piece, 0.004), seen(piece, 0.008, 2.0)]
    # The odd one, 30 % off, is 2 * ODD from the median: its weight is 1 / (1 + 4).
    shared = (0.004 + 0.004 + 0.2 * 0.0052) / 2.2
    assert blurs([*usual, seen(piece, 0.0052)], EYE) == pytest.approx([shared, 2 * shared, shared])
    assert blurs([*usual, seen(piece, 0.040)], EYE) == pytest.approx([0.004, 0.008, 0.040], rel=0.02)
    assert blurs([seen(piece, 0.040)], EYE) == [0.040]


def test_a_section_at_another_blur_fits_the_same_data_at_the_same_middle(piece: Piece) -> None:
    moved = replace(piece, fit=replace(piece.fit, section=replace(piece.fit.section, middle=1e-4)))
    first, second = at_one_window([seen(moved, 0.004), seen(moved, 0.003)], EYE[None], CONFIG)
    assert first.fit.section.middle == second.fit.section.middle == 1e-4
    assert first.fit.section.blur == second.fit.section.blur == pytest.approx(0.0035)
    assert first.fit.section.depth == pytest.approx(0.007, abs=1e-3)
