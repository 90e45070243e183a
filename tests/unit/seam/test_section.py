"""Cross-sections: what blur and slanted sight lines do to a groove, and that the middle of the lips survives both."""

from dataclasses import replace

import numpy as np
import pytest

import weldsim.seam.profile.lean as lean_module
from weldsim.seam.profile.lean import Doubt, first_section, section_at_blur, settled_section
from weldsim.seam.profile.section import Section
from weldsim.seam.profile.shape import Solution, section_of, twin, unknowns
from weldsim.seam.profile.views import Blocks, gather

X = np.arange(-0.030, 0.030, 0.0005) + 0.00025


def section(**changes: float) -> Section:
    return replace(Section(middle=0.0, width=0.014, depth=0.008, floor=0.0, lean=0.0, blur=0.003), **changes)


def seen_at(shape: Section, x: np.ndarray, shear: float) -> np.ndarray:
    return shape.image(x, np.array([shear]))[0][0]


def fine_area(shape: Section, shear: float) -> float:
    x = np.linspace(-0.05, 0.05, 20_001)
    return float(seen_at(shape, x, shear).sum() * (x[1] - x[0]))


def blocks_of(truth: Section, shear: np.ndarray, noise: float, rng: np.random.Generator) -> Blocks:
    depth = truth.image(X, shear)[0] + rng.normal(0.0, noise, (len(shear), len(X)))
    return Blocks(X, np.tile(X, (len(shear), 1)), depth, np.full(depth.shape, 8.0), shear, 8)


@pytest.mark.parametrize("shear", [0.0, 0.2, -0.45])
@pytest.mark.parametrize("floor", [0.0, 0.4])
def test_blur_keeps_the_area(shear: float, floor: float) -> None:
    sharp = fine_area(section(floor=floor, blur=0.0), shear)
    for blur in (0.002, 0.005, 0.010):
        assert fine_area(section(floor=floor, blur=blur), shear) == pytest.approx(sharp, rel=1e-4)


@pytest.mark.parametrize("width", [0.006, 0.014, 0.025])
@pytest.mark.parametrize("floor", [0.0, 0.5])
def test_a_sharp_section_has_its_own_area(width: float, floor: float) -> None:
    """A trapezoid of depth d, width w and floor f w holds d w (1 + f) / 2; a slanted view does not change that."""
    shape = section(width=width, floor=floor, blur=0.0)
    for shear in (0.0, 0.15):
        assert fine_area(shape, shear) == pytest.approx(shape.depth * width * (1 + floor) / 2, rel=0.01)


@pytest.mark.parametrize("blur", [0.0, 0.004, 0.008])
def test_a_symmetric_groove_seen_straight_on_is_symmetric(blur: float) -> None:
    for floor in (0.05, 0.0):
        shape = section(blur=blur, middle=0.0013, floor=floor)
        left, right = seen_at(shape, 0.0013 + X, 0.0), seen_at(shape, 0.0013 - X, 0.0)
        np.testing.assert_allclose(left, right, atol=1e-9)


@pytest.mark.parametrize("shear", [-0.6, 0.0, 0.4])
def test_plates_at_two_heights_lie_half_a_step_above_and_below_the_opening(shear: float) -> None:
    for step in (-0.002, 0.0015):
        seen = seen_at(section(step=step), X, shear)
        np.testing.assert_allclose(seen[-10:], -step / 2, atol=1e-12)
        np.testing.assert_allclose(seen[:10], step / 2, atol=1e-12)


def test_the_slope_of_an_image_is_what_a_small_shift_changes() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        shape = section(
            width=rng.uniform(0.006, 0.025), lean=rng.uniform(-0.002, 0.002), blur=rng.uniform(0.002, 0.008), step=0.001
        )
        shear = np.array([rng.uniform(-0.8, 0.8)])
        ahead, behind = (replace(shape, middle=d).image(X, shear)[0] for d in (1e-7, -1e-7))
        np.testing.assert_allclose((ahead - behind) / 2e-7, shape.image(X, shear)[1], atol=2e-3)


def test_mirrored_views_show_mirrored_sections() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        shape = section(
            width=rng.uniform(0.005, 0.026),
            depth=rng.uniform(0.001, 0.015),
            floor=rng.uniform(0, 0.8),
            lean=rng.uniform(-0.003, 0.003),
            blur=rng.uniform(0, 0.008),
        )
        shear = rng.uniform(-1.2, 1.2)
        seen = seen_at(shape, X, shear)
        mirrored = seen_at(replace(shape, lean=-shape.lean), -X, -shear)
        np.testing.assert_allclose(mirrored, seen, atol=1e-9)
        assert (seen >= -1e-9).all()
        assert (seen <= shape.depth + 1e-9).all()


def test_moving_the_middle_moves_the_section() -> None:
    rng = np.random.default_rng(1)
    for shift in rng.uniform(-0.004, 0.004, 8):
        shape = section(lean=0.001)
        np.testing.assert_allclose(seen_at(replace(shape, middle=shift), X + shift, 0.3), seen_at(shape, X, 0.3), atol=1e-12)


