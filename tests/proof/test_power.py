"""How often goals are missed, measured on campaigns few and small."""

import json

import numpy as np
import pytest

from inscal import chance
from inscal.parameters import COUNT
from pipeline.proof import looks, power
from pipeline.proof.looks import Innovations
from pipeline.proof.power import Campaign

RUNS = 200
FOUND = Innovations(0.0, 5e4, 0, 20_000)


@pytest.fixture(scope="module")
def campaign():
    correlation = np.full((COUNT, COUNT), 0.3) + 0.7 * np.eye(COUNT)
    return Campaign(correlation, RUNS, FOUND)


def share_missed(campaign, too_small, places=slice(None), count=300):
    lacking = np.zeros(COUNT)
    lacking[places] = too_small
    return campaign.missed(lacking, count, np.random.default_rng(4)).mean()


def test_a_perfect_filter_hardly_ever_misses_a_goal(campaign):
    # more than 9 of 300 would be one in 1 500 at a rate of 1 %
    assert share_missed(campaign, 0.0) <= 9 / 300


def test_sigmas_too_small_are_found_as_often_as_the_looks_promise(campaign):
    all_seen = chance.smallest_seen(RUNS * COUNT, looks.level("nees"), 0.9)
    assert share_missed(campaign, all_seen) >= 0.85  # by the NEES alone in 0.9
    one_seen = chance.smallest_seen(RUNS, looks.level("rmse_over_bound"), 0.9)
    assert share_missed(campaign, one_seen, 3) >= 0.85
    assert share_missed(campaign, 0.3 * one_seen, 3) < 0.5


def test_what_was_measured_holds_of_such_a_campaign_alone(campaign, tmp_path, monkeypatch):
    kinds = {name: kind._replace(campaigns=4) for name, kind in power.KINDS.items()}
    monkeypatch.setattr(power, "KINDS", kinds)
    path = tmp_path / "power.json"
    assert power.measured(campaign, path) == {}
    path.write_text(json.dumps(power.measure(campaign, 1)))
    found = power.measured(campaign, path)
    assert set(power.KINDS) < set(found)
    assert found[power.PERFECT]["campaigns"] == 4
    assert power.measured(campaign._replace(runs=RUNS + 1), path) == {}
    assert power.measure(campaign, 1) == power.measure(campaign, 1)
