"""What the consistency study needs of a campaign: its runs, bounds, and some runs once more."""

from pathlib import Path

import numpy as np
import xarray as xr

from inscal.experiment import Experiment
from inscal.information import parameter_information
from inscal.innovations import InnovationStatistics, innovation_statistics, units_told
from inscal.parameters import NAMES
from inscal.record import OBSERVED
from pipeline.campaign import store
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError
from pipeline.proof import statistics as numbers
from pipeline.proof.looks import Innovations
from pipeline.proof.power import Campaign
from pipeline.proof.statistics import LAGS, Bounds

FOLDER = Path("results/consistency")
REPORT = Path("results/consistency.md")

_SAMPLE = 256  # runs; resolves 0.005 of a mean NIS of 6
_SAME_ESTIMATE = 1e-6  # sigmas; other processors round differently


def done_of(path: str | Path) -> xr.Dataset:
    """Read the runs done of a campaign that the study can judge.

    Parameters
    ----------
    path : str or Path
        Campaign store.

    Returns
    -------
    xarray.Dataset
        With the number of failed runs as attribute ``failed``.

    Raises
    ------
    DataError
        If it is missing or unfinished, fewer than two runs are done, the filter does not model all
        parameters, or the truths are not normally distributed, as a Bayesian bound needs.
    """
    campaign = store.read(path)
    configuration = campaign.attrs["configuration"]
    if (campaign["status"] == store.NOT_RUN).any():
        raise DataError(f"campaign store {path}: not all runs are made; run pipeline.simulate")
    if configuration["truth"]["distribution"] != "normal":
        raise DataError(f"campaign store {path}: the study needs truth.distribution = normal")
    if not (campaign["predicted_std"] > 0.0).all():
        raise DataError(f"campaign store {path}: the filter does not estimate all parameters")
    done = store.done(campaign)
    if done.sizes["run"] < 2:
        raise DataError(f"campaign store {path}: a study needs two runs that did not fail")
    return done.assign_attrs(failed=int((campaign["status"] == store.FAILED).sum()))


def bounds_of(config: Config, experiment: Experiment) -> Bounds:
    """Cramér-Rao bounds, and the filter's covariance against them."""
    setup = Setup(config)
    information = parameter_information(setup.transitions, setup.model, setup.noise, setup.prior)
    of_truth = information.bayesian_covariance(experiment.truth.parameters.scale)
    of_filter = information.bayesian_covariance(setup.prior.parameter)
    sigma = experiment.estimator.predicted_std
    difference = np.abs(of_filter - experiment.estimator.parameter_covariance)
    return Bounds(
        np.sqrt(np.diag(of_truth)) / setup.unit,
        information.classical_std() / setup.unit,
        float((difference / np.outer(sigma, sigma)).max()),
    )


def repeat_runs(done: xr.Dataset, config: Config, experiment: Experiment) -> InnovationStatistics:
    """Repeat the first runs done and keep the statistics of their innovations.

    Raises
    ------
    DataError
        If they do not come out as the campaign has them: it was made by another version.
    """
    runs = done["run"].to_numpy()[:_SAMPLE].tolist()
    updates, positions = experiment.motion.updates, len(config.schedule.rotations) + 1
    stretches = [
        numbers.updates_of(s, positions, updates) for s in numbers.stretches_of(positions, updates)
    ]
    result = innovation_statistics(experiment, runs, stretches, LAGS)
    stored = done["estimate"].transpose("run", "parameter").to_numpy()[: len(runs)]
    unit = Setup(config).unit
    difference = np.abs(result.estimate / unit - stored) / done["predicted_std"].to_numpy()
    if not (difference < _SAME_ESTIMATE).all():
        raise DataError("campaign.store: not what this version makes; run pipeline.simulate again")
    return result


def campaign_of(done: xr.Dataset, experiment: Experiment) -> Campaign:
    """Size of a campaign, and what is expected of the innovations of its repeated runs."""
    runs, updates = done.sizes["run"], experiment.motion.updates
    repeated, last = min(runs, _SAMPLE), experiment.estimator.passes - 1
    dof = repeated * (OBSERVED * updates - units_told(experiment.estimator, last))
    expected = Innovations(dof, dof, 0, repeated * OBSERVED * len(LAGS))
    return Campaign(correlation_of(experiment), runs, expected)


def correlation_of(experiment: Experiment) -> np.ndarray:
    """Correlation that the filter claims of its errors, shape (27, 27)."""
    sigma = experiment.estimator.predicted_std
    return experiment.estimator.parameter_covariance / np.outer(sigma, sigma)


def prior_differs(config: Config, experiment: Experiment) -> list[str]:
    """Parameters whose prior is not the distribution that their truth is drawn from."""
    prior = Setup(config).prior.parameter
    same = np.isclose(experiment.truth.parameters.scale, prior, rtol=1e-9, atol=0.0)
    return [name for name, equal in zip(NAMES, same, strict=True) if not equal]
