"""Truth: the simulated sensors, their noise and what a laboratory would record of them.

**Random numbers.** Every run owns four streams, named by the campaign's seed, the run's number and
a purpose, and by nothing else: no batch, worker or schedule enters. A run therefore meets the same
sensor, the same initial errors and the same standardised noise under every schedule and noise
level. Campaigns that share a seed are paired run by run (which is what a comparison wants), and the
runs of one campaign are independent of each other (which is what its own statistics want).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inscal.disturbance import NOTHING, Disturbance
from inscal.kernel import LANES, compiled, empty_aligned
from inscal.motion import Motion
from inscal.parameters import COUNT
from inscal.record import Record
from inscal.recursion import InitialStd
from inscal.sensor import inverse_matrices, sense
from inscal.state_model import NoiseModel

PURPOSES = {"truth": 0, "initial": 1, "sensors": 2, "observations": 3}
"""Streams of a run."""

_BLOCK = 64
"""Steps drawn for one lane before the next: few changes of stream, and all still in cache."""


@dataclass(frozen=True)
class TruthModel:
    """How the true parameters of a run are drawn.

    Attributes
    ----------
    distribution : str
        ``"fixed"`` (always `scale`), ``"normal"`` (zero mean, `scale` the sigma) or ``"uniform"``
        (between -`scale` and `scale`).
    scale : ndarray, shape (27,)
        In state order, SI.
    """

    distribution: str
    scale: np.ndarray

    @property
    def rms(self) -> np.ndarray:
        """Root mean square of the parameters, shape (27,), SI."""
        return self.scale / np.sqrt(3.0) if self.distribution == "uniform" else np.abs(self.scale)


@dataclass(frozen=True)
class Truth:
    """What the runs of a campaign meet, whatever an estimator believes.

    Attributes
    ----------
    parameters : TruthModel
        Distribution of the true parameters.
    noise : NoiseModel
        True noise of sensors and observations.
    initial : InitialStd
        True spread of the initial attitude, velocity and position errors; its parameter part is
        not used.
    disturbance : Disturbance
        What is beyond the filter's model; its noise factors multiply `noise`.
    """

    parameters: TruthModel
    noise: NoiseModel
    initial: InitialStd
    disturbance: Disturbance = NOTHING


def generator(seed: int, run: int, purpose: str) -> np.random.Generator:
    """Random stream of one run for one purpose.

    Parameters
    ----------
    seed : int
        The campaign's.
    run : int
    purpose : str
        Key of `PURPOSES`.

    Returns
    -------
    numpy.random.Generator
    """
    sequence = np.random.SeedSequence(seed, spawn_key=(run, PURPOSES[purpose]))
    return np.random.Generator(np.random.SFC64(sequence))


def draw_truth(model: TruthModel, seed: int, run: int) -> np.ndarray:
    """True parameters of a run.

    Returns
    -------
    ndarray, shape (27,)
        In state order, SI.

    Raises
    ------
    ValueError
        If the distribution is unknown.
    """
    rng = generator(seed, run, "truth")
    match model.distribution:
        case "fixed":
            return model.scale.copy()
        case "normal":
            return model.scale * rng.standard_normal(COUNT)
        case "uniform":
            return model.scale * rng.uniform(-1.0, 1.0, COUNT)
    raise ValueError(f"truth distribution {model.distribution!r}: fixed, normal or uniform")


@dataclass(frozen=True)
class Workspace:
    """Buffers of one tile of runs, kept from tile to tile: fresh memory costs more than it holds.

    Attributes
    ----------
    sensors : ndarray, shape (steps, 6, LANES)
    observations : ndarray, shape (updates, 6, LANES)
    """

    sensors: np.ndarray
    observations: np.ndarray

    @classmethod
    def of(cls, motion: Motion) -> "Workspace":
        """Buffers for a motion."""
        return cls(
            empty_aligned((motion.steps, 6, LANES)), empty_aligned((motion.updates, 6, LANES))
        )

    def fits(self, motion: Motion) -> bool:
        """Whether the buffers are of the size that a motion needs."""
        return (len(self.sensors), len(self.observations)) == (motion.steps, motion.updates)


def simulate(
    truth: np.ndarray,
    motion: Motion,
    noise: NoiseModel,
    initial: InitialStd,
    *,
    seed: int,
    runs: Sequence[int],
    workspace: Workspace,
) -> Record:
    """Record of `LANES` simulated calibrations.

    Parameters
    ----------
    truth : ndarray, shape (27, LANES)
        True parameters, SI.
    motion : Motion
    noise : NoiseModel
        True noise of sensors and observations.
    initial : InitialStd
        Standard deviations of the initial attitude, velocity and position errors.
    seed : int
        The campaign's.
    runs : sequence of int, length LANES
        Run numbers; they choose the random streams.
    workspace : Workspace
        The record's arrays; overwritten by the next call with it.

    Returns
    -------
    Record
    """
    errors = np.array([generator(seed, r, "initial").standard_normal(9) for r in runs]).T
    misalignment = Rotation.from_rotvec(-(initial.attitude[:, None] * errors[0:3]).T)
    nominal = Rotation.from_matrix(motion.initial_attitude)
    sensors, observations = workspace.sensors, workspace.observations
    _observe(
        tuple(generator(seed, r, "observations") for r in runs),
        np.repeat([noise.velocity, noise.position], 3),
        observations,
    )
    _sense(
        tuple(generator(seed, r, "sensors") for r in runs),
        np.repeat([noise.gyro, noise.accel], 3),
        truth,
        inverse_matrices(truth),
        motion.duration,
        motion.angle,
        motion.velocity,
        sensors,
    )
    return Record(
        sensors=sensors,
        observations=observations,
        attitude=np.moveaxis((misalignment * nominal).as_matrix(), 0, -1),
        velocity=initial.velocity * errors[3:6],
        position=initial.position * errors[6:9],
    )


@compiled
def _draw(rng, out, lane, steps):
    """Standard normals of one lane, in order of time, six in a step."""
    for s in range(steps):
        for c in range(6):
            out[s, c, lane] = rng.standard_normal()


@compiled
def _observe(generators, scale, out):
    """Observations: the true ones are zero, so noise of sigma `scale`, (steps, 6, LANES)."""
    block = np.empty((_BLOCK, 6, LANES))
    for first in range(0, len(out), _BLOCK):
        steps = min(_BLOCK, len(out) - first)
        for j in range(LANES):
            _draw(generators[j], block, j, steps)
        for s in range(steps):
            for c in range(6):
                for j in range(LANES):
                    out[first + s, c, j] = scale[c] * block[s, c, j]


@compiled
def _sense(generators, scale, truth, inverse, duration, angle, velocity, out):
    """Reported increments of all steps; noise has sigma `scale` times the root of the step.

    Parameters and noise live in arrays of fixed shape made here, so that the compiler knows that
    they overlap nothing and turns the lane loops into vector instructions.
    """
    p = np.empty((COUNT, LANES))
    g = np.empty((15, LANES))
    n = np.empty((6, LANES))
    block = np.empty((_BLOCK, 6, LANES))
    for j in range(LANES):
        for i in range(COUNT):
            p[i, j] = truth[i, j]
        for i in range(15):
            g[i, j] = inverse[i, j]
    for first in range(0, len(out), _BLOCK):
        steps = min(_BLOCK, len(out) - first)
        for j in range(LANES):
            _draw(generators[j], block, j, steps)
        for s in range(steps):
            dt = duration[first + s]
            root = np.sqrt(dt)
            da = (angle[first + s, 0], angle[first + s, 1], angle[first + s, 2])
            dv = (velocity[first + s, 0], velocity[first + s, 1], velocity[first + s, 2])
            for c in range(6):
                for j in range(LANES):
                    n[c, j] = root * scale[c] * block[s, c, j]
            for j in range(LANES):
                na, nv = (n[0, j], n[1, j], n[2, j]), (n[3, j], n[4, j], n[5, j])
                a, v = sense(p, g, j, da, dv, na, nv, dt)
                n[0, j], n[1, j], n[2, j] = a
                n[3, j], n[4, j], n[5, j] = v
            for c in range(6):
                for j in range(LANES):
                    out[first + s, c, j] = n[c, j]
