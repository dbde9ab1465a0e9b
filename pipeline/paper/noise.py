"""Noise levels that would explain errors, and noise levels that bounds can stand.

Everything here is predicted: sigma of the 27 parameters from the covariance recursion, on a grid of
noise scales, interpolated between. Campaigns verify what comes out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy import special
from scipy.interpolate import RegularGridInterpolator

from inscal.parameters import KINDS, members
from inscal.statistics import normal_quantile
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.progress import track
from pipeline.study.findings import ENOUGH

SIGMAS = normal_quantile(ENOUGH)
"""Standard deviations within which the share `ENOUGH` of normal errors stays."""

SCALES = np.geomspace(0.25, 256.0, 11)
"""Noise scales of the sweep, in units of the configured noise; a factor of 2 from one to the next,
between which sigma follows a power law to a per cent or so."""

_FINE = 25  # points of the likelihood search per step of the sweep
_DROP_95 = float(special.gammaincinv(1.0, 0.95))  # of the log likelihood, two scales free


def scaled(config: Config, gyro: float, other: float, observation: float | None = None) -> Config:
    """Copy a configuration with scaled noise.

    Parameters
    ----------
    config : Config
    gyro, other : float
        Factors on the gyros' noise and on that of accelerometers and observations.
    observation : float, optional
        Factor on the noise of the observations, where it is not `other`.

    Returns
    -------
    Config
    """
    noise, observed = config.noise, other if observation is None else observation
    return replace(
        config,
        noise=replace(
            noise,
            gyro_angle_random_walk_deg_per_sqrt_h=gyro
            * noise.gyro_angle_random_walk_deg_per_sqrt_h,
            accel_white_noise_ug_per_sqrt_hz=other * noise.accel_white_noise_ug_per_sqrt_hz,
            velocity_observation_m_per_s=observed * noise.velocity_observation_m_per_s,
            position_observation_m=observed * noise.position_observation_m,
        ),
    )


def predicted_std(config: Config) -> np.ndarray:
    """Predicted sigma of the 27 parameters, in paper units."""
    setup = Setup(config)
    return setup.gains.parameter_std[-1] / setup.unit


@dataclass(frozen=True)
class Explanation:
    """Noise at which errors of a given size are typical.

    Attributes
    ----------
    gyro, other : float
        Most likely factors on the gyros' noise and on that of accelerometers and observations.
    gyro_range, other_range : tuple of 2 float
        Extent of the joint 95 % likelihood region.
    sigma : ndarray, shape (27,)
        Predicted there, in paper units.
    chi_square : float
        Sum of squared errors over sigma, 27 being typical.
    """

    gyro: float
    other: float
    gyro_range: tuple[float, float]
    other_range: tuple[float, float]
    sigma: np.ndarray
    chi_square: float


def sweep(config: Config) -> np.ndarray:
    """Predicted sigma at all pairs of `SCALES`, gyro first, shape (scales, scales, 27)."""
    pairs = list(product(SCALES, SCALES))
    sigma = [predicted_std(scaled(config, *pair)) for pair in track(pairs, "noise levels")]
    return np.reshape(sigma, (len(SCALES), len(SCALES), -1))


def explain(errors: np.ndarray, table: np.ndarray) -> Explanation:
    """Find the noise that makes errors most likely.

    The errors count as independent and normal: their sizes decide, not their correlations, which
    an extracted table of rounded numbers in an uncertain unit could not bear.

    Parameters
    ----------
    errors : ndarray, shape (27,)
        Estimates minus truth, in paper units.
    table : ndarray, shape (scales, scales, 27)
        From `sweep`.

    Returns
    -------
    Explanation
    """
    grid = np.log(SCALES)
    log_sigma = RegularGridInterpolator((grid, grid), np.log(table))
    fine = np.linspace(grid[0], grid[-1], _FINE * (len(grid) - 1) + 1)
    sigma = np.exp(log_sigma(np.stack(np.meshgrid(fine, fine, indexing="ij"), axis=-1)))
    likelihood = -(np.square(errors / sigma) / 2.0 + np.log(sigma)).sum(axis=-1)
    best = np.unravel_index(np.argmax(likelihood), likelihood.shape)
    likely = likelihood > likelihood[best] - _DROP_95
    gyro, other = (np.exp(fine[likely.any(axis=axis)]) for axis in (1, 0))
    return Explanation(
        gyro=float(np.exp(fine[best[0]])),
        other=float(np.exp(fine[best[1]])),
        gyro_range=(float(gyro[0]), float(gyro[-1])),
        other_range=(float(other[0]), float(other[-1])),
        sigma=sigma[best],
        chi_square=float(np.square(errors / sigma[best]).sum()),
    )


def margins(sigma_at: Callable[[float], np.ndarray], bound: np.ndarray) -> dict[str, float]:
    """Largest noise scale at which each kind's bound holds in `ENOUGH` of runs.

    Parameters
    ----------
    sigma_at : callable
        Predicted sigma, shape (27,), at one of `SCALES`.
    bound : ndarray, shape (27,)
        In the unit of the sigmas.

    Returns
    -------
    dict
        By kind; infinite where the bound still holds at the last of `SCALES`, 0 where it fails
        from the first on.
    """
    ratio = np.array([SIGMAS * sigma_at(scale) / bound for scale in SCALES])
    return {kind: _crossing(ratio[:, members(kind)].max(axis=1)) for kind in KINDS}


def _crossing(ratio: np.ndarray) -> float:
    """Scale at which a rising function of `SCALES` passes 1."""
    if ratio[0] > 1.0:
        return 0.0
    if ratio[-1] <= 1.0:
        return np.inf
    after = int(np.argmax(ratio > 1.0))
    pair = slice(after - 1, after + 1)
    return float(np.exp(np.interp(0.0, np.log(ratio[pair]), np.log(SCALES[pair]))))
