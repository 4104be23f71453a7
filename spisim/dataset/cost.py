"""What samples cost: seconds by scene and weather, and the slowest samples."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere.sections import WEATHER
from spisim.dataset.planned import PlannedSet, Sample
from spisim.dataset.records import Record

#: Samples of a plan drawn, but not made, to estimate the frequency of its groups.
MAX_DRAWN = 200


@dataclass(frozen=True)
class Group:
    """Samples of similar cost: those of one scene or family in one kind of weather."""

    scene: str
    weather: str

    @classmethod
    def of(cls, sample: Sample) -> Self:
        """Return the group of a sample by its scene and all weather in its scene file."""
        weather = [name for name in WEATHER if name in sample.scene_fields]
        return cls(str(sample.parameters["scene"]), ", ".join(weather) or "clear")


@dataclass(frozen=True)
class Cost:
    """Seconds per sample without compiling: quantiles and mean."""

    samples: int
    median_s: float
    p90_s: float
    max_s: float
    mean_s: float

    @classmethod
    def of(cls, seconds: Sequence[float] | Floats, weights: Floats | None = None) -> Self:
        """Summarize at least one sample; `weights` if samples represent unequal parts of a plan."""
        each = np.ones(len(seconds)) if weights is None else weights
        quantiles = np.quantile(seconds, (0.5, 0.9), weights=each, method="inverted_cdf")
        mean = np.average(seconds, weights=each)
        return cls(len(seconds), *map(float, (*quantiles, np.max(seconds), mean)))


@dataclass(frozen=True)
class GroupCost:
    """A group, its fraction of the plan, and its cost in the pilot run."""

    group: Group
    fraction: float
    cost: Cost | None  # None without samples in the pilot

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready summary."""
        cost = None if self.cost is None else vars(self.cost)
        return {**vars(self.group), "fraction": self.fraction, "cost": cost}


@dataclass(frozen=True)
class Pilot:
    """The samples of a pilot run, and the groups that they represent."""

    indices: Sequence[int]
    groups: dict[int, Group]  # by index, of all drawn samples

    @classmethod
    def of(cls, planned: PlannedSet, samples: int) -> Self:
        """Choose this many random samples: one per group if they suffice, frequent groups first."""
        size, rng = planned.plan.size, np.random.default_rng((planned.plan.seed, 1))
        drawn = range(size) if size <= MAX_DRAWN else np.unique(rng.integers(size, size=MAX_DRAWN))
        groups = {int(index): Group.of(planned.sample(int(index))) for index in drawn}
        order = [int(index) for index in rng.permutation(list(groups))]
        first: dict[Group, int] = {}
        for index in order:
            first.setdefault(groups[index], index)
        frequent = sorted(first, key=list(groups.values()).count, reverse=True)
        chosen = dict.fromkeys([*(first[group] for group in frequent), *order])
        return cls(list(chosen)[:samples], groups)

    def costs(self, records: Iterable[Record]) -> tuple[list[GroupCost], Cost]:
        """Return the cost by group, most frequent first, and of all samples of the plan.

        Samples of the pilot are weighted by the samples that they represent. Raises ValueError if
        no record is of a finished sample.
        """
        made: dict[Group, list[float]] = {}
        for record in records:
            if record.done and record.seconds is not None and record.index in self.indices:
                made.setdefault(self.groups[record.index], []).append(record.own_s)
        if not made:
            raise ValueError("no finished samples")
        drawn = list(self.groups.values())
        fractions = {group: drawn.count(group) / len(drawn) for group in dict.fromkeys(drawn)}
        weights = [np.full(len(made[group]), fractions[group] / len(made[group])) for group in made]
        costs = [
            GroupCost(group, fraction, Cost.of(made[group]) if group in made else None)
            for group, fraction in sorted(fractions.items(), key=lambda item: -item[1])
        ]
        return costs, Cost.of(np.concatenate(list(made.values())), np.concatenate(weights))


def cost_of(records: Iterable[Record]) -> Cost | None:
    """Return the cost of finished samples; None if no times are recorded."""
    seconds = [each.seconds - each.compiling_s for each in records if each.done and each.seconds]
    return Cost.of(seconds) if seconds else None


def slowest(records: Iterable[Record], count: int = 5) -> list[Record]:
    """Return the slowest finished samples without compile time, slowest first."""
    timed = [record for record in records if record.done and record.seconds]
    return sorted(timed, key=lambda each: each.compiling_s - (each.seconds or 0.0))[:count]
