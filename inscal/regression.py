"""Whether a campaign is worse than a baseline: the statistics of the gate, on plain arrays.

Questions are asked of 27 parameters and 11 pools of them ("looks": a loss spread over a group shows
best in the group), and each is held against a tolerance, so that differences of rounding between
machines are not a loss however significant they are. What a filter does not model is not asked.

**Paired ratio.** Rows of both campaigns are the same runs, or, after a change of seed, no pairs at
all. The ratio of two mean squares is tested exactly in both cases, whatever the correlation, by
that of sum and difference of the pairs (Pitman, 1939, Biometrika 31:9-12; Morgan, 1939, Biometrika
31:13-19; errors about zero rather than about their mean, which costs no degree of freedom).

**Added loss.** Where both campaigns saw the same data there is a far sharper measure. The error of
a minimum-mean-square-error estimate is uncorrelated with every function of the data (the
orthogonality principle: Kay, 1993, Fundamentals of Statistical Signal Processing: Estimation
Theory, sec. 12.4), so with the change n = new - old of the estimate. Hence

    MSE(new) = MSE(old) + E[n^2],

and the loss is the mean of n^2, known to a fraction sqrt(2 / runs) of *itself*: 1 % of RMSE shows
in 100 runs, where the two RMSE are known to 7 % each. It holds if the baseline is optimal (its
consistency says so); where it is not, a change may be a gain, and the paired ratio then says that.

**Claims.** A claimed sigma that has grown is a loss by the filter's own word, known without any
scatter. One that has changed while the errors did not, or not as much, is not honest, if it was:
RMSE over claimed sigma, new against old, takes the paired ratio. Where the errors are the same it
tells every change beyond the tolerance, also one that a campaign by itself is too short for.

**Checks** of the campaign by itself are those of `inscal.campaign_checks`.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy import special

from inscal.campaign_checks import CHECK_LEVEL, LOOKS, Check, Sample, bounds, consistency, modelled
from inscal.comparison_statistics import holm
from inscal.parameters import NAMES

TOLERANCE = 0.02
"""RMSE loss that counts as none."""

COMPARISON_LEVEL = 2e-4
"""False alarms of all comparisons together, of campaigns that lost `TOLERANCE` or less."""

CONFIDENCE = 0.95
"""Confidence of the intervals shown."""

SAME_DATA = 1e-3
"""Largest change of a sketch, in units of noise, that rounding explains. A change of data by this
much of its noise moves no estimate by more than this much of its sigma."""

_GAIN_LEVEL = 0.05


@dataclass(frozen=True)
class Ratios:
    """RMSE of new over RMSE of old at all looks; every array of shape (looks,).

    Attributes
    ----------
    names : tuple of str
        Keys of `inscal.campaign_checks.LOOKS` that hold parameters the filter models.
    ratio, lower, upper : ndarray
        The ratio and its pointwise interval of `CONFIDENCE`. Of a pool: of the root mean square of
        all its errors in units of the old predicted sigma.
    p_worse : ndarray
        One-sided p-value against "no more than 1 + `TOLERANCE`".
    p_better : ndarray
        One-sided p-value against "no less than 1".
    """

    names: tuple[str, ...]
    ratio: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    p_worse: np.ndarray
    p_better: np.ndarray


@dataclass(frozen=True)
class Loss:
    """A look that is worse.

    Attributes
    ----------
    name : str
        Key of `inscal.campaign_checks.LOOKS`.
    ratio, lower, upper : float
        RMSE of new over that of old, and its interval of `CONFIDENCE`.
    p_value : float
        Holm-adjusted over everything compared.
    """

    name: str
    ratio: float
    lower: float
    upper: float
    p_value: float


@dataclass(frozen=True)
class Judgement:
    """What the gate has to say.

    Attributes
    ----------
    verdict : str
        ``"identical"``, ``"changed, no worse"`` or ``"worse"``.
    same_data : bool
        Whether both campaigns saw the same data.
    failed : int
        Runs of the new campaign that diverged; nothing else is judged if there are any.
    losses : list of Loss
    checks : list of Check
        Of the new campaign and of its claims; all, passed or not.
    ratios : Ratios or None
        The sharper of the measures that apply, None with failed runs.
    """

    verdict: str
    same_data: bool
    failed: int
    losses: list[Loss]
    checks: list[Check]
    ratios: Ratios | None


def paired_ratio(old: np.ndarray, new: np.ndarray, covariance: np.ndarray) -> Ratios:
    """RMSE ratios of paired errors, by the test of Pitman and Morgan.

    Parameters
    ----------
    old, new : ndarray, shape (runs, 27)
    covariance : ndarray, shape (27, 27)
        Of old, as predicted: scales the parameters of a pool and tells how far they are one.

    Returns
    -------
    Ratios

    Notes
    -----
    With new divided by the ratio r, u = new / r + old and v = new / r - old are uncorrelated where
    r is the true ratio. For a pool the sum of u.v has the variance u^T cov(v) u summed over runs,
    given u; at the estimated r it gives the scatter of the log ratio, exactly Pitman and Morgan's
    for a single parameter. Pools use as many degrees of freedom per run as their predicted
    correlation leaves, (sum of eigenvalues)^2 / sum of squared eigenvalues.
    """
    looks, old, new, covariance = _modelled(old, new, covariance)
    ratio, scatter, dof = _ratio_and_scatter(old, new, covariance, looks)
    critical = special.stdtrit(dof - 1, (1 + CONFIDENCE) / 2)
    factor = np.exp(np.arcsinh(critical * scatter))
    t_worse = np.sinh(np.log(ratio / (1 + TOLERANCE))) / scatter
    t_better = np.sinh(-np.log(ratio)) / scatter
    return Ratios(
        looks.names,
        ratio,
        ratio / factor,
        ratio * factor,
        special.stdtr(dof - 1, -t_worse),
        special.stdtr(dof - 1, -t_better),
    )


def _ratio_and_scatter(old, new, covariance, looks):
    """Ratio at every look, the scatter of its logarithm, and the degrees of freedom of that."""
    runs, std = len(old), np.sqrt(np.diag(covariance))
    a, b = new / std, old / std
    aa, bb, cross = a.T @ a, b.T @ b, a.T @ b
    cross = cross + cross.T
    square = (looks.members @ np.diag(aa)) / (looks.members @ np.diag(bb))
    # sum over runs of u^T cov(v) u, both at the estimated ratio, expanded in products of columns
    spread = looks.pooled(aa**2) / square**2 + looks.pooled(bb**2)
    spread += (2 * looks.pooled(aa * bb) - looks.pooled(cross**2)) / square
    independent = looks.sizes**2 / looks.pooled((covariance / np.outer(std, std)) ** 2)
    dof = runs * independent
    scatter = spread / (4 * runs * (looks.members @ np.diag(bb)) ** 2) * dof / (dof - 1)
    scatter = np.sqrt(np.maximum(scatter, np.finfo(float).eps))  # rounding when a is near r b
    return np.sqrt(square), scatter, dof


def added_loss(old: np.ndarray, new: np.ndarray, covariance: np.ndarray) -> Ratios:
    """RMSE ratios from the change of the estimates on the same data (see the module).

    Parameters
    ----------
    old, new : ndarray, shape (runs, 27)
        Errors of two estimates from the same data; the old one optimal.
    covariance : ndarray, shape (27, 27)
        Of old, as predicted.

    Returns
    -------
    Ratios
        Of a change to an optimal estimate: a loss or nothing.

    Notes
    -----
    The mean of n^2 is taken as scaled chi-square with as many degrees of freedom as its scatter
    over the runs shows, and no more than it has numbers: a change of few runs is known badly.
    """
    looks, old, new, covariance = _modelled(old, new, covariance)
    change = np.square(new - old) / np.diag(covariance)
    per_run = change @ looks.members.T / looks.sizes
    mean, variance = per_run.mean(axis=0), per_run.var(axis=0)
    most = len(old) * looks.sizes
    dof = np.full_like(mean, np.inf)
    np.divide(2 * len(old) * mean**2, variance, out=dof, where=variance > 0)
    dof = np.minimum(dof, most)
    lower, upper = (
        dof / (2 * special.gammainccinv(dof / 2, tail))
        for tail in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)
    )
    allowed = (1 + TOLERANCE) ** 2 - 1
    return Ratios(
        looks.names,
        np.sqrt(1 + mean),
        np.sqrt(1 + mean * lower),
        np.sqrt(1 + mean * upper),
        special.gammaincc(dof / 2, dof / 2 * mean / allowed),
        np.ones_like(mean),
    )


def claims(old: Sample, new: Sample, share: float = 1.0) -> list[Check]:
    """Checks of the claimed sigmas against those of the baseline (see the module).

    Parameters
    ----------
    old, new : Sample
        Of filters that model the same parameters.
    share : float
        Of `inscal.campaign_checks.CHECK_LEVEL`, to be spent on this campaign.

    Returns
    -------
    list of Check
        Two per modelled parameter. None if the old campaign is not consistent by itself: then its
        claims are nothing to be held to.
    """
    if not all(check.passed for check in consistency(old)):
        return []
    own = old.columns
    sigma, before = (np.sqrt(np.diag(sample.covariance)[own]) for sample in (new, old))
    single = _Looks.of(own)
    score, score_before = new.error[:, own] / sigma, old.error[:, own] / before
    ratio, scatter, dof = _ratio_and_scatter(score_before, score, np.eye(len(own)), single)
    critical = special.stdtrit(dof - 1, 1 - CHECK_LEVEL * share / (2 * len(own)))
    most = (1 + TOLERANCE) * np.exp(np.arcsinh(critical * scatter))
    out = []
    for place, name in enumerate(NAMES[i] for i in own):
        grown, changed = float(sigma[place] / before[place]), float(ratio[place])
        limit = float(most[place])
        out += [
            Check(f"claimed sigma of {name} over the baseline's", grown, 0.0, 1 + TOLERANCE),
            Check(f"RMSE over claimed sigma of {name}, times", changed, 1 / limit, limit),
        ]
    return out


def identical(old: Sample, new: Sample) -> bool:
    """Whether two campaigns agree bit for bit, of the data what the sketch can tell."""
    pairs = ((old.error, new.error), (old.covariance, new.covariance), (old.nees, new.nees))
    return _same_data(old, new) and all(a.tobytes() == b.tobytes() for a, b in pairs)


def judge(
    old: Sample,
    new: Sample,
    bound: np.ndarray | None = None,
    share: float = 1.0,
    *,
    claimed: bool = True,
) -> Judgement:
    """Judge a campaign against the baseline.

    Parameters
    ----------
    old : Sample
        The baseline, without failed runs. What it is not consistent in the new one need not be.
    new : Sample
        As many runs, of a filter that models the same parameters.
    bound : ndarray, shape (27,), optional
        Accuracy bounds, SI.
    share : float
        Of all levels, to be spent on this campaign: where several are judged their false alarms
        add up.
    claimed : bool
        Whether covariances are what the campaigns claim. If not they only weigh the parameters, and
        nothing but losses and bounds is judged, by the paired ratio.

    Returns
    -------
    Judgement
    """
    same_data = claimed and _same_data(old, new)
    failed = int((~np.isfinite(new.error).all(axis=1)).sum())
    if failed:
        return Judgement("worse", same_data, failed, [], [], None)
    checks = []
    if claimed:
        held = {check.name for check in consistency(old, share) if check.passed}
        checks = [check for check in consistency(new, share) if check.name in held]
        checks += claims(old, new, share)
    if bound is not None:
        checks += bounds(new.error, old.covariance, bound, share)
    losses, ratios = _losses(old, new, same_data, COMPARISON_LEVEL * share)
    worse = losses or not all(check.passed for check in checks)
    verdict = "worse" if worse else "changed, no worse"
    if identical(old, new):
        verdict = "identical"
    return Judgement(verdict, same_data, 0, losses, checks, ratios)


def _losses(old: Sample, new: Sample, same_data: bool, level: float) -> tuple[list[Loss], Ratios]:
    measures = [paired_ratio(old.error, new.error, old.covariance)]
    if same_data:
        added = added_loss(old.error, new.error, old.covariance)
        gained = measures[0].p_better < _GAIN_LEVEL
        measures.append(replace(added, p_worse=np.where(gained, 1.0, added.p_worse)))
    adjusted = holm(np.concatenate([m.p_worse for m in measures])).reshape(len(measures), -1)
    losses = []
    for look, name in enumerate(measures[0].names):
        most = int(np.argmin([m.p_worse[look] for m in measures]))  # the measure that says most
        if adjusted[most, look] < level:
            m = measures[most]
            shown = (float(v[look]) for v in (m.ratio, m.lower, m.upper, adjusted[most]))
            losses.append(Loss(name, *shown))
    return losses, measures[-1]


def _same_data(old: Sample, new: Sample) -> bool:
    return bool((np.abs(old.sketch - new.sketch) <= SAME_DATA).all())


@dataclass(frozen=True)
class _Looks:
    """Pools of parameters, by a row of `members` each: ones at its own, shape (looks, n)."""

    names: tuple[str, ...]
    members: np.ndarray

    @staticmethod
    def of(columns) -> "_Looks":
        """Each of some parameters by itself."""
        return _Looks(tuple(NAMES[i] for i in columns), np.eye(len(columns)))

    @property
    def sizes(self) -> np.ndarray:
        return self.members.sum(axis=1)

    def pooled(self, matrix: np.ndarray) -> np.ndarray:
        """Sum of an n by n matrix over the block of each look."""
        return ((self.members @ matrix) * self.members).sum(axis=1)


@cache
def _looks_at(columns: tuple[int, ...]) -> _Looks:
    """All looks that hold some of these parameters."""
    held = {name: np.isin(columns, own) for name, own in LOOKS.items()}
    held = {name: own for name, own in held.items() if own.any()}
    return _Looks(tuple(held), np.array([*held.values()], dtype=float))


def _modelled(old, new, covariance):
    """Looks at what a covariance speaks of, and errors and covariance of that alone."""
    own = modelled(covariance)
    looks = _looks_at(tuple(own.tolist()))
    return looks, old[:, own], new[:, own], covariance[np.ix_(own, own)]
