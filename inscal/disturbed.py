r"""Disturbances put into simulated records, of which `inscal.simulation` knows nothing.

Constants act through the rows of `inscal.unit_effects`, processes through `inscal.wander`. Both
are *apparent* increments a beside the true ones t: sensors that `sense` would report of t + a what
they now report of t, so that much is added to the record. (Of noise, the quadratic term then sees
the force without a: below 1e-10 of the noise.) Beside them:

- **Pulses.** A sensor counts whole pulses of its integral and carries the remainder (Savage,
  Strapdown Analytics, 2000, sec. 8.1.3): it has reported what it saw to within half a pulse.
- **Correlated observations.** Noise n of the same sigma becomes x_k = c x_{k-1} +
  sqrt(1 - c^2) n_k with c = exp(-interval / time), x_0 = n_0.
- **Noise factors** multiply the true noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inscal.disturbance import Disturbance, draw_constants
from inscal.kernel import LANES, compiled
from inscal.parameters import COUNT
from inscal.path import Path
from inscal.record import OBSERVED, Record
from inscal.sensor import inverse_matrices, sense
from inscal.state_model import NoiseModel
from inscal.unit_effects import DELAY_TERMS, delay_series, effect
from inscal.wander import add_process

_DELAY = "gyro_accel_delay"


def true_noise(believed: NoiseModel, disturbance: Disturbance) -> NoiseModel:
    """Noise where a filter believes in `believed`."""
    return replace(
        believed,
        gyro=disturbance.gyro_noise_factor * believed.gyro,
        accel=disturbance.accel_noise_factor * believed.accel,
        velocity=disturbance.velocity_noise_factor * believed.velocity,
        position=disturbance.position_noise_factor * believed.position,
    )


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
        Effects on apparent increments of the constants, source by source, rad and m/s.
    observed : ndarray, shape (OBSERVED, n)
        Their effects on observations, m/s and m.
    """

    disturbance: Disturbance
    path: Path
    interval: float
    rows: np.ndarray
    observed: np.ndarray

    def put_into(
        self, record: Record, truth: np.ndarray, *, seed: int, runs: Sequence[int]
    ) -> None:
        """Disturb the record of `LANES` runs, in place.

        Parameters
        ----------
        record : Record
        truth : ndarray, shape (27, LANES)
            True parameters, SI.
        seed : int
            The campaign's.
        runs : sequence of int, length LANES
        """
        about, motion = self.disturbance, self.path.motion
        constants = self.constants(seed, runs)
        if self.alters_sensors:
            apparent = self.apparent(constants, seed=seed, runs=runs)
            inverse = inverse_matrices(truth)
            nominal = motion.duration, motion.angle, motion.velocity
            _report(truth, inverse, *nominal, apparent, record.sensors)
        for first, pulse in ((0, about.gyro_quantisation), (3, about.accel_quantisation)):
            if pulse > 0.0:
                _count(record.sensors, first, pulse)
        if about.observation_correlation_time > 0.0:
            _correlate(
                record.observations, np.exp(-self.interval / about.observation_correlation_time)
            )
        if self.observed.any():
            seen = record.observations
            seen += self.observed @ constants

    @cached_property
    def alters_sensors(self) -> bool:
        """Whether there are apparent increments at all."""
        about = self.disturbance
        return bool(self.rows.any() or about.processes)

    def constants(self, seed: int, runs: Sequence[int]) -> np.ndarray:
        """What the rows are multiplied with in some runs, shape (n, runs)."""
        drawn = [
            _powers(constants) if source == _DELAY else constants
            for source in _linear(self.disturbance)
            for constants in [self._drawn(source, seed, runs)]
        ]
        return np.concatenate([np.empty((0, len(runs))), *drawn])

    def apparent(self, constants: np.ndarray, *, seed: int, runs: Sequence[int]) -> np.ndarray:
        """Apparent increments of `LANES` runs, rad and m/s, shape (steps, 6, LANES)."""
        motion = self.path.motion
        out = np.zeros((motion.steps, 6, LANES))
        _combine(self.rows, constants, out)
        for source in self.disturbance.processes:
            add_process(out, self.disturbance, source, motion.duration, seed=seed, runs=runs)
        return out

    def _drawn(self, source: str, seed: int, runs: Sequence[int]) -> np.ndarray:
        return draw_constants(self.disturbance, source, self.path.turns, seed=seed, runs=runs)


def disturb(disturbance: Disturbance, path: Path, update_interval: float) -> Disturbed | None:
    """Prepare disturbances for a path.

    Parameters
    ----------
    disturbance : Disturbance
    path : Path
    update_interval : float
        s.

    Returns
    -------
    Disturbed or None
        None where nothing is disturbed.
    """
    if disturbance.absent:
        return None
    rows, observed = [np.zeros((0, path.motion.steps, 6))], [np.zeros((0, OBSERVED))]
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
    return disturbance.constants


def _powers(delay: np.ndarray) -> np.ndarray:
    """Powers of delays, shape (1, lanes), then of the amounts of negative ones."""
    late, early = np.maximum(delay[0], 0.0), np.maximum(-delay[0], 0.0)
    return np.array([side**n for side in (late, early) for n in range(1, DELAY_TERMS + 1)])


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
def _report(truth, inverse, duration, angle, velocity, apparent, out):
    """Add to reported increments what sensors without noise report of apparent ones."""
    p = np.empty((COUNT, LANES))
    g = np.empty((15, LANES))
    for j in range(LANES):
        for i in range(COUNT):
            p[i, j] = truth[i, j]
        for i in range(15):
            g[i, j] = inverse[i, j]
    nil = (0.0, 0.0, 0.0)
    for s in range(len(out)):
        dt = duration[s]
        da = (angle[s, 0], angle[s, 1], angle[s, 2])
        dv = (velocity[s, 0], velocity[s, 1], velocity[s, 2])
        x = apparent[s]
        for j in range(LANES):
            a, v = sense(p, g, j, da, dv, nil, nil, dt)
            more = (da[0] + x[0, j], da[1] + x[1, j], da[2] + x[2, j])
            faster = (dv[0] + x[3, j], dv[1] + x[4, j], dv[2] + x[5, j])
            b, u = sense(p, g, j, more, faster, nil, nil, dt)
            for c in range(3):
                out[s, c, j] += b[c] - a[c]
                out[s, 3 + c, j] += u[c] - v[c]


@compiled
def _count(sensors, first, pulse):
    per_pulse = 1.0 / pulse
    for c in range(first, first + 3):
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
                before = kept * observations[k - 1, c, j]
                observations[k, c, j] = before + new * observations[k, c, j]
