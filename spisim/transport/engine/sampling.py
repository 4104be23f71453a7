"""How long to go on: a number of paths, or an error to reach."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reconstruction.arrays import Floats
from spisim.transport.engine.tally import Sums

#: Independent repetitions from which a standard error is taken, at least.
MIN_LAUNCHES = 8
#: Lanes of one launch, per strategy: bounds memory.
MAX_LANES = 2**20
#: Where no number of paths is given: per cell in each of the first launches, which often are
#: enough, and in each after them; and launches before giving up.
FIRST_PATHS = 4
PATHS_PER_LAUNCH = 16
MAX_LAUNCHES = 2**16


class TransportWarning(UserWarning):
    """Light that could not be summed."""


@dataclass(frozen=True)
class Paths:
    """A fixed number of paths per cell (virtual pixel, beam) and strategy.

    One launch costs less than several, but gives no standard error.
    """

    per_cell: int
    launches: int = MIN_LAUNCHES  # at least


@dataclass(frozen=True, eq=False)
class TargetError:
    """Go on until the relative standard error of some readings is below `target`.

    `readings` turns what was estimated into the numbers that matter, such as the bucket vector;
    their relative error is ‖standard errors‖ / ‖means‖.
    """

    target: float
    readings: Callable[[Mapping[str, Floats]], Floats]


SamplingBudget = Paths | TargetError
Launch = Callable[[int, Sequence[int]], Sums]


@dataclass(frozen=True, eq=False)
class Estimate:
    """Means over the launches, their standard errors, and what they cost."""

    mean: Mapping[str, Floats]
    error: Mapping[str, Floats]
    launches: int
    paths: int


class _Running:
    """Weighted mean of arrays that arrive one by one, and its standard error.

    The weight of an array is what its variance is inversely proportional to: its number of paths.
    (West 1979; without weights, Welford.)
    """

    def __init__(self) -> None:
        self.count = 0
        self.weight = 0
        self.mean: dict[str, Floats] = {}
        self._squares: dict[str, Floats] = {}

    def add(self, values: Mapping[str, Floats], weight: int) -> None:
        self.count += 1
        self.weight += weight
        for name, value in values.items():
            mean = self.mean.get(name, np.zeros(()))
            step = value - mean
            self.mean[name] = mean + step * (weight / self.weight)
            before = self._squares.get(name, np.zeros(()))
            self._squares[name] = before + weight * step * (value - self.mean[name])

    def error(self) -> dict[str, Floats]:
        spread = max(self.count - 1, 1) * self.weight
        return {name: np.sqrt(squares / spread) for name, squares in self._squares.items()}


def repeat(
    launch: Launch,
    budget: SamplingBudget,
    cells: int,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
    *,
    replicas: int = 1,
) -> Estimate:
    """Repeat `launch(paths per cell, seeds)` with fresh seeds for as long as `budget` says.

    Each launch makes `replicas` estimates side by side, the first axis of its values: they count
    as so many launches, and cost one.

    TransportWarning tells how much of the light had to be left out.
    """
    most = max(1, MAX_LANES // (cells * replicas))
    if isinstance(budget, Paths):
        launches = replicas * -(-max(budget.launches, -(-budget.per_cell // most)) // replicas)
        first = later = max(1, round(budget.per_cell / launches))
    else:
        launches, first = MAX_LAUNCHES, min(FIRST_PATHS, most)
        later = min(-(-PATHS_PER_LAUNCH // replicas), most)
    running, readings, dropped = _Running(), _Running(), 0
    for step in range(launches // replicas):
        samples = first if running.count < MIN_LAUNCHES else later
        values, unsummed = launch(samples, _seeds(seed, step))
        dropped += unsummed
        for each in _split(values, replicas):
            running.add(each, samples)
            if isinstance(budget, TargetError):
                readings.add({"readings": budget.readings(each)}, samples)
        done = running.count / launches
        if isinstance(budget, TargetError):
            done = (budget.target / max(_relative(readings), budget.target)) ** 2
            if running.count < MIN_LAUNCHES:
                done = min(done, running.count / MIN_LAUNCHES)
        if progress is not None:
            progress(done)
        if done >= 1:
            break
    if dropped:
        warnings.warn(
            f"{dropped} contributions of light were not finite numbers and are left out: a "
            "material, medium or pose gives the light transport something it cannot calculate with",
            TransportWarning,
            stacklevel=2,
        )
    paths = 2 * running.weight * cells
    return Estimate(running.mean, running.error(), running.count, paths)


def replicas_of(cells: int) -> int:
    """As many estimates side by side as make an error, or fit into a launch: a power of two."""
    fitting = max(1, MAX_LANES // cells)
    return min(MIN_LAUNCHES, 1 << (fitting.bit_length() - 1))


def _split(values: Mapping[str, Floats], replicas: int) -> Iterator[Mapping[str, Floats]]:
    for number in range(replicas):
        yield {name: value[number] for name, value in values.items()}


def _relative(readings: _Running) -> float:
    norm = np.linalg.norm(readings.mean["readings"])
    error = np.linalg.norm(readings.error()["readings"])
    return float(error / norm) if norm > 0 and readings.count > 1 else np.inf


def _seeds(seed: np.random.SeedSequence, step: int) -> list[int]:
    child: Any = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, step))
    return [int(word) for word in child.generate_state(3)]
