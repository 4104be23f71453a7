"""The search space: chosen values as points of a unit cube, and as indices into lists."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_inverse.design.bench import Bench
from spisim_inverse.design.plan import Allowed

DIGITS = 6
"""Significant digits of a value: closer ones are the same instrument."""


@dataclass(frozen=True)
class Point:
    """A point of the space: a cube's coordinates, and an index by name of a list."""

    unit: tuple[float, ...]
    indices: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Space:
    """The choices of a plan."""

    choices: Mapping[str, Allowed]

    @cached_property
    def ranges(self) -> dict[str, tuple[Floats, Floats]]:
        """Ends of the ranges by name."""
        given = {name: choice.ends for name, choice in self.choices.items()}
        return {name: ends for name, ends in given.items() if ends is not None}

    @cached_property
    def lists(self) -> dict[str, tuple[Any, ...]]:
        """Values of the lists by name."""
        return {name: each.values for name, each in self.choices.items() if each.values is not None}

    @property
    def size(self) -> int:
        """Number of coordinates of the cube."""
        return sum(low.size for low, _ in self.ranges.values())

    def values(self, point: Point) -> dict[str, Any]:
        """Values by parameter."""
        result: dict[str, Any] = {}
        used = 0
        for name, (low, high) in self.ranges.items():
            unit = np.reshape(point.unit[used : used + low.size], low.shape)
            used += low.size
            value = low + unit * (high - low)
            step = self.choices[name].step
            if step is not None:
                value = np.clip(np.rint(value / step) * step, low, high)
            result[name] = _rounded(value).tolist()
        for name, index in point.indices:
            result[name] = self.lists[name][index]
        return {name: result[name] for name in self.choices}

    def point(self, values: Mapping[str, Any]) -> Point:
        """The nearest point to values; where there is none, the middle or the first of a list."""
        unit: list[float] = []
        for name, (low, high) in self.ranges.items():
            value = np.asarray(_middle(low, high) if values.get(name) is None else values[name])
            if value.shape != low.shape:
                value = _middle(low, high)
            width = np.where(high > low, high - low, 1.0)
            unit += np.clip((value - low) / width, 0, 1).ravel().tolist()
        indices = [
            (name, given.index(values[name]) if values.get(name) in given else 0)
            for name, given in self.lists.items()
        ]
        return Point(tuple(unit), tuple(indices))

    def of_base(self, bench: Bench) -> Point:
        """The nearest point to the base."""
        start = {name: bench.start(name) for name in self.choices}
        if (times := start.get("tof.times")) is not None and "tof.times" in self.ranges:
            # only their ratios matter
            high = self.ranges["tof.times"][1]
            start["tof.times"] = (np.array(times) / max(times) * float(np.max(high))).tolist()
        return self.point(start)

    def probes(self, point: Point, name: str) -> Iterator[Point]:
        """The point with one parameter at other values, from all over its range or list."""
        if name in self.lists:
            for index in range(len(self.lists[name])):
                yield Point(
                    point.unit,
                    tuple((n, index if n == name else old) for n, old in point.indices),
                )
            return
        used = 0
        for other, (low, _) in self.ranges.items():
            if other == name:
                for number in range(low.size):
                    for value in (0.0, 0.5, 1.0):
                        unit = list(point.unit)
                        unit[used + number] = value
                        yield Point(tuple(unit), point.indices)
            used += low.size


def _middle(low: Floats, high: Floats) -> Floats:
    return (low + high) / 2


def _rounded(values: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(values == 0, 1.0, 10.0 ** (DIGITS - 1 - np.floor(np.log10(abs(values)))))
    return np.asarray(np.round(values * size) / size)
