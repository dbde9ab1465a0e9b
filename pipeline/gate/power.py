"""How often the gate raises a false alarm, and which losses it finds."""

from collections.abc import Callable, Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from inscal import regression
from inscal.campaign_checks import LOOKS, Sample
from inscal.experiment import Experiment, run
from inscal.parameters import NAMES
from inscal.regression import Judgement
from inscal.simulation import Workspace
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.console.progress import track
from pipeline.gate.cases import RUNS
from pipeline.words import markdown
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"

_BLOCKS = 500
_PAIRS = 5_000
_NORMAL_PAIRS = 100_000
_TRIALS = 2_000
_RESEEDED_TRIALS = 500
_SAME_DATA_LOSS = 1.05
_LOSSES = (1.05, 1.10, 1.20, 1.50)
_FAMILY_LEVELS = (0.1, 0.01, 0.001)

POOLS = tuple(name for name in LOOKS if name not in NAMES)
"""Looks of several parameters."""

Row = dict[str, Any]


class Gate:
    """The gate on arrays of errors that share a covariance.

    Parameters
    ----------
    covariance, bound : ndarray
        Of the reference case, SI.
    """

    def __init__(self, covariance: np.ndarray, bound: np.ndarray):
        self.covariance, self.bound = covariance, bound
        self.std = np.sqrt(np.diag(covariance))
        self._whitening = np.linalg.inv(np.linalg.cholesky(covariance)).T

    def judge(self, old: np.ndarray, new: np.ndarray, *, same_data: bool) -> Judgement:
        """Judge errors, shape (runs, 27), against others."""
        sketch = np.zeros(len(old))
        return regression.judge(
            self._sample(old, sketch),
            self._sample(new, sketch if same_data else sketch + 1.0),
            self.bound,
        )

    def _sample(self, error: np.ndarray, sketch: np.ndarray) -> Sample:
        nees = np.square(error @ self._whitening).sum(axis=1)
        return Sample(error, self.covariance, nees, sketch)


def simulated_blocks(experiment: Experiment) -> np.ndarray:
    """Errors of disjoint campaigns, shape (blocks, runs, 27)."""
    workspace = Workspace.of(experiment.motion)
    blocks = []
    for block in track(range(_BLOCKS), "campaigns"):
        outcome = run(experiment, range(block * RUNS, (block + 1) * RUNS), workspace)
        blocks.append(outcome.estimate - outcome.truth)
    return np.array(blocks)


def rate(hits: int, trials: int) -> Row:
    """A share with its exact 95 % interval (Clopper & Pearson)."""
    interval = stats.binomtest(hits, trials).proportion_ci(0.95, "exact")
    return {"share": hits / trials, "lower": interval.low, "upper": interval.high, "of": trials}


Pairs = Iterable[tuple[np.ndarray, np.ndarray]]


def block_pairs(blocks: np.ndarray, count: int, rng: np.random.Generator) -> Pairs:
    """Random pairs of different blocks."""
    for _ in range(count):
        old, new = rng.choice(len(blocks), 2, replace=False)
        yield blocks[old], blocks[new]


def normal_pairs(covariance: np.ndarray, count: int, rng: np.random.Generator) -> Pairs:
    """Pairs of independent campaigns of normal errors."""
    factor = np.linalg.cholesky(covariance)
    for _ in range(count):
        old, new = rng.standard_normal((2, RUNS, len(factor))) @ factor.T
        yield old, new


def false_alarms(gate: Gate, pairs: Pairs) -> Row:
    """Verdicts on re-seeded campaigns that lost nothing.

    Returns
    -------
    dict
        The rate of "worse", the parts that comparisons and checks have in it, and how often the
        smallest of all p-values (of no loss beyond the tolerance) would pass larger levels.
    """
    alarms, losses, checks, trials = 0, 0, 0, 0
    below = np.zeros(len(_FAMILY_LEVELS), dtype=int)
    for old, new in pairs:
        judgement = gate.judge(old, new, same_data=False)
        assert judgement.ratios is not None
        alarms += judgement.verdict == "worse"
        losses += bool(judgement.losses)
        checks += not all(check.passed for check in judgement.checks)
        below += judgement.ratios.p_worse.min() * len(LOOKS) < np.array(_FAMILY_LEVELS)
        trials += 1
    levels = {
        f"family_below_{level:g}": int(n) / trials
        for level, n in zip(_FAMILY_LEVELS, below, strict=True)
    }
    return {**rate(alarms, trials), "comparisons": losses, "checks": checks, **levels}


def scaled(rng, error, std, loss):
    """Errors made larger by a factor."""
    return loss * error


def independent(rng, error, std, loss):
    """Errors with an independent one added to each, so that the RMSE grows by a factor."""
    return error + np.sqrt(loss**2 - 1) * std * rng.standard_normal(error.shape)


def common(rng, error, std, loss):
    """Errors with one random number added to all of a run, in units of sigma."""
    return error + np.sqrt(loss**2 - 1) * std * rng.standard_normal((len(error), 1))


Spoil = Callable[[np.random.Generator, np.ndarray, np.ndarray, float], np.ndarray]


