"""Means and their confidence intervals, by resampling independent units."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from reconstruction.base.arrays import Floats

RESAMPLES = 10_000
#: Probability outside a 95 % interval, on each side.
TAIL = 0.025
#: Limit on half the interval, relative to Student's: resamples of almost equal values have almost
#: no spread, which makes studentized means arbitrarily large.
MAX_WIDTH = 2.0
#: With fewer units than this, the bootstrap is unreliable.
FEW_UNITS = 5


@dataclass(frozen=True)
class Estimate:
    """Mean and median of `n` values, and the confidence interval of the mean.

    `units` is the number of independent units among the values. The interval is None for fewer than
    two units; mean and median are None without values.
    """

    n: int
    units: int
    mean: float | None = None
    low: float | None = None
    high: float | None = None
    median: float | None = None

    @property
    def settled(self) -> bool:
        """Whether the interval is reliable and excludes zero."""
        if self.low is None or self.high is None or self.units < FEW_UNITS:
            return False
        return self.low * self.high > 0


def estimate(values: Sequence[float], units: Sequence[Hashable]) -> Estimate:
    """Return the mean of values with its 95 % interval; values of the same unit are correlated.

    Units are resampled as a whole, and every resampled mean is divided by its own standard error
    (the studentized bootstrap, or bootstrap-t: A. C. Davison & D. V. Hinkley, Bootstrap Methods and
    their Application, 1997, sections 2.4, 3.8 and 5.2.1), which makes the interval of skewed values
    longer on the side of their tail. With fewer than `FEW_UNITS` the interval is Student's.
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
    residuals = np.bincount(member, numbers - mean).astype(np.float64)
    low, high = _interval(residuals, sizes)
    return Estimate(len(numbers), len(sizes), mean, mean + low, mean + high, median)


def _interval(residuals: Floats, sizes: NDArray[np.intp]) -> tuple[float, float]:
    """Return the ends of the interval minus the mean; `residuals` are sums over each unit."""
    units = len(sizes)
    _, (error,) = _means(np.ones((1, units)), residuals, sizes)
    student = -float(stdtrit(units - 1, TAIL))
    if units < FEW_UNITS:
        return -student * float(error), student * float(error)
    means, errors = _means(_resamples(units), residuals, sizes)
    # Equal values leave a rounding error of about 1e-17 of their size.
    with np.errstate(divide="ignore", invalid="ignore"):
        studentized = np.nan_to_num(means / np.maximum(errors, 1e-9 * error))
    low, high = np.quantile(studentized, [TAIL, 1 - TAIL])
    widest = MAX_WIDTH * student
    return -min(float(high), widest) * float(error), -max(float(low), -widest) * float(error)


def _means(drawn: Floats, residuals: Floats, sizes: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Return means of units (n,) drawn so often (resamples, n), and their standard errors."""
    units = len(sizes)
    columns = [residuals, sizes, residuals**2, residuals * sizes, sizes**2]
    total, counts, squares, products, sizes_squared = (drawn @ np.stack(columns, axis=1)).T
    means = total / counts
    spread = np.maximum(squares - 2 * means * products + means**2 * sizes_squared, 0)
    return means, np.sqrt(units / (units - 1) * spread) / counts


@lru_cache(maxsize=64)
def _resamples(units: int) -> Floats:
    """Return how often each unit is drawn (resamples, units), the same for each number of units."""
    rng = np.random.default_rng(units)
    return rng.multinomial(units, np.full(units, 1 / units), size=RESAMPLES).astype(float)
