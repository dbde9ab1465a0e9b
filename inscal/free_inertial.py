"""Free inertial navigation with height held: what compensated sensors are worth by themselves.

Nothing is observed. Vertical velocity and height are set back to those of the site after every
step, for an unaided vertical channel would lose the rest: its errors grow by e every 570 s.
"""

from dataclasses import dataclass

import numpy as np

from inscal import navigation
from inscal.kernel import compiled
from inscal.motion import Motion, Site
from inscal.navigation import advance, site_constants, straightened
from inscal.recorded import Increments, Stretch, aligned, compensated
from inscal.rotation import RAMP_TERMS
from inscal.sensor import compensate, compensate_in_ramp

HORIZONTAL = 4
"""Rows of a course: velocity North and East, then position North and East."""


@dataclass(frozen=True)
class Flight:
    """Errors of free inertial navigation of a body that stays at its site.

    Attributes
    ----------
    time : ndarray, shape (entries,)
        s.
    velocity : ndarray, shape (entries, 2, lanes)
        North and East, m/s.
    position : ndarray, shape (entries, 2, lanes)
        North and East, m.
    """

    time: np.ndarray
    velocity: np.ndarray
    position: np.ndarray


def fly(
    sensors: np.ndarray, parameters: np.ndarray, motion: Motion, site: Site, *, every: int
) -> Flight:
    """Navigate records of a motion freely, from perfect alignment.

    Parameters
    ----------
    sensors : ndarray, shape (steps, 6, lanes)
        Reported increments, rad and m/s.
    parameters : ndarray, shape (27, lanes)
        What they are compensated by, SI.
    motion : Motion
    site : Site
    every : int
        Steps from one entry of the course to the next.

    Returns
    -------
    Flight
    """
    lanes, entries = sensors.shape[2], motion.steps // every
    state = initial_state(np.repeat(motion.initial_attitude[:, :, None], lanes, axis=2))
    course = np.empty((entries, HORIZONTAL, lanes))
    known = np.ascontiguousarray(parameters)
    path = motion.duration, motion.ramp_terms
    navigate(state, sensors, known, *path, site_constants(site), every, course)
    time = np.cumsum(motion.duration)[every - 1 :: every]
    return Flight(time, course[:, :2], course[:, 2:] * site.metres[:2, None])


def fly_record(
    record: Increments, rest: Stretch, parameters: np.ndarray, site: Site, *, every: int
) -> Flight:
    """Navigate a record freely, from its own alignment in a rest at its beginning.

    Parameters
    ----------
    record : Increments
        Of a unit that stays at the site.
    rest : Stretch
        That it begins with; its mean attitude is taken for that at the start.
    parameters : ndarray, shape (27, lanes)
        What it is compensated by, and aligned with, SI.
    site : Site
    every : int
        Samples from one entry of the course to the next.

    Returns
    -------
    Flight
    """
    lanes, samples = parameters.shape[1], len(record.angle)
    first = record.part(rest.first, rest.end)
    whole = Stretch(0, rest.end - rest.first, False)
    attitudes = [aligned(compensated(first, one), whole, site) for one in parameters.T]
    state = initial_state(np.stack(attitudes, axis=2))
    both = np.concatenate([record.angle, record.velocity], axis=1)
    course = np.empty((samples // every, HORIZONTAL, lanes))
    navigate(
        state,
        np.ascontiguousarray(np.broadcast_to(both[:, :, None], (samples, 6, lanes))),
        np.ascontiguousarray(parameters),
        np.full(samples, record.interval),
        np.zeros((samples, RAMP_TERMS)),
        site_constants(site),
        every,
        course,
    )
    time = record.interval * every * np.arange(1, len(course) + 1)
    return Flight(time, course[:, :2], course[:, 2:] * site.metres[:2, None])


def initial_state(attitude: np.ndarray) -> np.ndarray:
    """State of bodies at rest at the site.

    Parameters
    ----------
    attitude : ndarray, shape (3, 3, lanes)
        Body-to-NED matrices as assumed at the start.

    Returns
    -------
    ndarray, shape (15, lanes)
        Rows as in `inscal.navigation`.
    """
    lanes = attitude.shape[-1]
    state = np.zeros((navigation.ROWS, lanes))
    state[: navigation.VELOCITY] = attitude.reshape(9, lanes)
    return state


@compiled
def navigate(state, sensors, parameters, duration, ramp_terms, site, every, course):
    """Navigate all lanes through reported increments, height held.

    Parameters
    ----------
    state : ndarray, shape (15, lanes)
        Rows as in `inscal.navigation`; updated in place, so that a record may come in pieces.
    sensors : ndarray, shape (steps, 6, lanes)
        Reported angle (rad) and velocity increments (m/s), body axes.
    parameters : ndarray, shape (27, lanes)
        What the increments are compensated by, SI; zeros leave them as they are.
    duration : ndarray, shape (steps,)
        Length of each step, s.
    ramp_terms : ndarray, shape (steps, RAMP_TERMS)
        From `inscal.rotation.ramp_terms`; zeros where nothing changes its rate as planned.
    site : tuple of float
        From `inscal.navigation.site_constants`.
    every : int
        Steps from one entry of the course to the next.
    course : ndarray, shape (steps // every, 4, lanes)
        Filled with velocity North and East (m/s) and the offsets of latitude and longitude (rad).
    """
    for s in range(len(duration)):
        for j in range(state.shape[1]):
            angle = (sensors[s, 0, j], sensors[s, 1, j], sensors[s, 2, j])
            velocity = (sensors[s, 3, j], sensors[s, 4, j], sensors[s, 5, j])
            if ramp_terms[s, 0] == 0.0:
                angle, velocity = compensate(parameters, j, angle, velocity, duration[s])
            else:
                angle, velocity = compensate_in_ramp(
                    parameters, j, angle, velocity, duration[s], ramp_terms[s, 0]
                )
                angle, velocity = straightened(
                    state, 0, j, angle, velocity, duration[s], site, ramp_terms, s
                )
            advance(state, 0, j, angle, velocity, duration[s], site)
            state[navigation.VELOCITY + 2, j] = 0.0
            state[navigation.POSITION + 2, j] = 0.0
        if (s + 1) % every == 0:
            k = (s + 1) // every - 1
            for j in range(state.shape[1]):
                course[k, 0, j] = state[navigation.VELOCITY, j]
                course[k, 1, j] = state[navigation.VELOCITY + 1, j]
                course[k, 2, j] = state[navigation.POSITION, j]
                course[k, 3, j] = state[navigation.POSITION + 1, j]
