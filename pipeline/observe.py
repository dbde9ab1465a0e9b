"""Stage `observe`: what a schedule makes observable, by rank and by sigma.

Usage: ``python -m pipeline.observe [schedule=...] [noise=...] [out=FILE.csv]``. With `out` the
course of every parameter's sigma goes to a CSV file and, beside it, to a heat map.

For example::

    python -m pipeline.observe schedule=position19
    python -m pipeline.observe 'schedule.rotations=[[90,Y],[180,Y],[90,X]]' out=observe.csv

Reads: schedule noise estimator out sensor site.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from inscal import observability as obs
from inscal.parameters import NAMES
from inscal.recursion import InitialStd, compute_gains, observation_covariance
from inscal.state_model import StateModel, build_transitions
from pipeline import build
from pipeline import figure_style as style
from pipeline.config import Config, ConfigError, stage
from pipeline.observe_plots import sigma_heat_map
from pipeline.output import complain, write_text
from pipeline.terminal import new_table, say, show

CONVENTIONS: dict[str, obs.Convention] = {
    "dwells alone": obs.Convention(),
    "dwells, the Earth's rate on the lever arms": obs.Convention(lever="earth"),
    "turns on the gyros": obs.Convention(gyro="turning"),
    "turns on gyros and lever arms": obs.Convention(gyro="turning", lever="turning"),
}
"""Plain ways to let a turn enter the constant dynamics of a position."""

TIED = 0.9
"""Absolute correlation from which on two parameters are called tied."""

WEAK_SHARE = 0.1
"""Share of the initial sigma that a combination must keep to be called weakly observed."""

_DIRECTIONS = 3
_FEW = 8  # positions in the terminal's table


@dataclass(frozen=True)
class Course:
    """How well a path lets a filter know its parameters.

    Attributes
    ----------
    share : ndarray, shape (positions, 27)
        Sigma at the end of each position over the initial one; 0 where not modelled.
    final_std : ndarray, shape (27,)
        Final sigma in paper units.
    directions : list of Direction
        Weakest combinations, weakest first.
    tied : list of (int, int, float)
        Pairs of correlation `TIED` or more.
    """

    share: np.ndarray
    final_std: np.ndarray
    directions: list[obs.Direction]
    tied: list[tuple[int, int, float]]


def rank_counts(config: Config, convention: obs.Convention) -> tuple[obs.Ranks, obs.Ranks]:
    """Count ranks after every position of a path: in SI by default tolerance, and unit-free.

    Parameters
    ----------
    config : Config
    convention : Convention

    Returns
    -------
    tuple of Ranks
    """
    path, std = build.build_schedule(config), build.build_initial_std(config)
    dynamics = obs.system_matrices(path, build.build_site(config), convention)
    noise = np.sqrt(np.diag(observation_covariance(build.build_noise(config))))
    return obs.ranks(dynamics), obs.unit_free_ranks(
        dynamics, _state_sigma(std), noise, path.position_duration
    )


def _state_sigma(std: InitialStd) -> np.ndarray:
    return np.concatenate([std.attitude, [std.velocity] * 3, [std.position] * 3, std.parameter])


def course_of(config: Config) -> Course:
    """Run the covariance recursion over a path and see what it leaves unknown.

    Parameters
    ----------
    config : Config

    Returns
    -------
    Course
    """
    path, interval = build.build_schedule(config), config.estimator.update_interval_s
    model, noise = StateModel(tuple(config.estimator.states)), build.build_noise(config)
    transitions = build_transitions(
        path, build.build_site(config), model, noise, update_interval=interval
    )
    std = build.build_initial_std(config)
    gains = compute_gains(transitions, model, noise, std)
    covariance = gains.covariance[: len(NAMES), : len(NAMES)]
    return Course(
        share=obs.sigma_share(gains.parameter_std, std.parameter, path, interval),
        final_std=gains.parameter_std[-1] / build.si_units(config),
        directions=obs.weakest_directions(covariance, std.parameter, _DIRECTIONS),
        tied=obs.tied_pairs(covariance, TIED),
    )


def direction_text(direction: obs.Direction) -> str:
    """Name a combination and what is known of it."""
    (first, weight), *others = direction.weights
    text = f"{NAMES[first]} ({weight:.2f})"
    for index, weight in others:
        text += f" {'with' if weight > 0 else 'against'} {NAMES[index]} ({weight:.2f})"
    known = "weakly observed" if direction.share > WEAK_SHARE else "observed"
    return f"{text}: {100 * direction.share:.2g} % of its initial sigma is left, {known}"


def tied_text(pair: tuple[int, int, float]) -> str:
    """Name two parameters whose errors go together."""
    first, second, correlation = pair
    return f"{NAMES[first]} and {NAMES[second]}: correlation {correlation:.3f}"


def share_table(course: Course) -> str:
    """CSV text: one row per parameter, one column per position."""
    frame = pd.DataFrame(
        course.share.T,
        index=pd.Index(NAMES, name="parameter"),
        columns=[f"position_{n}" for n in range(1, len(course.share) + 1)],
    )
    return frame.to_csv(float_format="%.6g")


def print_ranks(config: Config) -> None:
    """Print the rank after every position by each of `CONVENTIONS`."""
    letters = "ABCDEFGH"[: len(CONVENTIONS)]
    table = new_table((), ("position", *letters))
    columns = [
        [counts.rank for counts in rank_counts(config, convention)]
        for convention in CONVENTIONS.values()
    ]
    for row in range(len(columns[0][0])):
        cells = [_both(by_default[row], unit_free[row]) for by_default, unit_free in columns]
        table.add_row(str(row + 1), *cells)
    show(f"rank of the stripped observability matrix: {config.schedule.name}", table)
    print("\n".join(f"{key}: {name}" for key, name in zip(letters, CONVENTIONS, strict=True)))


def _both(by_default: int, unit_free: int) -> str:
    return str(by_default) if by_default == unit_free else f"{by_default} ({unit_free} unit-free)"


def print_course(config: Config, course: Course) -> None:
    """Print how each sigma falls, the weakest combinations and the tied pairs."""
    count = len(course.share)
    chosen = sorted({round(n) for n in np.linspace(1, count, min(count, _FEW))})
    table = new_table(("parameter",), tuple(map(str, chosen)))
    for name, share in zip(NAMES, course.share.T, strict=True):
        table.add_row(name, *(f"{share[number - 1]:.2g}" for number in chosen))
    show(f"\nsigma over initial sigma after position ...: {config.schedule.name}", table)
    print("Least known combinations:")
    for direction in course.directions:
        say(f"  {direction_text(direction)}", indent="    ")
    print(f"Tied pairs, correlation of {TIED:g} or more:")
    for text in [*map(tied_text, course.tied)] or ["none"]:
        print(f"  {text}")


@stage
def main(config: Config) -> None:
    """Print ranks and sigmas of a path; write the sigmas where `out` says."""
    if config.out and Path(config.out).suffix != ".csv":
        raise ConfigError(f"out = {config.out!r}: must be a CSV file; the heat map goes beside it")
    complain(build.warnings(config))
    print_ranks(config)
    course = course_of(config)
    print_course(config, course)
    if config.out:
        write_text(config.out, share_table(course))
        figure = sigma_heat_map(course.share, f"{config.schedule.name}, {config.noise.name} noise")
        style.save(figure, Path(config.out).with_suffix(".png"))


if __name__ == "__main__":
    main()
