"""Loading the configuration: from ``conf/`` and overrides, or as a campaign keeps it.

A configuration that cannot be used is a `ConfigError` with one line that says which key is wrong
and why.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import hydra
import yaml
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from inscal.parameters import AUGMENTATIONS
from pipeline.config.arguments import checked
from pipeline.config.disturbance import IDLE, key_of
from pipeline.config.messages import one_line
from pipeline.config.rule import Rule
from pipeline.config.rules import check
from pipeline.config.schema import KIND_KEYS, Config
from pipeline.console import conf
from pipeline.console.errors import ConfigError

RUN_GROUPS = (
    *("truth", "noise", "disturbance", "schedule", "site", "simulation", "estimator", "sensor"),
)
"""Groups that decide the runs of a campaign, beside its seed; bounds and cluster do not."""

VERSION_BASE = "1.3"
"""Version of Hydra whose behaviour is asked for."""

# Hydra lets plain errors out where it meets a list for a name, and OmegaConf integers too large
# for a float.
COMPOSE_ERRORS = (
    HydraException,
    OmegaConfBaseException,
    yaml.YAMLError,
    ValueError,
    OverflowError,
    TypeError,
    AttributeError,
    RecursionError,
)
"""What can be raised before a configuration is typed."""


@dataclass(frozen=True)
class Program:
    """What a stage reads: a primary file of ``conf/`` and the class that types it.

    Attributes
    ----------
    name : str
        Of the file, without its ending.
    schema : type
        `Config` or a subclass with further groups.
    rules : mapping of str to Rule
        Of the values of these groups.
    """

    name: str
    schema: type[Config]
    rules: Mapping[str, Rule] = field(default_factory=dict)

    def register(self) -> None:
        """Make the class the ``schema`` that the defaults of ``conf/config.yaml`` begin with."""
        ConfigStore.instance().store(name="schema", node=self.schema)

    def message(self, error: Exception, overrides: Sequence[str]) -> str:
        """Say in one line what one of `COMPOSE_ERRORS` means for the user."""
        return one_line(error, overrides, _allowed_keys(self.schema))


PRODUCT = Program("config", Config)
"""What every stage reads that does not say otherwise."""


def load(overrides: Sequence[str] = (), program: Program = PRODUCT) -> Any:
    """Load the configuration with Hydra, as a stage would with these arguments.

    Parameters
    ----------
    overrides : sequence of str
        Hydra overrides such as ``noise=quiet`` or ``campaign.runs=20``.
    program : Program

    Returns
    -------
    Config
        Of the program's class, checked; numbers, text and lists only.

    Raises
    ------
    ConfigError
        If it cannot be used; the message is one line.
    """
    running = GlobalHydra.instance().hydra  # of a stage this may be called from
    GlobalHydra.instance().clear()
    program.register()
    try:
        first, *others = map(str, conf.folders())
        search = [f"hydra.searchpath=[{','.join(map(json.dumps, others))}]"] if others else []
        with hydra.initialize_config_dir(first, version_base=VERSION_BASE):
            composed = hydra.compose(program.name, overrides=[*checked(overrides), *search])
    except COMPOSE_ERRORS as error:
        raise ConfigError(program.message(error, overrides)) from error
    finally:
        GlobalHydra.instance().hydra = running
    return typed(composed, overrides, program)


def typed(composed: DictConfig, overrides: Sequence[str], program: Program = PRODUCT) -> Any:
    """Turn what Hydra composed into the program's class and check its values.

    Raises
    ------
    ConfigError
        If it cannot be used.
    """
    try:
        plain = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
        # Merged into the schema once more: with "+key=value" Hydra adds keys it does not know.
        config = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(program.schema), plain))
    except COMPOSE_ERRORS as error:
        raise ConfigError(program.message(error, overrides)) from error
    assert isinstance(config, Config)
    check(config, program.rules)
    _make_floats(config)
    return config


def resolved(config: Config) -> dict[str, Any]:
    """Give a configuration as nested dicts, lists, numbers and text that JSON can hold."""
    return asdict(config)


def config_of(configuration: Mapping[str, Any]) -> Config:
    """Configuration that a campaign was made with.

    Parameters
    ----------
    configuration : mapping
        As a store keeps it, of `resolved`; groups that are none of the product's are left out.

    Returns
    -------
    Config

    Raises
    ------
    OmegaConfBaseException
        If it is of another version.
    """
    known = {f.name for f in fields(Config)}
    own = {name: value for name, value in configuration.items() if name in known}
    config = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(Config), own))
    assert isinstance(config, Config)
    return config


def run_settings(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """What of a configuration as stores and JSON have it makes the runs, seed included."""
    groups = {name: configuration[name] for name in RUN_GROUPS}
    return groups | {"seed": configuration["campaign"]["seed"]}


@cache
def undisturbed() -> Mapping[str, Any]:
    """Group `disturbance` of a truth that holds no more than the filter believes."""
    return MappingProxyType(_group("disturbance", "none"))


@cache
def usual_belief() -> Mapping[str, Any]:
    """Group `estimator.believed` where nothing is said of it."""
    return MappingProxyType(_group("estimator", "two_pass")["believed"])


def _group(name: str, option: str) -> Any:
    return yaml.safe_load((conf.SHIPPED / name / f"{option}.yaml").read_text(encoding="utf-8"))


def disturbances(configuration: Mapping[str, Any]) -> list[str]:
    """Keys of what truth holds beyond the filter's belief.

    Parameters
    ----------
    configuration : mapping
        As stores and JSON have it.

    Returns
    -------
    list of str
        Keys of the group `disturbance`, without the times and the frequency that do nothing alone.
    """
    usual, present = undisturbed(), configuration["disturbance"].items()
    return [key for key, value in present if key not in ("name", *IDLE) and value != usual[key]]


def unknown(configuration: Mapping[str, Any]) -> list[str]:
    """Keys of what truth holds and the filter does not believe in just that size.

    Parameters
    ----------
    configuration : mapping
        As stores and JSON have it.

    Returns
    -------
    list of str
        Of `disturbances`, without what the filter's augmented states, or the factors of its noise,
        are about.
    """
    about, true = configuration["estimator"], configuration["disturbance"]
    told = {key_of(AUGMENTATIONS[name].source) for name in about["states"] if name in AUGMENTATIONS}
    told |= {key for key in about["believed"] if key.endswith("_noise_factor")}
    same = {key for key in told if about["believed"][key] == true[key]}
    return [key for key in disturbances(configuration) if key not in same]


def position_durations(schedule: Mapping[str, Any]) -> list[float]:
    """Duration of every position of a schedule as stores and JSON have it, s."""
    usual = schedule["position_duration_s"]
    own = [rotation[2] if len(rotation) > 2 else None for rotation in schedule["rotations"]]
    return [x or usual for x in (*own, schedule.get("last_position_duration_s"))]


def differences(old: Mapping[str, Any], new: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Keys of nested configurations that differ, with both values."""
    lines = []
    for key in sorted(old.keys() | new.keys()):
        a, b = old.get(key), new.get(key)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            lines += differences(a, b, f"{prefix}{key}.")
        elif a != b:
            lines.append(f"{prefix}{key} = {a} -> {b}")
    return lines


def _allowed_keys(schema: type) -> dict[str, list[str]]:
    """Keys of a class of the schema and of its groups, by the name of the class."""
    keys = {schema.__name__: [f.name for f in fields(schema)]}
    for group in fields(schema):
        if is_dataclass(group.type):
            keys |= _allowed_keys(group.type)  # type: ignore[arg-type]
    return keys


def _make_floats(config: Config) -> None:
    # 10 and 10.0 are the same configuration, also to whoever compares its text.
    for group in (config.truth, config.estimator.initial_std, config.bounds):
        for key in KIND_KEYS.values():
            value = getattr(group, key)
            setattr(group, key, [*map(float, value)] if isinstance(value, list) else float(value))
    config.schedule.rotations = [
        [float(angle), axis, *(None if x is None else float(x) for x in rest)]
        for angle, axis, *rest in config.schedule.rotations
    ]
