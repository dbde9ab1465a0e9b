"""What a search for a schedule has found: a path, and what it promises."""

from dataclasses import dataclass

import numpy as np

from inscal import units
from inscal.schedule import Turn


@dataclass(frozen=True)
class Promise:
    """A path with what it promises.

    Attributes
    ----------
    turns : list of Turn
    durations : list of float
        Of positions, s.
    share : float
        Of runs that keep all bounds, predicted from the full covariance.
    sigma_over_bound : ndarray, shape (27,)
        NaN where not modelled.
    disturbed : float or None
        The share where truth has what the filter knows nothing of; None where there is nothing.
    """

    turns: list[Turn]
    durations: list[float]
    share: float
    sigma_over_bound: np.ndarray
    disturbed: float | None = None

    @property
    def total(self) -> float:
        """Duration of the path, s."""
        return sum(self.durations)

    @property
    def worst(self) -> float:
        """Largest sigma over bound."""
        return float(np.nanmax(self.sigma_over_bound))

    @property
    def rotations(self) -> list[tuple[float, str, float]]:
        """Turns as schedules have them: degrees, axis, seconds of the position that it ends."""
        return [
            (round(turn.angle / units.DEGREE, 6), "XYZ"[turn.axis], duration)
            for turn, duration in zip(self.turns, self.durations[:-1], strict=True)
        ]


@dataclass(frozen=True)
class Found:
    """What a search has found.

    Attributes
    ----------
    path : Promise
        By the recursion of all states.
    course : list of (float, float)
        Share of the search done, and the best share of runs by then.
    steps : int
        Paths judged.
    earned : list of float
        Share of runs that each position loses if it is cut by a minute; NaN if it cannot be.
    limit : float
        Share that no path can exceed in that time.
    left_out : list of str
        State groups that the search did without.
    considered : list of str
        Groups of what truth has and the filter does not know, which the search was to stand.
    """

    path: Promise
    course: list[tuple[float, float]]
    steps: int
    earned: list[float]
    limit: float
    left_out: list[str]
    considered: list[str]
