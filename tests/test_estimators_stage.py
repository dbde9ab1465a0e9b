"""Stage `estimators`: every group, and the named filters."""

import json

import pytest
from campaigns import SHORT, run_stage

from inscal.parameters import AUGMENTATIONS
from pipeline import estimators
from pipeline.config.load import disturbances, load, resolved, unknown
from pipeline.study.estimators import LABORATORY, NAMED, NOTHING, OWN, PAPER, plans

FEW = ("disturbance=laboratory", "campaign.runs=12", "campaign.max_failed_share=1")


def test_truth_is_what_each_plan_says():
    planned = plans(load([*SHORT, *FEW]))
    assert [p.filter for p in planned[: len(AUGMENTATIONS)]] == list(AUGMENTATIONS)
    assert {p.filter for p in planned[len(AUGMENTATIONS) : -2]} == set(NAMED)
    assert planned[-1].config.schedule.name == "position25_oblique"
    assert len({p.config.campaign.store for p in planned}) == len(planned)
    for plan in planned:
        full = resolved(plan.config)
        if plan.truth == NOTHING:
            assert disturbances(full) == []
        elif plan.truth == OWN:
            assert disturbances(full) != []
            assert unknown(full) == []
        else:
            assert len(disturbances(full)) == 32
    assert (PAPER, OWN) not in {(p.filter, p.truth) for p in planned}
    assert LABORATORY in {p.truth for p in planned}


def test_the_page_has_every_filter_and_its_price(tmp_path):
    out = tmp_path / "found.json"
    ended = run_stage(estimators, *SHORT, *FEW, f"campaign.store={tmp_path / 'runs'}", f"out={out}")
    assert ended.code == 0, ended.err
    found = json.loads(out.read_text())
    rows = {(row["filter"], row["truth"]): row for row in found["campaigns"]}
    assert len(rows) == len(AUGMENTATIONS) + 8
    cubic = rows["accel_cubic", OWN]
    assert cubic["nees_of_36"] > 10.0 * cubic["expected_nees"]
    assert cubic["expected_nees"] == pytest.approx(27.0)
    assert list(cubic["augmented"]) == ["accel_cubic_x", "accel_cubic_y", "accel_cubic_z"]
    assert rows["robust", LABORATORY]["states"] == 72
    assert rows["robust", OWN]["true_over_formal"] == pytest.approx([1.0, 1.0], abs=1e-6)
    assert list(found["price"]) == ["states43", "robust"]
    page = out.with_suffix(".md").read_text()
    assert "| `gyro_g_sensitivity` | 45 |" in page
    assert "`robust` under all of them" in page


def test_without_disturbances_there_is_nothing_to_stand(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(estimators, *SHORT)
    assert (ended.code, "has no disturbance; choose one that has" in ended.err) == (2, True)
    assert not list(tmp_path.iterdir())
