"""The penalised curve: what it leaves alone, what it bridges, and whether its error bar is the truth."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from weldsim.seam.profile.smooth import STRENGTHS, choose_strength, deviation, smooth


def correlated(rng: np.random.Generator, n: int, sigma: float, reach: float) -> np.ndarray:
    """Noise of standard deviation `sigma` shared over about `reach` stations."""
    field = gaussian_filter1d(rng.standard_normal(n + 100), reach)[50:-50]
    return sigma * field * np.sqrt(2 * np.sqrt(np.pi) * reach)


@pytest.mark.parametrize("strength", [STRENGTHS[0], STRENGTHS[len(STRENGTHS) // 2], STRENGTHS[-1]])
@pytest.mark.parametrize("degree", [1, 2])
def test_parabolas_stay_what_they_are(strength: float, degree: int) -> None:
    rng = np.random.default_rng(degree)
    t = np.linspace(-1, 1, 240)
    curve = np.stack([np.polyval(rng.normal(size=degree + 1), t) for _ in range(3)], axis=1)
    weights = rng.uniform(0.3, 3.0, len(t))
    np.testing.assert_allclose(smooth(curve, weights, strength), curve, atol=2e-4 * float(np.ptp(curve)))


@pytest.mark.parametrize("strength", STRENGTHS[:: len(STRENGTHS) - 1])
def test_stations_without_data_are_bridged(strength: float) -> None:
    """Whatever stands at stations of weight 0, a parabola is carried across them."""
    rng = np.random.default_rng(0)
    t = np.linspace(-1, 1, 200)
    curve = np.stack([t, 0.1 * t * t], axis=1)
    weights = np.ones(len(t))
    weights[80:115] = 0.0
    spoilt = curve.copy()
    spoilt[80:115] += rng.normal(size=(35, 2))
    np.testing.assert_allclose(smooth(spoilt, weights, strength), curve, atol=8e-3)


def test_it_is_linear_and_indifferent_to_the_scale_of_weights() -> None:
    rng = np.random.default_rng(3)
    a, b, w = rng.normal(size=(90, 2)), rng.normal(size=(90, 2)), rng.uniform(0.1, 1, 90)
    np.testing.assert_allclose(smooth(2 * a - b, w, 1e4), 2 * smooth(a, w, 1e4) - smooth(b, w, 1e4), atol=1e-9)
    np.testing.assert_allclose(smooth(a, 7 * w, 1e4), smooth(a, w, 1e4), atol=1e-9)


def test_either_direction_gives_the_same_curve() -> None:
    rng = np.random.default_rng(4)
    values, w = rng.normal(size=(120, 3)), rng.uniform(0.1, 1, 120)
    np.testing.assert_allclose(smooth(values[::-1], w[::-1], 1e5)[::-1], smooth(values, w, 1e5), atol=1e-8)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_a_handful_of_stations_is_no_error(n: int) -> None:
    values = np.random.default_rng(n).normal(size=(n, 3))
    assert np.isfinite(smooth(values, np.ones(n), 1e5)).all()


@pytest.mark.parametrize(("bow", "wave"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.015)])
def test_the_chosen_strength_is_near_the_best_there_is(bow: float, wave: float) -> None:
    """Against the truth: lines and arcs err little more than by the best of all strengths, an S less than its noise."""
    t = np.linspace(0, 1, 240)
    truth = np.stack([240e-3 * t, bow * (t - 0.5) ** 2 + wave * np.sin(2 * np.pi * t)], axis=1)
    ratios, made = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        noisy = truth + np.stack([np.zeros(240), correlated(rng, 240, 4e-4, 2.0)], axis=1)
        errors = [np.sqrt(((smooth(noisy, np.ones(240), s) - truth) ** 2).sum(axis=1).mean()) for s in STRENGTHS]
        made.append(errors[STRENGTHS.index(choose_strength(noisy, np.ones(240)))])
        ratios.append(made[-1] / min(errors))
    assert np.median(ratios) < (2.0 if wave else 1.3)
    assert max(made) < 5e-4


@pytest.mark.parametrize(("reach", "strength"), [(0.3, 1e4), (1.0, 1e4), (2.0, 1e6), (3.0, 1e8)])
def test_the_error_bar_agrees_with_monte_carlo(reach: float, strength: float) -> None:
    n, sigma, runs = 160, 3e-4, 30
    weights = np.ones(n)
    made, told = [], []
    for seed in range(runs):
        noise = correlated(np.random.default_rng(seed), n, sigma, reach)
        curve = smooth(noise[:, None], weights, strength)[:, 0]
        made.append(curve)
        told.append(deviation(noise - curve, weights, strength))
    inner = slice(15, -15)
    true = np.sqrt((np.array(made) ** 2).mean())
    assert np.sqrt((np.array(told) ** 2).mean()) == pytest.approx(true, rel=0.30)
    middle = np.sqrt((np.array(made)[:, inner] ** 2).mean())
    assert np.sqrt((np.array(told)[:, inner] ** 2).mean()) == pytest.approx(middle, rel=0.30)


def test_the_error_bar_grows_where_data_are_missing() -> None:
    rng = np.random.default_rng(5)
    weights = np.ones(200)
    weights[90:120] = 0.0
    noise = np.where(weights > 0, correlated(rng, 200, 3e-4, 1.0), 0.0)
    told = deviation(noise - smooth(noise[:, None], weights, 1e4)[:, 0] * (weights > 0), weights, 1e4)
    assert told[100:110].min() > 1.5 * np.median(told[30:70])
    assert np.isfinite(told).all()
