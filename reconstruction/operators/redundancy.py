"""What readings say twice: combinations in which light cancels, and noise alone is left.

A pattern and its complement together are the fully lit display, y+ + y- = all + 2 background, the
same for each pattern; exposures of one pattern are the same each time. Differences of such sums
that follow each other are noise, and of slow drifts next to nothing.
"""

from collections import defaultdict
from itertools import pairwise

import numpy as np
from scipy import sparse

from ..arrays import Mask
from .plan import PatternPlan

Weights = dict[int, float]
"""By reading."""


def redundant_combinations(plan: PatternPlan, usable: Mask) -> sparse.csr_array:
    """Combinations (D, M) of usable readings that are 0 but for noise, each of length 1.

    D is 0 where nothing is shown twice. Combinations that follow each other share readings: their
    errors are not independent.
    """
    shown: dict[tuple[int, int], list[int]] = defaultdict(list)
    for reading in np.flatnonzero(usable).tolist():
        shown[int(plan.index[reading]), int(plan.polarity[reading])].append(reading)
    equal: list[list[Weights]] = [[{reading: 1.0} for reading in each] for each in shown.values()]
    pairs = [(plus, shown.get((k, -1))) for (k, sign), plus in shown.items() if sign == 1]
    equal.append([_mean(plus) | _mean(minus) for plus, minus in pairs if minus])
    rows = [
        _difference(first, second)
        for group in equal
        for first, second in pairwise(sorted(group, key=min))
    ]
    places = [(row, reading) for row, weights in enumerate(rows) for reading in weights]
    values = [value for weights in rows for value in weights.values()]
    at = np.array(places, dtype=int).reshape(-1, 2).T
    return sparse.csr_array((values, (at[0], at[1])), shape=(len(rows), plan.exposures))


def _mean(readings: list[int]) -> Weights:
    return dict.fromkeys(readings, 1 / len(readings))


def _difference(first: Weights, second: Weights) -> Weights:
    """The second less the first, of length 1."""
    length = float(np.sqrt(sum(value**2 for value in (*first.values(), *second.values()))))
    return {reading: -value / length for reading, value in first.items()} | {
        reading: value / length for reading, value in second.items()
    }
