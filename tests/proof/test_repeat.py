"""Runs repeated for their innovations, and campaigns that cannot be."""

import dataclasses

import numpy as np
import pytest
from campaigns import SHORT, make, set_status, short

from inscal import statistics
from inscal.experiment import run, run_with_history
from inscal.innovations import autocorrelation, innovation_statistics
from pipeline.config.load import config_of, load
from pipeline.config.setup import Setup
from pipeline.console.errors import DataError
from pipeline.proof.repeat import done_of, repeat_runs
from pipeline.proof.statistics import LAGS


@pytest.fixture(scope="module")
def short_campaign(tmp_path_factory):
    return make(tmp_path_factory.mktemp("consistency") / "campaign", "campaign.runs=40")


def test_sample_repeats_the_runs(short_campaign):
    experiment = Setup(short(short_campaign)).experiment
    updates = experiment.motion.updates
    runs = [*range(33), 35]  # more than a tile, with a gap
    found = innovation_statistics(experiment, runs, [slice(0, updates), slice(40, 80)], LAGS)
    outcome = run(experiment, runs)
    np.testing.assert_array_equal(found.estimate, outcome.estimate)
    np.testing.assert_array_equal(found.truth, outcome.truth)
    single = dataclasses.replace(
        experiment,
        estimator=dataclasses.replace(experiment.estimator, passes=1, max_passes=1),
    )
    np.testing.assert_array_equal(found.first_estimate, run(single, runs).estimate)
    _, history = run_with_history(experiment, 35)
    for number in range(2):
        innovation = history.innovation[number, ..., 0]
        covariance = experiment.estimator.gains(number).innovation_covariance
        nis = statistics.nees(innovation, covariance)
        np.testing.assert_allclose(found.nis[number, :, -1], nis, rtol=1e-9)
        unit = np.linalg.solve(np.linalg.cholesky(covariance), innovation[..., None])[..., 0]
        expected = autocorrelation(unit[40:80], LAGS)
        np.testing.assert_allclose(
            found.autocorrelation[number, 1, ..., -1], expected, rtol=1e-7, atol=1e-9
        )


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("truth=paper",), "truth.distribution = normal"),
        (
            ("estimator.states=[gyro_bias,accel_bias]", "estimator.max_passes=null"),
            "does not estimate all",
        ),
    ],
)
def test_campaigns_that_cannot_be_judged_are_refused(tmp_path, overrides, message):
    path = make(tmp_path / "campaign", "campaign.runs=3", *overrides)
    with pytest.raises(DataError, match=message):
        done_of(path)


def test_unfinished_and_stale_campaigns_are_refused(short_campaign, tmp_path):
    path = make(tmp_path / "campaign", "campaign.runs=3")
    done = done_of(path)
    assert done.attrs["failed"] == 0
    config = config_of(done.attrs["configuration"])
    assert config == dataclasses.replace(
        load([*SHORT, "campaign.runs=3", f"campaign.store={path}"]),
    )
    stale = done.assign(estimate=done["estimate"] + 1e-3 * done["predicted_std"])
    with pytest.raises(DataError, match="not what this version makes"):
        repeat_runs(stale, config, Setup(config).experiment)
    set_status(path, 1, 2)
    assert done_of(path).attrs["failed"] == 1
    set_status(path, 2, 2)
    with pytest.raises(DataError, match="two runs"):
        done_of(path)
    set_status(path, 2, 0)
    with pytest.raises(DataError, match="not all runs are made"):
        done_of(path)
