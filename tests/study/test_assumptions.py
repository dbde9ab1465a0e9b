"""What the results assume, and the disturbances that take it away."""

from collections import Counter

from pipeline.config.disturbance import IDLE, KEYS
from pipeline.console.output import json_text, signed
from pipeline.page.study import assumptions_section
from pipeline.study import assumptions
from pipeline.study.names import ASSUMPTIONS

SHARE = {"joint_share": 0.6, "joint_share_lower": 0.5, "joint_share_upper": 0.7}


def row(name, nees, size=None, runs=500):
    about = {"worst": "accel_k33", "worst_rmse_over_formal": 2.0, "nees": nees} | SHARE
    return {"name": name, "size": size, "runs_done": runs} | (about if runs else {})


FOUND = {
    "disturbance": "mine",
    "runs": 500,
    "campaigns": [
        row("none", 27.0),
        row("gravity_mgal", 31.5, 0.1),
        row("latitude_arcsec", 28.0, 1.0),
        row("vibration_ug", None, 1e9, runs=0),
        row("all", 1500.0),
    ],
}


def test_every_disturbance_takes_one_assumption_away():
    counts = Counter(key for keys in ASSUMPTIONS.values() for key in keys)
    assert set(counts) == set(KEYS) - set(IDLE)
    assert set(counts.values()) == {1}


def test_of_each_assumption_the_worst_disturbance_is_shown():
    first, site, building, last = assumptions.rows(FOUND)
    assert first[:3] == ("all of these", "", "27")
    assert site[:3] == ("the site is known", "`gravity_mgal` 0.1 (of 2)", "31.5")
    assert site[3:] == ("2.00 (`accel_k33`)", "60.0 % (50.0 to 70.0)")
    assert building[1:3] == ("`vibration_ug` 1e+09 (of 1)", "every run fails")
    assert last[:3] == ("none of these", "all 3", "1500")


def test_it_is_read_where_it_was_written_and_left_out_where_not(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert assumptions.read() is None
    assert "pipeline.disturbances" in assumptions_section(None).left_out
    assumptions.PATH.parent.mkdir()
    assumptions.PATH.write_text(json_text(signed(FOUND)))
    (table,) = assumptions_section(assumptions.read()).tables
    assert len(table.rows) == 4
    assert "500 runs each" in table.caption
