"""Tables for a search: by what the filter believes, and by what truth has beyond that."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inscal.blocks import Believed, Builder
from inscal.design import Tables, considered, covariance, tables
from inscal.disturbance import Disturbance
from inscal.disturbed import true_noise
from inscal.parameters import AUGMENTATIONS
from inscal.schedule import initial_attitude, turns_of
from inscal.state_model import NoiseModel, StateModel
from inscal.wander import white_like
from pipeline.config.disturbance import sizes_of
from pipeline.config.load import disturbances, resolved
from pipeline.config.setup import Setup

_POSTURES = 96  # all that turns of 90 degrees and one of 45 lead to
_MOVING = [name for name, group in AUGMENTATIONS.items() if group.wanders or group.drifts]


@dataclass(frozen=True)
class Scene:
    """What a path is judged in.

    Attributes
    ----------
    tables : Tables
    others : tuple of int
        Places of constants that the filter knows nothing of.
    names : list of str
        Their groups.
    """

    tables: Tables
    others: tuple[int, ...] = ()
    names: Sequence[str] = ()

    def covariance(self, moves: np.ndarray, rests: np.ndarray) -> np.ndarray:
        """True covariance of the filter's constants at the end of a path, per prior sigma."""
        found = covariance(self.tables, moves, rests)
        if not self.others:
            return found
        states = np.setdiff1d(np.arange(len(found)), self.others)
        return considered(np.ascontiguousarray(found), states, np.array(self.others))


def left_out(setup: Setup) -> list[str]:
    """State groups that move in time, which tables have as white noise or not at all."""
    return [name for name in setup.model.augmentations if name in _MOVING]


def _at_rest(setup: Setup) -> tuple[str, ...]:
    """State groups that do not move."""
    return tuple(name for name in setup.model.groups if name not in _MOVING)


def believed(setup: Setup, longest: int) -> Scene:
    """Scene of the filter's own belief.

    Parameters
    ----------
    setup : Setup
    longest : int
        Updates of the longest dwell.

    Returns
    -------
    Scene
    """
    unmodelled = {name: 0.0 for name in _MOVING if name not in setup.model.groups}
    about = replace(setup.believed, **unmodelled)
    noise = _with_slow(setup.believed_noise, about, setup)
    return Scene(_tables(setup, StateModel(_at_rest(setup)), noise, about, longest))


def disturbed(setup: Setup, longest: int) -> Scene | None:
    """Scene with the disturbances of the configuration; None if there are none.

    What moves in time is white noise of the same Allan deviation at the mean time of a position;
    drifts are not in it, nor what is about table and building.
    """
    truth = sizes_of(setup.config.disturbance)
    if not disturbances(resolved(setup.config)):
        return None
    sources = {
        name: group.source
        for name, group in AUGMENTATIONS.items()
        if name not in [*_MOVING, *setup.model.groups] and getattr(truth, group.source) > 0.0
    }
    model = StateModel((*_at_rest(setup), *sources))
    noise = true_noise(setup.noise, truth)
    sizes = {source: getattr(truth, source) for source in sources.values()}
    about = replace(setup.believed, **sizes)
    made = _tables(setup, model, _with_slow(noise, truth, setup), about, longest)
    members = [name for name, group in model.augmentations.items() for _ in group.names]
    first = len(model.columns)
    others = tuple(first + k for k, name in enumerate(members) if name in sources)
    return Scene(made, others, list(sources))


def _with_slow(noise: NoiseModel, about: Disturbance, setup: Setup) -> NoiseModel:
    """Noise with what moves slowly added as white noise."""
    design = setup.config.design
    time = design.total_time_s / design.positions
    return replace(
        noise,
        gyro=float(np.hypot(noise.gyro, white_like(about, "gyro", time))),
        accel=float(np.hypot(noise.accel, white_like(about, "accel", time))),
    )


def _tables(
    setup: Setup, model: StateModel, noise: NoiseModel, about: Disturbance, longest: int
) -> Tables:
    config = setup.config
    sizes = Believed(about, config.simulation.dwell_step_s, config.simulation.turn_step_s)
    interval, design = config.estimator.update_interval_s, config.design
    return tables(
        Builder(setup.site, model, noise, interval, sizes),
        setup.prior,
        initial_attitude(config.schedule.initial_posture),
        turns_of((angle, axis) for axis in design.axes for angle in design.angles_deg),
        rate=setup.schedule.turn_rate,
        acceleration=setup.schedule.turn_acceleration,
        longest=longest,
        most_postures=_POSTURES,
    )
