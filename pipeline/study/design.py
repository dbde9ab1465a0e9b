"""A search for a schedule as a configuration asks for it, its file and its page."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from inscal import units
from inscal.blocks import Builder
from inscal.box import share_within
from inscal.design import Tables, covariance, tables
from inscal.parameters import NAMES, UNITS
from inscal.schedule import Turn, initial_attitude, turns_of
from inscal.search import Chain, Problem, advance, begin
from inscal.statistics import nominal_coverage
from pipeline.config.load import load
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
PAPER = "position25"
"""Schedule that a designed one is held against."""
_SLICES = 20
_POSTURES = 96  # all that turns of 90 degrees and one of 45 lead to
_LESS = 60.0  # s, by which a dwell is cut to see what it earns
_BISECTIONS = 6


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
    """

    turns: list[Turn]
    durations: list[float]
    share: float
    sigma_over_bound: np.ndarray


@dataclass(frozen=True)
class Found:
    """What a search has found.

    Attributes
    ----------
    path : Promise
    course : list of (float, float)
        Share of the search done, and the best share of runs by then.
    steps : int
        Paths judged.
    earned : list of float
        Share of runs that each position loses if it is cut by a minute; NaN if it cannot be.
    limit : float
        Share that no path can exceed in that time.
    """

    path: Promise
    course: list[tuple[float, float]]
    steps: int
    earned: list[float]
    limit: float


