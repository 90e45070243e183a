"""The penalised curve: what it leaves alone, what it bridges, how strong it is made, and whether its error bar is the truth."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from weldsim.seam.profile.smooth import deviation, smooth
from weldsim.seam.profile.strength import STRENGTHS, Choice, choose, correlation

LENGTHS = np.array([4.0, 4.5, 5.3, 6.4, 8.1])  # [stations] as looks over 7 stations and a camera's window give


def correlated(rng: np.random.Generator, n: int, sigma: float, reach: float) -> np.ndarray:
    """Noise of standard deviation `sigma` shared over about `reach` stations: correlation exp(-(lag / 2 reach)^2)."""
    field = gaussian_filter1d(rng.standard_normal(n + 100), reach)[50:-50]
    return sigma * field * np.sqrt(2 * np.sqrt(np.pi) * reach)


def wave(n: int, amplitude: float, wavelength: float, phase: float) -> np.ndarray:
    """A sine over n stations 1 mm apart [m]."""
    return amplitude * np.sin(2 * np.pi * np.arange(n) * 1e-3 / wavelength + phase)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def fitted(values: np.ndarray, weights: np.ndarray | None = None) -> tuple[np.ndarray, Choice]:
    """Stations smoothed as strongly as they ask for."""
    weights = np.ones(len(values)) if weights is None else weights
    choice = choose(values, weights, LENGTHS, 4)
    return smooth(values[:, None], weights, choice.strength)[:, 0], choice


@pytest.mark.parametrize("strength", [1e2, 1e5, 10**8.5])
@pytest.mark.parametrize("degree", [1, 2])
def test_parabolas_stay_what_they_are(strength: float, degree: int) -> None:
    rng = np.random.default_rng(degree)
    t = np.linspace(-1, 1, 240)
    curve = np.stack([np.polyval(rng.normal(size=degree + 1), t) for _ in range(3)], axis=1)
    weights = rng.uniform(0.3, 3.0, len(t))
    np.testing.assert_allclose(smooth(curve, weights, strength), curve, atol=2e-4 * float(np.ptp(curve)))


@pytest.mark.parametrize("strength", [1e2, 10**8.5])
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
    one, other = choose(values[:, 0], w, LENGTHS, 4), choose(values[::-1, 0], w[::-1], LENGTHS, 4)
    assert one.strength == pytest.approx(other.strength, rel=1e-6)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9, 20])
def test_a_handful_of_stations_is_no_error(n: int) -> None:
    values = np.random.default_rng(n).normal(size=n)
    curve, choice = fitted(values)
    assert np.isfinite(curve).all()
    assert choice.strength > 0
    assert choice.variance >= 0
    assert np.isfinite(deviation(np.ones(n), choice.strength, correlation(np.arange(n), choice.length))).all()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_the_choice_does_not_depend_on_units(scale: float) -> None:
    values = wave(200, 0.01, 0.15, 1.0) + correlated(np.random.default_rng(0), 200, 3e-4, 2.0)
    plain, scaled = choose(values, np.ones(200), LENGTHS, 4), choose(scale * values, np.full(200, 7.0), LENGTHS, 4)
    assert scaled.strength == pytest.approx(plain.strength, rel=1e-5)
    assert scaled.variance == pytest.approx(scale**2 * plain.variance, rel=1e-5)


@pytest.mark.parametrize(("bow", "amplitude"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.015)])
def test_the_chosen_strength_is_near_the_best_there_is(bow: float, amplitude: float) -> None:
    """Against the truth: lines, arcs and an S err little more than by the best of all strengths."""
    t = np.linspace(0, 1, 240)
    truth = bow * (t - 0.5) ** 2 + amplitude * np.sin(2 * np.pi * t)
    ratios, made = [], []
    for seed in range(10):
        noisy = truth + correlated(np.random.default_rng(seed), 240, 4e-4, 2.6)
        best = min(rms(smooth(noisy[:, None], np.ones(240), s)[:, 0] - truth) for s in STRENGTHS)
        made.append(rms(fitted(noisy)[0] - truth))
        ratios.append(made[-1] / best)
    assert np.median(ratios) < 1.3
    assert max(made) < 3.5e-4


@pytest.mark.parametrize("wavelength", [0.06, 0.08, 0.10, 0.15])
@pytest.mark.parametrize(("sigma", "reach"), [(1e-4, 2.0), (2e-4, 2.0), (4e-4, 2.6)])
def test_a_wave_is_no_noise(wavelength: float, sigma: float, reach: float) -> None:
    """Waves of 2 to 8 mm are kept: what smoothing takes of them is less than the noise it takes."""
    rng = np.random.default_rng(round(wavelength * 1e3))
    left = []
    for amplitude in (0.002, 0.005, 0.008):
        truth = wave(220, amplitude, wavelength, rng.uniform(0, 6))
        noise = correlated(rng, 220, sigma, reach)
        left.append(rms(fitted(truth + noise)[0] - truth) / rms(noise))
    assert np.mean(left) < 1.0


def test_gaps_and_outliers_marked_as_such_do_not_change_the_choice_much() -> None:
    rng = np.random.default_rng(2)
    values, weights = wave(240, 0.01, 0.3, 0.5) + correlated(rng, 240, 4e-4, 2.6), np.ones(240)
    whole = choose(values, weights, LENGTHS, 4)
    values[100:118], weights[100:118] = 0.3, 0.0
    assert abs(np.log10(choose(values, weights, LENGTHS, 4).strength / whole.strength)) < 1.0


@pytest.mark.parametrize("reach", [2.0, 2.6, 3.5])
def test_the_error_bar_agrees_with_monte_carlo(reach: float) -> None:
    """For lines, arcs and waves with the strength that each asks for: the rms error is what is told, within 30 %."""
    n, sigma = 200, 3e-4
    made, told = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        truth = (0.0, 0.02 * np.linspace(-1, 1, n) ** 2, wave(n, 0.02, 0.3, seed), wave(n, 0.005, 0.12, seed))[seed % 4]
        curve, choice = fitted(truth + correlated(rng, n, sigma, reach))
        made.append(curve - truth)
        told.append(np.sqrt(choice.variance) * deviation(np.ones(n), choice.strength, correlation(np.arange(n), choice.length)))
    assert rms(np.array(told)) == pytest.approx(rms(np.array(made)), rel=0.30)
    inner = slice(15, -15)
    assert rms(np.array(told)[:, inner]) == pytest.approx(rms(np.array(made)[:, inner]), rel=0.30)


def test_the_error_bar_grows_where_data_are_missing() -> None:
    weights = np.ones(200)
    weights[90:120] = 0.0
    told = deviation(weights, 1e4, correlation(np.arange(200), 4.0))
    assert told[100:110].min() > 1.5 * np.median(told[30:70])
    assert np.isfinite(told).all()
