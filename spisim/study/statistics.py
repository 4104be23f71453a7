"""Means and their confidence intervals, by resampling what is independent."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr, stdtrit

from reconstruction.arrays import Floats

RESAMPLES = 20_000
LEVEL = 0.95
#: With fewer units than this, the bootstrap knows too little of how they differ.
FEW_UNITS = 5


@dataclass(frozen=True)
class Estimate:
    """Mean and median of `n` values, and the confidence interval of the mean.

    `units` is the number of independent units among the values; the interval is None for fewer
    than two, mean and median are where there is no value.
    """

    n: int
    units: int
    mean: float | None = None
    low: float | None = None
    high: float | None = None
    median: float | None = None

    @property
    def settled(self) -> bool:
        """Whether the interval can be relied on and excludes zero."""
        if self.low is None or self.high is None or self.units < FEW_UNITS:
            return False
        return self.low * self.high > 0


def estimate(values: Sequence[float], units: Sequence[Hashable]) -> Estimate:
    """Mean of the values with its 95 % interval; values of equal unit depend on each other.

    Units are resampled as a whole (A. C. Davison & D. V. Hinkley, Bootstrap Methods and their
    Application, 1997, section 3.8). The percentiles of the resampled means are moved outwards so
    that with normal values and few units the interval is as wide as Student's (T. C. Hesterberg,
    The American Statistician 69, 371 (2015), section 4.3, "expanded percentile interval").
    """
    if len(values) == 0:
        return Estimate(0, 0)
    numbers = np.asarray(values, float)
    places = {unit: place for place, unit in enumerate(dict.fromkeys(units))}
    member = [places[unit] for unit in units]
    sums = np.bincount(member, numbers)
    sizes = np.bincount(member)
    mean, median = float(numbers.mean()), float(np.median(numbers))
    if len(sums) < 2:
        return Estimate(len(numbers), len(sums), mean, median=median)
    drawn = _resamples(len(sums))
    means = (drawn @ sums) / (drawn @ sizes)
    low, high = np.quantile(means, _levels(len(sums)))
    return Estimate(len(numbers), len(sums), mean, float(low), float(high), median)


@lru_cache(maxsize=64)
def _resamples(units: int) -> Floats:
    """How often each unit is drawn (resamples, units); the same whenever there are as many."""
    rng = np.random.default_rng(units)
    return rng.multinomial(units, np.full(units, 1 / units), size=RESAMPLES).astype(float)


def _levels(units: int) -> tuple[float, float]:
    tail = (1 - LEVEL) / 2
    outer = float(ndtr(np.sqrt(units / (units - 1)) * stdtrit(units - 1, tail)))
    return outer, 1 - outer
