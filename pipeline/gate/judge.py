"""The gate's two jobs: to judge this code against the baseline, and to make a new one."""

from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from inscal import regression
from inscal.parameters import GROUPS
from inscal.regression import Judgement, Sample
from pipeline.config.load import differences
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError, DataError
from pipeline.gate import history
from pipeline.gate.baseline import configuration_of, read_baseline, sample_of, write_baseline

BASELINE = Path("results/baseline")
"""Folder of the committed baseline."""


def campaign(config: Config) -> Sample:
    """The gate's campaign of a configuration.

    Raises
    ------
    ConfigError
        If the filter leaves out a parameter group.
    """
    if set(config.estimator.states) != set(GROUPS):
        raise ConfigError(
            f"estimator.states = {config.estimator.states}: must be all of {', '.join(GROUPS)}"
        )
    return sample_of(Setup(config).experiment)


def accept(config: Config, reason: str) -> None:
    """Make the campaign of this code the baseline.

    Raises
    ------
    DataError
        If the campaign is not fit to be one: the gate builds on its consistency.
    """
    sample = campaign(config)
    failed = int((~np.isfinite(sample.error).all(axis=1)).sum())
    if failed:
        raise DataError(f"accept: {failed} runs diverged; they are no baseline")
    for check in regression.consistency(sample):
        if not check.passed:
            raise DataError(f"accept: {_check_line(check)}; such a campaign is no baseline")
    write_baseline(BASELINE, sample, config, reason)
    history.append(
        BASELINE, history_row(sample, configuration_of(config), str(date.today()), reason)
    )
    print(f"baseline written to {BASELINE}: {reason}")


def history_row(
    sample: Sample, configuration: Mapping[str, Any], day: str, reason: str
) -> history.Row:
    """Row of the accuracy history that a baseline makes."""
    sigma = np.sqrt(np.diag(sample.covariance))
    return history.row_of(sample.error, sigma, sample.nees, configuration, date=day, reason=reason)


def compare(config: Config) -> Judgement:
    """Judge the campaign of this code against the baseline and print the verdict."""
    baseline, about = read_baseline(BASELINE)
    sample = campaign(config)
    setup = Setup(config)
    bound = setup.bound * setup.unit
    judgement = regression.judge(baseline, sample, bound)
    print(f"{judgement.verdict}: {len(sample.error)} runs against the baseline: {about['reason']}")
    for line in differences(about["configuration"], configuration_of(config)):
        print(f"  configuration: {line}")
    for line in lines(judgement):
        print(f"  {line}")
    return judgement


def lines(judgement: Judgement) -> list[str]:
    """What a judgement found, in words; nothing of an identical campaign."""
    if judgement.verdict == "identical":
        return []
    if judgement.failed:
        return [f"{judgement.failed} runs diverged"]
    out = ["same data" if judgement.same_data else "other data: only a large loss can be told"]
    out += [
        f"{loss.name}: RMSE {_interval(loss.ratio, loss.lower, loss.upper)} of the baseline's, "
        f"adjusted p {loss.p_value:.1g}"
        for loss in judgement.losses
    ]
    out += [_check_line(check) for check in judgement.checks if not check.passed]
    if judgement.verdict != "worse" and judgement.ratios is not None:
        ratios, names = judgement.ratios, list(regression.LOOKS)
        most = int(np.argmax(ratios.ratio))
        shown = _interval(ratios.ratio[most], ratios.lower[most], ratios.upper[most])
        out.append(f"largest of {len(names)}: {names[most]}, RMSE {shown} of the baseline's")
    return out


def _interval(ratio: float, lower: float, upper: float) -> str:
    percent = f"{100 * regression.CONFIDENCE:g} %"
    return f"{ratio:.3f} ({percent}: {lower:.3f} - {upper:.3f})"


def _check_line(check: regression.Check) -> str:
    return f"{check.name}: {check.value:.4g}, not in {check.lower:.4g} - {check.upper:.4g}"
