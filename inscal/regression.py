"""Whether a campaign is worse than a baseline: the statistics of the gate, on plain arrays.

Three questions are asked of 27 parameters and 11 pools of them ("looks": a loss spread over a group
shows best in the group), and each is held against a tolerance, so that differences of rounding
between machines are not a loss however significant they are.

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

**Checks** of the campaign by itself: NEES, mean error, independence of its runs, bounds.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from inscal.comparison_statistics import holm
from inscal.parameters import COUNT, GROUPS, KINDS, NAMES, members
from inscal.statistics import nees_interval

TOLERANCE = 0.02
"""RMSE loss that counts as none."""

COMPARISON_LEVEL = 2e-4
"""False alarms of all comparisons together, of campaigns that lost `TOLERANCE` or less."""

CHECK_LEVEL = 5e-5
"""False alarms of each of the four checks."""

CONFIDENCE = 0.95
"""Confidence of the intervals shown."""

SAME_DATA = 1e-3
"""Largest change of a sketch, in units of noise, that rounding explains. A change of data by this
much of its noise moves no estimate by more than this much of its sigma."""

_GAIN_LEVEL = 0.05
_RARE = 1e-4
# A violation of a bound is not believed to be rarer, whatever the normal distribution says of 30
# sigma: the tail is known from 64 000 runs.

LOOKS: dict[str, np.ndarray] = (
    {name: np.array([i]) for i, name in enumerate(NAMES)}
    | {group: np.array([NAMES.index(name) for name in names]) for group, names in GROUPS.items()}
    | {kind: members(kind) for kind in KINDS}
    | {"all": np.arange(COUNT)}
)
"""Parameters, and pools of them, that are compared: indices in a 27-vector."""

_MEMBERS = np.array([np.isin(np.arange(COUNT), own) for own in LOOKS.values()], dtype=float)
_SIZES = _MEMBERS.sum(axis=1)


@dataclass(frozen=True)
class Sample:
    """A campaign as the gate sees it, SI.

    Attributes
    ----------
    error : ndarray, shape (runs, 27)
        NaN where a run failed.
    covariance : ndarray, shape (27, 27)
        What the filter claims.
    nees : ndarray, shape (runs,)
    sketch : ndarray, shape (runs,)
        Of the data of each run, in units of noise: equal data give equal sketches, different ones
        sketches as different as they are.
    """

    error: np.ndarray
    covariance: np.ndarray
    nees: np.ndarray
    sketch: np.ndarray


@dataclass(frozen=True)
class Ratios:
    """RMSE of new over RMSE of old at all `LOOKS`; every array of shape (looks,).

    Attributes
    ----------
    ratio, lower, upper : ndarray
        The ratio and its pointwise interval of `CONFIDENCE`. Of a pool: of the root mean square of
        all its errors in units of the old predicted sigma.
    p_worse : ndarray
        One-sided p-value against "no more than 1 + `TOLERANCE`".
    p_better : ndarray
        One-sided p-value against "no less than 1".
    """

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
        Key of `LOOKS`.
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
class Check:
    """A statistic of one campaign and where it should lie.

    Attributes
    ----------
    name : str
    value, lower, upper : float
    """

    name: str
    value: float
    lower: float
    upper: float

    @property
    def passed(self) -> bool:
        """Whether the value is in the interval."""
        return self.lower <= self.value <= self.upper


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
        Of the new campaign; all, passed or not.
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
    runs, std = len(old), np.sqrt(np.diag(covariance))
    a, b = new / std, old / std
    aa, bb, cross = a.T @ a, b.T @ b, a.T @ b
    cross = cross + cross.T
    square = (_MEMBERS @ np.diag(aa)) / (_MEMBERS @ np.diag(bb))
    # sum over runs of u^T cov(v) u, both at the estimated ratio, expanded in products of columns
    spread = _pooled(aa**2) / square**2 + _pooled(bb**2)
    spread += (2 * _pooled(aa * bb) - _pooled(cross**2)) / square
    independent = _SIZES**2 / _pooled((covariance / np.outer(std, std)) ** 2)
    dof = runs * independent
    scatter = spread / (4 * runs * (_MEMBERS @ np.diag(bb)) ** 2) * dof / (dof - 1)
    scatter = np.sqrt(np.maximum(scatter, np.finfo(float).eps))  # rounding when a is near r b
    critical = special.stdtrit(dof - 1, (1 + CONFIDENCE) / 2)
    ratio, factor = np.sqrt(square), np.exp(np.arcsinh(critical * scatter))
    t_worse = np.sinh(np.log(ratio / (1 + TOLERANCE))) / scatter
    t_better = np.sinh(-np.log(ratio)) / scatter
    return Ratios(
        ratio,
        ratio / factor,
        ratio * factor,
        special.stdtr(dof - 1, -t_worse),
        special.stdtr(dof - 1, -t_better),
    )


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
    change = np.square(new - old) / np.diag(covariance)
    per_run = change @ _MEMBERS.T / _SIZES
    mean, variance = per_run.mean(axis=0), per_run.var(axis=0)
    most = len(old) * _SIZES
    dof = np.full_like(mean, np.inf)
    np.divide(2 * len(old) * mean**2, variance, out=dof, where=variance > 0)
    dof = np.minimum(dof, most)
    lower, upper = (
        dof / (2 * special.gammainccinv(dof / 2, tail))
        for tail in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)
    )
    allowed = (1 + TOLERANCE) ** 2 - 1
    return Ratios(
        np.sqrt(1 + mean),
        np.sqrt(1 + mean * lower),
        np.sqrt(1 + mean * upper),
        special.gammaincc(dof / 2, dof / 2 * mean / allowed),
        np.ones_like(mean),
    )


def consistency(sample: Sample) -> list[Check]:
    """Checks of a campaign against its own covariance: NEES, mean error, independent runs.

    Parameters
    ----------
    sample : Sample

    Returns
    -------
    list of Check
        The mean NEES; runs * mean error^T P^-1 mean error, chi-square if the error has no mean; the
        largest cosine between the whitened errors of two runs, of which all pairs are looked at.
    """
    runs = len(sample.error)
    low, high = nees_interval(runs, COUNT, 1 - CHECK_LEVEL)
    whitened = np.linalg.solve(np.linalg.cholesky(sample.covariance), sample.error.T).T
    mean = whitened.mean(axis=0)
    unit = whitened / np.linalg.norm(whitened, axis=1, keepdims=True)
    # not as a matrix product: its threads cost more than it has to do
    cosine = np.abs(np.triu(np.einsum("ri,si->rs", unit, unit), 1)).max()
    pairs = runs * (runs - 1) / 2
    # the squared cosine of random directions in 27 dimensions is beta distributed
    limit = np.sqrt(1 - special.betaincinv((COUNT - 1) / 2, 0.5, CHECK_LEVEL / pairs))
    return [
        Check("mean NEES", float(sample.nees.mean()), low, high),
        Check("mean error", float(runs * mean @ mean), 0.0, special.chdtri(COUNT, CHECK_LEVEL)),
        Check("likeness of two runs", float(cosine), 0.0, float(limit)),
    ]


def bounds(error: np.ndarray, covariance: np.ndarray, bound: np.ndarray) -> list[Check]:
    """Runs outside each bound, and how many the baseline's sigma would let be.

    Parameters
    ----------
    error : ndarray, shape (runs, 27)
    covariance : ndarray, shape (27, 27)
        The baseline's.
    bound : ndarray, shape (27,)
        In the unit of the errors.

    Returns
    -------
    list of Check
        One per parameter, `CHECK_LEVEL` over all of them.
    """
    rare = np.maximum(2 * special.ndtr(-bound / np.sqrt(np.diag(covariance))), _RARE)
    most = np.ceil(special.bdtrik(1 - CHECK_LEVEL / COUNT, len(error), rare))
    outside = (np.abs(error) > bound).sum(axis=0)
    return [
        Check(f"runs outside the bound of {name}", float(count), 0.0, float(limit))
        for name, count, limit in zip(NAMES, outside, most, strict=True)
    ]


def identical(old: Sample, new: Sample) -> bool:
    """Whether two campaigns agree bit for bit, of the data what the sketch can tell."""
    pairs = ((old.error, new.error), (old.covariance, new.covariance), (old.nees, new.nees))
    return _same_data(old, new) and all(a.tobytes() == b.tobytes() for a, b in pairs)


def judge(old: Sample, new: Sample, bound: np.ndarray) -> Judgement:
    """Judge a campaign against the baseline.

    Parameters
    ----------
    old : Sample
        The baseline; consistent, without failed runs.
    new : Sample
        As many runs.
    bound : ndarray, shape (27,)
        Accuracy bounds, SI.

    Returns
    -------
    Judgement
    """
    same_data = _same_data(old, new)
    failed = int((~np.isfinite(new.error).all(axis=1)).sum())
    if failed:
        return Judgement("worse", same_data, failed, [], [], None)
    checks = consistency(new) + bounds(new.error, old.covariance, bound)
    losses, ratios = _losses(old, new, same_data)
    worse = losses or not all(check.passed for check in checks)
    verdict = "worse" if worse else "changed, no worse"
    if identical(old, new):
        verdict = "identical"
    return Judgement(verdict, same_data, 0, losses, checks, ratios)


def _losses(old: Sample, new: Sample, same_data: bool) -> tuple[list[Loss], Ratios]:
    measures = [paired_ratio(old.error, new.error, old.covariance)]
    if same_data:
        added = added_loss(old.error, new.error, old.covariance)
        gained = measures[0].p_better < _GAIN_LEVEL
        measures.append(replace(added, p_worse=np.where(gained, 1.0, added.p_worse)))
    adjusted = holm(np.concatenate([m.p_worse for m in measures])).reshape(len(measures), -1)
    losses = []
    for look, name in enumerate(LOOKS):
        most = int(np.argmin([m.p_worse[look] for m in measures]))  # the measure that says most
        if adjusted[most, look] < COMPARISON_LEVEL:
            m = measures[most]
            shown = (float(v[look]) for v in (m.ratio, m.lower, m.upper, adjusted[most]))
            losses.append(Loss(name, *shown))
    return losses, measures[-1]


def _same_data(old: Sample, new: Sample) -> bool:
    return bool((np.abs(old.sketch - new.sketch) <= SAME_DATA).all())


def _pooled(matrix: np.ndarray) -> np.ndarray:
    """Sum of a 27 by 27 matrix over the block of each look."""
    return ((_MEMBERS @ matrix) * _MEMBERS).sum(axis=1)
