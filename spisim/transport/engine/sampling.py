"""Sampling budgets: a fixed number of paths, or a target error."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.tally import Sums

#: Minimum number of independent launches from which a standard error is taken.
MIN_LAUNCHES = 8
#: Maximum number of lanes per launch and strategy, which bounds the memory.
MAX_LANES = 2**20
#: Minimum number of lanes on the way to a target error, unless a third of all before is less: a
#: launch has a fixed cost.
MIN_LANES = 2**14


class TransportWarning(UserWarning):
    """Some light could not be summed, or is left out."""


@dataclass(frozen=True, eq=False)
class ErrorMetric:
    """A scalar measure of errors that falls as one over the square root of the number of paths.

    `readings` converts an estimate into the numbers that matter, such as decoded coefficients;
    `size` measures their standard errors, given their means.
    """

    readings: Callable[[Mapping[str, Floats]], Floats]
    size: Callable[[Floats, Floats], float]


@dataclass(frozen=True, eq=False)
class PathBudget:
    """A fixed number of paths: `samples` per cell (virtual pixel, beam) and strategy.

    One launch costs less than several, but gives no standard error.
    """

    samples: int
    min_launches: int = MIN_LAUNCHES
    error_metric: ErrorMetric | None = None


@dataclass(frozen=True, eq=False)
class TargetError:
    """Stop when errors are at most `target` by their metric, or at `max_samples` per cell.

    The first launch has `first_samples` per cell, which may be less than one. The next ones have as
    many as seem to be missing, at most `growth` times those before: early estimates are uncertain.
    """

    target: float
    error_metric: ErrorMetric
    first_samples: float = 1
    max_samples: int = 2**20
    min_launches: int = MIN_LAUNCHES
    growth: float = 1.0


SamplingBudget = PathBudget | TargetError
#: Runs one launch with some samples per cell, seeds, and number of replicas.
Launch = Callable[[float, Sequence[int], int], Sums]


@dataclass(frozen=True, eq=False)
class Estimate:
    """Means over the launches, their standard errors, and their cost."""

    mean: Mapping[str, Floats]
    error: Mapping[str, Floats]
    launches: int
    paths: int
    size: float  # of the errors, by their metric; nan without
    dropped: int  # contributions that were not finite numbers
    #: Means and standard errors of the metric's readings; empty without.
    readings: tuple[Floats, Floats] = (np.zeros(0), np.zeros(0))


class _Running:
    """Weighted running mean and standard error (West 1979); the weight is the number of paths."""

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
            if name not in self.mean:
                self.mean[name], self._squares[name] = np.array(value), np.zeros_like(value)
                continue
            # In place, as values may be large.
            mean = self.mean[name]
            before = value - mean
            mean += before * (weight / self.weight)
            before *= weight
            before *= value - mean
            self._squares[name] += before
        if self._error_metric is not None and self._readings is not None:
            self._readings.add({"readings": self._error_metric.readings(values)}, weight)

    def error(self) -> dict[str, Floats]:
        spread = max(self.count - 1, 1) * self.weight
        return {name: np.sqrt(squares / spread) for name, squares in self._squares.items()}

    def readings(self) -> tuple[Floats, Floats]:
        """Means and standard errors of the metric's readings."""
        if self._readings is None:
            return np.zeros(0), np.zeros(0)
        return self._readings.mean["readings"], self._readings.error()["readings"]

    def size(self) -> float:
        """Size of the errors by the metric."""
        if self._error_metric is None:
            return math.nan
        return math.inf if self.count < 2 else self._error_metric.size(*self.readings())


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
    """Repeat `launch(samples, seeds, replicas)` with fresh seeds until `budget` is met.

    Each launch makes `replicas` independent estimates. They count as that many launches but cost
    one. When fewer samples per cell than replicas are missing, the
    launch makes fewer. Paths are launched from `ends` ends. A TransportWarning states how many
    contributions were left out.
    """
    maximum = max(1, MAX_LANES // (cells * replicas))
    running, dropped = _Running(budget.error_metric), 0
    if isinstance(budget, PathBudget):
        launches = max(budget.min_launches, -(-budget.samples // maximum))
        launches = replicas * -(-launches // replicas)
        samples: float = max(1, round(budget.samples / launches))
    else:
        launches = budget.min_launches
        samples = min(budget.first_samples, maximum)
    done, estimates = 0.0, min(replicas, launches)
    for step in count():
        values, unsummed = launch(samples, _seeds(seed, step), estimates)
        dropped += unsummed
        for each in values:
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
            samples = min(math.ceil(wanted), maximum)
            if wanted <= budget.first_samples < 1:
                samples = budget.first_samples
    if dropped:
        warnings.warn(
            f"{dropped} contributions of light were not finite numbers and were left out: "
            "check the parameters of materials and media, and the poses",
            TransportWarning,
            stacklevel=2,
        )
    paths = round(ends * running.weight * cells)
    return Estimate(
        running.mean,
        running.error(),
        running.count,
        paths,
        running.size(),
        dropped,
        running.readings(),
    )


def replicas_of(cells: int) -> int:
    """Replicas that one launch makes: enough for an error, if they fit; a power of two."""
    fitting = max(1, MAX_LANES // cells)
    return min(MIN_LAUNCHES, 1 << (fitting.bit_length() - 1))


def _fraction_done(budget: TargetError, running: _Running) -> float:
    """Estimated fraction of the paths that the target will take."""
    if running.weight >= budget.max_samples:
        return 1.0
    fraction = (budget.target / max(running.size(), budget.target)) ** 2
    if running.count < budget.min_launches:
        return float(min(fraction, running.count / budget.min_launches))
    return float(fraction)


def _seeds(seed: np.random.SeedSequence, step: int) -> list[int]:
    child: Any = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, step))
    return [int(word) for word in child.generate_state(3)]
