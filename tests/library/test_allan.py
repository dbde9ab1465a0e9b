"""Noise at rest: Allan variances by definition, and sizes found within their intervals."""

import numpy as np
import pytest

from inscal.allan import KINDS, allan_variance, averages, fit_noise, spectra, transfer

SAMPLES, INTERVAL = 8192, 0.1
TRUE = {"white": 1.0, "flicker": 0.15, "random_walk": 0.02, "quantisation": 0.3}
NONE = dict.fromkeys(KINDS, 0.0)


def series(rng, size):
    """Rates with so much of each kind; flicker by its spectrum, of a series four times as long."""
    white = size["white"] / np.sqrt(INTERVAL) * rng.standard_normal(SAMPLES)
    walk = np.cumsum(size["random_walk"] * np.sqrt(INTERVAL) * rng.standard_normal(SAMPLES))
    rounding = np.diff(size["quantisation"] * rng.standard_normal(SAMPLES + 1)) / INTERVAL
    many = 4 * SAMPLES
    frequency = np.fft.rfftfreq(many, INTERVAL)[1:]
    power = size["flicker"] ** 2 / (2.0 * np.log(2.0) * frequency)
    wave = rng.standard_normal(len(power)) + 1j * rng.standard_normal(len(power))
    wave *= np.sqrt(power * many / (4.0 * INTERVAL))
    flicker = np.fft.irfft(np.concatenate([[0.0], wave]), many)[:SAMPLES]
    return white + walk + rounding + flicker


def test_allan_variance_is_that_of_neighbouring_averages():
    rate = np.random.default_rng(1).standard_normal(200)
    for m in (1, 3, 8):
        means = np.convolve(rate, np.ones(m) / m, mode="valid")
        expected = 0.5 * np.mean(np.square(means[m:] - means[:-m]))
        assert allan_variance(rate, np.array([m]))[0] == pytest.approx(expected, rel=1e-9)


def test_spectra_have_the_allan_variances_of_the_standard():
    """Of a long series: N^2/t, B^2, K^2 t/3 and 3 Q^2/t^2."""
    frequency = np.arange(1, 200001) / (400000 * INTERVAL)
    lengths = np.array([16, 64, 256])
    time = lengths * INTERVAL
    found = transfer(frequency, lengths, INTERVAL) @ spectra(frequency, INTERVAL).T
    found /= 400000 * INTERVAL
    expected = np.stack([1 / time, np.ones(3), time / 3.0, 3.0 / time**2], axis=1)
    np.testing.assert_allclose(found, expected, rtol=0.01)


@pytest.mark.parametrize(
    "size", [TRUE, NONE | {"white": 1.0}, NONE | {"white": 1.0, "flicker": 0.4}]
)
def test_known_sizes_are_within_their_intervals(size):
    """In some 95 of 100 series; 10 of 60 outside have a probability of 1 in 3 000."""
    rng, inside = np.random.default_rng(2), dict.fromkeys(KINDS, 0)
    for _ in range(60):
        fit = fit_noise(series(rng, size), INTERVAL)
        for kind in KINDS:
            inside[kind] += fit.size_lower[kind] <= size[kind] <= fit.size_upper[kind]
    assert min(inside.values()) > 50, inside


def test_the_fit_follows_the_deviation():
    fit = fit_noise(series(np.random.default_rng(3), TRUE), INTERVAL)
    assert (fit.lower < fit.deviation).all()
    assert (fit.deviation < fit.upper).all()
    inside = (fit.lower < fit.fitted) & (fit.fitted < fit.upper)
    assert inside.mean() > 0.7
    assert len(fit.time) == len(averages(SAMPLES))


@pytest.mark.parametrize("rate", [np.zeros(1000), np.ones(20)])
def test_no_noise_and_too_few_samples_are_refused(rate):
    with pytest.raises(ValueError, match="samples at rest"):
        fit_noise(rate, 0.1)
