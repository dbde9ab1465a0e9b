"""Stage `design`: the schedule that it writes keeps what it promises."""

import dataclasses
import json

import numpy as np
import pytest
import yaml
from campaigns import run_stage

from inscal.box import share_within
from pipeline import design
from pipeline.config.load import load
from pipeline.config.schema import Schedule
from pipeline.config.setup import Setup
from pipeline.study.budget import sheet
from pipeline.study.design import Search

FEW = (
    *("design.positions=7", "design.total_time_s=420", "design.longest_position_s=200"),
    *("design.shortest_dwell_s=10", "design.seconds=0.4", "design.chains=2", "noise=quiet"),
)


def run(folder, *overrides):
    out = folder / "found.json"
    ended = run_stage(design, *FEW, f"design.folder={folder}", f"out={out}", *overrides)
    assert ended.code == 0, ended.err
    return json.loads(out.read_text()), yaml.safe_load((folder / "designed.yaml").read_text())


def share_of(schedule, *overrides):
    """Predicted share of a schedule file, by the recursion."""
    setup = Setup(dataclasses.replace(load(["noise=quiet", *overrides]), schedule=schedule))
    setup.schedule  # noqa: B018
    covariance, n = setup.gains.covariance, 27
    return setup, share_within(covariance[:n, :n], setup.bound * setup.unit)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("estimator=robust", "design.angles_deg=[90,45]"),
        ("schedule.turn_acceleration_deg_per_s2=10", "design.last_posture=[North,East,Down]"),
    ],
)
def test_a_schedule_keeps_what_its_search_promises(tmp_path, overrides):
    found, file = run(tmp_path, *overrides)
    schedule = Schedule(**file)
    own = [o for o in overrides if o.startswith("estimator")]
    setup, share = share_of(schedule, *own)
    assert found["joint_share"] == pytest.approx(share, abs=1e-6)
    sigma = setup.gains.parameter_std[-1] / setup.unit / setup.bound
    np.testing.assert_allclose(found["sigma_over_bound"], sigma, rtol=1e-5)
    assert setup.schedule.duration == found["total_time_s"] == 420
    assert setup.schedule.positions == 7
    assert bool(found["left_out"]) == bool(own)
    page = (tmp_path / "found.md").read_text()
    assert f"{100 * found['joint_share']:.2f} % of runs" in page
    assert ("had no states for" in page) == bool(own)


def test_what_a_filter_does_not_know_moves_it_as_the_budget_says():
    """Consider covariance from joint blocks, and sensitivities of the recursion of the filter."""
    config = load(["disturbance.accel_cubic_ug_per_g3=1", "disturbance.off_axis_lever_arm_mm=2"])
    search = Search(config)
    moves, durations = search.known("position25")
    rests = durations - np.append(search.tables.updates[moves], 0)
    claimed = search.scene.covariance(moves, rests)
    true = search.disturbed.covariance(moves, rests)
    made, unit = sheet(search.setup), search.setup.prior.parameter / search.setup.unit
    np.testing.assert_allclose(np.sqrt(np.diag(claimed)) * unit, made.formal_std, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diag(true)) * unit, made.true_std, rtol=1e-5)
    assert search.judge(moves, durations).disturbed < search.judge(moves, durations).share


def test_a_search_for_a_disturbed_truth_stands_it_better(tmp_path):
    truth = ("disturbance.accel_cubic_ug_per_g3=300", "design.angles_deg=[90,-90,45]")
    found, file = run(tmp_path, *truth)
    plain, other = run(tmp_path, truth[1])
    assert (found["considered"], plain["considered"]) == (["accel_cubic"], [])
    assert plain["joint_share_disturbed"] is None
    ratio = [
        np.max(made.true_std / made.bound)
        for schedule in (file, other)
        for made in [
            sheet(
                Setup(
                    dataclasses.replace(
                        load(["noise=quiet", truth[0]]), schedule=Schedule(**schedule)
                    )
                )
            )
        ]
    ]
    assert ratio[0] < ratio[1]


def test_a_search_repeats_whatever_the_workers_and_goes_on_from_a_schedule(tmp_path, monkeypatch):
    found, file = run(tmp_path)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    again, same = run(tmp_path)
    assert (again, same) == (found, file)
    other, _ = run(tmp_path, "design.seed=5")
    assert other["rotations"] != found["rotations"]
    long = ("design.positions=25", "design.total_time_s=2000", "design.seconds=0.02")
    begun, _ = run(tmp_path, *long, "design.start_from=designed25_quiet")
    assert begun["joint_share"] > run(tmp_path, *long)[0]["joint_share"] + 0.05


def test_the_shortest_path_is_shorter_and_reaches_what_is_asked_for(tmp_path):
    asked = ("design.objective=shortest", "design.joint_share=0.2", "design.total_time_s=1200")
    found, file = run(tmp_path, *asked, "design.seconds=2")
    assert found["total_time_s"] < 1200
    assert share_of(Schedule(**file))[1] >= 0.2


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("design.total_time_s=100", "design.total_time_s = 100: must be at least"),
        ("design.longest_position_s=50", "design.longest_position_s = 50: 7 positions"),
        ("design.time_step_s=0.3", "design.time_step_s = 0.3: must be a multiple"),
        ("design.cable_limit_deg=0", "design.cable_limit_deg = 0"),
        ("design.cable_limit_deg=30", "design: no path of these turns"),
        ("design.axes=[]", "design.axes = []"),
        ("design.start_from=position25", "must have design.positions, which is 7"),
        ("design.last_posture=[Up,North,West] design.axes=[Z]", "no turns of design.angles_deg"),
        ("design.objective=shortest design.joint_share=0.99", "no path of 420 s can exceed"),
        ("design.objective=shortest design.joint_share=0.7", "more design.seconds may"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(tmp_path, override, said):
    ended = run_stage(design, *FEW, *override.split(), f"design.folder={tmp_path}")
    assert ended.code == 2
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) <= 2
    assert not list(tmp_path.iterdir())
