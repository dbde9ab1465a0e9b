"""The gate's cases: that they leave no default, and what of their settings' defects they see."""

import planted_settings as planted
import pytest

from inscal import regression
from pipeline.config.load import RUN_GROUPS, load, resolved
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError, DataError
from pipeline.gate import cases as gate_cases
from pipeline.gate import judge
from pipeline.gate.cases import REFERENCE, cases

NAMES_OF_CHOICES = {"schedule.name", "noise.name"}  # say nothing of a run


def settings(configuration, prefix=""):
    """Every value of a nested configuration by its dotted key."""
    out = {}
    for key, value in configuration.items():
        if isinstance(value, dict):
            out |= settings(value, f"{prefix}{key}.")
        else:
            out[f"{prefix}{key}"] = value
    return out


def run_values(config):
    full = resolved(config)
    return settings({group: full[group] for group in RUN_GROUPS})


def test_no_setting_is_at_its_default_in_every_case(reference):
    usual = run_values(reference)
    others = [run_values(case.config) for case in cases(reference) if case.name != REFERENCE]
    changed = {key for key in usual if any(other[key] != usual[key] for other in others)}
    assert changed == {*usual}


def test_cases_span_what_is_allowed(reference):
    every = [case for case in cases(reference) if case.name != REFERENCE]
    values = [run_values(case.config) for case in every]
    latitude = [one["site.latitude_deg"] for one in values]
    assert min(latitude) < -89.0
    assert max(latitude) > 89.8
    assert 0.0 in latitude
    intervals = {one["estimator.update_interval_s"] for one in values}
    assert {0.1, 10.0} <= intervals
    assert {one["truth.distribution"] for one in values} == {"fixed", "normal", "uniform"}
    assert {one["sensor.quadratic_unit"] for one in values} == {"pulse", "si"}
    assert {1, 2, 3} <= {one["estimator.passes"] for one in values}
    assert {len(one["estimator.states"]) for one in values} == {4, 5, 6, 24}
    angles = [angle for one in values for angle, *_ in one["schedule.rotations"]]
    assert min(angles) == -360.0
    assert any(angle % 90.0 for angle in angles)


def test_runs_of_a_case_are_of_two_seeds_and_of_numbers_that_wrap(reference):
    for case in cases(reference):
        if case.name == REFERENCE:
            continue
        assert len({draws.seed for draws in case.draws}) == 2
        one = [draws for draws in case.draws if draws.seed == reference.campaign.seed]
        low = {number % 2**8 for draws in one[:1] for number in draws.numbers}
        for bits in (8, 16, 32):
            far = [draws for draws in one if draws.first == 2**bits]
            assert {number % 2**8 for draws in far for number in draws.numbers} == low


def test_overrides_change_the_reference_case_alone(reference):
    other = load(["site.latitude_deg=10", "campaign.seed=5", "estimator=one_pass"])
    before, after = list(cases(reference)), list(cases(other))
    assert before[0].configuration != after[0].configuration
    assert [c.configuration for c in before[1:]] == [c.configuration for c in after[1:]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda case: case.pop("site"), "case some lacks site"),
        (lambda case: case.update(sites={}), "case some has the unknown key sites"),
        (
            lambda case: case["site"].update(latitude_deg=91.0),
            "case some: site.latitude_deg = 91",
        ),
    ],
    ids=["lacks", "unknown", "value"],
)
def test_a_case_that_cannot_be_used_is_named(reference, monkeypatch, change, said):
    content = gate_cases._content()["south"]
    content = {key: dict(v) if isinstance(v, dict) else v for key, v in content.items()}
    change(content)
    monkeypatch.setattr(gate_cases, "_content", lambda: {"some": content})
    with pytest.raises(ConfigError, match=said):
        list(cases(reference))


