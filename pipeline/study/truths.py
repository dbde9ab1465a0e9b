"""Configurations whose truth holds some disturbances and not others."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pipeline.config.disturbance import IDLE, KEYS
from pipeline.config.load import disturbances, resolved, undisturbed
from pipeline.config.schema import Config
from pipeline.console.errors import ConfigError


def disturbed_by(config: Config) -> dict[str, float]:
    """Disturbances of a configuration.

    Parameters
    ----------
    config : Config

    Returns
    -------
    dict
        Size by key.

    Raises
    ------
    ConfigError
        If there is none.
    """
    keys = disturbances(resolved(config))
    if not keys:
        raise ConfigError(
            f"disturbance = {config.disturbance.name}: has no disturbance; choose one that has, "
            "such as disturbance=laboratory"
        )
    return {key: getattr(config.disturbance, key) for key in keys}


def with_truth(config: Config, name: str, sizes: Mapping[str, Any], folder: str) -> Config:
    """Configuration with some disturbances and no other.

    Parameters
    ----------
    config : Config
    name : str
        What the truth is called.
    sizes : mapping
        Values by key; times and frequencies that do nothing alone stay where not given.
    folder : str
        Of the campaign's store, in that of the configuration.

    Returns
    -------
    Config
    """
    about = {key: undisturbed()[key] for key in KEYS if key not in IDLE} | dict(sizes)
    return replace(
        config,
        disturbance=replace(config.disturbance, name=name, **about),
        campaign=replace(config.campaign, store=f"{config.campaign.store}/{folder}"),
    )
