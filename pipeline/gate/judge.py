"""The gate's two jobs: to judge this code against the baselines, and to make new ones."""

from collections.abc import Iterator, Mapping
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from inscal import campaign_checks, regression
from inscal.campaign_checks import Sample
from inscal.parameters import GROUPS
from inscal.regression import Judgement
from pipeline.config.load import differences, resolved, unknown
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError, DataError
from pipeline.gate import history
from pipeline.gate.baseline import folder_of, read_baseline, sample_of, write_baseline
from pipeline.gate.cases import REFERENCE, Case, cases
from pipeline.gate.told import Report, Told, worst_first

BASELINE = Path("results/baseline")
"""Folder of the committed baselines."""

VERDICTS = ("identical", "changed, no worse", "worse")
"""From good to bad; the worst of the cases is that of all."""

_LEAST_P = 1e-300
"""What double precision makes of smaller p-values is no number."""


def campaign(case: Case) -> Sample:
    """Campaign of a case.

    Raises
    ------
    ConfigError
        If the filter of the reference case leaves out a parameter group.
    """
    states = case.config.estimator.states
    if case.name == REFERENCE and set(states) != set(GROUPS):
        raise ConfigError(f"estimator.states = {states}: must be all of {', '.join(GROUPS)}")
    return sample_of(Setup(case.config).experiment, case.draws)


def accept(config: Config, reason: str) -> None:
    """Make the campaigns of this code the baselines.

    Raises
    ------
    DataError
        If one is not fit to be one: the gate builds on their consistency. Then none is written.
    """
    made = [(case, campaign(case)) for case in cases(config)]
    for case, sample in made:
        _refuse(case, sample)
    for case, sample in made:
        write_baseline(
            folder_of(baseline_of(config), case.name), sample, case.configuration, reason
        )
    case, sample = made[0]
    row = history_row(sample, case.configuration, str(date.today()), reason)
    history.append(baseline_of(config), row)
    print(f"baseline written to {baseline_of(config)}: {reason}")


def _refuse(case: Case, sample: Sample) -> None:
    failed = int((~np.isfinite(sample.error).all(axis=1)).sum())
    if failed:
        raise DataError(f"accept: {case.name}: {failed} runs diverged; they are no baseline")
    disturbed = unknown(resolved(case.config))
    for check in campaign_checks.consistency(sample):
        if not (check.passed or disturbed):
            raise DataError(
                f"accept: {case.name}: {_check_line(check)}; such a campaign is no baseline"
            )


def history_row(
    sample: Sample, configuration: Mapping[str, Any], day: str, reason: str
) -> history.Row:
    """Row of the accuracy history that a baseline makes."""
    sigma = np.sqrt(np.diag(sample.covariance))
    return history.row_of(sample.error, sigma, sample.nees, configuration, date=day, reason=reason)


def compare(config: Config) -> Report:
    """Judge the campaigns of this code against the baselines.

    Returns
    -------
    Report
    """
    judged = list(judgements(config))
    told = []
    for case, judgement, about in judged:
        changes = differences(about["configuration"], case.configuration)
        said = [f"configuration: {change}" for change in changes] + lines(judgement)
        told.append(Told(case.name, judgement, said))
    told.sort(key=_badness, reverse=True)
    runs = sum(case.runs for case, _, _ in judged)
    return Report(told[0].judgement.verdict, runs, judged[0][2]["reason"], told)


def _badness(told: Told) -> tuple[int, float]:
    """By verdict, and then by the largest loss."""
    judgement = told.judgement
    losses = [loss.ratio for loss in judgement.losses]
    return VERDICTS.index(judgement.verdict), max(losses, default=0.0)


def baseline_of(config: Config) -> Path:
    """Folder of the baselines: the configured one, or that which is committed."""
    return Path(config.baseline) if config.baseline else BASELINE


def judgements(config: Config) -> Iterator[tuple[Case, Judgement, Mapping[str, Any]]]:
    """Judge case by case, and say what each baseline is about.

    The reference case has the levels of `inscal.regression` to itself, and the others share as
    much again.

    Raises
    ------
    ConfigError, DataError
        If a case cannot be run or compared.
    """
    every = list(cases(config))
    folder = baseline_of(config)
    baselines = [read_baseline(folder_of(folder, case.name), case.runs) for case in every]
    for case, (old, about) in zip(every, baselines, strict=True):
        new = campaign(case)
        if not np.array_equal(old.columns, new.columns):
            raise DataError(f"{case.name}: the baseline is of other states; make a new one")
        if case.name == REFERENCE:
            setup = Setup(case.config)
            judgement = regression.judge(old, new, setup.bound * setup.unit)
        else:
            judgement = regression.judge(old, new, share=1 / (len(every) - 1))
        yield case, judgement, about


def lines(judgement: Judgement) -> list[str]:
    """What a judgement found, in words; nothing of an identical campaign."""
    if judgement.verdict == "identical":
        return []
    if judgement.failed:
        return [f"{judgement.failed} runs diverged"]
    out = ["same data" if judgement.same_data else "other data: only a large loss can be told"]
    out += [
        f"{loss.name}: RMSE {_interval(loss.ratio, loss.lower, loss.upper)} of the baseline's, "
        f"adjusted p {_p_text(loss.p_value)}"
        for loss in worst_first(judgement.losses)
    ]
    out += [_check_line(check) for check in judgement.checks if not check.passed]
    if judgement.verdict != "worse" and judgement.ratios is not None:
        ratios, names = judgement.ratios, judgement.ratios.names
        most = int(np.argmax(ratios.ratio))
        shown = _interval(ratios.ratio[most], ratios.lower[most], ratios.upper[most])
        out.append(f"largest of {len(names)}: {names[most]}, RMSE {shown} of the baseline's")
    return out


def _p_text(p: float) -> str:
    return f"{p:.1g}" if p > _LEAST_P else f"below {_LEAST_P:g}"


def _interval(ratio: float, lower: float, upper: float) -> str:
    percent = f"{100 * regression.CONFIDENCE:g} %"
    return f"{ratio:.3f} ({percent}: {lower:.3f} - {upper:.3f})"


def _check_line(check: campaign_checks.Check) -> str:
    return f"{check.name}: {check.value:.4g}, not in {check.lower:.4g} - {check.upper:.4g}"
