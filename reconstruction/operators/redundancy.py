"""Redundant readings: combinations in which the light cancels and only noise remains.

A pattern and its complement add up to the fully lit display, y+ + y- = all + 2 background, for
every pattern, once divided by a known throughput; repeated exposures of one pattern are equal.
Differences of successive sums are noise, nearly unaffected by slow drift. Where no exposure is
repeated, more readings than pixels over-determine image and background.
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
"""Maximum number of readings that are searched for over-determination, with a square matrix."""

Weights = dict[int, float]
"""Weights by reading."""
DEGREE = 2
"""Degree of the polynomial that models drift."""
MIN_FREEDOM = 20
"""Minimum degrees of freedom left for the noise."""
MIN_F = 10.0
"""F statistic above which chance explains the drift in less than one recording in a thousand."""


def redundant_combinations(plan: PatternPlan, usable: Mask) -> SparseRows:
    """Combinations (D, M) of length 1 of usable readings (M,) that are zero but for noise.

    D is 0 without redundancy. Successive combinations share readings, so their errors are not
    independent.
    """
    rows = [
        _of_length_1({reading: -value for reading, value in first.items()} | second)
        for group in equal_sums(plan, usable)
        for first, second in pairwise(sorted(group, key=min))
    ]
    return matrix_of(rows, plan.exposures) if rows else _surplus(plan, usable)


def _surplus(plan: PatternPlan, usable: Mask) -> SparseRows:
    """Combinations that are zero for every image and every steady background."""
    readings = np.flatnonzero(usable)
    unknowns = plan.pixels + 1
    if not unknowns < readings.size <= MAX_READINGS:
        return matrix_of([], plan.exposures)
    seen = np.ones((readings.size, unknowns))
    for row, reading in enumerate(readings):
        seen[row, :-1] = plan.factors[reading] * illumination(plan, int(reading)).ravel()
    left = np.linalg.qr(seen, mode="complete").Q[:, unknowns:].T
    rows = np.repeat(np.arange(len(left)), readings.size)
    columns = np.tile(readings, len(left))
    return SparseRows(rows, columns, left.ravel(), (len(left), plan.exposures))


def drift_of(plan: PatternPlan, usable: Mask) -> "Drift | None":
    """Drift estimator of a plan, or None if too few readings are redundant."""
    groups = [group for group in equal_sums(plan, usable) if len(group) > 1]
    sums = matrix_of([_of_length_1(each) for group in groups for each in group], plan.exposures)
    of_group = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return _drift_in(sums, of_group)


def _drift_in(sums: SparseRows, of_group: NDArray[np.intp]) -> "Drift | None":
    freedom = of_group.size - np.unique(of_group).size - DEGREE
    return Drift(sums, of_group, freedom) if freedom >= MIN_FREEDOM else None


class Drift:
    """Estimator of a slow drift of the offset, a polynomial of time, from redundant sums.

    Parameters
    ----------
    sums
        Sums (S, M) of readings that are equal within each group.
    of_group
        Group (S,) of each sum.
    freedom
        Degrees of freedom left for the noise.
    """

    def __init__(self, sums: SparseRows, of_group: NDArray[np.intp], freedom: int) -> None:
        time = np.linspace(-1, 1, sums.shape[1])
        self._sums, self._of_group, self._freedom = sums, of_group, freedom
        self._powers = np.stack([time**power for power in range(1, DEGREE + 1)], axis=1)
        self._seen = np.stack([self._sigmas(power) for power in self._powers.T], axis=1)
        self._inverse = np.linalg.pinv(self._seen)

    def __call__(self, signal: NDArray[Any], usable: Mask | None = None) -> NDArray[Any]:
        """Drift (M,) of the readings by ``usable`` (M,) ones, 0 unless it is significant."""
        if usable is not None:
            retained = self._sums.resting_on(usable)
            _, of_group = np.unique(self._of_group[retained], return_inverse=True)
            fewer = _drift_in(self._sums.only(retained), of_group)
            return np.zeros_like(signal) if fewer is None else fewer(signal)
        sigmas = self._sigmas(signal)
        course = self._inverse @ sigmas
        explained = np.sum(np.abs(self._seen @ course) ** 2) / DEGREE
        noise = np.sum(np.abs(sigmas - self._seen @ course) ** 2) / self._freedom
        if explained <= MIN_F * noise:
            return np.zeros_like(signal)
        return np.asarray(self._powers @ course)

    def _sigmas(self, signal: NDArray[Any]) -> NDArray[Any]:
        """Deviation of each sum from the mean of its group."""
        sums = self._sums @ signal
        means = np.zeros(self._of_group.max() + 1, sums.dtype)
        np.add.at(means, self._of_group, sums)
        return np.asarray(sums - (means / np.bincount(self._of_group))[self._of_group])


def equal_sums(plan: PatternPlan, usable: Mask) -> list[list[Weights]]:
    """Groups of sums of usable readings that are equal but for noise and drift."""
    readings = _by_pattern(plan, usable)
    equal: list[list[Weights]] = [
        [{reading: 1.0} for reading in each] for each in readings.values()
    ]
    return [*equal, [plus | minus for plus, minus in complements(plan, usable)]]


def complements(plan: PatternPlan, usable: Mask) -> list[tuple[Weights, Weights]]:
    """Mean of each pattern's usable readings and of its complement's, where both exist.

    Both are divided by the pattern's throughput.
    """
    readings = _by_pattern(plan, usable)
    pairs = [(plus, readings.get((k, -1))) for (k, sign), plus in readings.items() if sign == 1]
    return [(_mean(plan, plus), _mean(plan, minus)) for plus, minus in pairs if minus]


def _by_pattern(plan: PatternPlan, usable: Mask) -> dict[tuple[int, int], list[int]]:
    """Usable readings by row index and polarity."""
    readings: dict[tuple[int, int], list[int]] = defaultdict(list)
    for reading in np.flatnonzero(usable).tolist():
        readings[int(plan.index[reading]), int(plan.polarity[reading])].append(reading)
    return readings


def matrix_of(rows: list[Weights], readings: int) -> SparseRows:
    """Sparse matrix (rows, readings) of these weights."""
    entries = [(row, reading) for row, weights in enumerate(rows) for reading in weights]
    values = [value for weights in rows for value in weights.values()]
    at = np.array(entries, dtype=int).reshape(-1, 2).T
    return SparseRows(at[0], at[1], np.array(values), (len(rows), readings))


def _of_length_1(weights: Weights) -> Weights:
    length = float(np.sqrt(sum(value**2 for value in weights.values())))
    return {reading: value / length for reading, value in weights.items()}


def _mean(plan: PatternPlan, readings: list[int]) -> Weights:
    return dict.fromkeys(readings, 1 / len(readings) / float(plan.factors[readings[0]]))
