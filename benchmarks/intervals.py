"""Intervals that hold a figure with a confidence, from samples in groups that share something.

Spots of one scene share its fog: it is scenes that are drawn independently, not spots.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta, binom, t

from reconstruction.base.arrays import Floats
from spisim_paper.checks import Interval

RESAMPLED = 1000
MIN_FINITE = 0.95
"""Fraction of resamples that need a finite figure: without the others it would look too sure."""
Indices = NDArray[np.intp]


def of_fraction(hits: ArrayLike, groups: ArrayLike) -> Interval:
    """Interval of Korn and Graubard for the fraction of hits.

    It is that of Clopper and Pearson for as many independent samples as the groups are worth.
    """
    hit = np.asarray(hits, dtype=float)
    group, count = _groups(groups)
    if count < 2:
        return lambda confidence: (0.0, 1.0)
    samples, fraction = hit.size, float(hit.mean())
    independent = fraction * (1 - fraction) / samples
    off = np.bincount(group, hit - fraction)
    variance = count / (count - 1) * float((off**2).sum()) / samples**2
    worth = samples * (min(independent / variance, 1.0) if variance > 0 else 1.0)

    def interval(confidence: float) -> tuple[float, float]:
        tail = (1 - confidence) / 2
        few = 1.0 if independent == 0 else t.isf(tail, samples - 1) / t.isf(tail, count - 1)
        yes, no = fraction * worth * few**2, (1 - fraction) * worth * few**2
        minimum = beta.ppf(tail, yes, no + 1) if yes > 0 else 0.0
        maximum = beta.isf(tail, yes + 1, no) if no > 0 else 1.0
        return float(minimum), float(maximum)

    return interval


def of_figure(
    figure: Callable[[Indices], float], groups: ArrayLike, *, positive: bool = False
) -> Interval:
    """Student's interval for any figure of samples, its error from the bootstrap over groups.

    `figure` gets the indices of samples. A positive one, as a ratio, is taken by its logarithm.
    """
    group, count = _groups(groups)
    members = [np.flatnonzero(group == each) for each in range(count)]
    rng = np.random.default_rng(0)
    drawn = (rng.integers(count, size=count) for _ in range(RESAMPLED if count > 1 else 0))
    values = [figure(np.concatenate([members[n] for n in each])) for each in drawn]
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = figure(np.arange(group.size)) if group.size else np.nan
        middle, resampled = (
            np.log(each) if positive else each for each in (middle, np.array(values))
        )
    resampled = resampled[np.isfinite(resampled)]
    if not np.isfinite(middle) or resampled.size < MIN_FINITE * RESAMPLED or np.ptp(resampled) == 0:
        return lambda confidence: (-np.inf, np.inf)  # what does not vary tells nothing of chance
    error = np.sqrt(count / (count - 1)) * resampled.std()

    def interval(confidence: float) -> tuple[float, float]:
        reach = t.isf((1 - confidence) / 2, count - 1) * error
        ends = np.array([middle - reach, middle + reach])
        low, high = np.exp(np.minimum(ends, 700)) if positive else ends
        return float(low), float(high)

    return interval


def of_quantile(values: Floats, fraction: float) -> Interval:
    """Of the value that a fraction of independent samples stays below, by their order."""
    ordered = np.concatenate([[-np.inf], np.sort(values), [np.inf]])

    def interval(confidence: float) -> tuple[float, float]:
        tail = (1 - confidence) / 2
        low = int(binom.ppf(tail, values.size, fraction))
        high = int(binom.isf(tail, values.size, fraction)) + 1
        return float(ordered[low]), float(ordered[high])

    return interval


def of_size(signed: Interval) -> Interval:
    """Of the absolute value of a figure."""

    def interval(confidence: float) -> tuple[float, float]:
        low, high = signed(confidence)
        nearest = 0.0 if low < 0 < high else min(abs(low), abs(high))
        return nearest, max(abs(low), abs(high))

    return interval


def of_minimum(several: Sequence[Interval]) -> Interval:
    """Of the smallest of several figures, each surer than all together are to be."""

    def interval(confidence: float) -> tuple[float, float]:
        each = 1 - (1 - confidence) / max(len(several), 1)
        ends = [one(each) for one in several]
        return min(low for low, _ in ends), min(high for _, high in ends)

    return interval


def _groups(groups: ArrayLike) -> tuple[Indices, int]:
    _, group = np.unique(np.asarray(groups), return_inverse=True)
    return group, int(group.max(initial=-1)) + 1
