"""One pass over a record: the compiled loop of navigation, innovation and correction.

Lanes are navigated with compensated increments; at every update the six differences between
navigated and observed velocity and position, times the gains of `inscal.recursion`, correct all
states at once. `inscal.calibrator` says what comes before and after.
"""

import numpy as np

from inscal import navigation
from inscal.estimator import CONSTANTS
from inscal.kernel import CACHE_LINE, LANES, compiled, inlined, prefetch
from inscal.navigation import advance, rotate_left, straightened
from inscal.parameters import COUNT
from inscal.record import OBSERVED
from inscal.sensor import compensate, compensate_in_ramp
from inscal.state_model import NAVIGATION

NAV = CONSTANTS
"""First row of the navigation state, after the parameters and the attitude error at the start."""
ROWS = NAV + navigation.ROWS
"""Rows of the state."""
_FURTHER = NAVIGATION + CONSTANTS
_STEP_BYTES = 8 * 6 * LANES
_GAIN_BYTES = 8 * OBSERVED * (NAVIGATION + CONSTANTS)
_WHITENING_BYTES = 8 * OBSERVED * OBSERVED
_AHEAD = 2  # steps from the asking for data to its use: farther ahead was a little slower


@compiled
def run_pass(
    start,
    sensors,
    observations,
    duration,
    ramp_terms,
    update_step,
    gain,
    whitening,
    site,
    metres,
    estimate_history,
    innovation_history,
    nis,
    further,
):
    """Navigate and correct all lanes through the record; `start` becomes the final state.

    Where `whitening` is given, `nis` becomes the sum of the normalised innovations squared.
    `further` is None, for which the compiler leaves out all that is about augmented states, or a
    tuple of what they are, (n, LANES), which becomes what they are at the end, their rows and
    decays (`inscal.augmentation`).

    Rows of the state: 27 parameters, attitude error at the start, attitude, velocity, position.
    The state lives in an array of fixed shape made here, so that the compiler knows that its rows
    do not overlap and keeps the lane loops free of run-time checks.
    """
    state = np.empty((ROWS, LANES))
    innovation = np.empty((OBSERVED, LANES))
    correction = np.empty((NAVIGATION, LANES))
    for j in range(LANES):
        for i in range(ROWS):
            state[i, j] = start[i, j]
    keep, tell, judge = len(estimate_history) > 0, len(innovation_history) > 0, len(whitening) > 0
    squares = np.zeros(LANES)
    moved = None if further is None else np.empty((6, LANES))
    for k in range(len(update_step) - 1):
        _fetch(gain, k + _AHEAD, _GAIN_BYTES)
        _fetch(observations, k + _AHEAD, _STEP_BYTES)
        for s in range(update_step[k], update_step[k + 1]):
            _fetch(sensors, s + _AHEAD, _STEP_BYTES)
            if further is not None:
                _apparent(further[0], further[1], s, moved)
            if ramp_terms[s, 0] == 0.0:
                _navigate(state, sensors, s, duration[s], site, moved)
            else:
                _navigate_ramp(state, sensors, s, duration[s], site, ramp_terms, moved)
        if further is not None:
            _decay(further[0], further[2])
        _innovate(state, observations, k, metres, innovation)
        if judge:
            _fetch(whitening, k + _AHEAD, _WHITENING_BYTES)
            for j in range(LANES):
                squares[j] += _squared(whitening, k, innovation, j)
        _correct(state, gain, k, innovation, correction, metres)
        if further is not None:
            for n in range(len(further[0])):
                for j in range(LANES):
                    further[0][n, j] += _product(gain, k, _FURTHER + n, innovation, j)
        if keep:
            for j in range(LANES):
                for i in range(COUNT):
                    estimate_history[k, i, j] = state[i, j]
        if tell:
            for j in range(LANES):
                for i in range(OBSERVED):
                    innovation_history[k, i, j] = innovation[i, j]
    for j in range(LANES):
        for i in range(ROWS):
            start[i, j] = state[i, j]
        nis[j] = squares[j]


