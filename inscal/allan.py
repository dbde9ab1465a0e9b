r"""Noise of a sensor at rest, from its Allan variance: what is in it, with intervals.

Of rates y_k, means over samples of length h, averaged over m samples, the overlapping Allan
variance is half the mean square of the difference of neighbouring averages (IEEE Std 952-2020,
annex C). It is linear in the power spectrum S(f) of y, one-sided:

.. math:: \sigma^2(m h) = \sum_f S(f) H_m(f) \Delta f , \qquad
          H_m(f) = \frac{2 \sin^4 \pi f m h}{m^2 \sin^2 \pi f h} ,

and so is its expectation in the sizes of four kinds of noise, squared:

- white rate noise N (angle random walk): S = 2 N^2;
- flicker, of a flat Allan deviation B: S = B^2 / (2 ln 2 f);
- random walk of the rate, K: S = K^2 h^2 / (2 sin^2 pi f h);
- quantisation of the angle, of standard deviation Q: S = 8 Q^2 sin^2(pi f h) / h.

Its scatter follows from the same sum, for a periodogram's ordinates are independent and as large as
they scatter: cov(m, n) = sum S^2 H_m H_n df / T. With it the sizes squared are found by least
squares, none below zero, which is repeated with the covariance of what was found.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from inscal.statistics import normal_quantile

KINDS = ("white", "flicker", "random_walk", "quantisation")
_LEAST = 9  # clusters in the longest average
_ROUNDS = 8


@dataclass(frozen=True)
class NoiseFit:
    """Noise of one sensor.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Averaging times, octaves, s.
    deviation : ndarray, shape (n,)
        Allan deviation.
    lower, upper : ndarray, shape (n,)
        Its interval, by the scatter of the noise that was found, lognormal.
    fitted : ndarray, shape (n,)
        Of the noise that was found.
    size, size_lower, size_upper : dict of str to float
        Of each of `KINDS`: per sqrt(s), plain, times sqrt(1/s), and times s, of the rate's unit.
        The lower end of what may be absent is zero.
    """

    time: np.ndarray
    deviation: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    fitted: np.ndarray
    size: dict[str, float]
    size_lower: dict[str, float]
    size_upper: dict[str, float]


def averages(samples: int) -> np.ndarray:
    """Octaves of averages of so many samples, as long as there are some of each; shape (n,)."""
    return 2 ** np.arange(max(0, int(np.log2(samples / _LEAST))) + 1)


def allan_variance(rate: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Overlapping Allan variance.

    Parameters
    ----------
    rate : ndarray, shape (samples,)
    lengths : ndarray of int, shape (n,)
        Samples averaged.

    Returns
    -------
    ndarray, shape (n,)
    """
    angle = np.concatenate([[0.0], np.cumsum(rate - rate.mean())])
    out = []
    for m in lengths:
        second = angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]
        out.append(0.5 * np.mean(np.square(second)) / m**2)
    return np.array(out)


def fit_noise(rate: np.ndarray, interval: float, confidence: float = 0.95) -> NoiseFit:
    """Find how much there is of each kind of noise.

    Parameters
    ----------
    rate : ndarray, shape (samples,)
        At rest, means over samples; at least 64 of them.
    interval : float
        Of a sample, s.
    confidence : float
        Of the intervals.

    Returns
    -------
    NoiseFit

    Raises
    ------
    ValueError
        If there are too few samples, or they do not change.
    """
    count = len(rate)
    if count < 64:
        raise ValueError(f"{count} samples at rest are too few to tell noise; 64 are the least")
    lengths = averages(count)
    variance = allan_variance(rate, lengths)
    if not variance.min() > 0.0:
        raise ValueError("samples at rest do not change: there is no noise in them")
    frequency = np.arange(1, count // 2 + 1) / (count * interval)
    step = 1.0 / (count * interval)
    passed = transfer(frequency, lengths, interval)
    unit = spectra(frequency, interval)
    design = passed @ unit.T * step
    squared = np.zeros(len(KINDS))
    covariance = np.diag(variance**2)
    for _ in range(_ROUNDS):
        root = np.linalg.cholesky(covariance)
        scale = np.linalg.norm(np.linalg.solve(root, design), axis=0)
        whitened = np.linalg.solve(root, design) / scale
        squared = nnls(whitened, np.linalg.solve(root, variance))[0] / scale
        spectrum = np.square(squared @ unit)
        covariance = (passed * spectrum) @ passed.T * step**2
    information = whitened.T @ whitened
    sigma = np.sqrt(np.diag(np.linalg.pinv(information))) / scale
    wide = float(normal_quantile(confidence))
    spread = np.exp(0.5 * wide * np.sqrt(np.diag(covariance)) / (design @ squared))
    bounds = (squared, squared - wide * sigma, squared + wide * sigma)
    middle, low, high = (
        dict(zip(KINDS, np.sqrt(np.maximum(one, 0.0)).tolist(), strict=True)) for one in bounds
    )
    return NoiseFit(
        lengths * interval,
        np.sqrt(variance),
        np.sqrt(variance) / spread,
        np.sqrt(variance) * spread,
        np.sqrt(design @ squared),
        middle,
        low,
        high,
    )


def transfer(frequency: np.ndarray, lengths: np.ndarray, interval: float) -> np.ndarray:
    """H of the module docstring, shape (lengths, frequencies)."""
    once = np.sin(np.pi * frequency * interval)
    many = np.sin(np.pi * np.outer(lengths, frequency) * interval)
    return np.asarray(2.0 * many**4 / np.square(np.outer(lengths, once)))


def spectra(frequency: np.ndarray, interval: float) -> np.ndarray:
    """Power spectrum of each of `KINDS` of size one, shape (4, frequencies)."""
    squared = np.square(np.sin(np.pi * frequency * interval))
    return np.stack(
        [
            np.full_like(frequency, 2.0),
            1.0 / (2.0 * np.log(2.0) * frequency),
            interval**2 / (2.0 * squared),
            8.0 * squared / interval,
        ]
    )
