"""Schema of the configuration: its groups, their keys, and the type of every value.

Every number a user would change is in ``conf/``, in the unit its key ends with.
"""

from dataclasses import dataclass, field
from typing import Any

from omegaconf import MISSING

from inscal.parameters import KINDS
from pipeline.config.calibration import Calibration
from pipeline.config.disturbance import Believed, Disturbance

KIND_KEYS: dict[str, str] = {
    kind: f"{kind}_{about.unit.replace('/', '_per_').replace('-', '_')}"
    for kind, about in KINDS.items()
}
"""Configuration key of each parameter kind: the kind and its paper unit."""


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
        Rate of the turns, the highest where they have ramps.
    turn_acceleration_deg_per_s2 : float or None
        With which turns come to their rate and back to rest; null: at once.
    initial_posture : list of str
        Where the body axes x, y, z point at first: North, South, East, West, Up or Down.
    rotations : list of [float, str, float or None, float or None]
        Angle in degrees and body axis (X, Y or Z) of each turn; then, where they differ from the
        others, the duration in seconds of the position that it ends, and its rate in deg/s.
    last_position_duration_s : float or None
        Duration of the last position; null: as long as others.
    """

    name: str = MISSING
    position_duration_s: float = MISSING
    turn_rate_deg_per_s: float = MISSING
    turn_acceleration_deg_per_s2: float | None = None
    initial_posture: list[str] = MISSING
    rotations: list[Any] = MISSING
    last_position_duration_s: float | None = None


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
        How often it goes over the same data at least.
    max_passes : int or None
        How often at most, until a run has converged; None: `passes` times, and no run is judged.
    convergence_sigma : float
        Change of every constant, in its sigmas, below which a run has converged.
    innovation_limit : float
        Times that a run's squared innovations may be what the filter expects, or it has failed.
    update_interval_s : float
        Time between observations.
    states : list of str
        Groups of states it estimates, keys of `inscal.parameters.GROUPS` and `AUGMENTATIONS`.
    initial_std : InitialStd
        Standard deviations it starts from.
    believed : Believed
        What it believes of disturbances, priors of the augmented states above all.
    """

    passes: int = MISSING
    max_passes: int | None = None
    convergence_sigma: float = MISSING
    innovation_limit: float = MISSING
    update_interval_s: float = MISSING
    states: list[str] = MISSING
    initial_std: InitialStd = field(default_factory=InitialStd)
    believed: Believed = field(default_factory=Believed)


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
    max_failed_share : float
        Share of the runs made that may fail; with more of them stages end with exit code 1.
    batch_time_limit_s : float
        Longest that a batch may take before its worker is taken to hang.
    """

    runs: int = MISSING
    seed: int = MISSING
    batch: int = MISSING
    store: str = MISSING
    replace: bool = MISSING
    precision: float | None = None
    max_failed_share: float = MISSING
    batch_time_limit_s: float = MISSING


@dataclass
class Cluster:
    """Where batches are computed; what a kind does not use is None.

    Attributes
    ----------
    kind : str
        ``threads``, ``processes``, ``scheduler`` or ``slurm``.
    workers : int or None
        Number of threads, processes or SLURM jobs.
    address : str or None
        Address of a running scheduler; with ``slurm``, where this process takes connections of
        jobs, this machine's own without one.
    queue, memory, walltime, account : str or None
        What a SLURM job asks for; the account may be left out.
    cores : int or None
        Threads of a SLURM job.
    """

    kind: str = MISSING
    workers: int | None = None
    address: str | None = None
    queue: str | None = None
    cores: int | None = None
    memory: str | None = None
    walltime: str | None = None
    account: str | None = None


@dataclass
class Bounds(KindValues):
    """Accuracy bounds the errors are judged by.

    Attributes
    ----------
    joint_share, each_share : float
        Shares of runs that are to keep all bounds at once, and any one of them.
    """

    joint_share: float = MISSING
    each_share: float = MISSING


@dataclass
class Design:
    """What `pipeline.design` looks for.

    Attributes
    ----------
    name : str
        Of the schedule that it writes.
    folder : str
        Where to.
    objective : str
        ``joint_share``: most runs that keep all bounds; ``worst``: least largest sigma over bound;
        ``d_optimal``: least determinant of the covariance; ``shortest``: least time at
        `joint_share`.
    total_time_s : float
        Of the path; of ``shortest``: at most.
    joint_share : float
        Share of runs that ``shortest`` is to reach.
    positions : int
        Number of positions.
    angles_deg : list of float
        Allowed angles of turns, multiples of 45.
    axes : list of str
        Allowed body axes of turns.
    shortest_dwell_s, longest_position_s, time_step_s : float
        Limits of times, and by what they change.
    last_posture : list of str or None
        Where the body axes are to point at the end; null: anywhere.
    cable_limit_deg : float or None
        Largest sum of turns about an axis either way; null: any.
    start_from : str or None
        Schedule to begin the search with; null: random turns.
    seconds : float
        How long to search, at `steps_per_second`; the number of steps is what counts.
    steps_per_second : float
        Paths judged a second on the machine that `seconds` are of.
    chains : int
        Independent searches, the best of which is taken.
    seed : int
        Of all its random draws.
    """

    name: str = MISSING
    folder: str = MISSING
    objective: str = MISSING
    total_time_s: float = MISSING
    joint_share: float = MISSING
    positions: int = MISSING
    angles_deg: list[float] = MISSING
    axes: list[str] = MISSING
    shortest_dwell_s: float = MISSING
    longest_position_s: float = MISSING
    time_step_s: float = MISSING
    last_posture: list[str] | None = None
    cable_limit_deg: float | None = None
    start_from: str | None = None
    seconds: float = MISSING
    steps_per_second: float = MISSING
    chains: int = MISSING
    seed: int = MISSING


@dataclass
class Config:
    """The whole configuration.

    Attributes
    ----------
    truth, noise, disturbance, schedule, site, simulation, estimator, sensor, campaign, cluster, \