def power(gate: Gate, pairs: Pairs, spoil: Spoil, look: str, loss: float, seed: int) -> Row:
    """Share of campaigns found worse when the parameters of a look lose.

    `pairs` gives the baseline and what becomes the new campaign; the same array twice stands for
    the same data.
    """
    rng = np.random.default_rng(seed)
    members = LOOKS[look]
    hits, trials = 0, 0
    for old, clean in pairs:
        new = clean.copy()
        new[:, members] = spoil(rng, clean[:, members], gate.std[members], loss)
        hits += gate.judge(old, new, same_data=clean is old).verdict == "worse"
        trials += 1
    return {"look": look, "kind": spoil.__name__, "loss": loss, **rate(hits, trials)}


def same_pairs(blocks: np.ndarray, count: int) -> Pairs:
    """Each block as its own baseline, over and over: what is added to it differs."""
    for trial in range(count):
        block = blocks[trial % len(blocks)]
        yield block, block


def known(result: Row) -> Row:
    """The result without the interval of its share, which holds for independent trials only."""
    return {key: value for key, value in result.items() if key not in ("lower", "upper")}


def study(config: Config) -> dict[str, Any]:
    """All that is measured, as JSON takes it."""
    setup = Setup(config)
    experiment = setup.experiment
    covariance = experiment.estimator.parameter_covariance
    gate = Gate(covariance, setup.bound * setup.unit)
    blocks = simulated_blocks(experiment)
    rng = np.random.default_rng(config.campaign.seed)
    looks = [(scaled, look, len(blocks)) for look in POOLS]  # nothing random: each block once
    looks += [(spoil, look, _TRIALS) for spoil in (independent, common) for look in POOLS]
    looks += [(independent, name, _TRIALS) for name in NAMES]
    same = [
        power(gate, same_pairs(blocks, trials), spoil, look, _SAME_DATA_LOSS, seed)
        for seed, (spoil, look, trials) in enumerate(track(looks, "losses, same data"))
    ]
    small = [
        power(gate, same_pairs(blocks, _TRIALS), independent, "gyro_k", 1 + loss, 0)
        for loss in (regression.TOLERANCE / 2, regression.TOLERANCE)
    ]
    reseeded = [
        known(power(gate, block_pairs(blocks, _RESEEDED_TRIALS, rng), scaled, look, loss, 0))
        for look, loss in track(list(product((*POOLS, "gyro_k11"), _LOSSES)), "losses, other data")
    ]
    return {
        "seed": config.campaign.seed,
        "blocks": len(blocks),
        "runs_per_block": RUNS,
        "false_alarms_simulated": known(
            false_alarms(
                gate, track(block_pairs(blocks, _PAIRS, rng), "pairs of campaigns", _PAIRS)
            ),
        ),
        "false_alarms_disjoint": false_alarms(gate, zip(blocks[::2], blocks[1::2], strict=True)),
        "false_alarms_normal": false_alarms(
            gate,
            track(
                normal_pairs(covariance, _NORMAL_PAIRS, rng),
                "pairs of normal errors",
                _NORMAL_PAIRS,
            ),
        ),
        "same_data": same,
        "same_data_small": small,
        "reseeded": reseeded,
    }


def report(result: dict[str, Any]) -> str:
    """The tables in Markdown."""
    rows: dict[str, dict[str, str]] = {row["look"]: {} for row in result["same_data"]}
    for row in result["same_data"]:
        rows[row["look"]][row["kind"]] = _share(row)
    kinds = [spoil.__name__ for spoil in (scaled, independent, common)]
    pools = [[look, *(rows[look][kind] for kind in kinds)] for look in POOLS]
    least = min((row for row in result["same_data"] if row["look"] in NAMES), key=_share_of)
    pools.append([f"one parameter, the least sure: {least['look']}", "", _share(least), ""])
    reseeded = [
        [
            look,
            *(markdown.percent(row["share"]) for row in result["reseeded"] if row["look"] == look),
        ]
        for look in dict.fromkeys(row["look"] for row in result["reseeded"])
    ]
    small = "; ".join(
        f"{100 * (row['loss'] - 1):g} %: {100 * row['share']:.2f} % "
        f"(at most {100 * row['upper']:.2f})"
        for row in result["same_data_small"]
    )
    return render(
        _TEMPLATES,
        "power.md.jinja",
        false_alarms=markdown.table(
            ("campaigns", "pairs", "worse", *(f"p < {level:g}" for level in _FAMILY_LEVELS)),
            [
                _alarm_row("simulated, pairs share campaigns", result["false_alarms_simulated"]),
                _alarm_row("simulated, disjoint pairs", result["false_alarms_disjoint"]),
                _alarm_row("normal errors", result["false_alarms_normal"]),
            ],
            1,
        ),
        same=markdown.table(("loss of 5 % in", *kinds), pools, 1),
        small=small,
        reseeded=markdown.table(
            ("loss in", *(f"{100 * (loss - 1):.0f} %" for loss in _LOSSES)), reseeded, 1
        ),
        **{key: result[key] for key in ("blocks", "runs_per_block", "seed")},
    )


def _share_of(row: Row) -> float:
    return row["share"]


def _share(row: Row) -> str:
    return f"{100 * row['share']:.2f} % (at least {100 * row['lower']:.2f})"


def _alarm_row(name: str, row: Row) -> list[str]:
    alarms = str(round(row["share"] * row["of"]))
    if "upper" in row:
        alarms += f" (at most {100 * row['upper']:.3f} %)"
    levels = (f"{100 * row[f'family_below_{level:g}']:.3f} %" for level in _FAMILY_LEVELS)
    return [name, str(row["of"]), alarms, *levels]
