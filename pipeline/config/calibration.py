"""Configuration group `calibration`: how a log is gone about."""

from dataclasses import dataclass

from omegaconf import MISSING


@dataclass
class Calibration:
    """How `pipeline.calibrate` goes about a log.

    Attributes
    ----------
    frame : str
        Body axes of the estimates: ``gyro``, as in campaigns, or ``accelerometer``.
    prior_factor : float
        By which the priors of the filter are wider than in campaigns.
    rounds : int
        How often the motion is taken from the log.
    first_guess : bool
        Whether scales are known to some percent only, and guessed from rests and turns first.
    left_out : list of int
        Rests in which nothing is observed, from 1.
    halves : bool
        Whether both halves of the log are calibrated too, and compared.
    compare_to : str or None
        Result of another calibration of the unit, JSON.
    false_alarms, power : float
        Of all tests of a log together, and share of logs in which what is called findable is found.
    wander_time_s : float
        Correlation time of the wander that is called findable.
    """

    frame: str = MISSING
    prior_factor: float = MISSING
    rounds: int = MISSING
    first_guess: bool = MISSING
    left_out: list[int] = MISSING
    halves: bool = MISSING
    compare_to: str | None = MISSING
    false_alarms: float = MISSING
    power: float = MISSING
    wander_time_s: float = MISSING