@pytest.mark.parametrize("width", [0.008, 0.014, 0.022])
@pytest.mark.parametrize("shear", [-0.3, 0.0, 0.2])
def test_the_middle_of_the_lips_is_recovered_from_noisy_slanted_profiles(width: float, shear: float) -> None:
    """A centroid would be drawn towards one wall by `depth * shear / 3`: 0.8 mm at a shear of 0.3."""
    errors = []
    for seed in range(4):
        rng = np.random.default_rng([seed, int(width * 1e4)])
        truth = section(middle=rng.uniform(-5e-4, 5e-4), width=width, depth=0.5 * width, floor=0.1, blur=0.004)
        blocks = blocks_of(truth, shear + rng.uniform(-0.05, 0.05, 24), 2e-4, rng)
        start = first_section(blocks, section(width=1.2 * width, depth=0.4 * width), 5e-5)
        found, doubt = settled_section(blocks, start, 5e-5)
        errors.append(found.middle - truth.middle)
        assert 0 < doubt.deviation < 1e-3
        assert abs(found.width - width) < 0.15 * width
    assert np.abs(errors).max() < 6e-5


@pytest.mark.parametrize("lean", [-0.006, -0.002, 0.002, 0.006])
def test_a_leaning_groove_is_seen_to_lean(lean: float) -> None:
    rng = np.random.default_rng(2)
    truth = section(lean=lean, middle=0.0004)
    blocks = blocks_of(truth, np.zeros(24), 1e-4, rng)
    found, doubt = settled_section(blocks, first_section(blocks, section(), 5e-5), 5e-5)
    assert found.lean == pytest.approx(truth.lean, abs=2e-4)
    assert found.middle == pytest.approx(truth.middle, abs=1e-4)
    assert abs(found.middle - truth.middle) < 3 * doubt.deviation


def test_a_lean_that_noise_hides_is_doubted() -> None:
    """Few blurred noisy blocks: the deviation is of the size of the error, mostly; a symmetric groove stays likelier."""
    scores = []
    for seed in range(12):
        rng = np.random.default_rng([seed, 7])
        truth = section(width=0.010, depth=0.005, lean=rng.choice([-1, 1]) * 0.0045, blur=0.007)
        blocks = blocks_of(truth, np.zeros(8), 4e-4, rng)
        found, doubt = settled_section(blocks, first_section(blocks, section(width=0.012, depth=0.004), 5e-5), 5e-5)
        scores.append(abs(found.middle - truth.middle) / doubt.deviation)
    assert np.median(scores) < 3
    assert max(scores) < 5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shear", [-0.35, 0.35])
