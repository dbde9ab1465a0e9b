r"""Stretches of a path as single steps of the covariance, exactly: schedules judged cheaply.

Given what a stretch of updates starts with, z = (navigation x_0, constants c), its navigation
states follow a linear system that knows no other unknown than noise. A Kalman filter that carries
its estimate as a function of z,

.. math:: x_k | z, y_1 ... y_k \sim N(F_k z + \ldots, \Sigma_k), \quad \Sigma_0 = 0,

leaves three things behind: the information of all its innovations on z,

.. math:: J = \sum_k E_k^T S_k^{-1} E_k, \quad E_k = H (\Phi F_{k-1} + B_k),

and F and Sigma at its end. A covariance of (x, c) then goes through the stretch in two steps, an
observation of z of information J, and x = F z + noise of covariance Sigma: the same as through all
of its updates one by one.

At rest the constants enter as three rates of attitude error and three of velocity error in NED,
which are the same matrix of the constants all along: so there is one block for every dwell of a
length, whatever the posture. A turn's depends on the posture that it starts from. Augmented states
are constants like others, but for those that wander or depend on the time since the start: these
have no block.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from inscal import earth
from inscal.augmentation import augment
from inscal.disturbance import Disturbance
from inscal.motion import Site, motion_of, steps_of
from inscal.path import Path
from inscal.profile import profile_of
from inscal.recursion import observation_covariance
from inscal.schedule import Segment, turned, turning
from inscal.state_model import (
    NAVIGATION,
    OBSERVED_STATES,
    NoiseModel,
    StateModel,
    columns_of,
    navigation_dynamics,
    noise_of,
    parameter_dynamics,
)

RATES = 6
"""Rates of attitude and velocity error that constants make at rest."""


@dataclass(frozen=True)
class Believed:
    """What a filter believes of its augmented states.

    Attributes
    ----------
    sizes : Disturbance
    dwell_step, turn_step : float
        In which their effect is taken, s.
    """

    sizes: Disturbance
    dwell_step: float
    turn_step: float


@dataclass(frozen=True)
class Block:
    """A stretch of updates as one.

    Attributes
    ----------
    seen : ndarray, shape (9 + n, 9 + n)
        Upper triangular root of J: ``seen.T @ seen``.
    carried : ndarray, shape (9, 9 + n)
        F.
    noise : ndarray, shape (9, 9)
        Sigma.
    """

    seen: np.ndarray
    carried: np.ndarray
    noise: np.ndarray


class Builder:
    """Makes blocks at a site, for a noise and an update interval.

    Parameters
    ----------
    site : Site
    model : StateModel
    noise : NoiseModel
    update_interval : float
        s.
    believed : Believed, optional
        Needed for augmented states.

    Raises
    ------
    ValueError
        If the model has states that wander or drift.
    """

    def __init__(
        self,
        site: Site,
        model: StateModel,
        noise: NoiseModel,
        update_interval: float,
        believed: Believed | None = None,
    ):
        moving = [g for g, about in model.augmentations.items() if about.wanders or about.drifts]
        if moving:
            raise ValueError(f"{', '.join(moving)}: no block has them")
        self.site, self.model, self.interval = site, model, update_interval
        self._believed = believed
        self._dynamics = navigation_dynamics(site)
        self._phi = expm(self._dynamics * update_interval)
        self._noise = noise_of(self._dynamics, noise, update_interval)
        self._observation = observation_covariance(noise)

    def dwells(self, updates: int, wanted: Sequence[int]) -> dict[int, Block]:
        """Blocks of dwells of some numbers of updates, by these, up to `updates`."""
        return self._run([self._of_rates] * updates, set(wanted))

    @cached_property
    def _of_rates(self) -> np.ndarray:
        """What rates of error at rest do over an update interval, shape (9, 6)."""
        entering = np.zeros((NAVIGATION + RATES,) * 2)
        entering[:NAVIGATION, :NAVIGATION] = self._dynamics
        entering[range(RATES), range(NAVIGATION, NAVIGATION + RATES)] = 1.0
        return np.asarray(expm(entering * self.interval)[:NAVIGATION, NAVIGATION:])

    @property
    def initial(self) -> np.ndarray:
        """Standard deviations of the augmented states at the start, shape (a,)."""
        still = np.zeros(3)
        return self._augmented([Segment(0.0, self.interval, np.eye(3), still, still, -1)], 1)[1]

    def _augmented(self, parts: Sequence[Segment], updates: int) -> tuple[np.ndarray, np.ndarray]:
        """What augmented states do over each update of a stretch, (updates, 9, a), and sigmas."""
        if self._believed is None or not self.model.augmented:
            return np.zeros((updates, NAVIGATION, 0)), np.zeros(0)
        steps = steps_of(
            parts,
            updates,
            update_interval=self.interval,
            dwell_step=self._believed.dwell_step,
            turn_step=self._believed.turn_step,
        )
        path = Path(steps, motion_of(steps, self.site), self.site)
        made = augment(self.model, self._believed.sizes, path, self.interval)
        assert made is not None
        return made.transitions.navigation, made.transitions.std

    def rates(self, attitude: np.ndarray) -> np.ndarray:
        """Rates of error that one of each constant makes at rest, shape (6, n)."""
        still = np.zeros(3)
        rest = Segment(0.0, self.interval, attitude, still, still, -1)
        further = np.linalg.lstsq(self._of_rates, self._augmented([rest], 1)[0][0])[0]
        rate = attitude.T @ earth.earth_rate_ned(self.site.latitude)
        force = attitude.T @ -earth.gravity_ned(self.site.latitude, self.site.height)
        own = parameter_dynamics(attitude, rate, force)[:RATES][:, self.model.columns]
        return np.concatenate([own, further], axis=1)

    def turn(
        self, attitude: np.ndarray, vector: np.ndarray, rate: float, acceleration: float | None
    ) -> tuple[int, Block]:
        """Block of a turn, and how many updates it takes.

        Parameters
        ----------
        attitude : ndarray, shape (3, 3)
            Body to NED before it.
        vector : ndarray, shape (3,)
            Rotation vector in body axes, rad.
        rate, acceleration : float, float or None
            As of `inscal.schedule.Schedule`.

        Returns
        -------
        updates : int
            It ends with the last; what is left of the first the body rests.
        block : Block
        """
        angle = float(np.linalg.norm(vector))
        profile = profile_of(angle, rate, acceleration)
        updates = int(np.ceil(profile.duration / self.interval - 1e-9))
        end, start = updates * self.interval, updates * self.interval - profile.duration
        still = np.zeros(3)
        parts = [Segment(0.0, start, attitude, still, still, -1)] if start > 1e-9 else []
        whole = Segment(start, end, attitude, still, still, 0)
        parts += turning(whole, vector / angle, profile)
        columns, index = columns_of(parts, self.site, self._dynamics, self.interval, updates)
        own = columns[index][:, :, self.model.columns]
        # effects need to know where a turn ends
        rest = Segment(end, end + self.interval, turned(attitude, vector), still, still, -1)
        further = self._augmented([*parts, rest], updates + 1)[0][:updates]
        both = np.concatenate([own, further], axis=2)
        return updates, self._run(list(both), {updates})[updates]

    def _run(self, columns: Sequence[np.ndarray], wanted: set[int]) -> dict[int, Block]:
        n = columns[0].shape[1]
        carried = np.eye(NAVIGATION, NAVIGATION + n)
        covariance = np.zeros((NAVIGATION, NAVIGATION))
        seen: list[np.ndarray] = [np.zeros((0, NAVIGATION + n))]
        out = {}
        if 0 in wanted:
            out[0] = Block(np.zeros((NAVIGATION + n,) * 2), carried, covariance)
        for k, column in enumerate(columns, start=1):
            carried = self._phi @ carried
            carried[:, NAVIGATION:] += column
            covariance = self._phi @ covariance @ self._phi.T + self._noise
            root = np.linalg.cholesky(
                covariance[OBSERVED_STATES, OBSERVED_STATES] + self._observation
            )
            seen.append(np.linalg.solve(root, carried[OBSERVED_STATES]))
            # the gain, by the same root
            half = np.linalg.solve(root, covariance[OBSERVED_STATES])
            carried = carried - half.T @ seen[-1]
            covariance = covariance - half.T @ half
            if len(seen) > 8:
                seen = [_root(seen)]
            if k in wanted:
                seen = [_root(seen)]
                full = np.zeros((NAVIGATION + n,) * 2)
                full[: len(seen[0])] = seen[0]
                out[k] = Block(full, carried.copy(), 0.5 * (covariance + covariance.T))
        return out


def _root(rows: Sequence[np.ndarray]) -> np.ndarray:
    return np.asarray(np.linalg.qr(np.concatenate(rows), mode="r"))
