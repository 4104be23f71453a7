"""The search: coordinate exchange over lists, differential evolution and Nelder-Mead over ranges.

With several objectives their logarithms are weighed in several ways, each a search of its own that
starts from the best of all before; the front is that of all evaluations. Coordinate exchange: R. D.
Meyer & C. J. Nachtsheim, Technometrics 37, 60 (1995). Differential evolution: R. Storn & K. Price,
J. Global Optim. 11, 341 (1997). Equal noise for all instruments makes the figures deterministic.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution, minimize
from scipy.stats import qmc

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim_inverse.design.archive import Evaluation, key_of
from spisim_inverse.design.space import Point, Space

IMPOSSIBLE = 1e3
"""Score of values that no instrument can have: above every logarithm of figures."""
EXCESS = 30.0
"""Weight of the logarithm of a figure over its limit."""
TRIES = 256
"""Points of the space tried for one possible instrument."""
EVOLVING = 0.6
"""Fraction of a search's evaluations for differential evolution; the rest is Nelder-Mead's."""
PER_COORDINATE, MIN_POPULATION = 3, 8
"""Size of the population of differential evolution."""
FUTILE = 20
"""Impossible instruments looked at for each simulated one, before a search ends."""
MOST = 10_000
"""Calls or generations of an optimiser, whose points may all be known."""
Evaluate = Callable[[Mapping[str, Any]], Evaluation]


class Spent(Exception):
    """All evaluations of a search are made."""


@dataclass(eq=False)
class Search:
    """A search over a space; figures count relative to those of the `base`."""

    space: Space
    objectives: Sequence[str]
    base: Mapping[str, float]
    evaluate: Evaluate
    evaluations: int
    seed: int
    at_most: Mapping[str, float] = field(default_factory=dict)
    progress: Callable[[float], None] = lambda fraction: None
    made: dict[str, tuple[Point, Evaluation]] = field(default_factory=dict)
    _budget: int = 0
    _simulated: int = 0
    _impossible: int = 0

    def run(self, start: Point) -> list[Evaluation]:
        """All evaluations of instruments, in order.

        Raises
        ------
        InputError
            If no point of the space is an instrument, or no objective depends on a parameter.
        """
        first = self._possible(start)
        for name in self.space.choices:
            self._require_influence(first, name)
        all_weights = weights_of(len(self.objectives))
        for number, weights in enumerate(all_weights):
            self._budget = round(self.evaluations * (number + 1) / len(all_weights))
            self._impossible = 0
            try:
                self._search(weights, first, np.random.default_rng([self.seed, number]))
            except Spent:
                continue
        return [each for _, each in self.made.values() if each.figures is not None]

    def score(self, evaluation: Evaluation, weights: Floats) -> float:
        """Weighed logarithm of the figures over those of the base."""
        return score(evaluation, self.base, weights, self.objectives, self.at_most)

    def _possible(self, start: Point) -> Point:
        """The start, or the first possible instrument of a space-filling sequence."""
        self._budget = self.evaluations + TRIES  # also for those that show what matters
        reasons: list[str] = []
        names, lists = list(self.space.lists), self.space.lists
        dimensions = self.space.size + len(names)
        cube = qmc.Halton(dimensions, rng=np.random.default_rng(self.seed)).random(TRIES)
        for row in [None, *cube]:
            point = start
            if row is not None:
                parts = zip(names, row[self.space.size :], strict=True)
                indices = tuple((name, int(part * len(lists[name]))) for name, part in parts)
                point = Point(tuple(row[: self.space.size].tolist()), indices)
            evaluation = self._evaluated(point)
            if evaluation.figures is not None:
                return point
            reasons.append(evaluation.reason)
        most = max(dict.fromkeys(reasons), key=reasons.count)
        raise InputError(
            f"choose: none of {len(reasons)} instruments is possible within the limits of the "
            f"base; most often: {most}"
        )

    def _require_influence(self, point: Point, name: str) -> None:
        """Raise InputError if the figures are equal at all possible values of a parameter."""
        here = self._evaluated(point).figures
        others = 0
        for probe in self.space.probes(point, name):
            there = self._evaluated(probe)
            if there.figures is None or there.key == self._evaluated(point).key:
                continue
            if there.figures != here:
                return
            others += 1
        if others:
            raise InputError(
                f"choose.{name}: {' and '.join(self.objectives)} do not depend on it; remove it"
            )

    def _search(self, weights: Floats, first: Point, rng: np.random.Generator) -> None:
        """Search one weighing until its evaluations are spent, or nothing improves."""
        while True:
            best, score = self._best(weights, first)
            self._exchange(weights, best)
            if self.space.size:
                self._evolve(weights, self._best(weights, first)[0], rng)
                self._descend(weights, self._best(weights, first)[0])
            if self._best(weights, first)[1] >= score:
                return

    def _best(self, weights: Floats, first: Point) -> tuple[Point, float]:
        scored = [(self.score(each, weights), point) for point, each in self.made.values()]
        if not scored:
            return first, IMPOSSIBLE
        score, point = min(scored, key=lambda each: each[0])
        return point, score

    def _exchange(self, weights: Floats, point: Point) -> None:
        """Every list in turn takes its best value, until none changes."""
        changed = True
        while changed:
            changed = False
            for name in self.space.lists:
                options = list(self.space.probes(point, name))
                scores = [self.score(self._evaluated(each), weights) for each in options]
                best = options[int(np.argmin(scores))]
                changed |= best != point and min(scores) < self.score(
                    self._evaluated(point), weights
                )
                point = best

    def _evolve(self, weights: Floats, point: Point, rng: np.random.Generator) -> None:
        left = self._budget - self._simulated
        stop_at = self._simulated + round(EVOLVING * left)
        size = max(MIN_POPULATION, PER_COORDINATE * self.space.size)
        population = qmc.LatinHypercube(self.space.size, rng=rng).random(size)
        population[0] = point.unit

        def enough(*_: Any, **__: Any) -> bool:
            return self._simulated >= stop_at

        options: Any = {"init": population, "maxiter": MOST, "tol": 0.01, "polish": False}
        options |= {"rng": rng, "callback": enough}
        differential_evolution(self._scorer(point, weights), self._cube, **options)

    def _descend(self, weights: Floats, point: Point) -> None:
        options: Any = {"xatol": 1e-3, "fatol": 1e-3, "adaptive": True, "maxfev": MOST}
        start, scored = np.array(point.unit), self._scorer(point, weights)
        minimize(scored, start, method="Nelder-Mead", bounds=self._cube, options=options)

    @property
    def _cube(self) -> Any:
        return [(0.0, 1.0)] * self.space.size

    def _scorer(self, point: Point, weights: Floats) -> Callable[[Floats], float]:
        """Score by coordinates, with the point's indices."""

        def scored(unit: Floats) -> float:
            here = Point(tuple(unit.tolist()), point.indices)
            return self.score(self._evaluated(here), weights)

        return scored

    def _evaluated(self, point: Point) -> Evaluation:
        """The evaluation of a point; raises Spent where a new one would exceed the budget."""
        values = self.space.values(point)
        key = key_of(values)
        if key not in self.made:
            if self._simulated >= self._budget or self._impossible > self._budget * FUTILE + TRIES:
                raise Spent
            self.made[key] = point, self.evaluate(values)
            if self.made[key][1].figures is None:
                self._impossible += 1
            else:
                self._simulated += 1
                self.progress(self._simulated / self.evaluations)
        return self.made[key][1]


