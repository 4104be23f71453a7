"""How long to go on: a number of paths, or an error to reach."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.tally import Sums

#: Independent repetitions from which a standard error is taken, at least.
MIN_LAUNCHES = 8
#: Lanes of one launch, per strategy: bounds memory.
MAX_LANES = 2**20
#: And at least, on the way to an error, if not a third of all before: a launch has its price.
MIN_LANES = 2**14


class TransportWarning(UserWarning):
    """Light that could not be summed."""


@dataclass(frozen=True, eq=False)
class ErrorMetric:
    """How large errors are, in a measure that falls with one over the square root of the paths.

    `readings` turns what was estimated into the numbers that matter, such as decoded coefficients;
    `size` measures their standard errors, given their means.
    """

    readings: Callable[[Mapping[str, Floats]], Floats]
    size: Callable[[Floats, Floats], float]


@dataclass(frozen=True, eq=False)
class PathBudget:
    """A fixed number of paths per cell (virtual pixel, beam) and strategy.

    One launch costs less than several, but gives no standard error.
    """

    samples: int
    min_launches: int = MIN_LAUNCHES
    error_metric: ErrorMetric | None = None


@dataclass(frozen=True, eq=False)
class TargetError:
    """Go on until errors are at most `target` by their metric, or there are `maximum` paths a cell.

    The first launch has `first` paths per cell, which may be less than one, the next as many as
    seem to be missing, at most `growth` times those before: the first few may not tell.
    """

    target: float
    error_metric: ErrorMetric
    first_samples: float = 1
    max_samples: int = 2**20
    min_launches: int = MIN_LAUNCHES
    growth: float = 1.0


SamplingBudget = PathBudget | TargetError
#: Paths per cell, seeds, and estimates side by side.
Launch = Callable[[float, Sequence[int], int], Sums]


@dataclass(frozen=True, eq=False)
class Estimate:
    """Means over the launches, their standard errors, and what they cost."""

    mean: Mapping[str, Floats]
    error: Mapping[str, Floats]
    launches: int
    paths: int
    size: float  # of the errors, by their gauge; nan without
    dropped: int  # contributions that were not finite numbers


class _Running:
    """Weighted mean of arrays that arrive one by one, and its standard error.

    The weight of an array is what its variance is inversely proportional to: its number of paths.
    (West 1979; without weights, Welford.)
    """

    def __init__(self, error_metric: ErrorMetric | None = None) -> None:
        self.count = 0
        self.weight = 0.0
        self.mean: dict[str, Floats] = {}
        self._squares: dict[str, Floats] = {}
        self._error_metric = error_metric
        self._readings = None if error_metric is None else _Running()

    def add(self, values: Mapping[str, Floats], weight: float) -> None:
        self.count += 1
        self.weight += weight
        for name, value in values.items():
            mean = self.mean.get(name, np.zeros(()))
            step = value - mean
            self.mean[name] = mean + step * (weight / self.weight)
            before = self._squares.get(name, np.zeros(()))
            self._squares[name] = before + weight * step * (value - self.mean[name])
        if self._error_metric is not None and self._readings is not None:
            self._readings.add({"readings": self._error_metric.readings(values)}, weight)

    def error(self) -> dict[str, Floats]:
        spread = max(self.count - 1, 1) * self.weight
        return {name: np.sqrt(squares / spread) for name, squares in self._squares.items()}

    def size(self) -> float:
        """Of the errors, by the gauge."""
        if self._error_metric is None or self._readings is None:
            return math.nan
        if self.count < 2:
            return math.inf
        readings = self._readings
        return self._error_metric.size(readings.mean["readings"], readings.error()["readings"])


def repeat(
    launch: Launch,
    budget: SamplingBudget,
    cells: int,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
    *,
    replicas: int = 1,
    ends: int = 2,
) -> Estimate:
    """Repeat `launch(paths per cell, seeds, replicas)` with fresh seeds as long as `budget` says.

    Each launch makes `replicas` estimates side by side, the first axis of its values: they count
    as so many launches, and cost one. Where fewer paths per cell than these are missing, it makes
    as many. Paths are launched from so many `ends`.

    TransportWarning tells how much of the light had to be left out.
    """
    maximum = max(1, MAX_LANES // (cells * replicas))
    running, dropped = _Running(budget.error_metric), 0
    if isinstance(budget, PathBudget):
        launches = replicas * -(
            -max(budget.min_launches, -(-budget.samples // maximum)) // replicas
        )
        samples: float = max(1, round(budget.samples / launches))
    else:
        launches = budget.min_launches
        samples = min(budget.first_samples, maximum)
    done, estimates = 0.0, min(replicas, launches)
    for step in count():
        values, unsummed = launch(samples, _seeds(seed, step), estimates)
        dropped += unsummed
        for each in _split(values, estimates):
            running.add(each, samples)
        if isinstance(budget, PathBudget):
            done = running.count / launches
        else:
            done = max(done, _fraction_done(budget, running))
        if progress is not None:
            progress(done)
        if done >= 1:
            break
        if isinstance(budget, TargetError) and running.count >= launches:
            minimum = min(running.weight / 3, MIN_LANES / cells)
            missing = max(running.weight * (1 / max(done, 1 / (1 + budget.growth)) - 1), minimum)
            estimates = min(replicas, max(1, math.ceil(missing / min(budget.first_samples, 1))))
            wanted = missing / estimates
            samples = (
                budget.first_samples
                if wanted <= budget.first_samples < 1
                else min(math.ceil(wanted), maximum)
            )
    if dropped:
        warnings.warn(
            f"{dropped} contributions of light were not finite numbers and are left out: a "
            "material, medium or pose gives the light transport something it cannot calculate with",
            TransportWarning,
            stacklevel=2,
        )
    paths = round(ends * running.weight * cells)
    return Estimate(running.mean, running.error(), running.count, paths, running.size(), dropped)


def replicas_of(cells: int) -> int:
    """As many estimates side by side as make an error, or fit into a launch: a power of two."""
    fitting = max(1, MAX_LANES // cells)
    return min(MIN_LAUNCHES, 1 << (fitting.bit_length() - 1))


def _fraction_done(budget: TargetError, running: _Running) -> float:
    """Share of the paths that it will take, as far as is known."""
    if running.weight >= budget.max_samples:
        return 1.0
    fraction = (budget.target / max(running.size(), budget.target)) ** 2
    if running.count < budget.min_launches:
        return float(min(fraction, running.count / budget.min_launches))
    return float(fraction)


def _split(values: Mapping[str, Floats], replicas: int) -> Iterator[Mapping[str, Floats]]:
    for number in range(replicas):
        yield {name: value[number] for name, value in values.items()}


def _seeds(seed: np.random.SeedSequence, step: int) -> list[int]:
    child: Any = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, step))
    return [int(word) for word in child.generate_state(3)]
