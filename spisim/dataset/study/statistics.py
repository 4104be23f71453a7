"""Means and their confidence intervals, by resampling what is independent."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from reconstruction.base.arrays import Floats

RESAMPLES = 10_000
#: Outside of a 95 % interval, on each side.
TAIL = 0.025
#: Of Student's, the most that an end lies from the mean: resamples of almost equal values, which
#: have no spread of their own, would put it anywhere.
WIDEST = 2.0
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

    Units are resampled as a whole, and every resampled mean is divided by its own standard error
    (the studentized bootstrap, or bootstrap-t: A. C. Davison & D. V. Hinkley, Bootstrap Methods and
    their Application, 1997, sections 2.4, 3.8 and 5.2.1), which makes the interval of skewed values
    longer on the side of their tail. Of fewer than `FEW_UNITS` the interval is Student's.
    """
    if len(values) == 0:
        return Estimate(0, 0)
    numbers = np.asarray(values, float)
    positions = {unit: position for position, unit in enumerate(dict.fromkeys(units))}
    member = [positions[unit] for unit in units]
    sizes = np.bincount(member)
    mean, median = float(numbers.mean()), float(np.median(numbers))
    if len(sizes) < 2:
        return Estimate(len(numbers), len(sizes), mean, median=median)
    sigmas = np.bincount(member, numbers - mean).astype(np.float64)
    low, high = _interval(sigmas, sizes)
    return Estimate(len(numbers), len(sizes), mean, mean + low, mean + high, median)


def _interval(sigmas: Floats, sizes: NDArray[np.intp]) -> tuple[float, float]:
    """Ends of the interval, less the mean; `sigmas` are the units' sums of values less that."""
    units = len(sizes)
    _, (error,) = _means(np.ones((1, units)), sigmas, sizes)
    student = -float(stdtrit(units - 1, TAIL))
    if units < FEW_UNITS:
        return -student * float(error), student * float(error)
    means, errors = _means(_resamples(units), sigmas, sizes)
    # Rounding leaves some 1e-17 of equal values' size.
    with np.errstate(divide="ignore", invalid="ignore"):
        studentized = np.nan_to_num(means / np.maximum(errors, 1e-9 * error))
    low, high = np.quantile(studentized, [TAIL, 1 - TAIL])
    widest = WIDEST * student
    return -min(float(high), widest) * float(error), -max(float(low), -widest) * float(error)


def _means(drawn: Floats, sigmas: Floats, sizes: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Mean of the values of units (n,) drawn so often (resamples, n); its error, as a ratio's."""
    units = len(sizes)
    columns = [sigmas, sizes, sigmas**2, sigmas * sizes, sizes**2]
    total, counts, squares, products, sizes_squared = (drawn @ np.stack(columns, axis=1)).T
    means = total / counts
    spread = np.maximum(squares - 2 * means * products + means**2 * sizes_squared, 0)
    return means, np.sqrt(units / (units - 1) * spread) / counts


@lru_cache(maxsize=64)
def _resamples(units: int) -> Floats:
    """How often each unit is drawn (resamples, units); the same whenever there are as many."""
    rng = np.random.default_rng(units)
    return rng.multinomial(units, np.full(units, 1 / units), size=RESAMPLES).astype(float)
