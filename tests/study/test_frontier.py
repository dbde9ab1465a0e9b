"""Stage `frontier`: predictions of inherited paths, and of designed ones that beat them."""

import dataclasses
import json

import numpy as np
import pytest
from campaigns import run_stage

from inscal.box import share_within
from pipeline import frontier
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.study import frontier as rooms

ABOUT = {
    "seconds": 0.2,
    "inherited": ["position19", "position25"],
    "levels": {
        "quiet": {"times_s": [2000, 2500], "start_from": "designed25_quiet"},
        "reference": {"times_s": [9500], "start_from": "designed25"},
    },
    "marked": ["position19-reference-proof", "designed25-reference"],
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frontier")
    whole = rooms.study()
    summary = {"joint_share": 0.9, "joint_share_lower": 0.88, "joint_share_upper": 0.92}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rooms, "study", lambda: {**whole, "frontier": ABOUT})
        patch.setattr(rooms, "read_summary", lambda name: summary | {"runs_done": 100})
        out = folder / "frontier.json"
        ended = run_stage(frontier, f"out={out}")
    assert ended.code == 0, ended.err
    assert out.with_suffix(".png").stat().st_size > 10_000
    return json.loads(out.read_text()), out.with_suffix(".md").read_text()


def test_inherited_paths_are_predicted_as_by_the_recursion(found):
    about = {(p["noise"], p["path"], p["total_time_s"]): p for p in found[0]["points"]}
    config = load(["noise=quiet", "schedule.position_duration_s=100"])
    setup = Setup(dataclasses.replace(config))
    own = setup.gains.covariance[:27, :27]
    point = about["quiet", "position25", 2500]
    assert point["joint_share"] == pytest.approx(
        share_within(own, setup.bound * setup.unit), abs=1e-6
    )
    worst = np.max(np.sqrt(np.diag(own)) / (setup.bound * setup.unit))
    assert point["worst_sigma_over_bound"] == pytest.approx(worst, rel=1e-6)


def test_designed_paths_beat_them_and_no_path_its_limit(found):
    points = found[0]["points"]
    for noise, time in {(p["noise"], p["total_time_s"]) for p in points}:
        share = {
            p["path"]: p["joint_share"]
            for p in points
            if (p["noise"], p["total_time_s"]) == (noise, time)
        }
        assert set(share) == {"position19", "position25", "designed"}
        assert share["designed"] > max(share["position19"], share["position25"])
    assert all(p["joint_share"] < p["limit"] for p in points)


def test_the_page_has_every_time_and_campaign(found):
    data, page = found
    assert page.count("\n| 2000 |") == 2
    assert "90.0 % (88.0 to 92.0)" in page
    assert [row["path"] for row in data["marked"]] == ["position19", "designed"]
    assert [row["total_time_s"] for row in data["marked"]] == [12502, 12500]
