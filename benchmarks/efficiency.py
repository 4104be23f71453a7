"""Error² × time of Monte Carlo methods that estimate the same readings."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats

#: Mean or median.
Average = Callable[[Floats], Any]

#: Relative difference of readings that single precision and path-length bins explain.
ROUNDING = 1e-5
#: Drawings of the repetitions from which the error of an error is told.
BOOTSTRAPS = 300


@dataclass(frozen=True)
class Method:
    """A way to all the readings, of which `run(seed)` may do a part only."""

    name: str
    paths: str  # how many, for people
    run: Callable[[int], Floats]
    fraction: float = 1.0  # of all the readings, in one run


@dataclass(frozen=True, eq=False)
class Series:
    """Independent repetitions: readings (repetitions, M) and seconds (repetitions,).

    Errors come from the differences of all pairs of repetitions. Their mean gives the standard
    deviations. Their median tells what is typical where there is no finite variance, as with paths
    that may scatter next to an end that they are connected to: the standard deviation then grows
    with the number of repetitions, for the rare bright paths among them.
    """

    readings: Floats
    seconds: Floats

    def error(self, average: Average) -> float:
        """‖errors‖ / ‖means‖ of the readings of one repetition.

        With `np.mean` as the average it is ‖standard deviations‖ / ‖means‖.
        """
        return float(np.sqrt(self._error2(np.arange(len(self.seconds)), average)))

    @property
    def time_s(self) -> float:
        """Wall-clock time of one repetition."""
        return float(self.seconds.mean())

    def efficiency(self, average: Average) -> float:
        """1 / (error² · time), 1/s: with Gaussian errors, more paths leave it as it is."""
        return 1 / (self.error(average) ** 2 * self.time_s)

    def efficiency_error(self, average: Average) -> float:
        """Relative standard error of `efficiency`, by drawing repetitions with replacement."""
        count = len(self.seconds)
        draws = np.random.default_rng(0).integers(count, size=(BOOTSTRAPS, count))
        differing = draws[np.ptp(draws, axis=1) > 0]
        costs = [self._error2(draw, average) * self.seconds[draw].mean() for draw in differing]
        return float(np.std(np.log(costs)))

    @cached_property
    def _differences(self) -> Floats:
        """Half the squared difference of each pair of repetitions, relative to the means."""
        norm = np.linalg.norm(self.readings.mean(axis=0))
        offsets = (self.readings[:, None] - self.readings[None]) / norm
        return np.asarray(np.sum(offsets**2, axis=-1) / 2)

    def _error2(self, chosen: NDArray[np.integer[Any]], average: Average) -> float:
        pairs = self._differences[np.ix_(chosen, chosen)]
        return float(average(pairs[chosen[:, None] != chosen]))


def measure(methods: Sequence[Method], repetitions: int) -> list[Series]:
    """Run every method once to warm up, then in turns, so that all meet the same disturbances."""
    for method in methods:
        method.run(0)
    runs: list[list[tuple[Floats, float]]] = [[] for _ in methods]
    for seed in range(1, repetitions + 1):
        for method, done in zip(methods, runs, strict=True):
            began = time.perf_counter()
            readings = method.run(seed).ravel()
            done.append((readings, (time.perf_counter() - began) / method.fraction))
    return [
        Series(np.array([r for r, _ in done]), np.array([seconds for _, seconds in done]))
        for done in runs
    ]


def ratio(first: Series, second: Series, average: Average) -> tuple[float, float]:
    """How much more efficient the first is, and the relative standard error of that."""
    value = first.efficiency(average) / second.efficiency(average)
    errors = first.efficiency_error(average), second.efficiency_error(average)
    return value, float(np.hypot(*errors))


def z_score(first: Floats, second: Floats) -> float:
    """Of the difference of the mean readings: ‖difference‖ / ‖standard error‖.

    One number for all readings (repetitions, M), about 1 where only chance differs: single
    readings have tails too long for many separate tests.
    """
    errors = [runs.var(axis=0, ddof=1) / len(runs) for runs in (first, second)]
    means = first.mean(axis=0), second.mean(axis=0)
    rounding = ROUNDING * np.linalg.norm(means[0])
    allowed = np.sqrt(np.sum(errors) + rounding**2)
    return float(np.linalg.norm(means[0] - means[1]) / allowed)
