"""Averages over impact parameters: which ones to simulate, their weights, and means with intervals over seeds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.errors import BadInput
from ..basics.units import seed_given, whole_number

__all__ = ["ImpactAverage", "impact_average", "impact_parameters", "impact_weights"]


class ImpactAverage(NamedTuple):
    """Average ∫ f 2b db/b_max² of a quantity f of collisions."""

    mean: float
    error: float  # standard error; NaN where the values do not determine it
    low: float  # 95 % interval, Student's t
    high: float
    collisions: int


@checked
def impact_parameters(number: int, most: float = 1.0, *, seed: int | None = None) -> np.ndarray:
    """Impact parameters (number,) whose plain mean is the average ∫ f 2b db/b_max² over collisions.

    Parallel paths are spread evenly over an area, and so b² is spread evenly up to b_max²: b_k = b_max √((k − ½)/n),
    k = 1 … n, whose mean is the midpoint rule in b²; with a seed √u times b_max, u uniform between 0 and 1.

    Parameters
    ----------
    number : int
        n ≥ 1.
    most : float, optional
        b_max > 0, in any unit; by default 1, for fractions of it.
    seed : int or None, optional
        Draw them at random.
    """
    count = whole_number(number, "number", 1, MOST_GRAINS)
    if not 0.0 < most < np.inf:
        raise BadInput(f"most = {most!r} must be above 0")
    if seed is not None:
        return most * np.sqrt(np.random.default_rng(seed_given(seed)).random(count))
    return most * np.sqrt((np.arange(count) + 0.5) / count)


@checked
def impact_weights(b: np.ndarray, most: float) -> np.ndarray:
    """Weights (n,) with the sum 1 of different impact parameters: the share of b² ≤ b_max² that is nearest to each.

    For those of `impact_parameters`, evenly spaced in b², all are equal.

    Parameters
    ----------
    b : ndarray
        (n,), different, 0 ≤ b ≤ b_max, in any order.
    most : float
        b_max > 0.
    """
    square, order = (np.asarray(b, float) / most) ** 2, np.argsort(b)
    sorted_ones = square[order]
    if square.ndim != 1 or not square.size or not (sorted_ones[0] >= 0.0 and sorted_ones[-1] <= 1.0 + 1e-9):
        raise BadInput(f"impact parameters must be from 0 to most = {most!r}, at least one")
    if (np.diff(sorted_ones) == 0.0).any():
        raise BadInput("impact parameters must be different from each other")
    edges = np.concatenate(([0.0], 0.5 * (sorted_ones[1:] + sorted_ones[:-1]), [1.0]))
    weights = np.empty(len(square))
    weights[order] = np.diff(edges)
    return weights


@checked
def impact_average(
    values: Any, b: Any, seeds: Any, most: float | None = None, *, sampled: bool = False
) -> ImpactAverage:
    """Average ∫ f 2b db/b_max² of a quantity of collisions, with a 95 % interval.

    If every seed has every impact parameter, the average of each seed is one independent value; the interval is that
    of their mean. If seeds differ between impact parameters, each of these is a stratum with independent values, of
    which it needs two: the variance is Σ w² s²/n, with the degrees of freedom of Welch and Satterthwaite. With
    impact parameters drawn at random all values have equal weight, and those of one seed are one independent value.

    The intervals assume normally distributed means. For the probability of a rare outcome, such as one bounce in ten
    collisions, use an interval of a probability (Wilson 1927) instead.

    Parameters
    ----------
    values : array_like
        f of each collision (n,), finite; True and False for the probability of an outcome.
    b : array_like
        Their impact parameters (n,), in units of `most`; values of the same one must be exactly equal.
    seeds : array_like
        Their seeds (n,).
    most : float or None, optional
        b_max; 1 by default, for fractions.
    sampled : bool, optional
        Whether impact parameters were drawn at random, evenly in b².

    Raises
    ------
    BadInput
        If columns have different lengths, values are not finite, or impact parameters are out of range, or are
        lengths and `most` is missing.
    """
    columns = [np.asarray(each, float) for each in (values, b, seeds)]
    if len({each.shape for each in columns}) != 1 or columns[0].ndim != 1 or not columns[0].size:
        raise BadInput("values, b and seeds must be columns of equal length, of at least one collision")
    if not np.isfinite(columns[0]).all():
        raise BadInput("values must be finite; leave out collisions that have none")
    f, impact, seed = columns
    if sampled:
        groups = np.unique(seed, return_inverse=True)[1]
        sums, counts = np.bincount(groups, f), np.bincount(groups)
        if len(set(counts.tolist())) > 1:  # a ratio of two sums: residuals in place of values
            mean = float(f.mean())
            return _result(mean, (sums - mean * counts) / counts.mean() + mean, len(f))
        return _result(float(f.mean()), sums / counts, len(f))
    different, which = np.unique(impact, return_inverse=True)
    if most is None and 0.0 < different[-1] < 1e-3:  # lengths in metres
        raise BadInput(f"most is missing: impact parameters up to {different[-1]:g} are no fractions; give b_max")
    weights = impact_weights(different, 1.0 if most is None else most)
    names, groups = np.unique(seed, return_inverse=True)
    table = np.full((len(names), len(different)), np.nan)
    table[groups, which] = f
    if len(f) == table.size and not np.isnan(table).any():
        each = table @ weights
        return _result(float(each.mean()), each, len(f))
    strata = [f[which == k] for k in range(len(different))]
    mean = float(sum(w * each.mean() for w, each in zip(weights, strata, strict=True)))
    if min(map(len, strata)) < 2 or len(names) < len(f):
        return ImpactAverage(mean, np.nan, np.nan, np.nan, len(f))
    terms = np.array([w * w * each.var(ddof=1) / len(each) for w, each in zip(weights, strata, strict=True)])
    left = np.array([len(each) - 1 for each in strata])
    spread = float((terms**2 / left).sum())
    return _interval(mean, float(np.sqrt(terms.sum())), terms.sum() ** 2 / spread if spread else 1.0, len(f))


def _result(mean: float, independent: np.ndarray, collisions: int) -> ImpactAverage:
    """Mean of independent values (n,), which is `mean`, with the interval of Student's t."""
    n = len(independent)
    if n < 2:
        return ImpactAverage(mean, np.nan, np.nan, np.nan, collisions)
    return _interval(mean, float(independent.std(ddof=1) / np.sqrt(n)), n - 1, collisions)


def _interval(mean: float, error: float, degrees: float, collisions: int) -> ImpactAverage:
    from scipy.stats import t

    half = float(t.ppf(0.975, degrees)) * error
    return ImpactAverage(mean, error, mean - half, mean + half, collisions)
