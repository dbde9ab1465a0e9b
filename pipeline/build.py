"""From configuration to library objects: where paper units become SI."""

from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from inscal import parameters, schedule, units
from inscal.experiment import Experiment, prepare
from inscal.motion import Site
from inscal.recursion import InitialStd
from inscal.simulation import TruthModel
from inscal.state_model import NoiseModel, StateModel
from pipeline.config import Config, KindValues
from pipeline.progress import note


def quadratic_unit(config: Config) -> float:
    """Size of 1e-9 of quadratic coefficient, s^2/m."""
    if config.sensor.quadratic_unit == "si":
        return units.QUADRATIC_SI_FACE_VALUE
    return units.quadratic_unit(config.sensor.accel_pulses_per_m_per_s)


def si_units(config: Config) -> NDArray[np.float64]:
    """Size in SI of the paper unit of each parameter, shape (27,)."""
    return parameters.si_units(quadratic_unit(config))


def parameter_vector(values: KindValues) -> NDArray[np.float64]:
    """Values of a configuration group in state order, shape (27,), in paper units."""
    return parameters.vector(values.by_kind())


def build_schedule(config: Config) -> schedule.Schedule:
    """Schedule of the configuration."""
    x, y, z = config.schedule.initial_posture
    return schedule.Schedule(
        initial_posture=(x, y, z),
        turns=schedule.turns_of((angle, axis) for angle, axis in config.schedule.rotations),
        position_duration=config.schedule.position_duration_s,
        turn_rate=config.schedule.turn_rate_deg_per_s * units.DEGREE,
    )


def build_site(config: Config) -> Site:
    """Site of the configuration."""
    return Site(config.site.latitude_deg * units.DEGREE, config.site.height_m)


def build_noise(config: Config) -> NoiseModel:
    """Noise of the configuration, for truth and filter alike."""
    return NoiseModel(
        gyro=config.noise.gyro_angle_random_walk_deg_per_sqrt_h * units.DEG_PER_SQRT_HOUR,
        accel=config.noise.accel_white_noise_ug_per_sqrt_hz * units.MICRO_G,
        velocity=config.noise.velocity_observation_m_per_s,
        position=config.noise.position_observation_m,
    )


def build_initial_std(config: Config) -> InitialStd:
    """Initial standard deviations of the configuration."""
    std = config.estimator.initial_std
    return InitialStd(
        attitude=np.array(std.attitude_deg) * units.DEGREE,
        velocity=std.velocity_m_per_s,
        position=std.position_m,
        parameter=parameter_vector(std) * si_units(config),
    )


def build_experiment(config: Config) -> Experiment:
    """Experiment of the configuration; computes the gains.

    Parameters
    ----------
    config : Config

    Returns
    -------
    Experiment
    """
    if not Path(getattr(numba.config, "CACHE_DIR", ".")).exists():
        note("compiling the kernels, once: some ten seconds")
    return prepare(
        config.campaign.seed,
        build_schedule(config),
        build_site(config),
        build_noise(config),
        build_initial_std(config),
        TruthModel(config.truth.distribution, parameter_vector(config.truth) * si_units(config)),
        model=StateModel(tuple(config.estimator.states)),
        passes=config.estimator.passes,
        update_interval=config.estimator.update_interval_s,
        dwell_step=config.simulation.dwell_step_s,
        turn_step=config.simulation.turn_step_s,
    )


def warnings(config: Config) -> list[str]:
    """Lines a user should see before a campaign: parameter pairs the schedule cannot separate."""
    return [
        f"warning: schedule.rotations never shows {direction}: {a} and {b} cannot be told apart"
        for a, b, direction in schedule.weak_pairs(build_schedule(config))
    ]
