"""Defects to plant: each makes the reference experiment as one mistake in the code would."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from inscal import earth, experiment, motion, recursion, simulation, state_model, units
from inscal.parameters import GROUPS, INDEX, KIND_OF
from pipeline.config.load import load
from pipeline.config.setup import Setup

INSTALLATION = [i for i, kind in enumerate(KIND_OF) if kind.endswith("installation")]


def reference():
    return Setup(load()).experiment


def built_with(patch, owner, name, value):
    """The reference experiment with an estimator that was built while `owner.name` was `value`."""
    clean = reference()
    with patch.context() as building:
        building.setattr(owner, name, value)
        return replace(clean, estimator=reference().estimator)


def with_gain(change):
    """The reference experiment with changed gains in every pass."""
    clean = reference()
    first, later = (
        replace(g, gain=change(g.gain.copy())) for g in map(clean.estimator.gains, (0, 1))
    )
    return replace(clean, estimator=replace(clean.estimator, first=first, later=later))


def with_sensed_truth(patch, change):
    """Sensors whose true parameters are `change` of those the errors are counted from."""
    original = experiment.simulate

    def simulate(truth, *arguments, **options):
        return original(change(truth.copy()), *arguments, **options)

    patch.setattr(experiment, "simulate", simulate)
    return reference()


def scaled(rows, factor):
    def change(truth):
        truth[rows] *= factor
        return truth

    return change


def lever_arm_column_sign(patch):
    original = state_model.parameter_dynamics

    def dynamics(*arguments):
        out = original(*arguments)
        out[..., INDEX["lever_arm"].start] *= -1.0
        return out

    return built_with(patch, state_model, "parameter_dynamics", dynamics)


def earth_rate_missing_in_filter(patch):
    return built_with(patch, earth, "earth_rate_ned", lambda latitude: np.zeros(3))


def upper_gyro_matrix_in_filter(patch):
    original = state_model.parameter_dynamics

    def dynamics(attitude, rate, force):
        out = original(attitude, rate, force)
        for column, name in enumerate(GROUPS["gyro_k"], INDEX["gyro_k"].start):
            row, source = int(name[-1]) - 1, int(name[-2]) - 1
            out[..., 0:3, column] = attitude[..., row] * rate[..., source, None]
        return out

    return built_with(patch, state_model, "parameter_dynamics", dynamics)


def initial_attitude_too_sure(patch):
    original = recursion.initial_root

    def root(model, std, *rest):
        return original(model, replace(std, attitude=std.attitude / 10), *rest)

    return built_with(patch, recursion, "initial_root", root)


def sensor_noise_missing_in_filter(patch):
    return built_with(patch, state_model, "noise_of", lambda a, noise, interval: np.zeros((9, 9)))


def gravity_of_1967(patch):
    clean = reference()
    s2 = np.sin(clean.site.latitude) ** 2
    gravity = 9.780318 * (1 + 0.0053024 * s2 - 0.0000058 * 4 * s2 * (1 - s2))
    ratio = gravity / earth.normal_gravity(np.sqrt(s2), 0.0)
    return replace(clean, motion=replace(clean.motion, velocity=clean.motion.velocity * ratio))


def earth_rate_missing_in_truth(patch):
    original = reference()
    patch.setattr(earth, "earth_rate_ned", lambda latitude: np.zeros(3))
    return replace(reference(), estimator=original.estimator)


def midpoint_rule_in_turns(patch):
    def middle(rotation, ramp):
        return Rotation.from_rotvec(rotation / 2).as_matrix()

    patch.setattr(motion, "mean_rotation_of_ramp", middle)
    return reference()


def velocity_and_position_gains_swapped(patch):
    return with_gain(lambda gain: gain[..., [3, 4, 5, 0, 1, 2]])


def gain_one_update_late(patch):
    return with_gain(lambda gain: np.roll(gain, 1, axis=0))


def every_second_update_skipped(patch):
    def change(gain):
        gain[::2] = 0.0
        return gain

    return with_gain(change)


def updates_of_one_position_skipped(patch):
    def change(gain):
        gain[6000:6500] = 0.0
        return gain

    return with_gain(change)


def start_attitude_not_smoothed(patch):
    def change(gain):
        gain[:, 36:] = 0.0
        return gain

    return with_gain(change)


def arcsec_of_three_digits(patch):
    return with_sensed_truth(patch, scaled(INSTALLATION, 4.85e-6 / units.ARCSEC))


def quadratic_sign_in_truth(patch):
    return with_sensed_truth(patch, scaled(INDEX["accel_quadratic"], -1.0))


def lever_arm_sign_in_truth(patch):
    return with_sensed_truth(patch, scaled(INDEX["lever_arm"], -1.0))


def _with_noise(experiment, **true):
    noise = replace(experiment.truth.noise, **true)
    return replace(experiment, truth=replace(experiment.truth, noise=noise))


def observation_noise_under_modelled(patch):
    clean = reference()
    return _with_noise(clean, velocity=2 * clean.truth.noise.velocity)


def sensor_noise_under_modelled(patch):
    clean = reference()
    return _with_noise(clean, gyro=2 * clean.truth.noise.gyro)


def one_pass(patch):
    return Setup(load(["estimator=one_pass"])).experiment


def translation_missing(patch):
    clean = reference()
    return replace(clean, estimator=replace(clean.estimator, translate=np.eye(30)))


def pull_missing(patch):
    clean = reference()
    return replace(clean, estimator=replace(clean.estimator, pull=np.zeros((30, 30))))


def prior_counted_twice(patch):
    clean = reference()
    return replace(
        clean,
        estimator=replace(
            clean.estimator, translate=np.eye(30), pull=np.zeros((30, 30)), later=None
        ),
    )


def noise_of_run_0_in_all(patch):
    original = simulation.generator

    def generator(seed, run, purpose):
        return original(seed, run if purpose == "truth" else 0, purpose)

    patch.setattr(simulation, "generator", generator)
    return reference()


def noise_shared_by_pairs_of_runs(patch):
    original = simulation.generator

    def generator(seed, run, purpose):
        return original(seed, run if purpose == "truth" else run // 2, purpose)

    patch.setattr(simulation, "generator", generator)
    return reference()


def one_stream_for_sensors_and_observations(patch):
    patch.setitem(simulation.PURPOSES, "observations", simulation.PURPOSES["sensors"])
    return reference()


def latitude_an_arcminute_off(patch):
    clean = reference()
    site = replace(clean.site, latitude=clean.site.latitude + 60 * units.ARCSEC)
    return replace(clean, site=site)


def metres_of_longitude_on_the_equator(patch):
    original = motion.Site.metres.fget

    def metres(site):
        return original(site) / np.array([1.0, np.cos(site.latitude), 1.0])

    patch.setattr(motion.Site, "metres", property(metres))
    return reference()


def covariance_too_small(patch):
    clean = reference()
    first = replace(clean.estimator.first, covariance=0.8 * clean.estimator.first.covariance)
    return replace(clean, estimator=replace(clean.estimator, first=first))


def estimates_swapped(patch):
    original = experiment.calibrate

    def calibrate(*arguments, **options):
        calibration = original(*arguments, **options)
        calibration.estimate[[13, 15]] = calibration.estimate[[15, 13]]
        return calibration

    patch.setattr(experiment, "calibrate", calibrate)
    return reference()


def one_run_diverges(patch):
    original = experiment.calibrate

    def calibrate(*arguments, **options):
        calibration = original(*arguments, **options)
        calibration.estimate[4, 7] = np.inf
        return calibration

    patch.setattr(experiment, "calibrate", calibrate)
    return reference()
