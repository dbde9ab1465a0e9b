"""The linear model of augmented states between updates; `inscal.augmentation` makes it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class AugmentedTransitions:
    """What augmented states do between updates.

    Attributes
    ----------
    std : ndarray, shape (n,)
        Standard deviations at the start, SI.
    navigation : ndarray, shape (updates, 9, n)
        Effect on the navigation states over each interval of what they are at its start.
    decay : ndarray, shape (w,)
        Transition of those that wander, the last, over an interval.
    drive : ndarray, shape (w,)
        Standard deviation of what is added to each meanwhile, by a unit normal u.
    driven : ndarray, shape (w, 2)
        What of u and of another unit normal acts on navigation within the interval, as a share of
        the state's own effect there.
    """

    std: np.ndarray
    navigation: np.ndarray
    decay: np.ndarray
    drive: np.ndarray
    driven: np.ndarray

    @property
    def wandering(self) -> int:
        """Number of states that wander; they are the last."""
        return len(self.decay)

    @property
    def constants(self) -> int:
        """Number of those that do not."""
        return len(self.std) - len(self.decay)

    @property
    def constant_std(self) -> np.ndarray:
        """Standard deviations of those that do not, SI, shape (constants,)."""
        return self.std[: self.constants]
