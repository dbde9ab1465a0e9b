r"""Disturbances put into simulated records: what `inscal.simulation.simulate` does beyond the model.

Constants act through the rows of `inscal.unit_effects`, processes through `inscal.wander`; both
add up to *apparent* increments beside the true ones, and the sensors report the sum. The rest:

- **Turn rate** off by a share r. A turn of rate (1 + r) w still ends in time, so it starts later by
  r / (1 + r) of its duration; its increments are exact, those of a rest and of a steady turn.
- **Pulses.** A sensor counts whole pulses of its integral and carries the remainder (Savage,
  Strapdown Analytics, 2000, sec. 8.1.3): what it has reported is within half a pulse of what it saw.
- **Correlated observations.** Noise n of the same sigma becomes x_k = c x_{k-1} +
  sqrt(1 - c^2) n_k with c = exp(-interval / time), x_0 = n_0.
- **Noise factors** multiply the true noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from inscal.disturbance import Disturbance, draw_constants
from inscal.kernel import LANES, compiled
from inscal.motion import Motion, Site, cut_into_steps
from inscal.path import Path
from inscal.record import OBSERVED
from inscal.rotation import mean_rotation
from inscal.schedule import Schedule
from inscal.state_model import NoiseModel
from inscal.unit_effects import DELAY_TERMS, delay_series, effect
from inscal.wander import add_process

_DELAY = "gyro_accel_delay"
_TURN_RATE = "turn_rate"


@dataclass(frozen=True)
class Disturbed:
    """Disturbances of a path, prepared for all runs on it.

    Attributes
    ----------
    disturbance : Disturbance
    path : Path
    interval : float
        Between observations, s.
    rows : ndarray, shape (steps, 6, n)
        Effects on apparent increments of the constants, source by source.
    observed : ndarray, shape (OBSERVED, n)
        Their effects on observations.
    """

    disturbance: Disturbance
    path: Path
    interval: float
    rows: np.ndarray
    observed: np.ndarray

    @property
    def turns(self) -> int:
        """Number of turns."""
        return int(self.path.turn_of.max()) + 1

    @property
    def alters_sensors(self) -> bool:
        """Whether increments are other than those of the model with some white noise."""
        about = self.disturbance
        return bool(self.rows.any() or about.processes or about.turn_rate)

    def noise(self, believed: NoiseModel) -> NoiseModel:
        """True noise where the noise model gives `believed`."""
        about = self.disturbance
        return replace(
            believed,
            gyro=about.gyro_noise_factor * believed.gyro,
            accel=about.accel_noise_factor * believed.accel,
            velocity=about.velocity_noise_factor * believed.velocity,
            position=about.position_noise_factor * believed.position,
        )

    def constants(self, seed: int, runs: Sequence[int]) -> np.ndarray:
        """What the rows are multiplied with, shape (n, LANES)."""
        drawn = [
            _powers(constants) if source == _DELAY else constants
            for source in _linear(self.disturbance)
            for constants in [self._drawn(source, seed, runs)]
        ]
        return np.concatenate([np.empty((0, len(runs))), *drawn])

    def increments(
        self, seed: int, runs: Sequence[int], constants: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """True and apparent increments of `LANES` runs, each of shape (steps, 6, LANES)."""
        motion = self.path.motion
        nominal = np.concatenate([motion.angle, motion.velocity], axis=1)
        true = np.repeat(nominal[:, :, None], LANES, axis=2)
        apparent = np.zeros_like(true)
        _combine(self.rows, constants, apparent)
        for source in self.disturbance.processes:
            add_process(
                apparent, self.disturbance, source, motion.duration, seed=seed, runs=runs
            )
        if self.disturbance.turn_rate > 0.0:
            for lane, [share] in enumerate(self._drawn(_TURN_RATE, seed, runs).T):
                turn_at_rate(self.path, share, true[:, :, lane])
        return true, apparent

    def observe(self, observations: np.ndarray, constants: np.ndarray) -> None:
        """Disturb observations, (updates, 6, LANES), in place."""
        time = self.disturbance.observation_correlation_time
        if time > 0.0:
            _correlate(observations, np.exp(-self.interval / time))
        for row, constant in zip(self.observed.T, constants, strict=True):
            if row.any():
                observations += row[:, None] * constant

    def count_pulses(self, sensors: np.ndarray) -> None:
        """Make sensors report whole pulses, (steps, 6, LANES), in place."""
        about = self.disturbance
        for part, pulse in ((0, about.gyro_quantisation), (3, about.accel_quantisation)):
            if pulse > 0.0:
                _count(sensors, part, pulse)

    def _drawn(self, source: str, seed: int, runs: Sequence[int]) -> np.ndarray:
        return draw_constants(self.disturbance, source, self.turns, seed=seed, runs=runs)


def disturb(
    disturbance: Disturbance,
    schedule: Schedule,
    site: Site,
    motion: Motion,
    *,
    update_interval: float,
    dwell_step: float,
    turn_step: float,
) -> Disturbed | None:
    """Prepare disturbances for a path.

    Parameters
    ----------
    disturbance : Disturbance
    schedule : Schedule
    site : Site
    motion : Motion
        Of the schedule, at the site, in the same steps.
    update_interval, dwell_step, turn_step : float
        s.

    Returns
    -------
    Disturbed or None
        None where nothing is disturbed.
    """
    if disturbance.absent:
        return None
    steps = cut_into_steps(
        schedule, update_interval=update_interval, dwell_step=dwell_step, turn_step=turn_step
    )
    path = Path(steps, motion, site)
    rows, observed = [np.zeros((0, motion.steps, 6))], [np.zeros((0, OBSERVED))]
    for source in _linear(disturbance):
        if source == _DELAY:
            rows.append(delay_series(path))
            observed.append(np.zeros((2 * DELAY_TERMS, OBSERVED)))
        else:
            unit = effect(path, disturbance, source)
            rows.append(unit.increments)
            observed.append(unit.observations)
    return Disturbed(
        disturbance,
        path,
        update_interval,
        np.ascontiguousarray(np.moveaxis(np.concatenate(rows), 0, 2)),
        np.concatenate(observed).T,
    )


def _linear(disturbance: Disturbance) -> list[str]:
    return [source for source in disturbance.constants if source != _TURN_RATE]


def _powers(delay: np.ndarray) -> np.ndarray:
    """Powers of delays, shape (1, lanes), then of the amounts of negative ones."""
    late, early = np.maximum(delay[0], 0.0), np.maximum(-delay[0], 0.0)
    return np.array([side**n for side in (late, early) for n in range(1, DELAY_TERMS + 1)])


def turn_at_rate(path: Path, share: float, true: np.ndarray) -> None:
    """Increments of turns that are faster by a share and end in time.

    Parameters
    ----------
    path : Path
    share : float
        Above -1. A turn too slow for its position takes all of it.
    true : ndarray, shape (steps, 6)
        Changed in place.
    """
    edges, steps = path.edges, path.steps
    for turn in range(int(path.turn_of.max()) + 1):
        own = np.flatnonzero(path.turn_of == turn)
        first = int(np.searchsorted(steps.segment, max(steps.segment[own[0]] - 1, 0)))
        earliest, planned, end = edges[first], edges[own[0]], edges[own[-1] + 1]
        duration = end - planned
        start = max(end - duration / max(1.0 + share, 1e-3), earliest)
        rate = steps.rate[own[0]] * (duration / (end - start))
        first = max(int(np.searchsorted(edges, min(start, planned), side="right")) - 1, first)
        window = slice(first, own[-1] + 1)
        a, b = edges[window], edges[1:][window]
        begin = np.clip(start, a, b)
        rest, moving = begin - a, b - begin
        turned = np.maximum(begin - start, 0.0)[:, None] * rate
        at_rest = steps.attitude[own[0]]
        attitude = at_rest @ Rotation.from_rotvec(turned).as_matrix()
        to_body = rest[:, None, None] * at_rest.T
        to_body = to_body + moving[:, None, None] * (
            mean_rotation(-moving[:, None] * rate) @ attitude.mT
        )
        true[window, :3] = moving[:, None] * rate + to_body @ path.earth_rate
        true[window, 3:] = to_body @ -path.gravity


@compiled
def _combine(rows, constants, out):
    """Add rows times constants, lane by lane in one order."""
    total = np.empty(LANES)
    for s in range(len(rows)):
        for c in range(6):
            for j in range(LANES):
                total[j] = out[s, c, j]
            for n in range(rows.shape[2]):
                row = rows[s, c, n]
                if row != 0.0:
                    for j in range(LANES):
                        total[j] += row * constants[n, j]
            for j in range(LANES):
                out[s, c, j] = total[j]


@compiled
def _count(sensors, part, pulse):
    per_pulse = 1.0 / pulse
    for c in range(part, part + 3):
        remainder = np.zeros(LANES)
        for s in range(len(sensors)):
            for j in range(LANES):
                seen = remainder[j] + sensors[s, c, j]
                reported = pulse * np.floor(seen * per_pulse + 0.5)
                remainder[j] = seen - reported
                sensors[s, c, j] = reported


@compiled
def _correlate(observations, kept):
    new = np.sqrt(1.0 - kept * kept)
    for k in range(1, len(observations)):
        for c in range(6):
            for j in range(LANES):
                observations[k, c, j] = kept * observations[k - 1, c, j] + new * observations[k, c, j]
