"""The gate for another program's estimates: worse than its own baseline, or not.

Its errors are those from the truth of a campaign's runs, and the verdicts are the gate's
(`inscal.regression`). What a program does not estimate is not asked. That a change of estimates is
a loss in full, which makes the gate so sharp for our filter, is true of optimal ones alone: it is
used where the baseline's errors are consistent with the covariance that is the best there is for
the campaign, our filter's. Else the paired ratio is, which finds larger losses only.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from inscal import campaign_checks, regression
from inscal.campaign_checks import Sample
from inscal.parameters import COUNT, NAMES
from pipeline.campaign import store
from pipeline.config.load import differences, resolved, run_settings
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError, DataError
from pipeline.gate.baseline import read_baseline, write_baseline
from pipeline.gate.judge import VERDICTS, lines
from pipeline.gate.told import Report, Told
from pipeline.study.estimates import read_estimates
from pipeline.study.others import as_campaign

_LEAST = 2 * COUNT  # runs: fewer give no covariance of 27 errors


def accept(config: Config, reason: str) -> None:
    """Make a table of estimates the baseline.

    Raises
    ------
    ConfigError, DataError
        If it cannot be one.
    """
    sample, about = _sample(config)
    failed = int((~np.isfinite(sample.error).all(axis=1)).sum())
    if failed:
        raise DataError(f"accept: {failed} runs have no estimates; they are no baseline")
    folder = _folder(config)
    write_baseline(folder, sample, about, reason)
    print(f"baseline written to {folder}: {reason}")


def compare(config: Config) -> Report:
    """Judge a table of estimates against its baseline.

    Returns
    -------
    Report

    Raises
    ------
    ConfigError, DataError
        If there is nothing to compare.
    """
    new, about = _sample(config)
    old, before = read_baseline(_folder(config), len(new.error))
    was: Mapping[str, Any] = before["configuration"]
    other = sorted(set(was["parameters"]) ^ set(about["parameters"]))
    if other:
        raise DataError(
            f"estimates = {config.estimates}: {', '.join(other)}: in it or in its baseline alone"
        )
    bound = Setup(config).bound * Setup(config).unit
    same = was == about
    best = same and all(check.passed for check in campaign_checks.consistency(old))
    judgement = regression.judge(old, new, bound, claimed=best)
    if same and regression.identical(old, new):
        judgement = replace(judgement, verdict=VERDICTS[0])
    kind = "an optimal" if best else "no optimal"
    said = [f"the baseline's errors are those of {kind} filter", *lines(judgement)]
    told = Told(Path(str(config.estimates)).stem, judgement, said)
    return Report(judgement.verdict, len(new.error), before["reason"], [told])


def _folder(config: Config) -> Path:
    if config.baseline is None:
        raise ConfigError("baseline = null: must be the folder of the estimates' baseline")
    return Path(config.baseline)


def _sample(config: Config) -> tuple[Sample, dict[str, Any]]:
    """Errors of a table of estimates as a campaign, and what it is of."""
    path = str(config.estimates)
    own = store.read(config.campaign.store)
    other = differences(run_settings(own.attrs["configuration"]), run_settings(resolved(config)))
    if other:
        raise ConfigError(
            f"campaign.store = {config.campaign.store}: {other[0]}: give the overrides that it was "
            "simulated with"
        )
    theirs, _ = as_campaign(read_estimates(config), own, path)
    if theirs.sizes["run"] < _LEAST:
        raise DataError(f"estimates = {path}: {theirs.sizes['run']} runs: the gate needs {_LEAST}")
    names = [str(name) for name in theirs["parameter"].values]
    place = [NAMES.index(name) for name in names]
    unit = Setup(config).unit[place]
    error = np.zeros((theirs.sizes["run"], COUNT))
    error[:, place] = theirs["error"].transpose("run", "parameter").to_numpy() * unit
    error[(theirs["status"] != store.DONE).to_numpy()] = np.nan
    covariance = np.zeros((COUNT, COUNT))
    best = Setup(config).experiment.estimator.parameter_covariance
    covariance[np.ix_(place, place)] = best[np.ix_(place, place)]
    whitened = np.linalg.solve(np.linalg.cholesky(best[np.ix_(place, place)]), error[:, place].T)
    about = {"campaign": _digest(own), "parameters": names}
    nees = np.square(whitened).sum(axis=0)
    return Sample(error, covariance, nees, _sketch(about, theirs)), about


def _digest(campaign: xr.Dataset) -> str:
    """Of what makes the records of a campaign: its configuration, and the truth that was drawn."""
    settings = json.dumps(run_settings(campaign.attrs["configuration"]), sort_keys=True)
    truth = np.ascontiguousarray(campaign["truth"].transpose("run", "parameter").to_numpy())
    return hashlib.sha256(settings.encode() + truth.tobytes()).hexdigest()


def _sketch(about: Mapping[str, Any], theirs: xr.Dataset) -> np.ndarray:
    """A number for the data of each run: the same campaign has the same records."""
    number = int(hashlib.sha256(about["campaign"].encode()).hexdigest()[:8], 16)
    return number + theirs["run"].to_numpy().astype(float)
