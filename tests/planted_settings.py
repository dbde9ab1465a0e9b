"""Defects that show at other settings than the reference case's: patches of the library, in force.

Each function plants one mistake with pytest's monkeypatch; those of the reference case are in
`planted`. What is patched must be looked up when it is called, so kernels are out of reach:
`mutants` changes those.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from inscal import (
    earth,
    estimator,
    experiment,
    motion,
    path,
    recursion,
    schedule,
    simulation,
    state_model,
)
from inscal.parameters import INDEX


def _wrap(patch, owner, name, change):
    """Replace a function by `change`, which is given the original and its arguments."""
    original = getattr(owner, name)
    patch.setattr(owner, name, lambda *args, **options: change(original, *args, **options))


def _in_filter_alone(patch, defect):
    """Plant a defect while estimators are built, and take it out again."""

    def build(original, *arguments, **options):
        with patch.context() as building:
            defect(building)
            return original(*arguments, **options)

    _wrap(patch, experiment, "build_estimator", build)


# the Earth


def earth_rate_of_the_north(patch):
    _wrap(patch, earth, "earth_rate_ned", lambda original, latitude: original(abs(latitude)))


def earth_rate_of_the_north_in_filter(patch):
    _in_filter_alone(patch, earth_rate_of_the_north)


def gravity_at_sea_level(patch):
    _wrap(patch, earth, "gravity_ned", lambda original, latitude, height: original(latitude, 0.0))


def meridians_parallel_in_filter(patch):
    def change(original, site):
        a = original(site)
        a[2, 4] = 0.0
        return a

    _wrap(patch, state_model, "navigation_dynamics", change)


def metres_of_longitude_on_the_equator(patch):
    original = motion.Site.metres.fget

    def metres(site):
        return original(site) / np.array([1.0, np.cos(site.latitude), 1.0])

    patch.setattr(motion.Site, "metres", property(metres))


# time between updates


def process_noise_of_one_second(patch):
    def change(original, a, noise, interval):
        return original(a, noise, 1.0)

    _wrap(patch, state_model, "noise_of", change)


def transition_of_one_second(patch):
    def change(original, way, site, *arguments, **options):
        out = original(way, site, *arguments, **options)
        return replace(out, navigation=expm(state_model.navigation_dynamics(site)))

    _wrap(patch, estimator, "build_transitions", change)


# what the filter claims, and what it trusts


def _claimed(patch, change):
    """Covariance changed in what the filter claims, and in nothing that it does."""

    def build(original, *arguments, **options):
        out = original(*arguments, **options)
        covariance = out.first.covariance.copy()
        covariance[:27, :27] = change(covariance[:27, :27])
        return replace(out, first=replace(out.first, covariance=covariance))

    _wrap(patch, experiment, "build_estimator", build)


def _times(group, factor):
    def change(covariance):
        scale = np.ones(27)
        scale[INDEX[group]] = factor
        return covariance * np.outer(scale, scale)

    return change


def gyro_bias_sigma_doubled(patch):
    _claimed(patch, _times("gyro_bias", 2.0))


def lever_arm_sigma_small(patch):
    _claimed(patch, _times("lever_arm", 0.85))


def correlations_lost(patch):
    _claimed(patch, lambda covariance: np.diag(np.diag(covariance)))


def observations_trusted_too_little(patch):
    _wrap(patch, recursion, "observation_covariance", lambda original, noise: 1.2 * original(noise))


def attitude_prior_in_reverse(patch):
    def change(original, model, std, *rest):
        return original(model, replace(std, attitude=std.attitude[::-1]), *rest)

    _wrap(patch, recursion, "initial_root", change)


def prior_forgotten_in_later_passes(patch):
    def build(original, *arguments, **options):
        out = original(*arguments, **options)
        return replace(out, pull=np.zeros_like(out.pull))

    _wrap(patch, experiment, "build_estimator", build)


def first_columns_whatever_the_states(patch):
    original = state_model.StateModel.columns.fget
    patch.setattr(
        state_model.StateModel, "columns", property(lambda model: np.arange(len(original(model))))
    )


# the path


def negative_turns_positive(patch):
    _wrap(patch, schedule, "turn_vector", lambda original, turn: abs(original(turn)))


def negative_turns_positive_in_filter(patch):
    _in_filter_alone(patch, negative_turns_positive)


def half_turns_rounded(patch):
    def change(original, rotations):
        return original(
            (90.0 * np.sign(a) * np.ceil(abs(a) / 90.0), *rest) for a, *rest in rotations
        )

    _wrap(patch, schedule, "turns_of", change)


def turns_at_twenty_degrees_a_second(patch):
    for owner in (motion, state_model):
        _wrap(
            patch,
            owner,
            "segments",
            lambda original, way: original(replace(way, turn_rate=np.deg2rad(20.0))),
        )


def ramps_taken_for_steady_turns(patch):
    def change(original, *arguments, **options):
        made = original(*arguments, **options)
        return replace(made, ramp=np.zeros_like(made.ramp))

    _wrap(patch, path, "motion_of", change)


def posture_north_east_down(patch):
    _wrap(
        patch,
        schedule,
        "initial_attitude",
        lambda original, posture: original(("North", "East", "Down")),
    )


# random numbers


def _drawn(patch, change):
    original = simulation.generator
    patch.setattr(
        simulation,
        "generator",
        lambda seed, run, purpose: original(*change(seed, run, purpose), purpose),
    )


def seed_ignored(patch):
    _drawn(patch, lambda seed, run, purpose: (1, run))


def runs_wrap_at_256(patch):
    _drawn(patch, lambda seed, run, purpose: (seed, run % 256))


def runs_wrap_at_32_bits(patch):
    _drawn(patch, lambda seed, run, purpose: (seed, run % 2**32))


def noise_of_the_sensors_wraps_at_256(patch):
    _drawn(patch, lambda seed, run, purpose: (seed, run % 256 if purpose == "sensors" else run))


# the truth


def _true(patch, change):
    _wrap(patch, experiment, "draw_truth", change)


def uniform_truth_positive(patch):
    def change(original, model, seed, run):
        truth = original(model, seed, run)
        return abs(truth) if model.distribution == "uniform" else truth

    _true(patch, change)


def uniform_truth_a_quarter_wider(patch):
    def change(original, model, seed, run):
        wider = 1.25 if model.distribution == "uniform" else 1.0
        return original(replace(model, scale=wider * model.scale), seed, run)

    _true(patch, change)


def fixed_truth_a_percent_off(patch):
    """Errors counted from a truth that is not the one sensed."""
    sensed = experiment.simulate

    def change(original, model, seed, run):
        truth = original(model, seed, run)
        return 1.01 * truth if model.distribution == "fixed" else truth

    def simulate(truth, *arguments, **options):
        alike = np.ptp(truth, axis=1).max() == 0.0
        return sensed(truth / 1.01 if alike else truth, *arguments, **options)

    _true(patch, change)
    patch.setattr(experiment, "simulate", simulate)
