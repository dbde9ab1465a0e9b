"""Typed configuration: schema, loading from ``conf/`` with Hydra, and the runner of a stage.

Every number a user would change is in ``conf/``, in the unit its key ends with. A configuration
that cannot be used is a `ConfigError` with one line that says which key is wrong and why.
"""

import functools
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import hydra
import yaml
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from pipeline import interrupts
from pipeline.checks import KIND_KEYS, ConfigError, check, one_line
from pipeline.config_groups import Cluster, Effects, Laboratory
from pipeline.help import CONF, help_text, is_asked

_VERSION_BASE = "1.3"

# Hydra lets plain ValueErrors out (noise=null), and OmegaConf integers too large for a float.
_COMPOSE_ERRORS = (
    HydraException,
    OmegaConfBaseException,
    yaml.YAMLError,
    ValueError,
    OverflowError,
)


class DataError(Exception):
    """Files a stage cannot use; the message is one line for the user."""


@dataclass
class KindValues:
    """One entry per parameter kind, in its paper unit.

    Attributes
    ----------
    gyro_bias_deg_per_h, accel_bias_ug, gyro_scale_factor_ppm, gyro_installation_arcsec, \
accel_scale_factor_ppm, accel_installation_arcsec, accel_quadratic_1e_9, lever_arm_mm : \
float or list of float
        A number for all parameters of the kind, or one for each of them in state order.
    """

    # OmegaConf has no type for "number or list": the value checks see to it.
    gyro_bias_deg_per_h: Any = MISSING
    accel_bias_ug: Any = MISSING
    gyro_scale_factor_ppm: Any = MISSING
    gyro_installation_arcsec: Any = MISSING
    accel_scale_factor_ppm: Any = MISSING
    accel_installation_arcsec: Any = MISSING
    accel_quadratic_1e_9: Any = MISSING
    lever_arm_mm: Any = MISSING

    def by_kind(self) -> dict[str, float | list[float]]:
        """Values keyed by parameter kind, as `inscal.parameters.vector` takes them."""
        return {kind: getattr(self, key) for kind, key in KIND_KEYS.items()}


@dataclass
class Truth(KindValues):
    """Sensor errors of the simulated runs.

    Attributes
    ----------
    distribution : str
        ``fixed``: the values themselves; ``normal``: zero mean, the values as sigma; ``uniform``:
        between minus and plus the values.
    """

    distribution: str = MISSING


@dataclass
class Noise:
    """Noise of sensors and observations, simulated and assumed by the filter.

    Attributes
    ----------
    name : str
        Name of this choice, part of the store's path.
    gyro_angle_random_walk_deg_per_sqrt_h, accel_white_noise_ug_per_sqrt_hz : float
        White noise of the sensors; 0 is allowed.
    velocity_observation_m_per_s, position_observation_m : float
        Standard deviation of each observation.
    """

    name: str = MISSING
    gyro_angle_random_walk_deg_per_sqrt_h: float = MISSING
    accel_white_noise_ug_per_sqrt_hz: float = MISSING
    velocity_observation_m_per_s: float = MISSING
    position_observation_m: float = MISSING


@dataclass
class Schedule:
    """Turntable schedule.

    Attributes
    ----------
    name : str
        Name of this choice, part of the store's path.
    position_duration_s : float
        Time of a position: its dwell and then its turn.
    turn_rate_deg_per_s : float
        Rate of the turns.
    initial_posture : list of str
        Where the body axes x, y, z point at first: North, South, East, West, Up or Down.
    rotations : list of [float, str]
        Angle in degrees and body axis (X, Y or Z) of each turn.
    """

    name: str = MISSING
    position_duration_s: float = MISSING
    turn_rate_deg_per_s: float = MISSING
    initial_posture: list[str] = MISSING
    rotations: list[Any] = MISSING


@dataclass
class Site:
    """Where the turntable stands: geodetic latitude and height above the ellipsoid."""

    latitude_deg: float = MISSING
    height_m: float = MISSING


@dataclass
class Simulation:
    """Sampling of the simulated sensors: longest increment at rest and during turns."""

    dwell_step_s: float = MISSING
    turn_step_s: float = MISSING


@dataclass
class InitialStd(KindValues):
    """Standard deviations the filter starts from; those of attitude are North, East, Down."""

    attitude_deg: list[float] = MISSING
    velocity_m_per_s: float = MISSING
    position_m: float = MISSING


@dataclass
class Estimator:
    """The Kalman filter.

    Attributes
    ----------
    passes : int
        How often it goes over the same data.
    update_interval_s : float
        Time between observations.
    states : list of str
        Parameter groups it estimates, keys of `inscal.parameters.GROUPS`.
    initial_std : InitialStd
        Standard deviations it starts from.
    """

    passes: int = MISSING
    update_interval_s: float = MISSING
    states: list[str] = MISSING
    initial_std: InitialStd = field(default_factory=InitialStd)


@dataclass
class Sensor:
    """What one unit of quadratic coefficient is.

    Attributes
    ----------
    quadratic_unit : str
        ``pulse`` (on pulse rates) or ``si`` (face value).
    accel_pulses_per_m_per_s : float
        Accelerometer scale factor.
    """

    quadratic_unit: str = MISSING
    accel_pulses_per_m_per_s: float = MISSING


@dataclass
class Campaign:
    """A campaign of runs.

    Attributes
    ----------
    runs : int
        Number of simulated calibrations.
    seed : int
        Seed of all random draws.
    batch : int
        Most runs computed together.
    store : str
        Path of the run store.
    replace : bool
        Whether a store of another configuration in the way may be deleted.
    precision : float or None
        Relative half-width of all RMSE intervals at which to stop before `runs`.
    """

    runs: int = MISSING
    seed: int = MISSING
    batch: int = MISSING
    store: str = MISSING
    replace: bool = MISSING
    precision: float | None = None


