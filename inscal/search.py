r"""Search for a schedule: simulated annealing of turns and times over tables of `inscal.design`.

A path has a number of positions and a total time, in ticks of some updates. A step of the search
changes a turn, swaps two, or moves a tick from one position to another; it is kept if the path is
better, or with probability exp(-worse / temperature) (Kirkpatrick, Gelatt and Vecchi, Science 220,
1983). The temperature falls geometrically. Chains are independent and each has a stream of its own,
so what is found depends on the seed and the number of steps and not on how many run at a time.
"""

from dataclasses import dataclass, replace
from itertools import chain as following

import numpy as np

from inscal.box import GENERATORS, box_share
from inscal.design import Tables, considered, through
from inscal.kernel import compiled
from inscal.state_model import NAVIGATION

OBJECTIVES = ("joint_share", "worst", "d_optimal")
"""Share of runs that keep all bounds, largest sigma over bound, determinant of the covariance."""
_POINTS = 64  # of the lattice: the share to 1e-5
_HOT, _COLD = 0.5, 0.01
_TRIES = 10_000


@dataclass(frozen=True)
class Problem:
    """What is searched for.

    Attributes
    ----------
    about : Tables
    bound : ndarray, shape (n,)
        Of the parameters, the first constants, in units of their priors.
    objective : str
        One of `OBJECTIVES`.
    tick : int
        Updates of the smallest change of a duration.
    shortest : int
        Updates of the shortest dwell.
    last : int
        Number of the last posture; -1: any.
    cable : float
        Largest sum of turns about an axis either way, rad; infinite: any.
    disturbed : Tables or None
        By what truth has beyond the filter's belief: a path is then judged by the mean of the
        objective without and with that.
    others : tuple of int
        Places there of constants that the filter knows nothing of.
    """

    about: Tables
    bound: np.ndarray
    objective: str
    tick: int
    shortest: int
    last: int = -1
    cable: float = np.inf
    disturbed: Tables | None = None
    others: tuple[int, ...] = ()

    @property
    def angles(self) -> np.ndarray:
        """Axis and angle of every move, shape (moves, 2)."""
        return np.array([[move.axis, move.angle] for move in self.about.moves])


@dataclass(frozen=True)
class Chain:
    """Where a chain stands.

    Attributes
    ----------
    moves : ndarray of int, shape (positions - 1,)
    durations : ndarray of int, shape (positions,)
        Updates, turns included.
    energy : float
        The less, the better.
    best_moves, best_durations : ndarray
    best_energy : float
    """

    moves: np.ndarray
    durations: np.ndarray
    energy: float
    best_moves: np.ndarray
    best_durations: np.ndarray
    best_energy: float


