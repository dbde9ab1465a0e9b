"""Stage `consistency`: is the filter as good as it says, and as any could be.

Usage: ``python -m pipeline.consistency [campaign.store=...]``

Judges a campaign, repeats a sample of its runs for their innovations, and writes tables, figures
and ``results/consistency.md``. All but the path is taken from the configuration that the campaign
was made with.

For example::

    python -m pipeline.consistency campaign.store=results/runs/position25-reference-consistency

Reads: campaign.store campaign.seed.
"""

from pathlib import Path

import numpy as np
import xarray as xr
from omegaconf import OmegaConf

from inscal.experiment import Experiment
from inscal.information import parameter_information
from inscal.innovations import Sample, sample
from inscal.parameters import NAMES
from inscal.state_model import StateModel, build_transitions
from pipeline import build, consistency_plots, consistency_report, store
from pipeline import consistency_statistics as numbers
from pipeline import figure_style as style
from pipeline.config import Config, DataError, stage
from pipeline.consistency_statistics import LAGS, Bounds
from pipeline.output import json_data, table_text, write_text
from pipeline.progress import busy
from pipeline.summarize import as_json

FOLDER = Path("results/consistency")
REPORT = Path("results/consistency.md")

_SAMPLE = 256  # runs; resolves 0.005 of a mean NIS of 6
_SAME_ESTIMATE = 1e-6  # sigmas; other processors round differently


def config_of(campaign: xr.Dataset) -> Config:
    """Configuration that a campaign was made with."""
    made_with = OmegaConf.merge(OmegaConf.structured(Config), campaign.attrs["configuration"])
    config = OmegaConf.to_object(made_with)
    assert isinstance(config, Config)
    return config


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
    done = campaign.isel(run=(campaign["status"] == store.DONE).to_numpy())
    if done.sizes["run"] < 2:
        raise DataError(f"campaign store {path}: a study needs two runs that did not fail")
    return done.assign_attrs(failed=int((campaign["status"] == store.FAILED).sum()))


def bounds_of(config: Config, experiment: Experiment) -> Bounds:
    """Cramér-Rao bounds, and the filter's covariance against them."""
    model, noise = StateModel(tuple(config.estimator.states)), build.build_noise(config)
    initial, unit = build.build_initial_std(config), build.si_units(config)
    transitions = build_transitions(
        build.build_schedule(config),
        build.build_site(config),
        model,
        noise,
        update_interval=config.estimator.update_interval_s,
    )
    information = parameter_information(transitions, model, noise, initial)
    of_truth = information.bayesian_covariance(experiment.truth.scale)
    of_filter = information.bayesian_covariance(initial.parameter)
    sigma = experiment.estimator.predicted_std
    difference = np.abs(of_filter - experiment.estimator.parameter_covariance)
    return Bounds(
        np.sqrt(np.diag(of_truth)) / unit,
        information.classical_std() / unit,
        float((difference / np.outer(sigma, sigma)).max()),
    )


def repeat_runs(done: xr.Dataset, config: Config, experiment: Experiment) -> Sample:
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
    result = sample(experiment, runs, stretches, LAGS)
    stored = done["estimate"].transpose("run", "parameter").to_numpy()[: len(runs)]
    unit = build.si_units(config)
    difference = np.abs(result.estimate / unit - stored) / done["predicted_std"].to_numpy()
    if not (difference < _SAME_ESTIMATE).all():
        raise DataError("campaign.store: not what this version makes; run pipeline.simulate again")
    return result


def _prior_differs(config: Config, experiment: Experiment) -> list[str]:
    """Parameters whose prior is not the distribution that their truth is drawn from."""
    prior = build.build_initial_std(config).parameter
    same = np.isclose(experiment.truth.scale, prior, rtol=1e-9, atol=0.0)
    return [name for name, equal in zip(NAMES, same, strict=True) if not equal]


@stage
def main(config: Config) -> None:
    """Judge one campaign."""
    done = done_of(config.campaign.store)
    made_with = config_of(done)
    experiment = build.build_experiment(made_with)
    with busy("repeating runs for their innovations"):
        repeated = repeat_runs(done, made_with, experiment)
    positions = len(made_with.schedule.rotations) + 1
    study = numbers.estimates(done, bounds_of(made_with, experiment)).assign_attrs(
        campaign=Path(config.campaign.store).name,
        seed=made_with.campaign.seed,
        usual_seed=config.campaign.seed,
        noise=done.attrs["configuration"]["noise"],
        prior_differs=_prior_differs(made_with, experiment),
        positions=positions,
        position_duration_s=made_with.schedule.position_duration_s,
        innovations=numbers.innovations(repeated, experiment, positions),
    )
    text = as_json(study)
    write_text(FOLDER / "consistency.csv", table_text(study))
    write_text(FOLDER / "consistency.json", text)
    style.save(consistency_plots.zip_plot(done, study), FOLDER / "zip.png")
    style.save(consistency_plots.innovations(repeated, study), FOLDER / "innovations.png")
    write_text(REPORT, consistency_report.report_text(json_data(text)))
    print(REPORT)


if __name__ == "__main__":
    main()
