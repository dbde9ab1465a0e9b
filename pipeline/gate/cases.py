"""What the gate runs: the reference case, and those of ``conf/gate.yaml`` that leave no default.

The reference case is what the command line configures. The others are whole in themselves: nothing
but an edit of their file changes them. What one does not say of disturbances is `none`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import yaml
from omegaconf import OmegaConf

from pipeline.config.load import (
    RUN_GROUPS,
    resolved,
    run_settings,
    typed,
    undisturbed,
    usual_belief,
)
from pipeline.config.schema import Config
from pipeline.console import conf
from pipeline.console.errors import ConfigError

REFERENCE = "reference"
"""Name of the case that the command line configures."""

RUNS = 128
"""Runs of the reference case; a multiple of the kernels' lanes."""

FILE = conf.SHIPPED / "gate.yaml"
"""Where the other cases are."""


@dataclass(frozen=True)
class Draws:
    """Some runs of a campaign: a seed, the number of the first, and how many."""

    seed: int
    first: int
    runs: int

    @property
    def numbers(self) -> range:
        """Run numbers."""
        return range(self.first, self.first + self.runs)


@dataclass(frozen=True)
class Case:
    """A campaign of the gate.

    Attributes
    ----------
    name : str
        Also of the folder that its baseline is kept in.
    config : Config
    draws : tuple of Draws
    """

    name: str
    config: Config
    draws: tuple[Draws, ...]

    @property
    def runs(self) -> int:
        """Number of runs."""
        return sum(draws.runs for draws in self.draws)

    @property
    def configuration(self) -> dict[str, Any]:
        """What makes the case's runs, seeds included."""
        settings = run_settings(resolved(self.config))
        if self.name == REFERENCE:
            return settings
        del settings["seed"]
        return settings | {"draws": [[d.seed, d.first, d.runs] for d in self.draws]}


def reference(config: Config) -> Case:
    """Case that a configuration describes."""
    return Case(REFERENCE, config, (Draws(config.campaign.seed, 0, RUNS),))


def cases(config: Config) -> Iterator[Case]:
    """All cases, that of a configuration first.

    Parameters
    ----------
    config : Config

    Raises
    ------
    ConfigError
        If one of `FILE` cannot be used.
    """
    yield reference(config)
    for name, about in _content().items():
        yield _case(name, about, config)


def _case(name: str, about: dict[str, Any], config: Config) -> Case:
    about = {"disturbance": {}} | about
    missing = [key for key in ("why", "draws", *RUN_GROUPS) if key not in about]
    unknown = [key for key in about if key not in ("why", "draws", *RUN_GROUPS)]
    if missing or unknown:
        what = "lacks" if missing else "has the unknown key"
        raise ConfigError(f"{FILE.name}: case {name} {what} {', '.join(missing or unknown)}")
    own = {group: about[group] for group in RUN_GROUPS}
    own["disturbance"] = {**undisturbed(), **own["disturbance"]}
    believed = {**usual_belief(), **own["estimator"].get("believed", {})}
    own["estimator"] = own["estimator"] | {"believed": believed}
    try:
        full = typed(OmegaConf.create({**resolved(config), **own}), ())
    except ConfigError as error:
        raise ConfigError(f"{FILE.name}: case {name}: {error}") from None
    return Case(name, full, tuple(Draws(*draws) for draws in about["draws"]))


@cache
def _content() -> dict[str, dict[str, Any]]:
    return yaml.safe_load(FILE.read_text(encoding="utf-8"))["cases"]
