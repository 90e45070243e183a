"""The parent surface: planes, cylinders and twists are recovered under a groove, with clamps and steps in view."""

import numpy as np
import pytest

from weldsim.seam.profile.parent import Parent, fit_parent
from weldsim.seam.profile.rail import Rail, Strip, lay_out, make_rail

INNER, OUTER = 0.010, 0.032


def straight_rail(length: float = 0.2) -> Rail:
    x = np.linspace(0.0, length, 400)
    return make_rail(np.stack([x, 0 * x, 0 * x], axis=1), np.tile([0.0, 0.0, 1.0], (400, 1)), 0.001)


def strip_of(rail: Rail, height, rng: np.random.Generator, noise: float = 1e-4, n: int = 40_000) -> Strip:
    """Points at heights `height(s, x)` above the rail's plane, and a V groove of 14 x 8 mm along it."""
    s, x = rng.uniform(-0.005, 0.205, n), rng.uniform(-0.040, 0.040, n)
    h = height(s, x) - 0.008 * np.maximum(1 - np.abs(x) / 0.007, 0) + rng.normal(0.0, noise, n)
    return lay_out(rail, np.stack([s, x, h], axis=1), None)


def surface(parent: Parent, x: float) -> np.ndarray:
    return parent.a + parent.b * x + parent.c * x * x


SHAPES = {
    "plane": lambda s, x: 0.001 + 0.05 * s - 0.08 * x,
    "cylinder along": lambda s, x: -(x**2) / (2 * 0.25),
    "cylinder across": lambda s, x: -((s - 0.1) ** 2) / (2 * 0.3),
    "twist": lambda s, x: 0.8 * (s - 0.1) * x,
    "all of them": lambda s, x: 0.03 * s - ((s - 0.1) ** 2) / 0.8 + 0.5 * (s - 0.1) * x - x**2 / 0.9,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_smooth_surfaces_are_carried_across_the_groove(shape: str) -> None:
    height, rail = SHAPES[shape], straight_rail()
    for seed in range(2):
        parent = fit_parent(rail, strip_of(rail, height, np.random.default_rng(seed)), INNER, OUTER)
        at = np.arange(len(rail)) * rail.step
        for x in (-0.02, -0.007, 0.0, 0.007, 0.02):
            assert np.abs(surface(parent, x) - height(at, x))[3:-3].max() < 3e-5
        assert (parent.step[5:-5] < 5e-4).all()
        assert (parent.angle[5:-5] < 0.03).all(), "a bend that either side shows by itself is no fold"
        assert (parent.support[5:-5] > 0.6).all()


@pytest.mark.parametrize("seed", range(4))
def test_clamps_and_the_table_fall_out(seed: int) -> None:
    """A clamp 15 mm high along 35 mm of one side, and a table 20 mm below beyond an edge."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.02, 0.12)

    def height(s: np.ndarray, x: np.ndarray) -> np.ndarray:
        out = 0.04 * s + 0.1 * x
        out = np.where((s > start) & (s < start + 0.035) & (x > 0.012), out + 0.015, out)
        return np.where(x < -0.028, out - 0.020, out)

    rail = straight_rail()
    parent = fit_parent(rail, strip_of(rail, height, rng), INNER, OUTER)
    at = np.arange(len(rail)) * rail.step
    assert np.abs(surface(parent, 0.0) - 0.04 * at)[3:-3].max() < 5e-5
    hidden = (at > start + 0.008) & (at < start + 0.027)
    assert parent.support[hidden, 0].max() < 0.4, "no surface is seen where a clamp stands on it"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("ends", [(0.03, 0.17), (0.0, 0.16), (0.045, 0.2)])
def test_the_table_past_a_thin_plates_ends_does_not_bend_its_surface(seed: int, ends: tuple[float, float]) -> None:
    """A plate 10 mm thick whose edges a camera's window of 10 mm smooths into ramps, under noise as smooth as that."""
    rng = np.random.default_rng(seed)
    waves = [(rng.uniform(0, 2 * np.pi), rng.uniform(100, 400, 2), 4e-4) for _ in range(6)]

    def height(s: np.ndarray, x: np.ndarray) -> np.ndarray:
        past = np.maximum(ends[0] - s, s - ends[1])
        noise = sum(size * np.sin(phase + k[0] * s + k[1] * x) for phase, k, size in waves)
        return noise - 0.010 * np.clip(past / 0.010 + 0.5, 0.0, 1.0)

    rail = straight_rail()
    parent = fit_parent(rail, strip_of(rail, height, rng, noise=3e-4), INNER, OUTER)
    at = np.arange(len(rail)) * rail.step
    on = (at > ends[0] + 0.006) & (at < ends[1] - 0.006)
    past = (at < ends[0] - 0.008) | (at > ends[1] + 0.008)
    assert np.abs(surface(parent, 0.0))[on].max() < 1.5e-3
    assert parent.support[past].max() < 0.4, "the table is no part of the plate's surface"


def test_a_step_or_a_fold_between_the_sides_is_told() -> None:
    rail = straight_rail()
    stepped = fit_parent(rail, strip_of(rail, lambda s, x: np.where(x > 0, 0.004, 0.0), np.random.default_rng(0)), INNER, OUTER)
    middle = np.s_[20:-20]
    assert np.median(stepped.step[middle]) == pytest.approx(0.004, abs=1e-3)
    folded = fit_parent(rail, strip_of(rail, lambda s, x: -0.4 * np.abs(x), np.random.default_rng(0)), INNER, OUTER)
    flat = fit_parent(rail, strip_of(rail, lambda s, x: 0 * s, np.random.default_rng(0)), INNER, OUTER)
    assert np.median(folded.angle[middle]) > 0.3
    assert np.median(flat.angle[middle]) < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_a_tight_bend_is_no_fold_and_a_fold_no_bend(seed: int) -> None:
    """A pipe of 120 mm radius has sides of one surface; the fold whose sides lie at the same angle has not."""
    rail, rng = straight_rail(), np.random.default_rng(seed)
    pipe = fit_parent(rail, strip_of(rail, lambda s, x: -(x**2) / 0.24, rng, noise=2e-4), INNER, OUTER)
    fold = fit_parent(rail, strip_of(rail, lambda s, x: -np.abs(x) * 0.5 * (INNER + OUTER) / 0.12, rng, noise=2e-4), INNER, OUTER)
    assert pipe.c == pytest.approx(-1 / 0.24, rel=0.02)
    assert np.median(pipe.angle[20:-20]) < 0.05
    assert np.median(fold.angle[20:-20]) > 0.3


def test_the_noise_told_is_that_of_the_cells() -> None:
    rail = straight_rail()
    quiet, loud = (
        fit_parent(rail, strip_of(rail, SHAPES["plane"], np.random.default_rng(3), noise=n), INNER, OUTER).noise
        for n in (1e-4, 4e-4)
    )
    assert loud == pytest.approx(4 * quiet, rel=0.2)


def test_one_side_without_surface_is_no_step() -> None:
    """Infinity, which no limit admits, not zero."""
    rail, rng = straight_rail(), np.random.default_rng(4)
    s, x = rng.uniform(0, 0.2, 20_000), rng.uniform(-0.04, 0.0, 20_000)
    parent = fit_parent(rail, lay_out(rail, np.stack([s, x, 0 * s], axis=1), None), INNER, OUTER)
    assert np.isinf(parent.step).all()
    assert np.isinf(parent.angle).all()
    assert parent.support[:, 0].max() == 0
    assert np.isfinite(parent.a).all()
