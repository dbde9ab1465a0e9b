"""A search for a schedule as a configuration asks for it."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from inscal import units
from inscal.box import share_within
from inscal.parameters import NAMES
from inscal.schedule import initial_attitude
from inscal.search import Chain, Problem, advance, begin, scaled
from inscal.state_model import NAVIGATION
from inscal.statistics import nominal_coverage
from pipeline.config.load import load
from pipeline.config.rules import check_duration
from pipeline.config.schema import Config, Schedule
from pipeline.config.setup import Setup
from pipeline.console.errors import ConfigError
from pipeline.study.budget import sheet
from pipeline.study.design_tables import believed, disturbed, left_out
from pipeline.study.promise import Found, Promise

_SLICES = 20
_LESS = 60.0  # s, by which a dwell is cut to see what it earns
_BISECTIONS = 6
_COOLED = 0.6  # of the cooling that a search does without which goes on from a path
_STATES = 36  # that `design.steps_per_second` is of; time grows as their square


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
        setup = self.setup
        self.interval = config.estimator.update_interval_s
        self.tick = self._updates("time_step_s")
        longest = self._updates("longest_position_s")
        self.left_out = left_out(setup)
        self.scene, self.disturbed = believed(setup, longest), disturbed(setup, longest)
        self.tables, self.own = self.scene.tables, setup.model.columns
        self.bound = (setup.bound * setup.unit / setup.prior.parameter)[self.own]
        self._refuse_impossible()

    def _updates(self, key: str) -> int:
        value = getattr(self.config.design, key)
        check_duration(f"design.{key}", value, self.config)
        return round(value / self.interval)

    def _refuse_impossible(self) -> None:
        about = self.config.design
        if self.shortest_time > about.total_time_s:
            raise ConfigError(
                f"design.total_time_s = {about.total_time_s:g}: must be at least "
                f"{self.shortest_time:g}, which {about.positions} positions take with the "
                "shortest dwells and turns"
            )
        if about.positions * about.longest_position_s < about.total_time_s:
            raise ConfigError(
                f"design.longest_position_s = {about.longest_position_s:g}: {about.positions} "
                f"positions of it take less than design.total_time_s = {about.total_time_s:g}"
            )

    @property
    def shortest_time(self) -> float:
        """Time that the shortest dwells and turns take, s."""
        about = self.config.design
        turns = int(self.tables.updates.min()) * self.interval * (about.positions - 1)
        return turns + about.positions * about.shortest_dwell_s

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
            self.disturbed.tables if self.disturbed else None,
            self.disturbed.others if self.disturbed else (),
        )

    def judge(self, moves: np.ndarray, durations: np.ndarray) -> Promise:
        """A path with what it promises, without states that are left out.

        Raises
        ------
        ConfigError
            If a turn does not fit into its position, or a position is longer than the search knows.
        """
        rests, longest = self._rests(moves, durations), len(self.tables.rest_seen) - 1
        low, high = rests.min() * self.interval, rests.max() * self.interval
        if low < 0 or rests.max() > longest:
            raise ConfigError(
                f"design.longest_position_s = {self.config.design.longest_position_s:g}: a path "
                f"has dwells of {low:g} to {high:g} s"
            )
        promise = self._promise(moves, durations, self.scene.covariance(moves, rests))
        if self.disturbed is None:
            return promise
        true = self._promise(moves, durations, self.disturbed.covariance(moves, rests))
        return replace(promise, disturbed=true.share)

    def exactly(self, moves: np.ndarray, durations: np.ndarray) -> Promise:
        """A path with what it promises, by the recursion of all states and the error budget."""
        if self.disturbed is None and not self.left_out:
            return self.judge(moves, durations)
        path = self._promise(moves, durations, np.eye(len(self.own)))
        setup, disturbed = Setup(replace(self.config, schedule=self.schedule_of(path))), None
        if self.disturbed:
            made = sheet(setup).budget
            disturbed = self._promise(moves, durations, self._own(made.true_covariance)).share
        exact = self._promise(moves, durations, self._own(setup.gains.covariance))
        return replace(exact, disturbed=disturbed)

    def _own(self, covariance: np.ndarray) -> np.ndarray:
        """Covariance of the parameters in units of their priors."""
        prior = self.setup.prior.parameter[self.own]
        return np.asarray(covariance[np.ix_(self.own, self.own)] / np.outer(prior, prior))

    def _promise(self, moves: np.ndarray, durations: np.ndarray, found: np.ndarray) -> Promise:
        n, sigma = len(self.own), np.full(len(NAMES), np.nan)
        sigma[self.own] = np.sqrt(np.diag(found)[:n]) / self.bound
        return Promise(
            [self.tables.moves[m] for m in moves],
            [float(x) * self.interval for x in durations],
            share_within(found[:n, :n], self.bound),
            sigma,
        )

    def schedule_of(self, path: Promise) -> Schedule:
        """Group `schedule` of a path."""
        return replace(
            self.config.schedule,
            name=self.config.design.name,
            position_duration_s=path.durations[-1],
            last_position_duration_s=path.durations[-1],
            rotations=[list(rotation) for rotation in path.rotations],
        )

    def _rests(self, moves: np.ndarray, durations: np.ndarray) -> np.ndarray:
        return np.asarray(durations - np.append(self.tables.updates[moves], 0))

    def known(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Moves and durations, in updates, of a schedule.

        Raises
        ------
        ConfigError
            If the search does not know its turns.
        """
        other = Setup(replace(self.config, schedule=load([f"schedule={name}"]).schedule)).schedule
        known = {(m.axis, round(m.angle, 6)): n for n, m in enumerate(self.tables.moves)}
        moves = [known.get((turn.axis, round(turn.angle, 6))) for turn in other.turns]
        if None in moves:
            raise ConfigError(
                f"design.angles_deg = {self.config.design.angles_deg}: must hold the turns of "
                f"schedule {name}, about design.axes"
            )
        return np.array(moves), np.rint(other.durations / self.interval).astype(int)

    def run(
        self,
        objective: str,
        seconds: float,
        total: float,
        tell: Callable[[str], None],
        given: tuple[np.ndarray, np.ndarray] | None = None,
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
        given : tuple of ndarray, optional
            Moves and durations to go on from, scaled to the time.

        Returns
        -------
        Found
            The best by then, if it is interrupted.
        """
        about, problem = self.config.design, self.problem(objective)
        updates = int(total / self.interval) // self.tick * self.tick
        streams = [np.random.default_rng([about.seed, n]) for n in range(about.chains)]
        moves, durations = given or (None, np.ones(about.positions))
        durations = scaled(durations, updates, self.tick)
        try:
            chains = [begin(problem, durations, rng, moves) for rng in streams]
        except ValueError as error:
            raise ConfigError(f"design: {error}") from None
        every = [self.tables, *([self.disturbed.tables] if self.disturbed else [])]
        work = sum((NAVIGATION + one.rates.shape[2]) ** 2 for one in every)
        speed = about.steps_per_second * _STATES**2 / work
        steps = max(1, int(seconds * speed / about.chains / _SLICES))
        course: list[tuple[float, float]] = []
        cooled = 0.0 if given is None else _COOLED
        try:
            with ThreadPoolExecutor(min(about.chains, os.cpu_count() or 1)) as pool:
                for k in range(_SLICES):
                    done = k / _SLICES, (k + 1) / _SLICES
                    part = [cooled + (1.0 - cooled) * share for share in done]
                    going = [
                        pool.submit(advance, problem, chain, rng, steps, *part)
                        for chain, rng in zip(chains, streams, strict=True)
                    ]
                    chains = [one.result() for one in going]
                    share = self.judge(*_best(chains)).share
                    course.append((done[1], share))
                    tell(f"{100 * done[1]:.0f} %: {100 * share:.2f} % of runs keep all bounds")
        except KeyboardInterrupt:
            tell("interrupted: the best so far is kept")
        path, best = self._chosen(chains)
        return Found(
            path,
            course,
            steps * about.chains * len(course),
            self._earned(*best),
            self.limit(path.total),
            self.left_out,
            list(self.disturbed.names) if self.disturbed else [],
        )

    def _chosen(self, chains: Sequence[Chain]) -> tuple[Promise, tuple[np.ndarray, np.ndarray]]:
        """Best of the chains; with disturbances by the mean of exact log odds of both shares."""
        if self.disturbed is None:
            best = _best(chains)
            return self.exactly(*best), best
        made = []
        for one in chains:
            path = self.exactly(one.best_moves, one.best_durations)
            odds = [share / (1.0 - share) for share in (path.share, path.disturbed or 0.0)]
            made.append((odds[0] * odds[1], path, (one.best_moves, one.best_durations)))
        return max(made, key=lambda one: one[0])[1:]

    def _earned(self, moves: np.ndarray, durations: np.ndarray) -> list[float]:
        """Share of runs that a minute of each position is worth; NaN where it has none to give."""
        whole, less = self.judge(moves, durations).share, int(_LESS / self.interval)
        earned = []
        for k in range(len(durations)):
            cut = durations.copy()
            cut[k] -= less
            possible = self._rests(moves, cut).min() >= 0
            earned.append(whole - self.judge(moves, cut).share if possible else np.nan)
        return earned

    def limit(self, total: float) -> float:
        """Share of runs that no path of a time can exceed: gyro biases against their white noise.

        With the gyro's noise alone a bias is known to N / sqrt(T) at best, whatever the path.
        """
        setup = self.setup
        sigma = setup.believed_noise.gyro / np.sqrt(total)
        bound = (setup.bound * setup.unit)[:3]
        return float(np.prod([nominal_coverage(one / sigma) for one in bound]))

    def best(self, tell: Callable[[str], None]) -> Found:
        """What the configuration asks for.

        Raises
        ------
        ConfigError
            If the search cannot begin from `design.start_from`, or does not reach what
            `design.objective` asks for.
        """
        about = self.config.design
        given = self.known(about.start_from) if about.start_from else None
        if given and len(given[1]) != about.positions:
            raise ConfigError(
                f"design.start_from = {about.start_from}: must have design.positions, which is "
                f"{about.positions}; it has {len(given[1])}"
            )
        if about.objective == "shortest":
            return self._shortest(tell, given)
        return self.run(about.objective, about.seconds, about.total_time_s, tell, given)

    def _shortest(
        self, tell: Callable[[str], None], given: tuple[np.ndarray, np.ndarray] | None
    ) -> Found:
        """Shortest path found whose share is what is asked for, each from the one before."""
        about = self.config.design
        wanted, high = about.joint_share, about.total_time_s
        seconds = about.seconds / (_BISECTIONS + 1)
        if self.limit(high) < wanted:
            raise ConfigError(
                f"design.joint_share = {wanted:g}: no path of {high:g} s can exceed "
                f"{self.limit(high):.4f} at this noise, by the gyros' alone"
            )
        best = self.run("joint_share", seconds, high, tell, given)
        if best.path.share < wanted:
            raise ConfigError(
                f"design.joint_share = {wanted:g}: the best path found of {high:g} s "
                f"has {best.path.share:.4f}; more design.seconds may find a better one"
            )
        low = min(self.shortest_time, high)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            found = self.run("joint_share", seconds, middle, lambda _: None, self._of(best.path))
            tell(f"{middle:.0f} s: {100 * found.path.share:.2f} % of runs keep all bounds")
            if found.path.share >= wanted:
                best, high = found, middle
            else:
                low = middle
        return best

    def _of(self, path: Promise) -> tuple[np.ndarray, np.ndarray]:
        """Moves and durations of a path that was found."""
        moves = np.array([self.tables.moves.index(turn) for turn in path.turns])
        return moves, np.rint(np.array(path.durations) / self.interval).astype(int)


def _best(chains: Sequence[Chain]) -> tuple[np.ndarray, np.ndarray]:
    best = min(chains, key=lambda chain: chain.best_energy)
    return best.best_moves, best.best_durations
