"""Traces of disturbances, against innovations of whole runs and where physics allows none."""

import numpy as np
import pytest
from disturbed_case import (
    SCHEDULE,
    SIZES,
    disturbed_by,
    every_system,
    filtered,
    plain,
    system_of,
)

from inscal.budget import budget
from inscal.disturbance import draw_constants
from inscal.experiment import run_with_history
from inscal.response import together
from inscal.traces import innovations, std_of, traces


def innovations_of(system):
    """Of states and of all constants of a system."""
    parts = system.transitions, system.gains, system.model, std_of(system)
    return innovations(*parts, together(system.constants.values()))


TRIED = ("accel_cubic", "table_offset", "gyro_accel_delay", "base_tilt", "observation_bias")


@pytest.mark.parametrize("source", TRIED)
def test_innovations_move_as_those_of_a_whole_run(source):
    """Of the nonlinear first pass, a run with and without the disturbance."""
    experiment = disturbed_by(**{source: SIZES[source]})
    (without, of_it), number = [run_with_history(e, 3)[1] for e in (plain(), experiment)], 0
    moved = (of_it.innovation - without.innovation)[number, :, :, 0]
    whitening = filtered()[1].whitening
    unit = np.einsum("kij,kj->ki", whitening, moved).ravel()
    about = experiment.truth.disturbance
    drawn = draw_constants(about, source, len(SCHEDULE.turns), seed=9, runs=[3])[:, 0]
    made = system_of(experiment)
    _, per_unit = innovations_of(made)
    expected = per_unit @ drawn
    assert np.linalg.norm(expected) > 1e-4
    assert np.linalg.norm(unit - expected) < 0.03 * np.linalg.norm(expected)


def test_a_parameters_own_error_leaves_no_trace():
    """The square root of what is left of parameters when parameters are taken out is rounding."""
    system = every_system()
    of_parameters, _ = innovations_of(system)
    base, _ = np.linalg.qr(of_parameters)
    left = of_parameters - base @ (base.T @ of_parameters)
    assert np.linalg.norm(left) < 1e-12 * np.linalg.norm(of_parameters)


def test_gravity_hides_and_a_delay_does_not():
    """More gravity than believed is a scale factor of all accelerometers, whatever the path."""
    seen, made = traces(every_system()), budget(every_system())
    sigma = np.sqrt(np.diag(made.formal_covariance))
    scaled = np.linalg.inv(made.formal_covariance / np.outer(sigma, sigma))

    def trace_over_effect(source):
        unit = made.effects[source] / sigma[:, None]
        moved = np.einsum("in,ij,jn->n", unit, scaled, unit)
        return np.sqrt(np.maximum(np.diag(seen[source]), 0.0) / moved)

    assert trace_over_effect("gravity") < 1e-3
    assert (trace_over_effect("accel_cubic") < 0.1).all()  # dwells along the axes: f = -1, 0, 1 g
    assert (trace_over_effect("gyro_accel_delay") > 1.0).all()
    assert all(np.linalg.eigvalsh(s)[0] > -1e-9 * np.trace(s) for s in seen.values())


def test_nothing_disturbed_has_no_traces():
    assert traces(system_of(plain())) == {}
