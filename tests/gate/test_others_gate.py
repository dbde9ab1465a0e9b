"""The gate for another program's estimates: its verdicts, and how small a loss it finds."""

import numpy as np
import pandas as pd
import pytest
from campaigns import make, run_stage

from inscal.parameters import NAMES
from pipeline import regress
from pipeline.campaign import store
from pipeline.campaign.driver import simulate_campaign
from pipeline.config.load import load

PATH = ("schedule=position19", "schedule.position_duration_s=60", "campaign.runs=128")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gate")
    simulate_campaign(load([*PATH, f"campaign.store={folder / 'own'}"]))
    return folder


@pytest.fixture(scope="module")
def own(place):
    return store.read(place / "own")


def table_of(own, rng=None, **sigmas):
    """Our estimates, some of them worse by so many sigmas of their own."""
    estimate = own["estimate"].transpose("run", "parameter").to_numpy().copy()
    for name, size in sigmas.items():
        sigma = float(own["predicted_std"].sel(parameter=name))
        estimate[:, NAMES.index(name)] += size * sigma * rng.standard_normal(len(estimate))
    table = pd.DataFrame(estimate, columns=list(NAMES))
    table.insert(0, "run", own["run"].to_numpy())
    return table


def gate(place, table, *overrides):
    path = place / "table.csv"
    table.to_csv(path, index=False, float_format="%.17g")
    return run_stage(
        regress, f"estimates={path}", f"baseline={place / 'base'}",
        f"campaign.store={place / 'own'}", *PATH[:2], *overrides,
    )  # fmt: skip


@pytest.fixture(scope="module")
def baseline(place, own):
    ended = gate(place, table_of(own), "accept='the first'")
    assert ended.code == 0, ended.err
    return place


def test_the_same_is_identical(baseline, own):
    ended = gate(baseline, table_of(own))
    assert ended.code == 0
    assert ended.out.startswith("identical: 128 runs against the baseline: the first")


def test_rounding_is_no_loss(baseline, own):
    table = table_of(own)
    table[list(NAMES)] = table[list(NAMES)].round(5)
    ended = gate(baseline, table)
    assert ended.code == 0
    assert "changed, no worse" in ended.out


def test_seven_percent_of_rmse_are_found_and_named(baseline, own):
    rng = np.random.default_rng(3)
    ended = gate(baseline, table_of(own, rng, accel_k22=0.4))
    assert ended.code == 1
    assert "worse: 128 runs" in ended.out
    assert "accel_k22: RMSE 1.0" in ended.out


def test_of_estimates_that_are_not_optimal_only_large_losses_are_found(place, own, tmp_path):
    rng = np.random.default_rng(4)
    every = dict.fromkeys(NAMES, 1.0)
    rough = table_of(own, rng, **every)
    base = f"baseline={tmp_path}"
    assert gate(place, rough, base, "accept='rough'").code == 0
    assert "those of no optimal filter" in gate(place, rough, base).out
    again = table_of(own, rng, **every)
    assert gate(place, again, base).code == 0
    assert gate(place, table_of(own, rng, **every | {"accel_k22": 6.0}), base).code == 1


def test_runs_without_estimates_are_worse_and_no_baseline(baseline, own, tmp_path):
    table = table_of(own)
    table.loc[3, "gyro_k11"] = np.nan
    ended = gate(baseline, table)
    assert ended.code == 1
    assert "1 runs diverged" in ended.out
    ended = gate(baseline, table, f"baseline={tmp_path}", "accept='x'")
    assert ended.code == 2
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_compared_is_refused_in_one_line(baseline, own, tmp_path):
    table = table_of(own)
    for change, overrides, said in (
        (table.drop(columns="gyro_k11"), (), "gyro_k11: in it or in its baseline alone"),
        (table, ("noise=quiet",), "noise.accel_white_noise"),
        (table, (f"baseline={tmp_path / 'none'}",), "no baseline"),
        (table, ("baseline=null",), "baseline = null"),
    ):
        ended = gate(baseline, change, *overrides)
        assert ended.code == 2
        assert said in ended.err
        assert len(ended.err.strip().splitlines()) == 1


def test_few_runs_are_too_few(tmp_path):
    path = tmp_path / "few"
    make(path)
    few = store.read(path)
    table_of(few).to_csv(tmp_path / "t.csv", index=False)
    ended = run_stage(
        regress, f"estimates={tmp_path / 't.csv'}", f"baseline={tmp_path / 'b'}",
        f"campaign.store={path}", "schedule.position_duration_s=40",
        "schedule.rotations=[[90,Y],[180,Y],[90,X]]", "accept='x'",
    )  # fmt: skip
    assert ended.code == 2
    assert "the gate needs 54" in ended.err
