"""Readings that cannot be right: lost, hit by a flash or by interference.

A pattern and its complement together are the fully lit display, whichever pattern it is (see
`redundancy`). A sum far from those before and after it has a spoilt reading in it; which of the two
it is cannot be told. Where sums differ by pattern (see `throughput`) they tell of none.
"""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Mask
from .plan import PatternPlan
from .redundancy import FEWEST, Weights, equal_sums, matrix_of
from .throughput import CERTAIN, Throughput

FAR = 10.0
"""Standard deviations of all sums, by their median, beyond which one is spoilt,"""
HARMFUL = 0.2
"""and the share of the readings' own spread below which that does no harm."""
FEW = 0.2
"""Where a larger share of the sums is far off, they are no few spoilt ones."""
NEIGHBOURS = 9
"""Sums of whose median a slow drift is."""
MEDIAN_OF_NORMAL = 0.6745


class OutlierDetector:
    """Finds them among ``usable`` (M,) readings of a plan, wherever enough is shown twice.

    ``throughput`` tells whether that says anything of these patterns.
    """

    def __init__(self, plan: PatternPlan, usable: Mask, throughput: Throughput) -> None:
        groups = [sorted(group, key=min) for group in equal_sums(plan, usable)]
        self._groups = [_Group(group, usable.size) for group in groups if len(group) >= FEWEST]
        self._usable = usable
        self._throughput = throughput

    def __call__(self, signal: NDArray[np.float64], usable: Mask | None = None) -> Mask:
        """Which of the readings (M,) are spoilt, (M,), where fewer are ``usable`` than usually."""
        result = np.zeros(signal.shape, dtype=bool)
        if not self._groups or np.iscomplexobj(signal):
            return result
        if self._throughput.score(signal, usable) > CERTAIN:
            return result
        reported = signal[self._usable if usable is None else usable]
        if not reported.size:
            return result
        minimum = HARMFUL * _sigma(reported - np.median(reported))
        for group in self._groups:
            result |= group.outliers(signal, minimum, usable)
        return result


class _Group:
    """Sums that are alike, in the sequence of their first readings."""

    def __init__(self, sums: list[Weights], readings: int) -> None:
        self._sums = matrix_of(sums, readings)
        self._of = [np.array(list(weights)) for weights in sums]

    def outliers(self, signal: NDArray[np.float64], minimum: float, usable: Mask | None) -> Mask:
        result = np.zeros(signal.shape, dtype=bool)
        sums, numbers = self._sums, np.arange(self._sums.shape[0])
        if usable is not None:
            retained = sums.resting_on(usable)
            sums, numbers = sums.only(retained), numbers[retained]
            if numbers.size < FEWEST:
                return result
        off = sums @ signal
        off = off - _course(off)
        limit = max(FAR * _sigma(off), minimum)
        far = np.abs(off) > limit
        if limit > 0 and far.mean() <= FEW:  # 0 of counts of few photons, most of them the same
            for number in numbers[far]:
                result[self._of[number]] = True
        return result


def _course(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median of each sum and its neighbours."""
    padded = np.pad(sums, NEIGHBOURS // 2, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS)
    return np.asarray(np.median(windows, axis=-1))


def _sigma(values: NDArray[np.float64]) -> float:
    """Standard deviation about 0, by the median, as if few values were not normal."""
    return float(np.median(np.abs(values))) / MEDIAN_OF_NORMAL