def found(clean_cases, reference):
    """What the gate finds against the clean campaigns, by case; failed runs and refusals too."""
    out = {}
    for (case, old), new_case in zip(clean_cases, cases(reference), strict=True):
        new = judge.campaign(new_case)
        bound = None
        if case.name == REFERENCE:
            setup = Setup(case.config)
            bound = setup.bound * setup.unit
        share = 1.0 if case.name == REFERENCE else 1.0 / (len(clean_cases) - 1)
        judgement = regression.judge(old, new, bound, share)
        names = [loss.name for loss in judgement.losses]
        names += [check.name for check in judgement.checks if not check.passed]
        names += ["failed"] if judgement.failed else []
        assert (judgement.verdict == "worse") == bool(names)
        if judgement.verdict != "identical":
            out[case.name] = names
    return out


# the case that finds a defect, and what it finds
PLANTED = [
    (planted.earth_rate_of_the_north, "south", "failed"),
    (planted.gravity_at_sea_level, "states30", "accel_scale_factor"),
    (planted.metres_of_longitude_on_the_equator, "pole", "failed"),
    (planted.process_noise_of_one_second, "pole", "mean NEES"),
    (planted.process_noise_of_one_second, "often", "gyro_bias"),
    (planted.transition_of_one_second, "pole", "failed"),
    (planted.gyro_bias_sigma_doubled, "reference", "RMSE over claimed sigma of gyro_bias_x"),
    (planted.gyro_bias_sigma_doubled, "south", "claimed sigma of gyro_bias_z over the baseline's"),
    (planted.lever_arm_sigma_small, "reference", "RMSE over claimed sigma of lever_arm_x, times"),
    (
        planted.correlations_lost,
        "few_positions",
        "log of generalised variance over the claimed one",
    ),
    (planted.observations_trusted_too_little, "reference", "claimed sigma of lever_arm_x"),
    (planted.attitude_prior_in_reverse, "few_positions", "gyro_k11"),
    (planted.prior_forgotten_in_later_passes, "few_positions", "gyro_bias"),
    (planted.negative_turns_positive, "south", "claimed sigma of"),
    (planted.negative_turns_positive_in_filter, "south", "failed"),
    (planted.half_turns_rounded, "pole", "claimed sigma of gyro_bias_y over the baseline's"),
    (planted.turns_at_twenty_degrees_a_second, "often", "lever_arm"),
    (planted.ramps_taken_for_steady_turns, "south", "gyro_k"),
    (planted.posture_north_east_down, "states33_quadratic", "accel_k"),
    (planted.seed_ignored, "south", "likeness of two runs"),
    (planted.runs_wrap_at_256, "south", "likeness of two runs"),
    (planted.runs_wrap_at_32_bits, "south", "likeness of two runs"),
    (planted.noise_of_the_sensors_wraps_at_256, "south", "likeness of two runs"),
    (planted.uniform_truth_positive, "few_positions", "mean error"),
    (planted.uniform_truth_a_quarter_wider, "few_positions", "mean NEES"),
    (planted.fixed_truth_a_percent_off, "often", "accel_k"),
]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(
    ("defect", "case", "what"), PLANTED, ids=lambda value: getattr(value, "__name__", None)
)
def test_a_defect_of_a_setting_is_worse(clean_cases, reference, monkeypatch, defect, case, what):
    defect(monkeypatch)
    assert any(name.startswith(what) for name in found(clean_cases, reference)[case])


def test_a_filter_of_other_states_is_refused(reference, monkeypatch):
    planted.first_columns_whatever_the_states(monkeypatch)
    with pytest.raises(DataError, match="states33_lever_arm: the baseline is of other states"):
        list(judge.judgements(reference))


# What costs nothing is a change and no more: a table at rest does not tell these terms.
HARMLESS = [
    planted.earth_rate_of_the_north_in_filter,
    planted.meridians_parallel_in_filter,
]


@pytest.mark.parametrize("defect", HARMLESS, ids=lambda defect: defect.__name__)
def test_a_defect_that_costs_nothing_is_a_change(clean_cases, reference, monkeypatch, defect):
    defect(monkeypatch)
    changed = found(clean_cases, reference)
    assert changed
    assert not any(changed.values())
