"""Configuration group `disturbance`: its keys, what they are in SI, and what is refused."""

import math
from dataclasses import replace

import pytest

from inscal.disturbance import NOTHING
from pipeline.config.disturbance import KEYS, sizes_of
from pipeline.config.load import disturbances, load, resolved
from pipeline.config.rules import check
from pipeline.console.errors import ConfigError

ARCSEC = math.pi / 180 / 3600
G = 9.80665
SI = {
    "gyro_wander_deg_per_h": ("gyro_wander", ARCSEC),
    "gyro_wander_time_s": ("gyro_wander_time", 1),
    "accel_wander_ug": ("accel_wander", 1e-6 * G),
    "accel_wander_time_s": ("accel_wander_time", 1),
    "gyro_flicker_deg_per_h": ("gyro_flicker", ARCSEC),
    "accel_flicker_ug": ("accel_flicker", 1e-6 * G),
    "gyro_rate_random_walk_deg_per_h_per_sqrt_h": ("gyro_rate_random_walk", ARCSEC / 60),
    "accel_random_walk_ug_per_sqrt_h": ("accel_random_walk", 1e-6 * G / 60),
    "gyro_drift_deg_per_h": ("gyro_drift", ARCSEC),
    "accel_drift_ug": ("accel_drift", 1e-6 * G),
    "gyro_scale_drift_ppm": ("gyro_scale_drift", 1e-6),
    "accel_scale_drift_ppm": ("accel_scale_drift", 1e-6),
    "drift_time_s": ("drift_time", 1),
    "off_axis_lever_arm_mm": ("off_axis_lever_arm", 1e-3),
    "table_offset_mm": ("table_offset", 1e-3),
    "gyro_accel_delay_ms": ("gyro_accel_delay", 1e-3),
    "observation_delay_ms": ("observation_delay", 1e-3),
    "accel_asymmetry_ppm": ("accel_asymmetry", 1e-6),
    "accel_cubic_ug_per_g3": ("accel_cubic", 1e-6 / G**2),
    "accel_cross_coupling_ug_per_g2": ("accel_cross_coupling", 1e-6 / G),
    "accel_pendulous_ug_per_g2": ("accel_pendulous", 1e-6 / G),
    "gyro_asymmetry_ppm": ("gyro_asymmetry", 1e-6),
    "gyro_g_sensitivity_deg_per_h_per_g": ("gyro_g_sensitivity", ARCSEC / G),
    "gyro_quantisation_arcsec": ("gyro_quantisation", ARCSEC),
    "accel_quantisation_m_per_s": ("accel_quantisation", 1),
    "gravity_mgal": ("gravity", 1e-5),
    "latitude_arcsec": ("latitude", ARCSEC),
    "deflection_arcsec": ("deflection", ARCSEC),
    "turn_angle_arcsec": ("turn_angle", ARCSEC),
    "turn_rate_percent": ("turn_rate", 1e-2),
    "table_axis_arcsec": ("table_axis", ARCSEC),
    "base_tilt_arcsec": ("base_tilt", ARCSEC),
    "vibration_ug": ("vibration", 1e-6 * G),
    "vibration_hz": ("vibration_frequency", 1),
    "observation_correlation_time_s": ("observation_correlation_time", 1),
    "observation_bias_m_per_s": ("observation_bias", 1),
    "gyro_noise_factor": ("gyro_noise_factor", 1),
    "accel_noise_factor": ("accel_noise_factor", 1),
    "velocity_noise_factor": ("velocity_noise_factor", 1),
    "position_noise_factor": ("position_noise_factor", 1),
}
"""Every key of the group, the size of the library that it is, and its unit in SI."""
ALONE = {"gyro_wander_time_s", "accel_wander_time_s", "vibration_hz", "drift_time_s"}


def test_keys_are_these():
    assert set(KEYS) == set(SI)


def with_(config, key, value):
    return replace(config, disturbance=replace(config.disturbance, **{key: value}))


@pytest.mark.parametrize("key", SI)
def test_a_key_is_one_size_in_si(reference, key):
    made = sizes_of(with_(reference, key, 7.0).disturbance)
    usual = sizes_of(reference.disturbance)
    field, unit = SI[key]
    assert getattr(made, field) == pytest.approx(7.0 * unit, rel=1e-12)
    changed = {name for name in vars(made) if getattr(made, name) != getattr(usual, name)}
    assert changed == {field}


def test_none_is_nothing(reference):
    sizes, needless = vars(sizes_of(reference.disturbance)), {SI[key][0] for key in ALONE}
    assert {key: value for key, value in sizes.items() if key not in needless} == {
        key: value for key, value in vars(NOTHING).items() if key not in needless
    }
    assert disturbances(resolved(reference)) == []


@pytest.mark.parametrize("key", SI)
def test_what_disturbs_is_named_and_what_does_nothing_alone_is_not(reference, key):
    named = disturbances(resolved(with_(reference, key, 7.0)))
    assert named == ([] if key in ALONE else [key])


def test_laboratory_is_a_disturbance():
    config = load(["disturbance=laboratory"])
    assert config.disturbance.name == "laboratory"
    assert len(disturbances(resolved(config))) > 30


@pytest.mark.parametrize("key", SI)
def test_every_size_is_a_finite_number_from_0(reference, key):
    for value in (-1.0, math.inf, math.nan):
        with pytest.raises(ConfigError) as caught:
            check(with_(reference, key, value))
        assert str(caught.value) == f"disturbance.{key} = {value}: must be a finite number >= 0"


@pytest.mark.parametrize(
    ("needed", "size"),
    [
        ("gyro_wander_time_s", "gyro_wander_deg_per_h"),
        ("accel_wander_time_s", "accel_wander_ug"),
        ("vibration_hz", "vibration_ug"),
    ],
)
def test_a_size_that_needs_a_time_is_refused_without_it(needed, size):
    load([f"disturbance.{needed}=0"])
    with pytest.raises(ConfigError) as caught:
        load([f"disturbance.{needed}=0", f"disturbance.{size}=2"])
    assert str(caught.value) == (
        f"disturbance.{needed} = 0.0: must be above zero where disturbance.{size} is, which is 2"
    )


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("disturbance.gravity_mgal=-1", "gravity_mgal = -1.0: must be a finite number >= 0"),
        ("disturbance=factory", "disturbance = factory: must be one of laboratory, none"),
        (
            "disturbance.accel_wander=1",
            "accel_wander: unknown key; must be one of name",
        ),
        ("disturbance.accel_wander_ug=a", "disturbance.accel_wander_ug = a: must be a number"),
        (
            "disturbance.accel_wander_ug=null",
            "accel_wander_ug = null: must not be null",
        ),
        ("disturbance.name=a/b", "disturbance.name = 'a/b': must be letters"),
    ],
)
def test_refusals_name_key_value_and_what_is_allowed(override, said):
    with pytest.raises(ConfigError) as caught:
        load([override])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
