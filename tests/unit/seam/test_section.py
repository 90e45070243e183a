"""Cross-sections: what blur and slanted sight lines do to a groove, and that the middle of the lips survives both."""

from dataclasses import replace

import numpy as np
import pytest

from weldsim.seam.profile.section import Section, fit_section

X = np.arange(-0.030, 0.030, 0.0005) + 0.00025


def section(**changes: float) -> Section:
    return replace(Section(middle=0.0, width=0.014, depth=0.008, floor=0.0, lean=0.0, blur=0.003), **changes)


def fine_area(shape: Section, shear: float) -> float:
    x = np.linspace(-0.05, 0.05, 20_001)
    return float(shape.depth_at(x, np.full_like(x, shear)).sum() * (x[1] - x[0]))


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
    none = np.zeros_like(X)
    for floor, most in ((0.05, 1e-9), (0.0, 6e-5)):  # a V's own bottom is 50 um wide, and off the middle by half of it
        shape = section(blur=blur, middle=0.0013, floor=floor)
        left, right = shape.depth_at(0.0013 + X, none), shape.depth_at(0.0013 - X, none)
        np.testing.assert_allclose(left, right, atol=most)


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
        shear = np.full_like(X, rng.uniform(-1.2, 1.2))
        seen = shape.depth_at(X, shear)
        mirrored = replace(shape, lean=-shape.lean).depth_at(-X, -shear)
        np.testing.assert_allclose(mirrored, seen, atol=1e-9)
        assert (seen >= -1e-9).all()
        assert (seen <= shape.depth + 1e-9).all()


def test_moving_the_middle_moves_the_section() -> None:
    rng = np.random.default_rng(1)
    for shift in rng.uniform(-0.004, 0.004, 8):
        shape, shear = section(lean=0.001), np.full_like(X, 0.3)
        np.testing.assert_allclose(replace(shape, middle=shift).depth_at(X + shift, shear), shape.depth_at(X, shear), atol=1e-12)


@pytest.mark.parametrize("width", [0.008, 0.014, 0.022])
@pytest.mark.parametrize("shear", [-0.3, 0.0, 0.2])
def test_the_middle_of_the_lips_is_recovered_from_noisy_slanted_profiles(width: float, shear: float) -> None:
    """A centroid would be drawn towards one wall by `depth * shear / 3`: 0.8 mm at a shear of 0.3."""
    blocks, errors = 24, []
    block = np.repeat(np.arange(blocks), len(X))
    x = np.tile(X, blocks)
    for seed in range(4):
        rng = np.random.default_rng([seed, int(width * 1e4)])
        slant = shear + np.repeat(rng.uniform(-0.05, 0.05, blocks), len(X))
        truth = section(middle=rng.uniform(-5e-4, 5e-4), width=width, depth=0.5 * width, floor=0.1, blur=0.004)
        depth = truth.depth_at(x, slant) + rng.normal(0.0, 2e-4, x.shape)
        start = section(width=1.2 * width, depth=0.4 * width)
        found, sigma = fit_section(x=x, shear=slant, depth=depth, weight=np.ones_like(x), start=start, block=block, noise=2e-4)
        errors.append(found.middle - truth.middle)
        assert 0 < sigma < 1e-3
        assert abs(found.width - width) < 0.15 * width
    assert np.abs(errors).max() < 6e-5


def test_a_leaning_groove_is_seen_to_lean() -> None:
    rng = np.random.default_rng(2)
    blocks = 24
    block, x = np.repeat(np.arange(blocks), len(X)), np.tile(X, blocks)
    truth, none = section(lean=0.002, middle=0.0004), np.zeros(len(X) * blocks)
    depth = truth.depth_at(x, none) + rng.normal(0.0, 1e-4, x.shape)
    found, _ = fit_section(x=x, shear=none, depth=depth, weight=np.ones_like(x), start=section(), block=block, noise=1e-4)
    assert found.lean == pytest.approx(truth.lean, abs=2e-4)
    assert found.middle == pytest.approx(truth.middle, abs=1e-4)
