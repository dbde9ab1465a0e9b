"""Configuration: what loads, from which options, and that the paper's numbers are in it."""

import json
from dataclasses import fields

import numpy as np
import pytest
from hydra.core.global_hydra import GlobalHydra

from inscal import parameters
from pipeline.config.load import load, resolved
from pipeline.config.schema import KIND_KEYS, KindValues
from pipeline.console.conf import SHIPPED as CONF
from pipeline.console.errors import ConfigError

GROUPS = sorted(path.name for path in CONF.iterdir() if path.is_dir())
OPTIONS = [
    f"{group}={path.stem}" for group in GROUPS for path in sorted((CONF / group).glob("*.yaml"))
]

# Postures of the paper's Table 1: where x, y, z point at each position, as initials.
_TABLE_1 = (
    "NED UEN DES UEN EDN WUN EDN ENU ESD ENU EUS ESD EDN DWN WUN UEN SEU DES "
    "NED SWD SEU NED SEU SWD NED"
)
POSTURES = _TABLE_1.split()
OPPOSITE = dict(zip("NSEWDU", "SNWEUD", strict=True))

WHITE_NOISE = "noise.accel_white_noise_ug_per_sqrt_hz"
GYRO_BIAS = "truth.gyro_bias_deg_per_h"
ROTATIONS = "schedule.rotations"
POSTURE = "schedule.initial_posture"


def test_defaults():
    config = load()
    assert config.truth.distribution == "normal"
    assert config.noise.name == "reference"
    assert config.schedule.name == "position25"
    assert config.estimator.passes == 2
    assert config.estimator.states == list(parameters.GROUPS)
    assert config.cluster.kind == "threads"
    assert config.campaign.store == "results/runs/position25-reference"
    assert [config.only_run, config.out, config.a, config.b, config.accept] == [None] * 5


@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_composes(option):
    group, _, choice = option.partition("=")
    config = resolved(load([option]))
    assert isinstance(config[group], dict)
    # Options that carry their own name carry the right one.
    assert config[group].get("name", choice) == choice
    if group == "cluster":
        assert config[group]["kind"] == choice


def test_noise_options():
    numbers = {
        name: list(resolved(load([f"noise={name}"]))["noise"].values())[1:]
        for name in ("reference", "quiet", "noisy")
    }
    assert numbers == {
        "reference": [0.0005, 5.0, 0.001, 0.1],
        "quiet": [0.0002, 2.0, 0.001, 0.05],
        "noisy": [0.001, 50.0, 0.1, 10.0],
    }


def test_store_follows_schedule_and_noise():
    config = load(["schedule=position19", "noise=quiet"])
    assert config.campaign.store == "results/runs/position19-quiet"


def test_one_pass_inherits_the_rest():
    two, one = (resolved(load([f"estimator={name}"])) for name in ("two_pass", "one_pass"))
    assert one["estimator"].pop("passes") == 1
    assert two["estimator"].pop("passes") == 2
    assert one["estimator"].pop("max_passes") is None
    assert two["estimator"].pop("max_passes") > 2
    assert one == two


PAPER_TRUTH = {
    "gyro_bias": 0.05,
    "accel_bias": 200.0,
    "gyro_scale_factor": 500.0,
    "gyro_installation": 206.26,
    "accel_scale_factor": 500.0,
    "accel_installation": 206.26,
    "accel_quadratic": 30.0,
    "lever_arm": (10.0, 20.0, 30.0),
}
PAPER_BOUNDS = {
    "gyro_bias": 0.001,
    "accel_bias": 9.0,
    "gyro_scale_factor": 3.0,
    "gyro_installation": 1.0,
    "accel_scale_factor": 2.0,
    "accel_installation": 3.0,
    "accel_quadratic": 0.4,
    "lever_arm": 3.0,
}
"""The paper's Table 3, in its units."""