def scaled(durations: np.ndarray, updates: int, tick: int) -> np.ndarray:
    """Durations in proportion to some, in whole ticks, of a sum.

    Parameters
    ----------
    durations : ndarray, shape (positions,)
    updates : int
        Their sum, a multiple of `tick`.
    tick : int

    Returns
    -------
    ndarray of int, shape (positions,)
    """
    ends = np.cumsum(durations) / np.sum(durations)
    return np.diff(np.rint(ends * (updates // tick)).astype(int), prepend=0) * tick


def begin(
    problem: Problem,
    durations: np.ndarray,
    rng: np.random.Generator,
    moves: np.ndarray | None = None,
) -> Chain:
    """Start a chain at random turns, or at some.

    Parameters
    ----------
    problem : Problem
    durations : ndarray of int, shape (positions,)
        Updates, turns included.
    rng : Generator
    moves : ndarray of int, optional
        Turns to begin with, if they are allowed in these times.

    Returns
    -------
    Chain

    Raises
    ------
    ValueError
        If no path of random turns is allowed.
    """
    kinds, even = (
        len(problem.about.moves),
        scaled(np.ones(len(durations)), int(durations.sum()), problem.tick),
    )
    given = [] if moves is None else [(moves, durations), (moves, even)]
    drawn = ((rng.integers(kinds, size=len(durations) - 1), even) for _ in range(_TRIES))
    for tried, times in following(given, drawn):
        energy = energy_of(problem, tried, times)
        if np.isfinite(energy):
            return Chain(tried, times, energy, tried, times, energy)
    raise ValueError("no path of these turns ends in time and where it is to end")


def energy_of(problem: Problem, moves: np.ndarray, durations: np.ndarray) -> float:
    """Energy of a path; infinite where it is not allowed."""
    return float(_energy(moves, durations, *_arguments(problem)))


def advance(
    problem: Problem, chain: Chain, rng: np.random.Generator, steps: int, begun: float, ended: float
) -> Chain:
    """Go on with a chain.

    Parameters
    ----------
    problem : Problem
    chain : Chain
    rng : Generator
        Of the chain; goes on.
    steps : int
    begun, ended : float
        Shares of the whole search before and after these steps, 0 to 1.

    Returns
    -------
    Chain
    """
    now = [np.array(x) for x in (chain.moves, chain.durations)]
    best = [np.array(x) for x in (chain.best_moves, chain.best_durations)]
    temperature = _HOT * (_COLD / _HOT) ** begun, _HOT * (_COLD / _HOT) ** ended
    energy, best_energy = _anneal(
        *now, chain.energy, *best, chain.best_energy, rng, steps, temperature, *_arguments(problem)
    )
    return replace(
        chain,
        moves=now[0],
        durations=now[1],
        energy=energy,
        best_moves=best[0],
        best_durations=best[1],
        best_energy=best_energy,
    )


def _arguments(problem: Problem) -> tuple:
    rules = (
        problem.about.updates, problem.angles, problem.tick, problem.shortest, problem.last,
        problem.cable + 1e-9, OBJECTIVES.index(problem.objective), problem.bound, GENERATORS,
    )  # fmt: skip
    if problem.disturbed is None:
        return problem.about.blocks, None, rules
    others = np.array(problem.others, dtype=int)
    states = np.setdiff1d(np.arange(problem.disturbed.rates.shape[2]), others)
    return problem.about.blocks, (problem.disturbed.blocks, states, others), rules


@compiled
def _energy(moves, durations, blocks, disturbed, rules):
    after, updates, angles = blocks[0], rules[0], rules[1]
    shortest, last, cable, objective, bound = rules[3], rules[4], rules[5], rules[6], rules[7]
    rests = durations.copy()
    wound, posture = np.zeros(3), 0
    for k in range(len(moves)):
        rests[k] -= updates[moves[k]]
        axis = int(angles[moves[k], 0])
        wound[axis] += angles[moves[k], 1]
        if abs(wound[axis]) > cable:
            return np.inf
        posture = after[posture, moves[k]]
        if posture < 0:
            return np.inf
    if rests.min() < shortest or (last >= 0 and posture != last) or rests.max() >= len(blocks[5]):
        return np.inf
    energy = _worth(_constants(moves, rests, blocks), bound, objective, rules[8])
    if disturbed is not None:
        true, states, others = _constants(moves, rests, disturbed[0]), disturbed[1], disturbed[2]
        if len(others) > 0:
            true = considered(true, states, others)
        energy = 0.5 * (energy + _worth(true, bound, objective, rules[8]))
    return energy


@compiled
def _constants(moves, rests, blocks):
    """Covariance of the constants at the end of a path."""
    count = NAVIGATION + blocks[1].shape[2]
    p = np.empty((count, count))
    through(moves, rests, *blocks, p)
    return np.ascontiguousarray(p[NAVIGATION:, NAVIGATION:])


@compiled
def _worth(covariance, bound, objective, generators):
    """Energy of a covariance, the less, the better."""
    n = len(bound)
    own = np.ascontiguousarray(covariance[:n, :n])
    if objective == 2:
        return 0.5 * np.linalg.slogdet(own)[1]
    largest = 0.0
    for i in range(n):
        largest = max(largest, np.sqrt(own[i, i]) / bound[i])
    if objective == 1:
        return np.log(largest)
    share = box_share(own, bound, _POINTS, generators)
    if share < 1e-6:
        return 14.0 + largest  # so far off that any better bound helps
    return np.log(max(1.0 - share, 1e-12)) - np.log(share)


@compiled
def _anneal(
    moves, durations, energy, best_moves, best_durations, best_energy, rng, steps, temperature,
    blocks, disturbed, rules,
):  # fmt: skip
    """Go `steps` on; arrays change in place, energies are returned."""
    count, tick, kinds = len(durations), rules[2], len(rules[0])
    tried, times = moves.copy(), durations.copy()
    for step in range(steps):
        hot = temperature[0] * (temperature[1] / temperature[0]) ** (step / steps)
        tried[:], times[:] = moves, durations
        kind = rng.random()
        if kind < 0.4:
            tried[int(rng.random() * (count - 1))] = int(rng.random() * kinds)
            if rng.random() < 0.4:
                tried[int(rng.random() * (count - 1))] = int(rng.random() * kinds)
        elif kind < 0.5:
            i, j = int(rng.random() * (count - 1)), int(rng.random() * (count - 1))
            tried[i], tried[j] = tried[j], tried[i]
        else:
            i, j = int(rng.random() * count), int(rng.random() * count)
            moved = tick * (1 + int(rng.random() * rng.random() * 8.0))
            times[i] -= moved
            times[j] += moved
        found = _energy(tried, times, blocks, disturbed, rules)
        if found <= energy or rng.random() < np.exp((energy - found) / hot):
            moves[:], durations[:], energy = tried, times, found
            if energy < best_energy:
                best_moves[:], best_durations[:], best_energy = moves, durations, energy
    return energy, best_energy
