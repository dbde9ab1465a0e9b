"""One run of a campaign again, with its course over time."""

from typing import Any

import numpy as np
import xarray as xr

from inscal.experiment import Outcome, run_with_history
from inscal.parameters import NAMES, UNITS
from pipeline.campaign.template import attributes
from pipeline.config.schema import Config
from pipeline.config.setup import Setup


def history_dataset(config: Config) -> xr.Dataset:
    """Course of run `only_run`: estimates, errors, predicted sigma and innovations at every update.

    Parameters
    ----------
    config : Config

    Returns
    -------
    xarray.Dataset
        Dimensions calibration_pass, time, parameter and observation; parameters in paper units.
        Dimension augmented has the augmented states that do not wander, in the units of their keys.
    """
    setup = Setup(config)
    experiment, unit = setup.experiment, setup.unit
    number = config.only_run
    assert number is not None
    outcome, history = run_with_history(experiment, number)
    passes = range(len(history.estimate))
    truth, estimate = outcome.truth[0] / unit, history.estimate[..., 0] / unit
    course = ("calibration_pass", "time", "parameter")
    observed = ("calibration_pass", "time", "observation")
    per_parameter = {"units": "see coordinate unit"}
    per_observation = {"units": "see coordinate observation_unit"}
    interval = config.estimator.update_interval_s
    augmented, coordinates = _augmented(setup, outcome)
    gains = [experiment.estimator.gains(p) for p in passes]
    return xr.Dataset(
        {
            "truth": ("parameter", truth, per_parameter),
            "final_estimate": ("parameter", outcome.estimate[0] / unit, per_parameter),
            "final_error": ("parameter", outcome.estimate[0] / unit - truth, per_parameter),
            "estimate": (course, estimate, per_parameter),
            "error": (course, estimate - truth, per_parameter),
            "predicted_std": (
                course,
                np.array([g.parameter_std for g in gains]) / unit,
                per_parameter,
            ),
            "innovation": (observed, history.innovation[..., 0], per_observation),
            "innovation_std": (
                observed,
                np.sqrt(np.array([g.innovation_covariance for g in gains]).diagonal(0, 2, 3)),
                per_observation,
            ),
            "nees": ((), outcome.nees[0], {"units": "1"}),
            **{
                name: ("augmented", values, {"units": "see coordinate augmented_unit"})
                for name, values in augmented.items()
            },
        },
        coords={
            "calibration_pass": np.arange(1, len(passes) + 1),
            "time": (
                "time",
                interval * np.arange(1, experiment.motion.updates + 1),
                {"units": "s"},
            ),
            "parameter": np.array(NAMES, dtype=object),
            "unit": ("parameter", np.array(UNITS, dtype=object)),
            **coordinates,
            "observation": np.array(
                [f"velocity_{d}" for d in ("north", "east", "down")]
                + [f"position_{d}" for d in ("north", "east", "height")],
                dtype=object,
            ),
            "observation_unit": ("observation", np.array(["m/s"] * 3 + ["m"] * 3, dtype=object)),
        },
        attrs={
            "run": number,
            "positions": setup.schedule.positions,
            **attributes(config),
        },
    )


def _augmented(setup: Setup, outcome: Outcome) -> tuple[dict[str, Any], dict[str, Any]]:
    """Values and coordinates of augmented states; nothing where there are none."""
    names, unit = setup.augmented_names, setup.augmented_unit
    if not names:
        return {}, {}
    values = {
        "augmented_truth": outcome.augmented_truth[0] / unit,
        "augmented_estimate": outcome.augmented_estimate[0] / unit,
        "augmented_predicted_std": setup.experiment.estimator.augmented_std / unit,
    }
    units = np.array(setup.augmented_units, dtype=object)
    coordinates = {
        "augmented": np.array(names, dtype=object),
        "augmented_unit": ("augmented", units),
    }
    return values, coordinates
