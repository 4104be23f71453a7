"""What readings say twice: combinations in which light cancels, and noise alone is left.

A pattern and its complement together are the fully lit display, y+ + y- = all + 2 background, the
same for each pattern; exposures of one pattern are the same each time. Differences of such sums
that follow each other are noise, and of slow drifts next to nothing. Where nothing is shown twice,
more readings than pixels say more than an image and a background can.
"""

from collections import defaultdict
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Mask
from .plan import PatternPlan, illumination
from .sparse import SparseRows

MAX_READINGS = 2048
"""Of which combinations are looked for that no image explains: a matrix of their square."""

Weights = dict[int, float]
"""By reading."""
DEGREE = 2
"""Of the polynomial that drifts are."""
FEWEST = 20
"""Degrees of freedom that are left for the noise, at least."""
CERTAIN = 10.0
"""F above which a drift is none by chance in less than one recording of a thousand."""


def redundant_combinations(plan: PatternPlan, usable: Mask) -> SparseRows:
    """Combinations (D, M) of usable readings that are 0 but for noise, each of length 1.

    D is 0 where nothing is said twice. Combinations that follow each other share readings: their
    errors are not independent.
    """
    rows = [
        _difference(first, second)
        for group in equal_sums(plan, usable)
        for first, second in pairwise(sorted(group, key=min))
    ]
    return matrix_of(rows, plan.exposures) if rows else _surplus(plan, usable)


def _surplus(plan: PatternPlan, usable: Mask) -> SparseRows:
    """Combinations that are 0 for every image and every steady background."""
    readings = np.flatnonzero(usable)
    unknowns = plan.pixels + 1
    if not unknowns < readings.size <= MAX_READINGS:
        return matrix_of([], plan.exposures)
    seen = np.ones((readings.size, unknowns))
    for row, reading in enumerate(readings):
        seen[row, :-1] = illumination(plan, int(reading)).ravel()
    left = np.linalg.qr(seen, mode="complete").Q[:, unknowns:].T
    rows = np.repeat(np.arange(len(left)), readings.size)
    columns = np.tile(readings, len(left))
    return SparseRows(rows, columns, left.ravel(), (len(left), plan.exposures))


def drift_of(plan: PatternPlan, usable: Mask) -> "Drift | None":
    """What tells a drift of the offset, None where too little is shown twice."""
    groups = [group for group in equal_sums(plan, usable) if len(group) > 1]
    sums = matrix_of([_of_length_1(each) for group in groups for each in group], plan.exposures)
    of_group = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return _drift_in(sums, of_group)


def _drift_in(sums: SparseRows, of_group: NDArray[np.intp]) -> "Drift | None":
    freedom = of_group.size - np.unique(of_group).size - DEGREE
    return Drift(sums, of_group, freedom) if freedom >= FEWEST else None


class Drift:
    """A slow drift of the offset, a polynomial of time, told by what is shown twice.

    ``sums`` (S, M) of readings are alike within each group, ``of_group`` (S,).
    """

    def __init__(self, sums: SparseRows, of_group: NDArray[np.intp], freedom: int) -> None:
        time = np.linspace(-1, 1, sums.shape[1])
        self._sums, self._of_group, self._freedom = sums, of_group, freedom
        self._powers = np.stack([time**power for power in range(1, DEGREE + 1)], axis=1)
        self._seen = np.stack([self._sigmas(power) for power in self._powers.T], axis=1)
        self._inverse = np.linalg.pinv(self._seen)

    def __call__(self, signal: NDArray[Any], usable: Mask | None = None) -> NDArray[Any]:
        """The drift in each of the readings (M,): 0 where it is not beyond doubt.

        By those sums alone that rest on ``usable`` (M,) readings, where not all do.
        """
        if usable is not None:
            retained = self._sums.resting_on(usable)
            _, of_group = np.unique(self._of_group[retained], return_inverse=True)
            fewer = _drift_in(self._sums.only(retained), of_group)
            return np.zeros_like(signal) if fewer is None else fewer(signal)
        sigmas = self._sigmas(signal)
        course = self._inverse @ sigmas
        explained = np.sum(np.abs(self._seen @ course) ** 2) / DEGREE
        noise = np.sum(np.abs(sigmas - self._seen @ course) ** 2) / self._freedom
        if explained <= CERTAIN * noise:
            return np.zeros_like(signal)
        return np.asarray(self._powers @ course)

    def _sigmas(self, signal: NDArray[Any]) -> NDArray[Any]:
        """Of the sums from the mean of their group."""
        sums = self._sums @ signal
        means = np.zeros(self._of_group.max() + 1, sums.dtype)
        np.add.at(means, self._of_group, sums)
        return np.asarray(sums - (means / np.bincount(self._of_group))[self._of_group])


def equal_sums(plan: PatternPlan, usable: Mask) -> list[list[Weights]]:
    """Groups of sums of usable readings which are the same but for noise, and drift."""
    displayed = _displayed(plan, usable)
    equal: list[list[Weights]] = [
        [{reading: 1.0} for reading in each] for each in displayed.values()
    ]
    return [*equal, [plus | minus for plus, minus in complements(plan, usable)]]


def complements(plan: PatternPlan, usable: Mask) -> list[tuple[Weights, Weights]]:
    """Means of the usable readings of each pattern that is shown with its complement, and of that
    complement."""
    displayed = _displayed(plan, usable)
    pairs = [(plus, displayed.get((k, -1))) for (k, sign), plus in displayed.items() if sign == 1]
    return [(_mean(plus), _mean(minus)) for plus, minus in pairs if minus]


def _displayed(plan: PatternPlan, usable: Mask) -> dict[tuple[int, int], list[int]]:
    """Usable readings by index and polarity."""
    displayed: dict[tuple[int, int], list[int]] = defaultdict(list)
    for reading in np.flatnonzero(usable).tolist():
        displayed[int(plan.index[reading]), int(plan.polarity[reading])].append(reading)
    return displayed


def matrix_of(rows: list[Weights], readings: int) -> SparseRows:
    """The matrix (rows, readings) of these weights."""
    positions = [(row, reading) for row, weights in enumerate(rows) for reading in weights]
    values = [value for weights in rows for value in weights.values()]
    at = np.array(positions, dtype=int).reshape(-1, 2).T
    return SparseRows(at[0], at[1], np.array(values), (len(rows), readings))


def _of_length_1(weights: Weights) -> Weights:
    length = float(np.sqrt(sum(value**2 for value in weights.values())))
    return {reading: value / length for reading, value in weights.items()}


def _mean(readings: list[int]) -> Weights:
    return dict.fromkeys(readings, 1 / len(readings))


def _difference(first: Weights, second: Weights) -> Weights:
    """The second less the first, of length 1."""
    return _of_length_1({reading: -value for reading, value in first.items()} | second)