class Search:
    """A search, made ready.

    Parameters
    ----------
    config : Config

    Raises
    ------
    ConfigError
        If what is asked for cannot be.
    """

    def __init__(self, config: Config):
        self.config, self.setup = config, Setup(config)
        about, setup = config.design, self.setup
        if setup.model.augmented:
            raise ConfigError(
                "estimator.states: a schedule is designed for the 36 states or fewer; "
                f"leave out {', '.join(setup.model.augmentations)}"
            )
        self.interval = config.estimator.update_interval_s
        self.tick = self._updates("time_step_s")
        builder = Builder(setup.site, setup.model, setup.believed_noise, self.interval)
        moves = turns_of((angle, axis) for axis in about.axes for angle in about.angles_deg)
        start = initial_attitude(config.schedule.initial_posture)
        self.tables: Tables = tables(
            builder,
            setup.prior,
            start,
            moves,
            rate=setup.schedule.turn_rate,
            acceleration=setup.schedule.turn_acceleration,
            longest=self._updates("longest_position_s"),
            most_postures=_POSTURES,
        )
        own = setup.model.columns
        self.bound = (setup.bound * setup.unit / setup.prior.parameter)[own]
        turns = int(self.tables.updates.min()) * self.interval * (about.positions - 1)
        needed = turns + about.positions * about.shortest_dwell_s
        if needed > about.total_time_s:
            raise ConfigError(
                f"design.total_time_s = {about.total_time_s:g}: must be at least {needed:g}, "
                f"which {about.positions} positions take with the shortest dwells and turns"
            )
        if about.positions * about.longest_position_s < about.total_time_s:
            raise ConfigError(
                f"design.longest_position_s = {about.longest_position_s:g}: {about.positions} "
                f"positions of it take less than design.total_time_s = {about.total_time_s:g}"
            )

    def _updates(self, key: str) -> int:
        value = getattr(self.config.design, key)
        count = round(value / self.interval)
        if count < 1 or abs(count * self.interval - value) > 1e-6:
            raise ConfigError(
                f"design.{key} = {value:g}: must be a multiple of estimator.update_interval_s, "
                f"which is {self.interval:g}"
            )
        return count

    def problem(self, objective: str) -> Problem:
        """What is searched for."""
        about = self.config.design
        last = -1
        if about.last_posture is not None:
            wanted = initial_attitude(about.last_posture)
            near = np.abs(self.tables.attitudes - wanted).max(axis=(1, 2)) < 1e-6
            if not near.any():
                raise ConfigError(
                    f"design.last_posture = {about.last_posture}: no turns of design.angles_deg "
                    "about design.axes lead there"
                )
            last = int(np.argmax(near))
        limit = about.cable_limit_deg
        return Problem(
            self.tables,
            self.bound,
            objective,
            self.tick,
            int(np.ceil(about.shortest_dwell_s / self.interval)),
            last,
            np.inf if limit is None else limit * units.DEGREE,
        )

    def judge(self, moves: np.ndarray, durations: np.ndarray) -> Promise:
        """A path with what it promises."""
        found = covariance(self.tables, moves, self._rests(moves, durations))
        sigma = np.full(len(NAMES), np.nan)
        sigma[self.setup.model.columns] = np.sqrt(np.diag(found)) / self.bound
        return Promise(
            [self.tables.moves[m] for m in moves],
            [float(x) * self.interval for x in durations],
            share_within(found, self.bound),
            sigma,
        )

    def _rests(self, moves: np.ndarray, durations: np.ndarray) -> np.ndarray:
        return np.asarray(durations - np.append(self.tables.updates[moves], 0))

    def numbers_of(self, name: str) -> tuple[np.ndarray, np.ndarray] | None:
        """Moves and durations of a schedule; None where it has other moves."""
        other = Setup(replace(self.config, schedule=load([f"schedule={name}"]).schedule)).schedule
        moves = []
        for turn in other.turns:
            same = [
                n
                for n, move in enumerate(self.tables.moves)
                if move.axis == turn.axis and abs(move.angle - turn.angle) < 1e-9
            ]
            if not same:
                return None
            moves.append(same[0])
        return np.array(moves), np.rint(other.durations / self.interval).astype(int)

    def run(
        self, objective: str, seconds: float, total: float, tell: Callable[[str], None]
    ) -> Found:
        """Search for a path of a time.

        Parameters
        ----------
        objective : str
        seconds : float
            Of search.
        total : float
            Time of the path, s.
        tell : callable
            Is told how it goes.

        Returns
        -------
        Found
            The best by then, if it is interrupted.
        """
        about, problem = self.config.design, self.problem(objective)
        updates = int(total / self.interval) // self.tick * self.tick
        given = self.numbers_of(about.start_from) if about.start_from else None
        streams = [np.random.default_rng([about.seed, n]) for n in range(about.chains)]
        first = given[0] if given and len(given[0]) == about.positions - 1 else None
        try:
            chains = [begin(problem, about.positions, updates, r, first) for r in streams]
        except ValueError as error:
            raise ConfigError(f"design: {error}") from None
        steps = max(1, int(seconds * about.steps_per_second / about.chains / _SLICES))
        course: list[tuple[float, float]] = []
        try:
            with ThreadPoolExecutor(min(about.chains, os.cpu_count() or 1)) as pool:
                for k in range(_SLICES):
                    part = k / _SLICES, (k + 1) / _SLICES
                    going = [
                        pool.submit(advance, problem, chain, rng, steps, *part)
                        for chain, rng in zip(chains, streams, strict=True)
                    ]
                    chains = [one.result() for one in going]
                    share = self._best(chains).share
                    course.append((part[1], share))
                    tell(f"{100 * part[1]:.0f} %: {100 * share:.2f} % of runs keep all bounds")
        except KeyboardInterrupt:
            tell("interrupted: the best so far is kept")
        best = min(chains, key=lambda chain: chain.best_energy)
        return self._found(best, course, steps * about.chains * len(course))

    def _best(self, chains: Sequence[Chain]) -> Promise:
        best = min(chains, key=lambda chain: chain.best_energy)
        return self.judge(best.best_moves, best.best_durations)

    def _found(self, best: Chain, course: list[tuple[float, float]], steps: int) -> Found:
        moves, durations = best.best_moves, best.best_durations
        path, less = self.judge(moves, durations), int(_LESS / self.interval)
        earned = []
        for k in range(len(durations)):
            cut = durations.copy()
            cut[k] -= less
            possible = self._rests(moves, cut).min() >= 0
            earned.append(path.share - self.judge(moves, cut).share if possible else np.nan)
        return Found(path, course, steps, earned, self.limit(sum(path.durations)))

    def limit(self, total: float) -> float:
        """Share of runs that no path of a time can exceed: gyro biases against their white noise.

        With the gyro's noise alone a bias is known to N / sqrt(T) at best, whatever the path.
        """
        setup = self.setup
        sigma = setup.believed_noise.gyro / np.sqrt(total)
        bound = (setup.bound * setup.unit)[:3]
        return float(np.prod([nominal_coverage(one / sigma) for one in bound]))

    def shortest(self, tell: Callable[[str], None]) -> Found:
        """Shortest path found whose share is what is asked for.

        Raises
        ------
        ConfigError
            If it is not reached in `design.total_time_s`.
        """
        about = self.config.design
        wanted, seconds = about.joint_share, about.seconds / (_BISECTIONS + 1)
        if self.limit(about.total_time_s) < wanted:
            raise ConfigError(
                f"design.joint_share = {wanted:g}: no path of {about.total_time_s:g} s can exceed "
                f"{self.limit(about.total_time_s):.4f} at this noise, by the gyros' alone"
            )
        low, high, best = (
            0.0,
            about.total_time_s,
            self.run("joint_share", seconds, about.total_time_s, tell),
        )
        if best.path.share < wanted:
            raise ConfigError(
                f"design.joint_share = {wanted:g}: the best path found of {about.total_time_s:g} s "
                f"has {best.path.share:.4f}; more design.seconds may find a better one"
            )
        floor = about.positions * (
            about.shortest_dwell_s + int(self.tables.updates.max()) * self.interval
        )
        low = min(floor, high)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            found = self.run("joint_share", seconds, middle, lambda _: None)
            tell(f"{middle:.0f} s: {100 * found.path.share:.2f} % of runs keep all bounds")
            if found.path.share >= wanted:
                best, high = found, middle
            else:
                low = middle
        return best