@pytest.mark.parametrize(
    ("option", "distribution"),
    [("paper", "fixed"), ("dispersed", "normal"), ("uniform", "uniform")],
)
def test_truth_has_the_papers_numbers(option, distribution):
    truth = load([f"truth={option}"]).truth
    assert truth.distribution == distribution
    np.testing.assert_array_equal(
        parameters.vector(truth.by_kind()), parameters.vector(PAPER_TRUTH)
    )


def test_bounds_are_the_papers():
    bounds = parameters.vector(load().bounds.by_kind())
    np.testing.assert_array_equal(bounds, parameters.vector(PAPER_BOUNDS))


def test_initial_std_is_the_papers_truth_but_for_the_lever_arm():
    expected = parameters.vector(PAPER_TRUTH)
    expected[parameters.INDEX["lever_arm"]] = 50.0
    std = parameters.vector(load().estimator.initial_std.by_kind())
    np.testing.assert_array_equal(std, expected)


def test_keys_of_kinds_are_the_fields_of_the_schema():
    assert list(KIND_KEYS) == list(parameters.KINDS)
    assert list(KIND_KEYS.values()) == [field.name for field in fields(KindValues)]


def turned(posture, angle, axis):
    """Posture after a right-handed quarter-turn sequence about a body axis."""
    x, y, z = posture
    for _ in range(round(angle / 90)):
        if axis == "X":
            y, z = z, OPPOSITE[y]
        elif axis == "Y":
            z, x = x, OPPOSITE[z]
        else:
            x, y = y, OPPOSITE[x]
    return x + y + z


def test_position25_visits_the_postures_of_table_1():
    schedule = load().schedule
    postures = ["".join(name[0] for name in schedule.initial_posture)]
    for angle, axis in schedule.rotations:
        postures.append(turned(postures[-1], angle, axis))
    assert len(schedule.rotations) == 24
    assert postures == POSTURES


def test_position19_is_the_head_of_position25():
    long, short = (load([f"schedule={name}"]).schedule for name in ("position25", "position19"))
    assert len(short.rotations) == 18
    assert short.rotations == long.rotations[:18]
    assert short.initial_posture == long.initial_posture


def test_lists_may_change_their_length():
    config = load([f"{GYRO_BIAS}=[0.1,0.2,0.3]", "truth.lever_arm_mm=5", f"{ROTATIONS}=[[-90,Y]]"])
    assert config.truth.gyro_bias_deg_per_h == [0.1, 0.2, 0.3]
    assert config.truth.lever_arm_mm == 5.0
    assert config.schedule.rotations == [[-90.0, "Y"]]


def test_fixed_truth_may_be_negative():
    truth = load(["truth=paper", f"{GYRO_BIAS}=-0.05"]).truth
    assert truth.gyro_bias_deg_per_h == -0.05


def test_noise_free_sensors_are_allowed():
    noise = load([f"{WHITE_NOISE}=0", "noise.gyro_angle_random_walk_deg_per_sqrt_h=0"]).noise
    assert noise.accel_white_noise_ug_per_sqrt_hz == 0.0
    assert noise.gyro_angle_random_walk_deg_per_sqrt_h == 0.0


def test_decimal_seconds_divide_a_position():
    assert not (20.7 / 0.1).is_integer()  # in binary; in decimals it is 207
    load(["schedule.position_duration_s=20.7", "estimator.update_interval_s=0.1"])


def test_posture_may_be_any_right_handed_one():
    assert load([f"{POSTURE}=[Up,East,North]"]).schedule.initial_posture == ["Up", "East", "North"]


def test_resolved_is_plain_and_does_not_tell_10_from_10_point_0():
    integers = resolved(load(["truth.lever_arm_mm=[10,20,30]", f"{ROTATIONS}=[[90,X]]"]))
    decimals = resolved(load(["truth.lever_arm_mm=[10.0,20.0,30.0]", f"{ROTATIONS}=[[90.0,X]]"]))
    assert json.dumps(integers) == json.dumps(decimals)
    assert json.loads(json.dumps(integers)) == integers


def test_load_leaves_no_hydra_behind():
    load()
    with pytest.raises(ConfigError):
        load(["noise=loud"])
    assert not GlobalHydra.instance().is_initialized()
