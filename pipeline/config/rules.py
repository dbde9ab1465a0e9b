"""What the values of a configuration may be: rules that types alone cannot give."""

from collections.abc import Mapping
from dataclasses import asdict
from operator import attrgetter
from types import MappingProxyType

from inscal.directions import DIRECTIONS
from inscal.parameters import AUGMENTATIONS, GROUPS, NAMES, members
from inscal.profile import profile_of
from pipeline.config.disturbance import BELIEVED, NEEDED, key_of
from pipeline.config.disturbance import KEYS as DISTURBANCES
from pipeline.config.rule import (
    COUNT,
    FILE,
    FINITE,
    FROM_0,
    INDEX,
    LARGEST_PASSES,
    NAME,
    PASSES,
    POSITIVE,
    REASON,
    SHARE,
    STORE,
    STORES,
    TRIPLE_OF_POSITIVE,
    Rule,
    apply,
    check_sizes,
    is_address,
    is_count,
    is_number,
    is_range,
    matching,
    one_of,
    refuse,
)
from pipeline.config.schema import KIND_KEYS, Config

_MAX_ANGLE_STEP_DEG = 14.0  # inside inscal.rotation.MAX_STEP_ANGLE, where its series are exact
_LONGEST_S = 1e6  # of what is waited for
_MOST_RUNS = 10_000_000

_CLUSTER_KEYS: dict[str, tuple[str, ...]] = {
    "threads": ("workers",),
    "processes": ("workers",),
    "scheduler": ("address",),
    "slurm": ("workers", "queue", "cores", "memory", "walltime"),
}
"""Keys each kind of cluster needs."""

_CLUSTER_EXTRAS: dict[str, tuple[str, ...]] = {"slurm": ("account", "address")}
"""Keys a kind of cluster takes but can do without."""


def check(config: Config, further: Mapping[str, Rule] = MappingProxyType({})) -> None:
    """Check every value of a configuration whose types are already right.

    Parameters
    ----------
    config : Config
    further : mapping of str to Rule
        Of the keys that a subclass of `Config` adds.

    Raises
    ------
    ConfigError
        At the first value that is not allowed.
    """
    check_sizes("", asdict(config))
    for key, rule in {**_RULES, **further}.items():
        apply(key, attrgetter(key)(config), rule)
    for key, rule in _OPTIONAL_RULES.items():
        value = attrgetter(key)(config)
        if value is not None:
            apply(key, value, rule)
    _check_kinds("truth", config.truth, FINITE if config.truth.distribution == "fixed" else FROM_0)
    _check_kinds("estimator.initial_std", config.estimator.initial_std, POSITIVE)
    _check_kinds("bounds", config.bounds, POSITIVE)
    _check_schedule(config)
    _check_passes(config)
    _check_disturbance(config)
    _check_states(config)
    _check_cluster(config)
    if config.only_run is not None and config.only_run >= config.campaign.runs:
        refuse(
            "only_run", config.only_run, f"less than campaign.runs, which is {config.campaign.runs}"
        )