def schedule_text(config: Config, found: Found) -> str:
    """Text of the schedule's file, with a comment of what it promises."""
    return render(
        _TEMPLATES,
        "designed.yaml.jinja",
        called=config.design.name,
        objective=config.design.objective,
        share=found.path.share,
        noise=config.noise.name,
        total=sum(found.path.durations),
        usual=found.path.durations[-1],
        schedule=config.schedule,
        posture=list(config.schedule.initial_posture),
        rotations=_rotations(found.path),
        seed=config.design.seed,
        steps=found.steps,
    )


def _rotations(path: Promise) -> list[str]:
    return [
        f"[{turn.angle / units.DEGREE:g}, {'XYZ'[turn.axis]}, {duration:g}]"
        for turn, duration in zip(path.turns, path.durations[:-1], strict=True)
    ]


def page(config: Config, search: Search, found: Found) -> str:
    """Write the page of what was found.

    Parameters
    ----------
    config : Config
    search : Search
    found : Found

    Returns
    -------
    str
    """
    numbers = search.numbers_of(PAPER)
    paper = search.judge(*numbers) if numbers else None
    durations = found.path.durations
    angles = ["", *(f"{t.angle / units.DEGREE:g} about {'xyz'[t.axis]}" for t in found.path.turns)]
    return render(
        _TEMPLATES,
        "design.md.jinja",
        called=config.design.name,
        objective=config.design.objective,
        noise=config.noise.name,
        total=sum(durations),
        positions=len(durations),
        share=found.path.share,
        limit=found.limit,
        steps=found.steps,
        chains=config.design.chains,
        seed=config.design.seed,
        paper=PAPER,
        paper_share=paper.share if paper else None,
        paper_total=sum(paper.durations) if paper else None,
        places=[
            (str(k + 1), f"{time:g}", turn, _points(earned))
            for k, (time, turn, earned) in enumerate(
                zip(durations, [*angles[1:], ""], found.earned, strict=True)
            )
        ],
        sigmas=[
            (md.code(name), UNITS[i], f"{found.path.sigma_over_bound[i]:.3f}",
             f"{paper.sigma_over_bound[i]:.3f}" if paper else "")
            for i, name in enumerate(NAMES)
        ],
        course=[(f"{100 * part:.0f} %", f"{100 * share:.3f} %") for part, share in found.course],
    )  # fmt: skip


def _points(value: float) -> str:
    return "" if np.isnan(value) else f"{100 * value:.3f}"


def content(config: Config, found: Found) -> dict[str, Any]:
    """What was found, as it is written."""
    return {
        "name": config.design.name,
        "objective": config.design.objective,
        "joint_share": found.path.share,
        "limit": found.limit,
        "total_time_s": sum(found.path.durations),
        "durations_s": found.path.durations,
        "rotations": _rotations(found.path),
        "parameter": list(NAMES),
        "sigma_over_bound": found.path.sigma_over_bound.tolist(),
        "steps": found.steps,
        "course": found.course,
    }