@inlined
def _fetch(array, row, row_bytes):
    """Ask for the cache lines of a row of an array; beyond its end that does nothing."""
    for line in range(0, row_bytes, CACHE_LINE):
        prefetch(array, row * row_bytes + line)  # type: ignore[call-arg]  # numba adds one


@inlined
def _navigate(state, sensors, s, dt, site, moved):
    for j in range(LANES):
        angle = (sensors[s, 0, j], sensors[s, 1, j], sensors[s, 2, j])
        velocity = (sensors[s, 3, j], sensors[s, 4, j], sensors[s, 5, j])
        angle, velocity = compensate(state, j, angle, velocity, dt)
        if moved is not None:
            angle, velocity = _rid(angle, velocity, moved, j)
        advance(state, NAV, j, angle, velocity, dt, site)


@inlined
def _navigate_ramp(state, sensors, s, dt, site, terms, moved):
    for j in range(LANES):
        angle = (sensors[s, 0, j], sensors[s, 1, j], sensors[s, 2, j])
        velocity = (sensors[s, 3, j], sensors[s, 4, j], sensors[s, 5, j])
        angle, velocity = compensate_in_ramp(state, j, angle, velocity, dt, terms[s, 0])
        if moved is not None:
            angle, velocity = _rid(angle, velocity, moved, j)
        angle, velocity = straightened(state, NAV, j, angle, velocity, dt, site, terms, s)
        advance(state, NAV, j, angle, velocity, dt, site)


@inlined
def _apparent(augmented, rows, s, moved):
    """Apparent increments that augmented states add to a step."""
    for c in range(6):
        for j in range(LANES):
            moved[c, j] = 0.0
        for n in range(len(augmented)):
            row = rows[s, c, n]
            if row != 0.0:
                for j in range(LANES):
                    moved[c, j] += row * augmented[n, j]


@inlined
def _rid(angle, velocity, moved, j):
    """Compensated increments without what augmented states add."""
    return (
        (angle[0] - moved[0, j], angle[1] - moved[1, j], angle[2] - moved[2, j]),
        (velocity[0] - moved[3, j], velocity[1] - moved[4, j], velocity[2] - moved[5, j]),
    )


@inlined
def _decay(augmented, decay):
    for n in range(len(augmented)):
        if decay[n] != 1.0:
            for j in range(LANES):
                augmented[n, j] *= decay[n]


@inlined
def _innovate(state, observations, k, metres, innovation):
    for i in range(3):
        for j in range(LANES):
            innovation[i, j] = state[NAV + 9 + i, j] - observations[k, i, j]
        for j in range(LANES):
            innovation[3 + i, j] = state[NAV + 12 + i, j] * metres[i] - observations[k, 3 + i, j]


@inlined
def _correct(state, gain, k, innovation, correction, metres):
    """Feed back: navigation errors are navigated minus true, constants true minus estimated."""
    for i in range(NAVIGATION):
        for j in range(LANES):
            correction[i, j] = _product(gain, k, i, innovation, j)
    for i in range(CONSTANTS):
        for j in range(LANES):
            state[i, j] += _product(gain, k, NAVIGATION + i, innovation, j)
    for j in range(LANES):
        rotate_left(state, NAV, j, (correction[0, j], correction[1, j], correction[2, j]))
    for i in range(3):
        for j in range(LANES):
            state[NAV + 9 + i, j] -= correction[3 + i, j]
            state[NAV + 12 + i, j] -= correction[6 + i, j] / metres[i]


@inlined
def _product(gain, k, row, innovation, j):
    return (
        gain[k, row, 0] * innovation[0, j]
        + gain[k, row, 1] * innovation[1, j]
        + gain[k, row, 2] * innovation[2, j]
        + gain[k, row, 3] * innovation[3, j]
        + gain[k, row, 4] * innovation[4, j]
        + gain[k, row, 5] * innovation[5, j]
    )


@inlined
def _squared(whitening, k, innovation, j):
    """Normalised innovation squared: of the six, whitened by a lower triangular matrix."""
    total = 0.0
    for i in range(OBSERVED):
        unit = 0.0
        for c in range(i + 1):
            unit += whitening[k, i, c] * innovation[c, j]
        total += unit * unit
    return total
