"""What a configuration means in SI: everything the library is handed, made once and passed down.

The library's modules are imported where they are used: numba and scipy take half a second, and
many stages need no more than units and bounds.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inscal import parameters, units
from pipeline.config.disturbance import key_of, size_of, sizes_of, unit_text
from pipeline.config.schema import Config, KindValues
from pipeline.console.errors import ConfigError
from pipeline.console.progress import note

if TYPE_CHECKING:
    from inscal.augmentation import Augmented
    from inscal.disturbance import Disturbance
    from inscal.estimator import Belief
    from inscal.experiment import Experiment
    from inscal.motion import Site
    from inscal.recursion import Gains, InitialStd
    from inscal.schedule import Schedule
    from inscal.simulation import TruthModel
    from inscal.state_model import NoiseModel, StateModel, Transitions


_EXCESS = 0.25  # of the mean NEES: what a campaign of 2 000 runs can just tell


@dataclass(frozen=True)
class Setup:
    """A configuration and what it means; every part is made when it is first asked for.

    Attributes
    ----------
    config : Config
    """

    config: Config

    @cached_property
    def quadratic_unit(self) -> float:
        """Size of 1e-9 of quadratic coefficient, s^2/m."""
        if self.config.sensor.quadratic_unit == "si":
            return units.QUADRATIC_SI_FACE_VALUE
        return units.quadratic_unit(self.config.sensor.accel_pulses_per_m_per_s)

    @cached_property
    def unit(self) -> NDArray[np.float64]:
        """Size in SI of the paper unit of each parameter, shape (27,)."""
        return parameters.si_units(self.quadratic_unit)

    @cached_property
    def bound(self) -> NDArray[np.float64]:
        """Accuracy bounds in paper units, shape (27,)."""
        return parameter_vector(self.config.bounds)

    @cached_property
    def schedule(self) -> Schedule:
        """Schedule of the table."""
        from inscal import schedule

        about = self.config.schedule
        acceleration = about.turn_acceleration_deg_per_s2
        x, y, z = about.initial_posture
        return schedule.Schedule(
            initial_posture=(x, y, z),
            turns=schedule.turns_of(about.rotations),
            position_duration=about.position_duration_s,
            turn_rate=about.turn_rate_deg_per_s * units.DEGREE,
            turn_acceleration=None if acceleration is None else acceleration * units.DEGREE,
            last_duration=about.last_position_duration_s,
        )

    @cached_property
    def site(self) -> Site:
        """Where the table stands."""
        from inscal.motion import Site

        return Site(self.config.site.latitude_deg * units.DEGREE, self.config.site.height_m)

    @cached_property
    def noise(self) -> NoiseModel:
        """Noise of sensors and observations that the group `noise` says; of the truth."""
        from inscal.state_model import NoiseModel

        about = self.config.noise
        return NoiseModel(
            gyro=about.gyro_angle_random_walk_deg_per_sqrt_h * units.DEG_PER_SQRT_HOUR,
            accel=about.accel_white_noise_ug_per_sqrt_hz * units.MICRO_G,
            velocity=about.velocity_observation_m_per_s,
            position=about.position_observation_m,
        )

    @cached_property
    def believed(self) -> Disturbance:
        """What the filter believes of disturbances."""
        return sizes_of(self.config.estimator.believed)

    @cached_property
    def believed_noise(self) -> NoiseModel:
        """Noise that the filter takes for true."""
        from inscal.disturbed import true_noise

        return true_noise(self.noise, self.believed)

    @cached_property
    def prior(self) -> InitialStd:
        """Standard deviations that the filter starts from."""
        from inscal.recursion import InitialStd

        about = self.config.estimator.initial_std
        return InitialStd(
            attitude=np.array(about.attitude_deg) * units.DEGREE,
            velocity=about.velocity_m_per_s,
            position=about.position_m,
            parameter=parameter_vector(about) * self.unit,
        )

    @cached_property
    def truth(self) -> TruthModel:
        """Distribution of the true parameters."""
        from inscal.simulation import TruthModel

        about = self.config.truth
        return TruthModel(about.distribution, parameter_vector(about) * self.unit)

    @cached_property
    def model(self) -> StateModel:
        """States of the filter."""
        from inscal.state_model import StateModel

        return StateModel(tuple(self.config.estimator.states))

    @cached_property
    def augmented(self) -> Augmented | None:
        """Augmented states of the filter."""
        if not self.model.augmented:
            return None
        from inscal.augmentation import augment
        from inscal.path import path_of

        interval, about = self.config.estimator.update_interval_s, self.config.simulation
        path = path_of(
            self.schedule,
            self.site,
            update_interval=interval,
            dwell_step=about.dwell_step_s,
            turn_step=about.turn_step_s,
        )
        return augment(self.model, self.believed, path, interval)

    @cached_property
    def augmented_unit(self) -> NDArray[np.float64]:
        """Paper units in SI of the augmented states that do not wander."""
        return np.array([size_of(key)[1] for _, key in self._augmented_keys])

    @cached_property
    def augmented_names(self) -> list[str]:
        """Names of the augmented states that do not wander."""
        return [name for name, _ in self._augmented_keys]

    @cached_property
    def augmented_units(self) -> list[str]:
        """Names of these units."""
        return [unit_text(key) for _, key in self._augmented_keys]

    @property
    def _augmented_keys(self) -> list[tuple[str, str]]:
        groups = [g for g in self.model.augmentations.values() if not g.wanders]
        return [(name, key_of(group.source)) for group in groups for name in group.names]

    @cached_property
    def transitions(self) -> Transitions:
        """Linear model between updates."""
        from inscal.state_model import build_transitions

        plain = build_transitions(
            self.schedule,
            self.site,
            self.model,
            self.believed_noise,
            update_interval=self.config.estimator.update_interval_s,
        )
        about = self.augmented
        return replace(plain, augmented=about.transitions) if about else plain

    @cached_property
    def gains(self) -> Gains:
        """Gains and covariance of a first pass."""
        from inscal.recursion import compute_gains, refuse_degenerate

        with _told():
            gains = compute_gains(self.transitions, self.model, self.believed_noise, self.prior)
            refuse_degenerate(gains, self.model)
        return gains

    @cached_property
    def belief(self) -> Belief:
        """What the filter takes for true, and how it goes about a record."""
        from inscal.estimator import Belief

        about = self.config.estimator
        return Belief(
            self.believed_noise,
            self.prior,
            passes=about.passes,
            update_interval=about.update_interval_s,
            model=self.model,
            augmented=self.believed,
            max_passes=about.max_passes,
            convergence_sigma=about.convergence_sigma,
            innovation_limit=about.innovation_limit,
        )

    @cached_property
    def experiment(self) -> Experiment:
        """All that the runs of a campaign share."""
        from inscal.experiment import prepare
        from inscal.kernel import is_compiled
        from inscal.simulation import Truth

        if not is_compiled("closed_loop"):
            note("compiling the kernels, once: some ten seconds")
        with _told():
            return prepare(
                self.config.campaign.seed,
                self.schedule,
                self.site,
                Truth(self.truth, self.noise, self.prior, sizes_of(self.config.disturbance)),
                self.belief,
                dwell_step=self.config.simulation.dwell_step_s,
                turn_step=self.config.simulation.turn_step_s,
            )

    @cached_property
    def linearisation(self) -> list[str]:
        """Line to see before a campaign whose errors are too large for its noise."""
        from inscal.convergence import expected_excess

        excess = expected_excess(self.experiment.estimator, self.truth.rms)
        if excess < _EXCESS:
            return []
        return [
            "warning: truth, noise: sigma is claimed for sensors without errors; with errors so "
            f"large and noise so small the mean NEES will be too large by {excess:.1f} or more"
        ]

    @cached_property
    def warnings(self) -> list[str]:
        """Lines to see before a campaign: pairs of parameters that the schedule cannot separate."""
        from inscal import schedule

        return [
            f"warning: schedule.rotations never shows {direction}: {a} and {b} cannot be told apart"
            for a, b, direction in schedule.weak_pairs(self.schedule)
        ]


@contextmanager
def _told() -> Iterator[None]:
    """Make a line for the user of what the library says of numbers that are right one by one."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    except ValueError as error:
        raise ConfigError(f"estimator.initial_std, noise: {error}") from None


def parameter_vector(values: KindValues) -> NDArray[np.float64]:
    """Values of a configuration group in state order, shape (27,), in paper units."""
    return parameters.vector(values.by_kind())
