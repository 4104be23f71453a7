"""Outlier readings: lost, or disturbed by a flash or by interference.

A pattern and its complement add up to the fully lit display, whichever pattern it is (see
`redundancy`). A sum far from its neighbours in time contains an outlier; which of its readings it
is cannot be decided. Where sums differ by pattern (see `throughput`) they reveal no outliers.
"""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Mask
from .plan import PatternPlan
from .redundancy import MIN_FREEDOM, Weights, equal_sums, matrix_of
from .throughput import MAX_SCORE, Throughput

FAR_SIGMAS = 10.0
"""A sum is an outlier beyond this many standard deviations, estimated by the median,"""
HARMLESS_FRACTION = 0.2
"""and beyond this fraction of the spread of the readings; below it does no harm."""
MAX_OUTLIERS = 0.2
"""Maximum fraction of sums that may be far off; if more are, none is an outlier."""
NEIGHBOURS = 9
"""Window of the running median that follows a slow drift."""
MEDIAN_OF_NORMAL = 0.6745


class OutlierDetector:
    """Detects outliers among the readings of a plan that exposes enough patterns twice.

    Parameters
    ----------
    plan
        Plan of M exposures.
    usable
        Mask (M,) of the readings that are usable as a rule.
    throughput
        Tests whether sums of these patterns can reveal outliers.
    """

    def __init__(self, plan: PatternPlan, usable: Mask, throughput: Throughput) -> None:
        groups = [sorted(group, key=min) for group in equal_sums(plan, usable)]
        self._groups = [_Group(group, usable.size) for group in groups if len(group) >= MIN_FREEDOM]
        self._usable = usable
        self._throughput = throughput

    def __call__(self, signal: NDArray[np.float64], usable: Mask | None = None) -> Mask:
        """Mask (M,) of the outliers in a ``signal`` (M,), of which some may be ``usable`` (M,)."""
        outliers = np.zeros(signal.shape, dtype=bool)
        if not self._groups or np.iscomplexobj(signal):
            return outliers
        if self._throughput.score(signal, usable) > MAX_SCORE:
            return outliers
        readings = signal[self._usable if usable is None else usable]
        if not readings.size:
            return outliers
        minimum = HARMLESS_FRACTION * _sigma(readings - np.median(readings))
        for group in self._groups:
            outliers |= group.outliers(signal, minimum, usable)
        return outliers


class _Group:
    """Sums that are equal but for noise, in the order of their first readings."""

    def __init__(self, sums: list[Weights], readings: int) -> None:
        self._sums = matrix_of(sums, readings)
        self._of = [np.array(list(weights)) for weights in sums]

    def outliers(self, signal: NDArray[np.float64], minimum: float, usable: Mask | None) -> Mask:
        outliers = np.zeros(signal.shape, dtype=bool)
        sums, numbers = self._sums, np.arange(self._sums.shape[0])
        if usable is not None:
            retained = sums.resting_on(usable)
            sums, numbers = sums.only(retained), numbers[retained]
            if numbers.size < MIN_FREEDOM:
                return outliers
        off = sums @ signal
        off = off - _course(off)
        limit = max(FAR_SIGMAS * _sigma(off), minimum)
        far = np.abs(off) > limit
        if limit > 0 and far.mean() <= MAX_OUTLIERS:  # 0 for low photon counts, most of them equal
            for number in numbers[far]:
                outliers[self._of[number]] = True
        return outliers


def _course(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Running median of the sums."""
    padded = np.pad(sums, NEIGHBOURS // 2, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS)
    return np.asarray(np.median(windows, axis=-1))


def _sigma(values: NDArray[np.float64]) -> float:
    """Standard deviation about 0, estimated robustly by the median."""
    return float(np.median(np.abs(values))) / MEDIAN_OF_NORMAL
