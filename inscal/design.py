r"""Schedules judged by the thousand: the covariance of a path, block by block.

Postures are numbered, as are moves (turns about body axes). A path is a sequence of moves with the
number of updates that the body rests before each. Its final covariance takes two blocks of
`inscal.blocks` a position and no simulation; constants are in units of their priors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inscal.blocks import RATES, Builder
from inscal.kernel import compiled, inlined
from inscal.recursion import InitialStd
from inscal.schedule import Turn, turn_vector, turned
from inscal.state_model import NAVIGATION

_DIGITS = 6


@dataclass(frozen=True)
class Tables:
    """All that a path's covariance needs to know, by posture and move.

    Attributes
    ----------
    moves : tuple of Turn
    attitudes : ndarray, shape (postures, 3, 3)
        Body to NED; the first is that of the start.
    after : ndarray of int, shape (postures, moves)
        Posture after a move; -1 where it is not allowed.
    updates : ndarray of int, shape (moves,)
        That a move takes.
    rates : ndarray, shape (postures, 6, n)
        Of `Builder.rates`, per prior sigma.
    turn_seen, turn_carried, turn_noise : ndarray
        Blocks of turns, shape (postures, moves, ...), per prior sigma.
    rest_seen, rest_carried, rest_noise : ndarray
        Blocks of dwells by their updates, shape (longest + 1, ...).
    initial : ndarray, shape (9,)
        Variances of the navigation states at the start.
    """

    moves: tuple[Turn, ...]
    attitudes: np.ndarray
    after: np.ndarray
    updates: np.ndarray
    rates: np.ndarray
    turn_seen: np.ndarray
    turn_carried: np.ndarray
    turn_noise: np.ndarray
    rest_seen: np.ndarray
    rest_carried: np.ndarray
    rest_noise: np.ndarray
    initial: np.ndarray

    @property
    def blocks(self) -> tuple[np.ndarray, ...]:
        """What `through` takes, from `after` on."""
        return (
            self.after, self.rates, self.turn_seen, self.turn_carried, self.turn_noise,
            self.rest_seen, self.rest_carried, self.rest_noise, self.initial,
        )  # fmt: skip


def tables(
    builder: Builder,
    prior: InitialStd,
    start: np.ndarray,
    moves: Sequence[Turn],
    *,
    rate: float,
    acceleration: float | None,
    longest: int,
    most_postures: int,
) -> Tables:
    """Make the tables.

    Parameters
    ----------
    builder : Builder
    prior : InitialStd
    start : ndarray, shape (3, 3)
        Attitude before the first turn.
    moves : sequence of Turn
    rate, acceleration : float, float or None
        Of all turns.
    longest : int
        Updates of the longest dwell.
    most_postures : int
        Moves that lead to yet more postures are not allowed; those nearest to the start come first.

    Returns
    -------
    Tables
    """
    attitudes, after = _postures(start, moves, most_postures)
    unit = np.concatenate([prior.parameter[builder.model.columns], builder.initial])
    n = NAVIGATION + len(unit)
    shape = len(attitudes), len(moves)
    seen, carried = np.zeros((*shape, n, n)), np.zeros((*shape, NAVIGATION, n))
    noise, updates = np.zeros((*shape, NAVIGATION, NAVIGATION)), np.zeros(len(moves), dtype=int)
    scale = np.concatenate([np.ones(NAVIGATION), unit])
    for p, m in np.argwhere(after >= 0):
        updates[m], block = builder.turn(attitudes[p], turn_vector(moves[m]), rate, acceleration)
        seen[p, m], carried[p, m] = block.seen * scale, block.carried * scale
        noise[p, m] = block.noise
    rests = builder.dwells(longest, range(longest + 1))
    return Tables(
        moves=tuple(moves),
        attitudes=attitudes,
        after=after,
        updates=updates,
        rates=np.array([builder.rates(a) for a in attitudes]) * unit,
        turn_seen=seen,
        turn_carried=carried,
        turn_noise=noise,
        rest_seen=np.array([rests[k].seen for k in range(longest + 1)]),
        rest_carried=np.array([rests[k].carried for k in range(longest + 1)]),
        rest_noise=np.array([rests[k].noise for k in range(longest + 1)]),
        initial=np.square(prior.navigation),
    )


def _postures(start: np.ndarray, moves: Sequence[Turn], most: int) -> tuple[np.ndarray, np.ndarray]:
    """Postures that moves lead to, breadth first, and which follows which."""

    def key(attitude: np.ndarray) -> bytes:
        return (np.round(attitude, _DIGITS) + 0.0).tobytes()

    known, number = [start], {key(start): 0}
    after: list[list[int]] = []
    for place in range(most):
        if place == len(known):
            break
        row = []
        for move in moves:
            led = turned(known[place], turn_vector(move))
            if key(led) not in number and len(known) < most:
                number[key(led)] = len(known)
                known.append(led)
            row.append(number.get(key(led), -1))
        after.append(row)
    return np.array(known), np.array(after)


def covariance(about: Tables, moves: np.ndarray, rests: np.ndarray) -> np.ndarray:
    """Covariance of the constants at the end of a path.

    Parameters
    ----------
    about : Tables
    moves : ndarray of int, shape (positions - 1,)
    rests : ndarray of int, shape (positions,)
        Updates of the dwells.

    Returns
    -------
    ndarray, shape (n, n)
        In units of the priors.
    """
    n = about.rates.shape[2]
    out = np.empty((NAVIGATION + n,) * 2)
    through(moves, rests, *about.blocks, out)
    return out[NAVIGATION:, NAVIGATION:]


@compiled
def considered(own, states, others):
    """True covariance of the states of a filter that knows nothing of others.

    Both are constants of known prior, whose joint covariance `own` has their priors as units. Its
    inverse is the information J; without the others the filter claims A = J_ss^-1, and one unit of
    them moves its estimates by -A J_so (Schmidt's consider covariance): A + A J_so J_os A.
    """
    information = np.linalg.inv(own)
    claimed = np.linalg.inv(np.ascontiguousarray(information[states][:, states]))
    moved = claimed @ np.ascontiguousarray(information[states][:, others])
    return claimed + moved @ moved.T


@compiled
def through(
    moves, rests, after, rates, turn_seen, turn_carried, turn_noise,
    rest_seen, rest_carried, rest_noise, initial, p,
):  # fmt: skip
    """Fill `p` with the covariance of navigation and parameters at the end of a path."""
    count = len(p)
    seen, carried = np.zeros((NAVIGATION + RATES, count)), np.empty((NAVIGATION, count))
    work = np.empty((NAVIGATION, count))
    vector = np.empty(count)
    p[:] = 0.0
    for i in range(NAVIGATION):
        p[i, i] = initial[i]
    for i in range(NAVIGATION, count):
        p[i, i] = 1.0
    posture = 0
    for k in range(len(rests)):
        rest = rests[k]
        if rest > 0:
            _spread(rest_seen[rest], rates[posture], seen)
            _spread(rest_carried[rest], rates[posture], carried)
            _observe(p, seen, vector)
            _carry(p, carried, rest_noise[rest], work)
        if k < len(moves):
            move = moves[k]
            _observe(p, turn_seen[posture, move], vector)
            _carry(p, turn_carried[posture, move], turn_noise[posture, move], work)
            posture = after[posture, move]


@inlined
def _spread(block, rates, out):
    """Rows on navigation and rates of error as rows on navigation and parameters."""
    for i in range(len(block)):
        for j in range(NAVIGATION):
            out[i, j] = block[i, j]
        for j in range(NAVIGATION, out.shape[1]):
            out[i, j] = 0.0
        for r in range(RATES):
            f = block[i, NAVIGATION + r]
            for j in range(rates.shape[1]):
                out[i, NAVIGATION + j] += f * rates[r, j]


@inlined
def _observe(p, seen, vector):
    """Update by observations of unit noise, row by row."""
    count = len(p)
    for i in range(len(seen)):
        variance = 1.0
        for j in range(count):
            vector[j] = 0.0
        for m in range(count):
            f = seen[i, m]
            if f != 0.0:
                for j in range(count):
                    vector[j] += f * p[m, j]
        for m in range(count):
            variance += seen[i, m] * vector[m]
        if variance == 1.0:
            continue
        share = 1.0 / variance
        for m in range(count):
            f = vector[m] * share
            for j in range(count):
                p[m, j] -= f * vector[j]


@inlined
def _carry(p, carried, noise, work):
    """Replace navigation by `carried` of all states and noise."""
    count = len(p)
    for i in range(NAVIGATION):
        for j in range(count):
            work[i, j] = 0.0
        for m in range(count):
            f = carried[i, m]
            if f != 0.0:
                for j in range(count):
                    work[i, j] += f * p[m, j]
    for i in range(NAVIGATION):
        for j in range(NAVIGATION, count):
            p[i, j] = work[i, j]
            p[j, i] = work[i, j]
    for i in range(NAVIGATION):
        for j in range(i + 1):
            total = noise[i, j]
            for m in range(count):
                total += carried[j, m] * work[i, m]
            p[i, j] = total
            p[j, i] = total
