"""Noise² × time of Monte Carlo methods that estimate the same readings."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Relative difference of readings that single precision and path-length bins explain.
ROUNDING = 1e-5


@dataclass(frozen=True)
class Method:
    """A way to all the readings, of which `run(seed)` may do a part only."""

    name: str
    paths: str  # how many, for people
    run: Callable[[int], Floats]
    share: float = 1.0  # of all the readings, in one run


@dataclass(frozen=True, eq=False)
class Series:
    """Independent repetitions: readings (repetitions, M) and seconds (repetitions,)."""

    readings: Floats
    seconds: Floats

    @property
    def noise(self) -> float:
        """‖standard deviations‖ / ‖means‖ of the readings of one repetition."""
        return float(_noise(self.readings))

    @property
    def time_s(self) -> float:
        """Wall-clock time of one repetition."""
        return float(self.seconds.mean())

    @property
    def efficiency(self) -> float:
        """1 / (noise² · time), 1/s: repeating the work changes nothing."""
        return 1 / (self.noise**2 * self.time_s)

    @property
    def efficiency_error(self) -> float:
        """Relative standard error of `efficiency`, by leaving out one repetition at a time."""
        count = len(self.seconds)
        others = [np.arange(count) != left_out for left_out in range(count)]
        logs = np.log([_noise(self.readings[i]) ** 2 * self.seconds[i].mean() for i in others])
        return float(np.sqrt((count - 1) * logs.var()))


def measure(methods: Sequence[Method], repetitions: int) -> list[Series]:
    """Run every method once to warm up, then in turns, so that all meet the same disturbances."""
    for method in methods:
        method.run(0)
    runs: list[list[tuple[Floats, float]]] = [[] for _ in methods]
    for seed in range(1, repetitions + 1):
        for method, done in zip(methods, runs, strict=True):
            began = time.perf_counter()
            readings = method.run(seed).ravel()
            done.append((readings, (time.perf_counter() - began) / method.share))
    return [
        Series(np.array([r for r, _ in done]), np.array([seconds for _, seconds in done]))
        for done in runs
    ]


def ratio(first: Series, second: Series) -> tuple[float, float]:
    """How much more efficient the first is, and the standard error of that."""
    value = first.efficiency / second.efficiency
    return value, value * float(np.hypot(first.efficiency_error, second.efficiency_error))


def z_score(first: Floats, second: Floats) -> float:
    """Of the difference of the mean readings: ‖difference‖ / ‖standard error‖.

    One number for all readings (repetitions, M), about 1 where only chance differs: paths that
    scatter next to an end give single readings too long a tail for many separate tests.
    """
    errors = [runs.var(axis=0, ddof=1) / len(runs) for runs in (first, second)]
    means = first.mean(axis=0), second.mean(axis=0)
    rounding = ROUNDING * np.linalg.norm(means[0])
    allowed = np.sqrt(np.sum(errors) + rounding**2)
    return float(np.linalg.norm(means[0] - means[1]) / allowed)


def _noise(readings: Floats) -> Floats:
    spread = np.linalg.norm(readings.std(axis=0, ddof=1))
    return np.asarray(spread / np.linalg.norm(readings.mean(axis=0)))
