"""A path in the steps of a simulation: what the effects of disturbances need to know of it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inscal import earth
from inscal.motion import Motion, Site, Steps, cut_into_steps, motion_of
from inscal.rotation import mean_rotation
from inscal.schedule import Schedule

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_TAU, _SHARE = 0.5 * (1.0 + _NODES), 0.5 * _WEIGHTS


@dataclass(frozen=True)
class Path:
    """What effects need to know of a path.

    Attributes
    ----------
    steps : Steps
    motion : Motion
        In the same steps.
    site : Site
    """

    steps: Steps
    motion: Motion
    site: Site

    @cached_property
    def edges(self) -> np.ndarray:
        """Times of the steps' ends, s, shape (steps + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.steps.duration)])

    @property
    def turns(self) -> int:
        """Number of turns."""
        return int(self.steps.turn.max()) + 1

    @cached_property
    def gravity(self) -> np.ndarray:
        """Gravity, NED, shape (3,)."""
        return earth.gravity_ned(self.site.latitude, self.site.height)

    @cached_property
    def earth_rate(self) -> np.ndarray:
        """Rate of the Earth, NED, shape (3,)."""
        return earth.earth_rate_ned(self.site.latitude)

    @cached_property
    def end_attitude(self) -> np.ndarray:
        """Body-to-NED matrices at the end of each step, shape (steps, 3, 3)."""
        last = self.steps.attitude[-1:]  # the last position only dwells
        return np.concatenate([self.steps.attitude[1:], last])

    @cached_property
    def edge_rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Rate of the table at the start and at the end of each step, rad/s, shape (steps, 3)."""
        change = self.steps.rate * self.steps.ramp[:, None]
        return self.steps.rate - change, self.steps.rate + change

    @cached_property
    def jumps(self) -> tuple[np.ndarray, np.ndarray]:
        """Change of the table's rate at once, at the start and at the end of each step, rad/s.

        Shape (steps, 3): where a turn without ramps begins or ends, and zero elsewhere.
        """
        number, at_once = self.steps.turn, self.steps.ramp == 0.0
        starts = (np.diff(number, prepend=-1) != 0) & at_once
        ends = (np.diff(number, append=-1) != 0) & at_once
        return self.steps.rate * starts[:, None], -self.steps.rate * ends[:, None]

    @cached_property
    def rate_change(self) -> np.ndarray:
        """Change of the inertial rate within each step, in body axes, rad/s, shape (steps, 3)."""
        start = self.steps.attitude.mT @ self.earth_rate
        first, last = self.edge_rates
        return np.asarray(self.end_attitude.mT @ self.earth_rate - start + last - first)

    def mean_of(self, function: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Mean over every step of a function of the specific force, which takes (..., 3)."""
        total = np.zeros(1)
        force = self.steps.attitude.mT @ -self.gravity
        for tau, share in zip(_TAU, _SHARE, strict=True):
            part = tau - self.steps.ramp * tau * (1.0 - tau)
            turned = self.steps.rate * (part * self.steps.duration)[:, None]
            total = total + share * function(_turned(-turned, force))
        return np.asarray(total)


def _turned(vector: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Force after a rotation by a vector, all of shape (steps, 3)."""
    angle = np.linalg.norm(vector, axis=1)[:, None]
    a, b = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    once = np.cross(vector, force)
    return np.asarray(force + a * once + b * np.cross(vector, once))


def path_of(
    schedule: Schedule, site: Site, *, update_interval: float, dwell_step: float, turn_step: float
) -> Path:
    """Path of a schedule.

    Parameters
    ----------
    schedule : Schedule
    site : Site
    update_interval, dwell_step, turn_step : float
        As of `inscal.motion.cut_into_steps`, s.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If the schedule is not a whole number of update intervals long, or a turn does not fit.
    """
    steps = cut_into_steps(
        schedule, update_interval=update_interval, dwell_step=dwell_step, turn_step=turn_step
    )
    return Path(steps, motion_of(steps, site), site)


def attitude_effect(path: Path, psi: np.ndarray, gained: np.ndarray) -> np.ndarray:
    """Effect of an attitude error that is `psi` on average in a step, by `gained` more after it.

    Parameters
    ----------
    path : Path
    psi : ndarray, shape (steps, 3)
        NED, rad.
    gained : ndarray, shape (steps, 3)
        In body axes, rad.

    Returns
    -------
    ndarray, shape (steps, 6)
    """
    force = np.cross(psi, path.gravity)
    rate = -np.cross(psi, path.earth_rate)
    b = path.steps.to_body
    return np.concatenate(
        [np.einsum("sij,sj->si", b, rate) + gained, np.einsum("sij,sj->si", b, force)], axis=1
    )


def turned_otherwise(path: Path, rate: np.ndarray) -> np.ndarray:
    """Effect of a body rate in excess of the table's planned one.

    Parameters
    ----------
    path : Path
    rate : ndarray, shape (steps, 3)
        Mean over each step, within which it changes as the table's does; in body axes, rad/s.

    Returns
    -------
    ndarray, shape (steps, 6)
    """
    steps = path.steps
    excess = rate * steps.duration[:, None]
    # both rates keep step, so the path does not depend on their course in time
    turning = steps.attitude @ mean_rotation(steps.rate * steps.duration[:, None])
    gain = np.einsum("sij,sj->si", turning, excess)
    psi = np.cumsum(gain, axis=0) - (0.5 + steps.ramp[:, None] / 6.0) * gain
    return attitude_effect(path, psi, excess)