_RULES: dict[str, Rule] = {
    "truth.distribution": one_of("fixed", "normal", "uniform"),
    "noise.name": NAME,
    "noise.gyro_angle_random_walk_deg_per_sqrt_h": FROM_0,
    "noise.accel_white_noise_ug_per_sqrt_hz": FROM_0,
    "noise.velocity_observation_m_per_s": POSITIVE,
    "noise.position_observation_m": POSITIVE,
    "disturbance.name": NAME,
    **{f"disturbance.{key}": FROM_0 for key in DISTURBANCES},
    "schedule.name": NAME,
    "schedule.position_duration_s": POSITIVE,
    "schedule.turn_rate_deg_per_s": POSITIVE,
    # where north still is a direction: inscal.motion.Site
    "site.latitude_deg": (lambda v: abs(v) <= 89.99, "a number from -89.99 to 89.99"),
    "site.height_m": (lambda v: -500.0 <= v <= 10000.0, "a number from -500 to 10000"),
    "simulation.dwell_step_s": POSITIVE,
    "simulation.turn_step_s": POSITIVE,
    "estimator.passes": PASSES,
    "estimator.convergence_sigma": POSITIVE,
    "estimator.innovation_limit": (lambda v: is_number(v) and v > 1.0, "a finite number > 1"),
    "estimator.update_interval_s": POSITIVE,
    "estimator.initial_std.attitude_deg": TRIPLE_OF_POSITIVE,
    "estimator.initial_std.velocity_m_per_s": POSITIVE,
    "estimator.initial_std.position_m": POSITIVE,
    **{
        f"estimator.believed.{key}": POSITIVE if key.endswith("_factor") else FROM_0
        for key in BELIEVED
    },
    "bounds.joint_share": SHARE,
    "bounds.each_share": SHARE,
    "sensor.quadratic_unit": one_of("pulse", "si"),
    "sensor.accel_pulses_per_m_per_s": POSITIVE,
    "campaign.runs": (lambda v: 1 <= v <= _MOST_RUNS, f"an integer >= 1, up to {_MOST_RUNS}"),
    "campaign.seed": INDEX,
    "campaign.batch": COUNT,
    "campaign.store": STORE,
    "campaign.batch_time_limit_s": (
        lambda v: 0.0 < v <= _LONGEST_S,
        f"a number > 0, and at most {_LONGEST_S:g}",
    ),
    "campaign.max_failed_share": (lambda v: 0.0 <= v <= 1.0, "a number from 0 to 1"),
    "cluster.kind": one_of(*_CLUSTER_KEYS),
    "design.name": NAME,
    "design.folder": STORE,
    "design.objective": one_of("joint_share", "worst", "d_optimal", "shortest"),
    "design.total_time_s": POSITIVE,
    "design.joint_share": SHARE,
    "design.positions": (lambda v: 2 <= v <= 200, "an integer from 2 to 200"),
    "design.angles_deg": (
        lambda v: len(set(v)) == len(v) > 0 and all(a % 45 == 0 and 0 < abs(a) <= 360 for a in v),
        "a list of one or more multiples of 45 up to 360 either way, each once",
    ),
    "design.axes": (
        lambda v: len(set(v)) == len(v) > 0 and set(v) <= {"X", "Y", "Z"},
        "a list of one or more of X, Y and Z, each once",
    ),
    "design.shortest_dwell_s": FROM_0,
    "design.longest_position_s": POSITIVE,
    "design.time_step_s": POSITIVE,
    "design.seconds": POSITIVE,
    "design.steps_per_second": POSITIVE,
    "design.chains": COUNT,
    "design.seed": INDEX,
    "calibration.frame": one_of("gyro", "accelerometer"),
    "calibration.prior_factor": POSITIVE,
    "calibration.rounds": COUNT,
    "calibration.left_out": (
        lambda v: all(n >= 1 for n in v) and len(set(v)) == len(v),
        "a list of numbers of rests from 1, each once",
    ),
    "calibration.false_alarms": (lambda v: 0.0 < v < 0.5, "a number between 0 and 0.5"),
    "calibration.power": (lambda v: 0.5 < v < 1.0, "a number between 0.5 and 1"),
    "calibration.wander_time_s": POSITIVE,
    "rate_hz": (lambda v: 1.0 <= v <= 10_000.0, "a number from 1 to 10000"),
}

_OPTIONAL_RULES: dict[str, Rule] = {
    "schedule.turn_acceleration_deg_per_s2": (POSITIVE[0], f"null, or {POSITIVE[1]}"),
    "schedule.last_position_duration_s": (POSITIVE[0], f"null, or {POSITIVE[1]}"),
    "cluster.workers": COUNT,
    "design.cable_limit_deg": POSITIVE,
    "design.start_from": NAME,
    "runs": (
        is_range,
        "two integers such as 0:128, the first one less",
    ),
    "cluster.address": (is_address, "an address such as tcp://127.0.0.1:8786"),
    "cluster.queue": NAME,
    "cluster.cores": COUNT,
    "cluster.memory": matching(r"[1-9]\d*(\.\d+)? ?[kMGT]i?B", "an amount such as 8GB"),
    "cluster.walltime": matching(r"(\d+-)?\d{1,2}:\d\d:\d\d", "a time such as 02:00:00"),
    "cluster.account": NAME,
    "campaign.precision": SHARE,
    "only_run": INDEX,
    "out": FILE,
    "name": NAME,
    "compensation": FILE,
    "baseline": STORE,
    "calibration.compare_to": FILE,
    "a": STORE,
    "b": STORE,
    "campaigns": STORES,
    "growth": (
        lambda v: v == "bounds" or (is_number(v) and v > 1),
        "null, bounds, or a finite number > 1",
    ),
    "parameter": one_of(*NAMES),
    "accept": REASON,
}
"""Rules of keys that may be null."""


def _check_kinds(prefix: str, group: object, rule: Rule) -> None:
    accepts, allowed = rule
    for kind, key in KIND_KEYS.items():
        value, count = getattr(group, key), len(members(kind))
        numbers = value if isinstance(value, list) else [value]
        right_length = not isinstance(value, list) or len(value) == count
        if not (right_length and all(accepts(number) for number in numbers)):
            refuse(f"{prefix}.{key}", value, f"{allowed}, or a list of {count} such numbers")