def weights_of(objectives: int) -> list[Floats]:
    """Weights (objectives,) of the searches: all equal, each nearly alone, and those between."""
    if objectives == 1:
        return [np.ones(1)]
    equal = np.full(objectives, 1 / objectives)
    corners = 0.9 * np.eye(objectives) + 0.1 * equal
    return [equal, *corners, *((corner + equal) / 2 for corner in corners)]


def score(
    evaluation: Evaluation,
    base: Mapping[str, float],
    weights: Floats,
    objectives: Sequence[str],
    at_most: Mapping[str, float],
) -> float:
    """Weighed logarithm of figures over those of the base, and what exceeds a limit many times."""
    figures = evaluation.figures
    if figures is None:
        return IMPOSSIBLE
    logs = {name: np.log(figures[name] / base[name]) for name in objectives}
    excess = sum(max(logs[name] - np.log(limit), 0.0) for name, limit in at_most.items())
    return float(weights @ list(logs.values()) + EXCESS * excess)


def front(evaluations: Sequence[Evaluation], objectives: Sequence[str]) -> list[Evaluation]:
    """Evaluations that no other one beats in one objective without losing in another.

    Sorted by the first objective; of equal ones the first.
    """
    distinct: dict[tuple[float, ...], Evaluation] = {}
    for each in evaluations:
        assert each.figures is not None
        distinct.setdefault(tuple(each.figures[name] for name in objectives), each)
    kept = [
        (figures, each)
        for figures, each in distinct.items()
        if not any(
            other != figures and all(np.array(other) <= np.array(figures)) for other in distinct
        )
    ]
    return [each for _, each in sorted(kept, key=lambda one: one[0])]