def test_a_lean_that_a_slanted_look_may_make_up_has_to_stand_out(shear: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for lean, noise, few in ((0.0022, 8e-4, 12), (0.0055, 1e-4, 24)):
        truth = section(lean=-np.sign(shear) * lean, blur=0.004)
        blocks = blocks_of(truth, np.full(few, shear), noise, rng)
        found, doubt = settled_section(blocks, first_section(blocks, section(), 5e-5), 5e-5)
        clear = noise < 2e-4
        assert (abs(found.lean) > 0.5 * lean) == clear
        assert abs(found.middle - truth.middle) < max(3 * doubt.deviation, 1e-4)


@pytest.mark.parametrize("shear", [-0.35, 0.35])
def test_a_lean_that_a_slanted_look_may_make_up_is_the_less_likely_of_two_that_fit_alike(shear: float) -> None:
    blocks = blocks_of(section(), np.full(12, shear), 1e-4, np.random.default_rng(3))
    views, base = gather(blocks, 0.008, 5e-5), unknowns(section())
    lean = np.array([0.0, -0.4, 0.4])
    found = [Solution(base + each * (np.arange(7) == 4), 0.0, np.ones(7, bool)) for each in lean.tolist()]
    _, left, right = lean_module._likelihood(found, lean, views, blocks, 0.0, whitened=False)
    made_up, other = (left, right) if shear > 0 else (right, left)
    assert other == pytest.approx(lean_module.MADE_UP_ODDS * made_up, rel=0.01)
    assert lean_module.MADE_UP_ODDS >= 2


@pytest.mark.parametrize("seed", range(6))
def test_a_bevel_behind_a_drivers_filter_is_seen_to_lean(seed: int) -> None:
    """A single bevel of 12 x 10 mm under smooth noise, its image smoothed once more than the section's window does.

    Taken for a symmetric groove it lies 1 to 3 mm towards its wall.
    """
    rng = np.random.default_rng([seed, 21])
    truth, shear = section(width=0.012, depth=0.010, lean=0.006, blur=0.007), np.full(24, 0.12)
    apart = X[:, None] - X
    smooth = np.linalg.cholesky(np.exp(-((apart / 0.010) ** 2)) + 1e-6 * np.eye(len(X)))
    kernel = np.exp(-np.abs(apart) / 0.002)
    image = truth.image(X, shear)[0] @ (kernel / kernel.sum(axis=1, keepdims=True)).T
    depth = image + 4e-4 * rng.normal(size=image.shape) @ smooth.T + rng.normal(0.0, 3e-5, image.shape)
    blocks = Blocks(X, np.tile(X, (24, 1)), depth, np.full(depth.shape, 8.0), shear, 8)
    found, _ = settled_section(blocks, first_section(blocks, section(), 5e-5), 5e-5)
    assert found.lean > 0.003
    assert abs(found.middle - truth.middle) < 8e-4


def test_scatter_that_the_stations_show_too_counts_once() -> None:
    doubt = Doubt(lean=3e-4, data=5e-4)
    assert doubt.deviation == pytest.approx(np.sqrt(34) * 1e-4)
    assert doubt.beyond(9e-8) == pytest.approx(5e-4), "of 0.5 mm 0.4 mm are new"
    assert doubt.beyond(1e-6) == pytest.approx(3e-4), "only the lean is"


@pytest.mark.parametrize(
    ("lean", "shear", "sigmas", "believed"),
    [
        (0.6, 0.0, 5.0, True),  # bevels of 45 and 15 deg
        (0.2, 0.0, 4.0, False),
        (0.2, 0.0, 5.0, True),
        (-0.4, 0.5, 5.0, False),  # as a slanted look makes up
        (-0.4, 0.5, 9.5, True),
        (0.4, 0.5, 5.0, True),
        (1.0, 0.0, 4.0, False),
    ],
)
def test_how_far_a_lean_must_stand_out(lean: float, shear: float, sigmas: float, believed: bool) -> None:
    """Grooves are symmetric or have bevels of unlike angles: between these the lean of a groove is likelier noise."""
    blocks = blocks_of(section(), np.full(4, shear), 1e-4, np.random.default_rng(0))
    theta = unknowns(section(lean=0.001))
    theta[4] = lean
    solution = Solution(theta, 0.0, np.ones(7, bool))
    assert lean_module._insists(sigmas**2 / 2, solution, blocks) is believed


@pytest.mark.parametrize("seed", range(4))
def test_at_the_right_blur_a_groove_taken_for_a_narrower_deeper_one_gets_its_size_back(seed: int) -> None:
    rng = np.random.default_rng([seed, 11])
    truth = section(width=rng.uniform(0.010, 0.020), depth=rng.uniform(0.006, 0.010), blur=0.007)
    blocks = blocks_of(truth, rng.uniform(-0.1, 0.1, 16), 2e-4, rng)
    mistaken = replace(truth, width=0.7 * truth.width, depth=1.4 * truth.depth, blur=0.009)
    found = section_at_blur(blocks, mistaken, 5e-5, truth.blur)
    assert found.blur == truth.blur
    assert found.width == pytest.approx(truth.width, rel=0.05)
    assert abs(found.depth / truth.depth - 1) < 0.15, "a floor makes up for some of it"


@pytest.mark.parametrize("place", [-2.2e-4, 1.6e-4])
def test_cells_that_are_seen_at_one_place_off_their_middle_give_the_width_and_the_line(place: float) -> None:
    """As along a groove that runs with the image's columns: on a wall, that is another depth than the cell's middle has."""
    truth = section(width=0.006, depth=0.0034, middle=2e-4, blur=0.0)
    at, shear = np.tile(X + place, (24, 1)), np.zeros(24)
    blocks = Blocks(X, at, truth.image(X + place, shear)[0], np.full(at.shape, 8.0), shear, 8)
    found, _ = settled_section(blocks, first_section(blocks, section(width=0.008, depth=0.0025), 1e-6), 1e-6)
    assert found.middle == pytest.approx(truth.middle, abs=2e-5)
    assert found.width == pytest.approx(truth.width, abs=1e-4)
    assert found.depth == pytest.approx(truth.depth, abs=1e-4)


def test_a_shallow_groove_seen_without_noise_is_not_deepened_by_what_is_usual() -> None:
    truth = section(width=0.006, depth=0.0018, blur=0.0)
    blocks = blocks_of(truth, np.zeros(24), 1e-6, np.random.default_rng(0))
    found, _ = settled_section(blocks, first_section(blocks, section(width=0.006, depth=0.0015), 1e-6), 1e-6)
    assert found.width == pytest.approx(truth.width, abs=2e-4)
    assert found.depth == pytest.approx(truth.depth, abs=1e-4)


@pytest.mark.parametrize("floor", [0.0, 0.4])
def test_walls_and_blur_may_be_exchanged_and_the_likelier_section_is_taken(floor: float) -> None:
    truth = section(width=0.010, depth=0.005, floor=floor, blur=4e-4, taper=0.05)
    other = section_of(twin(unknowns(truth)), 0.0)
    np.testing.assert_allclose(seen_at(other, X, 0.0), seen_at(truth, X, 0.0), atol=1.5e-4)
    assert other.blur > 0.0025
    found, _ = settled_section(blocks_of(truth, np.zeros(24), 1e-5, np.random.default_rng(1)), other, 1e-6)
    assert found.width == pytest.approx(truth.width, abs=2e-4)
    assert found.blur < 0.001