def _check_schedule(config: Config) -> None:
    schedule = config.schedule
    _check_posture("schedule.initial_posture", schedule.initial_posture)
    if config.design.last_posture is not None:
        _check_posture("design.last_posture", config.design.last_posture)
    if not schedule.rotations:
        refuse(
            "schedule.rotations", [], "at least one [angle_deg, axis]; this is an empty schedule"
        )
    for number, rotation in enumerate(schedule.rotations):
        _check_rotation(f"schedule.rotations[{number}]", rotation, config)
    rates = [rotation[3] or 0.0 for rotation in schedule.rotations if len(rotation) > 3]
    fastest = max(schedule.turn_rate_deg_per_s, *rates, 0.0)
    if fastest * config.simulation.turn_step_s > _MAX_ANGLE_STEP_DEG:
        refuse(
            "simulation.turn_step_s",
            config.simulation.turn_step_s,
            f"at most {_MAX_ANGLE_STEP_DEG / fastest:g}, which is "
            f"{_MAX_ANGLE_STEP_DEG:g} deg at schedule.turn_rate_deg_per_s",
        )
    for key in ("position_duration_s", "last_position_duration_s"):
        check_duration(f"schedule.{key}", getattr(schedule, key), config)


def check_duration(key: str, value: float | None, config: Config) -> None:
    """Refuse a time that is no multiple of the filter's updates; ConfigError names its key."""
    interval = config.estimator.update_interval_s
    if value is not None and not is_count(value / interval):
        refuse(key, value, f"a multiple of estimator.update_interval_s, which is {interval!r}")


def _check_posture(key: str, posture: list[str]) -> None:
    allowed = f"3 of {', '.join(DIRECTIONS)}"
    if len(posture) != 3 or any(name not in list(DIRECTIONS) for name in posture):
        refuse(key, posture, allowed)
    (x1, x2, x3), (y1, y2, y3), z = (DIRECTIONS[name] for name in posture)
    if (x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1) != z:
        refuse(key, posture, f"{allowed}, at right angles and right-handed (North, East, Down is)")


def _check_rotation(key: str, rotation: object, config: Config) -> None:
    if not isinstance(rotation, list) or not 2 <= len(rotation) <= 4:
        refuse(key, rotation, "[angle_deg, axis], such as [90, Y], then seconds and deg/s, if any")
    angle, axis, *rest = rotation
    if not is_number(angle) or not 0.0 < abs(angle) <= 360.0:
        refuse(key, rotation, "[angle_deg, axis] with an angle up to 360 either way, and not 0")
    if axis not in ("X", "Y", "Z"):
        refuse(key, rotation, "[angle_deg, axis] with X, Y or Z for its axis")
    if not all(value is None or POSITIVE[0](value) for value in rest):
        refuse(
            key, rotation, "[angle_deg, axis, seconds, deg/s] that ends with null or numbers > 0"
        )
    about = config.schedule
    seconds, rate, *_ = [*rest, None, None]
    position = about.position_duration_s if seconds is None else seconds
    check_duration(f"{key}: position of", seconds, config)
    duration = profile_of(
        abs(angle), rate or about.turn_rate_deg_per_s, about.turn_acceleration_deg_per_s2
    ).duration
    if duration >= position:
        whose = "schedule.position_duration_s" if seconds is None else "its position"
        refuse(key, rotation, f"a turn shorter than {whose}, {position:g}; it takes {duration:g} s")


def _check_passes(config: Config) -> None:
    fewest, most = config.estimator.passes, config.estimator.max_passes
    if most is not None and not fewest <= most <= LARGEST_PASSES:
        allowed = (
            f"null, or an integer from estimator.passes, which is {fewest}, to {LARGEST_PASSES}"
        )
        refuse("estimator.max_passes", most, allowed)


def _check_disturbance(config: Config) -> None:
    about = config.disturbance
    for key, size in NEEDED.items():
        value, needs = getattr(about, key), getattr(about, size)
        if needs > 0.0 and value == 0.0:
            allowed = f"above zero where disturbance.{size} is, which is {needs:g}"
            refuse(f"disturbance.{key}", value, allowed)


def _check_states(config: Config) -> None:
    states, allowed = config.estimator.states, [*GROUPS, *AUGMENTATIONS]
    known = all(name in allowed for name in states)
    if not known or not set(states) & set(GROUPS) or len(set(states)) < len(states):
        words = f"one or more of {', '.join(GROUPS)}, and any of {', '.join(AUGMENTATIONS)}"
        refuse("estimator.states", states, f"{words}, each once")
    for name, about in AUGMENTATIONS.items():
        for key in (key_of(about.source), *([f"{about.source}_time_s"] if about.wanders else [])):
            value = getattr(config.estimator.believed, key)
            if name in states and value == 0.0:
                refuse(f"estimator.believed.{key}", value, "> 0 where estimator.states has " + name)


def _check_cluster(config: Config) -> None:
    cluster = config.cluster
    needed = _CLUSTER_KEYS[cluster.kind]
    taken = ("kind", *needed, *_CLUSTER_EXTRAS.get(cluster.kind, ()))
    for key, value in vars(cluster).items():
        if value is None and key in needed:
            refuse(f"cluster.{key}", value, f"given with cluster.kind {cluster.kind}")
        if value is not None and key not in taken:
            refuse(f"cluster.{key}", value, f"null with cluster.kind {cluster.kind}")