bounds, design, calibration : object
        The groups of ``conf/``.
    only_run : int or None
        The one run to compute.
    out : str or None
        File a stage writes its result to.
    a, b : str or None
        Stores to compare.
    estimates, mapping : str or None
        Table of another program's estimates, and what its columns are.
    log : str or None
        Header of a log.
    compensation : str or None
        File of parameters that compensate a log.
    name : str or None
        Of the configuration files that a stage writes.
    baseline : str or None
        Folder of the baseline of another program's estimates.
    rate_hz : float
        Samples a second of an exported log.
    runs : str or None
        Runs to export, such as ``0:128``.
    campaigns : list of str or None
        Stores to report on, the main one first.
    growth : float, "bounds" or None
        How much disturbances are to let an RMSE grow, one by one, or that it is as far as the
        bounds allow.
    parameter : str or None
        Parameter whose error budget is drawn over time.
    accept : str or None
        Why the gate's new baseline is accepted.
    """

    truth: Truth = field(default_factory=Truth)
    noise: Noise = field(default_factory=Noise)
    disturbance: Disturbance = field(default_factory=Disturbance)
    schedule: Schedule = field(default_factory=Schedule)
    site: Site = field(default_factory=Site)
    simulation: Simulation = field(default_factory=Simulation)
    estimator: Estimator = field(default_factory=Estimator)
    sensor: Sensor = field(default_factory=Sensor)
    campaign: Campaign = field(default_factory=Campaign)
    cluster: Cluster = field(default_factory=Cluster)
    bounds: Bounds = field(default_factory=Bounds)
    design: Design = field(default_factory=Design)
    calibration: Calibration = field(default_factory=Calibration)
    only_run: int | None = None
    out: str | None = None
    a: str | None = None
    b: str | None = None
    estimates: str | None = None
    mapping: str | None = None
    log: str | None = None
    compensation: str | None = None
    name: str | None = None
    baseline: str | None = None
    rate_hz: float = 100.0
    runs: str | None = None
    campaigns: list[str] | None = None
    growth: Any = None
    parameter: str | None = None
    accept: str | None = None
