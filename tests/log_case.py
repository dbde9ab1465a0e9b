"""A log of some minutes, as it is exported, and its calibration: made once for all tests."""

import pytest
from campaigns import run_stage

from pipeline import export
from pipeline.config.load import load
from pipeline.logs.calibration import calibrated, read_log

RATE = 20.0
PATH = (
    "schedule=position19",
    "schedule.position_duration_s=40",
    "schedule.turn_acceleration_deg_per_s2=20",
    "noise=quiet",
    f"rate_hz={RATE:g}",
)
RUN = 3


def calibrate_it(*overrides, path=PATH):
    config = load([*path, *overrides])
    return calibrated(read_log(config), config)


@pytest.fixture(scope="session")
def log(tmp_path_factory):
    """Header of an exported run of some minutes."""
    path = tmp_path_factory.mktemp("log") / "run.parquet"
    ended = run_stage(export, *PATH, f"only_run={RUN}", f"log={path}")
    assert ended.code == 0, ended.err
    return path.with_suffix(".yaml")


@pytest.fixture(scope="session")
def found(log):
    """The log calibrated, with the prior its unit is drawn from."""
    return calibrate_it(f"log={log}", "calibration.prior_factor=1")
