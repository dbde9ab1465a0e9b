"""The one answer: what it says follows from the summary, and from nothing else."""

from pipeline.campaign.judged import as_json, summary_of
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.console.output import json_data
from pipeline.study.findings import Contest
from pipeline.study.headline import headline, runs_needed
from pipeline.study.predicted import predicted


def test_headline_follows_the_joint_share(short_store):
    summary = json_data(as_json(summary_of(load([]), short_store)))
    for lower, upper, words in (
        (0.99, 1.0, "the bounds are met, all"),
        (0.97, 0.98, "the bounds are not met, all"),
        (0.97, 1.0, "whether the bounds are met cannot be judged, all"),
    ):
        ends = {"joint_share_lower": lower, "joint_share_upper": upper}
        assert words in headline(summary | ends)


def test_headline_says_how_many_runs_could_show_it(short_store):
    assert [runs_needed(share) for share in (0.99, 0.9)] == [381, 35]
    summary = json_data(as_json(summary_of(load([]), short_store)))
    few = {"joint_share_lower": 0.95, "joint_share_upper": 1.0}
    assert "So few runs can never show 99 %: 381 are needed" in headline(summary | few)
    many = few | {"runs_done": 381, "runs_failed": 0}
    assert "never show" not in headline(summary | many)
    own = json_data(as_json(summary_of(load(["bounds.joint_share=0.9"]), short_store)))
    assert "where 90 % is asked for" in headline(own)


def test_headline_counts_the_runs_that_failed(short_store):
    summary = json_data(as_json(summary_of(load([]), short_store)))
    text = headline(summary | {"runs_done": 466, "runs_failed": 34})
    assert " of 500 runs, where 99 % is asked for. 34 runs (6.8 %) did not converge and" in text
    assert "NEES and sigma are of the 466 that did." in text
    assert "converge" not in headline(summary)
    assert "of 7 runs contradict" in headline(summary | {"runs_contradicted": 7})


def test_headline_names_schedule_noise_assumptions_honesty_and_the_better_schedule(short_store):
    summary = json_data(as_json(summary_of(load([]), short_store)))
    text = headline(summary)
    assert "(schedule position25, noise reference, truth as the filter believes it)" in text
    assert "The filter's own sigma: " in text
    assert "Schedules" not in text
    disturbed = headline(summary | {"disturbance": "laboratory"})
    assert "truth with the disturbances laboratory" in disturbed
    joint = {
        **{"joint_share_a": 0.94, "joint_share_b": 0.97, "joint_difference": -0.03},
        **{"joint_difference_lower": -0.05, "joint_difference_upper": -0.01, "runs_judged": 500},
    }
    contest = Contest("a", "b", 1.2, 1.0, 1.5, (), (), 0.0, joint)
    assert headline(summary, contest).endswith(
        "Schedules: b keeps all bounds more often than a: 97.0 % against 94.0 % of 500 paired "
        "runs, +3.0 points (+1.0 to +5.0)."
    )


def test_predicted_noise_and_time_are_just_enough():
    reference = predicted(Setup(load([])))
    assert 0.965 < reference.share < 0.975  # 96.8 % of 10 000 runs, in results/summary
    assert reference.worst == "gyro_bias_z"
    factor = reference.noise_factor
    noise = [
        f"noise.{key}={factor * value}"
        for key, value in vars(load([]).noise).items()
        if key != "name"
    ]
    assert abs(predicted(Setup(load(noise))).share - 0.99) < 3e-4
    longer = predicted(
        Setup(load([f"schedule.position_duration_s={round(500 * reference.time_factor)}"]))
    )
    assert 0.99 < longer.share < 0.993  # a rule, on the safe side: turns do not take longer
    nothing = predicted(Setup(load(["bounds.joint_share=0.5", "noise=quiet"])))
    assert nothing.noise_factor > 2.0
