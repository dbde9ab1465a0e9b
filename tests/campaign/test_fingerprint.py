"""What changes a store's fingerprint, and what does not."""

import shutil
from pathlib import Path

import pytest
from campaigns import SHORT

from inscal import kernel
from pipeline.campaign import store
from pipeline.config.disturbance import BELIEVED, KEYS
from pipeline.config.load import load, resolved
from pipeline.config.schema import KIND_KEYS

CHANGES = [
    *(f"truth.{key}=7" for key in KIND_KEYS.values()),
    *(f"estimator.initial_std.{key}=7" for key in KIND_KEYS.values()),
    "truth=uniform",
    "noise.gyro_angle_random_walk_deg_per_sqrt_h=0.1",
    "noise.accel_white_noise_ug_per_sqrt_hz=0.1",
    "noise.velocity_observation_m_per_s=0.1",
    "noise.position_observation_m=0.2",
    "schedule.position_duration_s=41",
    "schedule.turn_rate_deg_per_s=9",
    "schedule.turn_acceleration_deg_per_s2=90",
    "schedule.initial_posture=[East,South,Down]",
    "schedule.rotations=[[90,Y],[180,Y],[-90,X]]",
    "site.latitude_deg=40",
    "site.height_m=51",
    "simulation.dwell_step_s=0.5",
    "simulation.turn_step_s=0.05",
    "estimator.passes=3",
    "estimator.max_passes=19",
    "estimator.convergence_sigma=0.02",
    "estimator.innovation_limit=99",
    "estimator.update_interval_s=2",
    "estimator.states=[gyro_bias]",
    "estimator.initial_std.attitude_deg=[0.1,0.1,0.6]",
    "estimator.initial_std.velocity_m_per_s=0.02",
    "estimator.initial_std.position_m=2",
    "sensor.quadratic_unit=si",
    "sensor.accel_pulses_per_m_per_s=1000",
    "campaign.runs=31",
    "campaign.seed=1",
    *(f"disturbance.{key}=0.7" for key in KEYS),
    *(f"estimator.believed.{key}=0.7" for key in BELIEVED),
    "schedule.last_position_duration_s=33",
    "schedule.rotations=[[90,Y,50],[180,Y],[90,X]]",
    "schedule.rotations=[[90,Y,40,11],[180,Y],[90,X]]",
]
SAME = [
    ["cluster=processes"],
    ["cluster=slurm"],
    ["cluster.workers=1"],
    ["campaign.batch=7"],
    ["campaign.store=elsewhere"],
    ["campaign.replace=true"],
    ["campaign.precision=0.1"],
    ["campaign.max_failed_share=0.5"],
    ["bounds.lever_arm_mm=1"],
    ["only_run=3"],
    ["campaigns=[x,y]"],
    ["out=file"],
    ["a=x", "b=y"],
    ["accept=reason"],
    ["site.height_m=50"],  # as it is, though written without its decimals
]


def test_fingerprint_changes_with_every_number_that_matters():
    prints = [store.fingerprint(load([*SHORT, change])) for change in CHANGES]
    prints.append(store.fingerprint(load(SHORT)))
    assert len(set(prints)) == len(CHANGES) + 1


@pytest.mark.parametrize("overrides", SAME, ids=str)
def test_fingerprint_stays_where_no_number_changes(overrides):
    assert store.fingerprint(load([*SHORT, *overrides])) == store.fingerprint(load(SHORT))


def test_every_setting_is_known_to_matter_or_not():
    # A key new to the configuration is to be put on one of the two lists above.
    settings = resolved(load([]))
    changed = {change.partition("=")[0] for change in CHANGES} | {
        *("truth.distribution", "noise.name", "schedule.name", "disturbance.name")
    }
    groups = {key: value for key, value in settings.items() if isinstance(value, dict)}
    keys = {f"{group}.{key}" for group, values in groups.items() for key in values}
    aside = ("cluster.", "bounds.", "design.", "calibration.")
    keys -= {key for key in keys if key.startswith(aside)}
    keys -= {
        f"campaign.{key}"
        for key in (
            *("batch", "batch_time_limit_s", "store", "replace", "precision", "max_failed_share"),
        )
    }
    keys -= {"estimator.initial_std", "estimator.believed"}
    assert keys <= changed
    assert settings.keys() - groups.keys() == {
        "baseline",
        "compensation",
        "name",
        "only_run",
        "out",
        "a",
        "b",
        "campaigns",
        "accept",
        "growth",
        "parameter",
        "estimates",
        "mapping",
        "log",
        "rate_hz",
        "runs",
    }


def test_fingerprint_changes_with_the_source_of_what_a_run_needs(tmp_path, monkeypatch):
    copy = tmp_path / "inscal"
    shutil.copytree(
        Path(kernel.__file__).parent, copy, ignore=shutil.ignore_patterns("*.nb?", "__pycache__")
    )
    config = load(SHORT)
    before = store.fingerprint(config)
    monkeypatch.setattr(kernel, "_PACKAGE", copy)
    assert store.fingerprint(config) == before
    for name, decides in (("summary", False), ("earth", True)):
        source = copy / f"{name}.py"
        source.write_text(source.read_text() + "\n")
        assert (store.fingerprint(config) != before) == decides