@dataclass
class Bounds(KindValues):
    """Accuracy bounds the errors are judged by."""


@dataclass
class Config:
    """The whole configuration.

    Attributes
    ----------
    truth, noise, schedule, site, simulation, estimator, sensor, campaign, cluster, bounds, \
effects, laboratory : object
        The groups of ``conf/``.
    only_run : int or None
        The one run to compute.
    out : str or None
        File a stage writes its result to.
    a, b : str or None
        Stores to compare.
    campaigns : list of str or None
        Stores to report on, the main one first.
    accept : str or None
        Why the gate's new baseline is accepted.
    """

    truth: Truth = field(default_factory=Truth)
    noise: Noise = field(default_factory=Noise)
    schedule: Schedule = field(default_factory=Schedule)
    site: Site = field(default_factory=Site)
    simulation: Simulation = field(default_factory=Simulation)
    estimator: Estimator = field(default_factory=Estimator)
    sensor: Sensor = field(default_factory=Sensor)
    campaign: Campaign = field(default_factory=Campaign)
    cluster: Cluster = field(default_factory=Cluster)
    bounds: Bounds = field(default_factory=Bounds)
    effects: Effects = field(default_factory=Effects)
    laboratory: Laboratory = field(default_factory=Laboratory)
    only_run: int | None = None
    out: str | None = None
    a: str | None = None
    b: str | None = None
    campaigns: list[str] | None = None
    accept: str | None = None


ConfigStore.instance().store(name="schema", node=Config)

_CLASSES = (
    *(Config, Truth, Noise, Schedule, Site, Simulation, Estimator, InitialStd),
    *(Sensor, Campaign, Cluster, Bounds, Effects, Laboratory),
)
_ALLOWED_KEYS = {cls.__name__: [f.name for f in fields(cls)] for cls in _CLASSES}


def load(overrides: Sequence[str] = ()) -> Config:
    """Load the configuration with Hydra, as a stage would with these arguments.

    Parameters
    ----------
    overrides : sequence of str
        Hydra overrides such as ``noise=quiet`` or ``campaign.runs=20``.

    Returns
    -------
    Config
        The checked configuration, numbers and lists only.

    Raises
    ------
    ConfigError
        If it cannot be used; the message is one line.
    """
    running = GlobalHydra.instance().hydra  # of a stage this may be called from
    GlobalHydra.instance().clear()
    try:
        with hydra.initialize_config_dir(str(CONF), version_base=_VERSION_BASE):
            composed = hydra.compose("config", overrides=list(overrides))
    except _COMPOSE_ERRORS as error:
        raise ConfigError(one_line(error, overrides, _ALLOWED_KEYS)) from error
    finally:
        GlobalHydra.instance().hydra = running
    return _typed(composed, overrides)


def stage(main: Callable[[Config], None]) -> Callable[[], None]:
    """Make a stage's main function a Hydra program, for ``python -m pipeline.<stage>``.

    The program ends with exit code 2 and one line on stderr after a `ConfigError` or `DataError`,
    as `pipeline.interrupts` says after a signal; any other exception is a defect and keeps its
    traceback. With ``--help`` it prints `pipeline.help` of the module.

    Parameters
    ----------
    main : callable
        Takes the checked `Config`.

    Returns
    -------
    callable
        Takes nothing; reads the command line.
    """
    defects: list[Exception] = []

    @functools.wraps(main)  # Hydra names the program after the module of the wrapped function
    def job(composed: DictConfig) -> None:
        try:
            main(_typed(composed, sys.argv[1:]))
        except (ConfigError, DataError) as error:
            _stop(str(error))
        except Exception as error:
            defects.append(error)
            raise

    @functools.wraps(main)
    def run() -> None:
        found = help_text(Path(main.__code__.co_filename)) if is_asked(sys.argv[1:]) else None
        if found:
            print(found)
            return
        os.environ["HYDRA_FULL_ERROR"] = "1"  # or Hydra prints errors itself and exits with 1
        program = hydra.main(str(CONF), "config", version_base=_VERSION_BASE)(job)
        try:
            with interrupts.raised(), interrupts.telling(interrupts.line):
                program()
        except _COMPOSE_ERRORS as error:
            if error in defects:
                raise
            _stop(one_line(error, sys.argv[1:], _ALLOWED_KEYS))

    return run


def resolved(config: Config) -> dict[str, Any]:
    """Give a configuration as nested dicts, lists, numbers and text that JSON can hold."""
    return asdict(config)


def _stop(line: str) -> None:
    print(f"error: {line}", file=sys.stderr)
    raise SystemExit(2)


def _typed(composed: DictConfig, overrides: Sequence[str]) -> Config:
    try:
        plain = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
        # Merged into the schema once more: with "+key=value" Hydra adds keys it does not know.
        config = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(Config), plain))
    except _COMPOSE_ERRORS as error:
        raise ConfigError(one_line(error, overrides, _ALLOWED_KEYS)) from error
    assert isinstance(config, Config)
    check(config)
    _make_floats(config)
    return config


def _make_floats(config: Config) -> None:
    # 10 and 10.0 are the same configuration, also to whoever compares its text.
    for group in (config.truth, config.estimator.initial_std, config.bounds):
        for key in KIND_KEYS.values():
            value = getattr(group, key)
            setattr(group, key, [*map(float, value)] if isinstance(value, list) else float(value))
    config.schedule.rotations = [[float(angle), axis] for angle, axis in config.schedule.rotations]
