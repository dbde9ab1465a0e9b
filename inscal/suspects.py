r"""What a unit may have that its filter does not know, and what each of that does to a record.

A suspect is a set of shapes of apparent increments, each with a size of its own:

- the constants of a disturbance (`inscal.unit_effects`), such as a delay;
- a bias that wanders: on each axis the half-range cosines cos(pi k t / T), k = 1 .. `COSINES`, of
  the record's time T;
- a parameter that drifts: its increments times the time since the record's middle, over T.

Table and building are no suspects, for a log's motion is taken as it was.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from inscal.disturbance import NOTHING
from inscal.parameters import NAMES
from inscal.path import Path
from inscal.record import OBSERVED
from inscal.response import ConstantsResponse, Response, of_constants, of_parameters
from inscal.state_model import StateModel
from inscal.unit_effects import bias

COSINES = 12
"""Of a wandering bias; on 25 positions about two positions are half a wave of the fastest."""
CONSTANT = (
    *("off_axis_lever_arm", "table_offset", "gyro_accel_delay"),
    *("accel_asymmetry", "accel_cubic", "accel_cross_coupling", "accel_pendulous"),
    *("gyro_asymmetry", "gyro_g_sensitivity", "gravity", "latitude", "deflection"),
    "observation_bias",
)
"""Disturbances suspected: members of `inscal.disturbance.COMPONENTS`."""
WANDERING = ("gyro_wander", "accel_wander")
DRIFT = "_drift"
"""Ending of the names of parameters that drift."""


@dataclass(frozen=True)
class Span:
    """Place of a record in a longer one, of which it is a part.

    Attributes
    ----------
    first, whole : float
        When it begins, and how long the whole is, s.
    """

    first: float
    whole: float


def suspects(
    path: Path, made: Response, model: StateModel, span: Span | None = None
) -> Iterator[tuple[str, ConstantsResponse]]:
    """What each suspect does to navigation, per unit of its constants, SI.

    Parameters
    ----------
    path : Path
    made : Response
        Of the path.
    model : StateModel
        What it estimates is no suspect.
    span : Span, optional
        Of the path; without it, it is the whole.

    Yields
    ------
    name : str
        Source of a disturbance, or a parameter with `DRIFT`.
    response : ConstantsResponse
    """
    span = span or Span(0.0, float(path.edges[-1]))
    middle = (0.5 * (path.edges[1:] + path.edges[:-1]) + span.first) / span.whole
    known = {group.source for group in model.augmentations.values()}
    for name in CONSTANT:
        if name not in known:
            yield name, of_constants(made, path, NOTHING, name)
    for name in WANDERING:
        if name not in known:
            unit = bias(path, name)
            waves = [np.cos(np.pi * k * middle) for k in range(1, COSINES + 1)]
            moved = [made.by_update(unit * wave[:, None]) for wave in waves]
            yield name, _seen_by_sensors(np.concatenate(moved, axis=2))
    drifts = of_parameters(made, path, model.columns, middle - 0.5)
    for number, place in enumerate(model.columns):
        yield NAMES[place] + DRIFT, _seen_by_sensors(drifts[:, :, number : number + 1])


def wander_covariance(size: float, time: float, duration: float) -> np.ndarray:
    """Variances of the constants of a wander of some size, as `suspects` has them.

    Parameters
    ----------
    size : float
        Standard deviation, SI.
    time : float
        Correlation time, s.
    duration : float
        Of the record, s.

    Returns
    -------
    ndarray, shape (3 * COSINES,)
        2/T times its spectral density at each cosine's frequency: right for time << T.
    """
    frequency = np.pi * np.arange(1, COSINES + 1) / duration
    density = 2.0 * size**2 * time / (1.0 + np.square(frequency * time))
    return np.repeat(2.0 * density / duration, 3)


def _seen_by_sensors(moved: np.ndarray) -> ConstantsResponse:
    """Response without an effect on observations."""
    return ConstantsResponse(moved, np.zeros((OBSERVED, moved.shape[2])))
