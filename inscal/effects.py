r"""What one sensor error alone does to navigation, at rest, in vibration and in a swing.

A level body (axes North, East, Down) at one place of the Earth rests, vibrates along its x axis or
swings about one of its axes. Imperfect sensors are read at a rate that resolves the motion and
navigated uncompensated, with height held; so are perfect ones, and the difference is the effect.

What is to be expected: a constant error a of north specific force grows as
:math:`(a / \omega_s) \sin \omega_s t`, with the Schuler rate :math:`\omega_s`. Seen over many
cycles, a vibration of rms :math:`\sigma_f` makes of a quadratic term :math:`a = D_2 \sigma_f^2`,
and a swing about z with amplitude :math:`\Theta` and rate :math:`\omega` makes of a lever arm r

.. math:: a = \overline{w^2 \cos\theta}\, r = \Theta \omega^2 J_1(\Theta)\, r

because the lever arm's force turns with the body (the mean of :math:`\cos^2 u \cos(\Theta \sin u)`
is the Bessel function :math:`J_1(\Theta)/\Theta`). Both are what compensation adds; sensors left
uncompensated err by as much with the opposite sign.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from inscal import earth
from inscal.free_inertial import HORIZONTAL, initial_state, navigate
from inscal.kernel import compiled
from inscal.motion import Site
from inscal.navigation import site_constants
from inscal.rotation import RAMP_TERMS, mean_rotation, skew
from inscal.sensor import inverse_matrices, sense

_PIECE = 50_000
"""Steps made and navigated at a time: bounds the memory of long studies at high rates."""


@dataclass(frozen=True)
class Environment:
    """Motion of the body; a body at rest has neither vibration nor swing.

    Attributes
    ----------
    step : float
        Time between two readings of the sensors, s.
    frequency : float
        Of vibration and swing, Hz.
    acceleration : float
        Amplitude of the vibration along x, m/s^2.
    angle : float
        Amplitude of the swing, rad.
    axis : int
        Body axis of the swing.
    """

    step: float
    frequency: float = 0.0
    acceleration: float = 0.0
    angle: float = 0.0
    axis: int = 2


@dataclass(frozen=True)
class Course:
    """North velocity errors over time.

    Attributes
    ----------
    time : ndarray, shape (entries,)
        s.
    north : ndarray, shape (entries, cases)
        Navigated with imperfect minus navigated with perfect sensors, m/s.
    """

    time: np.ndarray
    north: np.ndarray


def true_increments(
    environment: Environment, site: Site, first: int, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """What perfect sensors integrate in some steps.

    Within a step the body turns steadily, to the swing's angle at its end; the vibration's velocity
    is exact.

    Parameters
    ----------
    environment : Environment
    site : Site
    first, steps : int
        Number of the first step, and how many.

    Returns
    -------
    angle, velocity : ndarray, shape (steps, 3)
        rad and m/s, body axes.
    """
    dt, rate = environment.step, 2.0 * np.pi * environment.frequency
    phase = rate * dt * np.arange(first, first + steps + 1)
    swung = environment.angle * np.sin(phase)
    turn = np.zeros((steps, 3))
    turn[:, environment.axis] = np.diff(swung)
    cross = skew(np.eye(3)[environment.axis])
    # from the body at the start of a step to level: Rodrigues' formula
    sine, versine = np.sin(swung[:-1]), 1.0 - np.cos(swung[:-1])
    attitude = np.eye(3) + sine[:, None, None] * cross + versine[:, None, None] * (cross @ cross)
    to_body = mean_rotation(-turn) @ attitude.mT
    gained = np.broadcast_to(-earth.gravity_ned(site.latitude, site.height) * dt, (steps, 3)).copy()
    if environment.acceleration:
        gained[:, 0] -= environment.acceleration / rate * np.diff(np.cos(phase))
    angle = turn + to_body @ (earth.earth_rate_ned(site.latitude) * dt)
    return angle, np.einsum("sij,sj->si", to_body, gained)


def north_errors(
    environment: Environment, truth: np.ndarray, site: Site, *, duration: float, interval: float
) -> Course:
    """North velocity errors of uncompensated sensors.

    Parameters
    ----------
    environment : Environment
    truth : ndarray, shape (27, cases)
        True sensor parameters of each case, SI.
    site : Site
    duration : float
        s.
    interval : float
        Time between two entries of the course, s.

    Returns
    -------
    Course
    """
    cases = truth.shape[1]
    every = max(1, round(interval / environment.step))
    piece = every * max(1, _PIECE // every)
    entries = int(duration / environment.step + 1e-9) // every
    lanes = np.column_stack([np.zeros(len(truth)), truth])
    inverse, nothing = inverse_matrices(lanes), np.zeros_like(lanes)
    state = initial_state(np.repeat(np.eye(3)[:, :, None], cases + 1, axis=2))
    course = np.empty((entries, HORIZONTAL, cases + 1))
    for first in range(0, entries * every, piece):
        steps = min(piece, entries * every - first)
        sensors = np.empty((steps, 6, cases + 1))
        angle, velocity = true_increments(environment, site, first, steps)
        _sense(lanes, inverse, angle, velocity, environment.step, sensors)
        part = course[first // every : (first + steps) // every]
        path = np.full(steps, environment.step), np.zeros((steps, RAMP_TERMS))
        navigate(state, sensors, nothing, *path, site_constants(site), every, part)
    time = environment.step * every * np.arange(1, entries + 1)
    return Course(time, course[:, 0, 1:] - course[:, 0, :1])


@compiled
def _sense(parameters, inverse, angle, velocity, dt, out):
    """Increments that noise-free sensors report, (steps, 6, lanes)."""
    silent = (0.0, 0.0, 0.0)
    for s in range(len(angle)):
        da = (angle[s, 0], angle[s, 1], angle[s, 2])
        dv = (velocity[s, 0], velocity[s, 1], velocity[s, 2])
        for j in range(out.shape[2]):
            a, v = sense(parameters, inverse, j, da, dv, silent, silent, dt)
            out[s, 0, j], out[s, 1, j], out[s, 2, j] = a
            out[s, 3, j], out[s, 4, j], out[s, 5, j] = v


def schuler_rate(site: Site) -> float:
    """Schuler rate of north motion, rad/s."""
    sine = np.sin(site.latitude)
    # metres per radian of latitude are the radius of the arc
    return float(np.sqrt(earth.normal_gravity(sine, site.height) / site.metres[0]))


def vibration_error(quadratic: float, rms: float) -> float:
    """Mean error of specific force by a quadratic term in vibration, m/s^2.

    Parameters
    ----------
    quadratic : float
        s^2/m.
    rms : float
        Of the specific force along the accelerometer's axis, m/s^2.
    """
    return quadratic * rms**2


def swing_error(lever_arm: float, angle: float, frequency: float) -> float:
    """Mean north error of specific force by a lever arm in a swing about the vertical, m/s^2.

    Parameters
    ----------
    lever_arm : float
        Of the accelerometer that points north in the middle of the swing, m.
    angle, frequency : float
        Amplitude, rad, and frequency, Hz.
    """
    return lever_arm * angle * (2.0 * np.pi * frequency) ** 2 * float(special.j1(angle))
