"""A campaign read once: its runs, what they amount to, and what it was made with."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline.campaign import judged, store
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.console.output import json_data
from pipeline.study.findings import Summary

_FEWEST = 2


@dataclass(frozen=True)
class Campaign:
    """A campaign to draw or to report on.

    Attributes
    ----------
    path : Path
        Of its store.
    name : str
        What it is called.
    every : xarray.Dataset
        All runs asked for, in whatever state.
    table : xarray.Dataset
        Of `inscal.summary.summarize`.
    """

    path: Path
    name: str
    every: xr.Dataset
    table: xr.Dataset

    @cached_property
    def runs(self) -> xr.Dataset:
        """Runs done."""
        return store.done(self.every)

    @cached_property
    def summary(self) -> Summary:
        """The table as `pipeline.study.findings` takes it."""
        return json_data(judged.as_json(self.table))

    @cached_property
    def error(self) -> np.ndarray:
        """Errors in paper units, shape (runs, 27)."""
        return self.runs["error"].transpose("run", "parameter").to_numpy()

    @property
    def asked(self) -> int:
        """How many runs were asked for."""
        return self.every.sizes["run"]

    @property
    def predicted_std(self) -> np.ndarray:
        """Sigma the filter claims in paper units, shape (27,); 0 where it models nothing."""
        return self.table["predicted_std"].to_numpy()

    @property
    def configuration(self) -> Mapping[str, Any]:
        """Configuration it was made with."""
        return self.every.attrs["configuration"]

    @property
    def passes(self) -> int:
        """Passes of the filter."""
        return self.configuration["estimator"]["passes"]

    @property
    def quadratic_unit(self) -> str:
        """How its quadratic term is read."""
        return self.configuration["sensor"]["quadratic_unit"]


def read(config: Config, path: str | Path, *, several: bool = False) -> Campaign:
    """Read a campaign and judge it.

    Parameters
    ----------
    config : Config
        Gives the bounds.
    path : str or Path
        Campaign store.
    several : bool
        Whether two runs done are needed at least: of one there is no scatter.

    Returns
    -------
    Campaign

    Raises
    ------
    DataError
        If there is no store, or too few runs in it are done.
    """
    every = store.read(path)
    done, asked = store.done(every).sizes["run"], every.sizes["run"]
    if several and done < _FEWEST:
        raise DataError(f"campaign store {path}: {done} of {asked} runs done; a report needs two")
    return Campaign(Path(path), Path(path).name, every, judged.summary(config, path, every))


def comparison(a: Campaign, b: Campaign) -> Summary:
    """Compare two campaigns as `pipeline.compare` does; DataError if they are no pair."""
    bound = a.table["bound"]
    return json_data(judged.as_json(judged.comparison(a.path, a.every, b.path, b.every, bound)))
