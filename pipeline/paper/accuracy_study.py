"""The paper's Table 3 beside a campaign: what is compared, and the campaigns that verify it."""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy import special

from inscal import experiment
from inscal.parameters import KINDS, NAMES, members, vector
from inscal.statistics import wilson_interval
from pipeline.campaign import store
from pipeline.campaign.judged import summary
from pipeline.config.schema import Config
from pipeline.config.setup import Setup, parameter_vector
from pipeline.console.errors import DataError
from pipeline.console.progress import busy, track
from pipeline.paper import noise as paper_noise
from pipeline.paper import values as paper_values
from pipeline.paper.noise import Explanation

SENSORS = ("gyro", "accel")
"""Sensors whose noise is varied one at a time; attributes of `Margin`."""


@dataclass(frozen=True)
class Margin:
    """What noise a kind's bound stands, as factors on the configured noise.

    Attributes
    ----------
    gyro, accel : float
        Infinite where the sweep found no limit, 0 where the other noise alone is too much.
    """

    gyro: float
    accel: float


@dataclass(frozen=True)
class Checked:
    """A campaign at a predicted limit: how often the kind's worst parameter keeps its bound."""

    kind: str
    sensor: str
    parameter: str
    within: int
    runs: int
    interval: tuple[float, float]


@dataclass(frozen=True)
class Study:
    """All that the accuracy report says; parameters in paper units and state order."""

    config: Config
    runs: int
    truth: np.ndarray
    paper: np.ndarray
    bound: np.ndarray
    one_run: np.ndarray
    summary: xr.Dataset
    one_pass_bias: np.ndarray
    explanation: Explanation
    matched_rmse: np.ndarray
    matched_failed: int
    margins: dict[str, Margin]
    checked: tuple[Checked, ...]

    @property
    def paper_error(self) -> np.ndarray:
        """Errors of the paper's estimates."""
        return self.paper - self.truth


def kind_probability(errors: np.ndarray, sigma: np.ndarray) -> dict[str, float]:
    """Probability, by kind, that errors come out as small as they did.

    Parameters
    ----------
    errors, sigma : ndarray, shape (27,)

    Returns
    -------
    dict
        Near 0 where errors are too small for their sigma, near 1 where they are too large.
    """
    squared = {kind: np.square(errors / sigma)[members(kind)] for kind in KINDS}
    return {kind: float(special.chdtr(len(own), own.sum())) for kind, own in squared.items()}


def _errors(config: Config) -> np.ndarray:
    """Errors of a campaign's runs, shape (runs, 27), in paper units; NaN where a run failed."""
    setup = Setup(config)
    outcome = experiment.run(setup.experiment, range(config.campaign.runs))
    return (outcome.estimate - outcome.truth) / setup.unit


def _margins(config: Config, bound: np.ndarray) -> dict[str, Margin]:
    gyro = paper_noise.margins(
        lambda s: paper_noise.predicted_std(paper_noise.scaled(config, s, 1.0)), bound
    )
    accel = paper_noise.margins(
        lambda s: paper_noise.predicted_std(paper_noise.scaled(config, 1.0, s, 1.0)), bound
    )
    return {kind: Margin(gyro[kind], accel[kind]) for kind in KINDS}


def _check_margin(config: Config, sensor: str, kind: str, factor: float) -> Checked:
    """Run a campaign at the predicted limit and count for the parameter nearest to its bound."""
    gyro, accel = (factor, 1.0) if sensor == "gyro" else (1.0, factor)
    noisy = paper_noise.scaled(config, gyro, accel, 1.0)
    bound, error = Setup(config).bound, _errors(noisy)
    own = members(kind)
    worst = int(own[np.argmax((paper_noise.predicted_std(noisy) / bound)[own])])
    within = int((np.abs(error[:, worst]) <= bound[worst]).sum())
    held = wilson_interval(within, len(error))
    interval = float(held.lower), float(held.upper)
    return Checked(kind, sensor, NAMES[worst], within, len(error), interval)


def _tightest(margins: dict[str, Margin], sensor: str) -> tuple[str, float]:
    """Kind with the smallest limit that the noise of one sensor reaches."""
    limits = {kind: getattr(margin, sensor) for kind, margin in margins.items()}
    reached = {kind: factor for kind, factor in limits.items() if 0.0 < factor < np.inf}
    return min(reached.items(), key=lambda item: item[1])


def study_of(config: Config) -> Study:
    """Judge the campaign of the configuration and make the campaigns that verify predictions.

    Raises
    ------
    DataError
        If there is no such campaign, its run 0 failed or its truth is not fixed.
    """
    campaign = store.read(config.campaign.store)
    if campaign.attrs["configuration"]["truth"]["distribution"] != "fixed":
        raise DataError(f"campaign store {config.campaign.store}: must have truth=paper")
    if campaign["status"].to_numpy()[0] != store.DONE:
        raise DataError(f"campaign store {config.campaign.store}: run 0 is not done")
    truth, bound = parameter_vector(config.truth), Setup(config).bound
    paper = vector(paper_values.TABLE_3_ESTIMATES)
    explanation = paper_noise.explain(paper - truth, paper_noise.sweep(config))
    matched = _errors(paper_noise.scaled(config, explanation.gyro, explanation.other))
    with busy("noise that the bounds can bear"):
        margins = _margins(config, bound)
    one_pass = replace(config, estimator=replace(config.estimator, passes=1, max_passes=None))
    return Study(
        config=config,
        runs=int((campaign["status"] == store.DONE).sum()),
        truth=truth,
        paper=paper,
        bound=bound,
        one_run=campaign["estimate"].isel(run=0).to_numpy(),
        summary=summary(config, config.campaign.store, campaign),
        one_pass_bias=np.nanmean(_errors(one_pass), axis=0),
        explanation=explanation,
        matched_rmse=np.sqrt(np.nanmean(np.square(matched), axis=0)),
        matched_failed=int(np.isnan(matched[:, 0]).sum()),
        margins=margins,
        checked=tuple(
            _check_margin(config, sensor, *_tightest(margins, sensor))
            for sensor in track(SENSORS, "campaigns at the limits")
        ),
    )
