"""Whether patterns differ in how much of their light arrives.

A pattern and its complement together are the fully lit display, so that their sums scatter by noise
alone (see `redundancy`). Where fine patterns lose more light than coarse ones, by diffraction at a
mirror array or by an aperture, sums scatter by pattern, again and again, and tell nothing of the
noise; but then they are larger where the difference is: coarse patterns, of which images have most,
keep most of their light. Noise of sums and differences is independent.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import Mask
from .plan import PatternPlan
from .redundancy import Weights, matrix_of

NEIGHBOURS = 9
"""Sums of whose median a slow drift is."""
FEWEST = 9
"""Pairs that are compared, at least."""
USUAL = 1.0
"""Score that noise alone often has,"""
BEYOND_DOUBT = 3.5
"""and one that it has in one recording of several thousand."""


class Throughput:
    """Of patterns that are shown with their complements, by ``usable`` (M,) readings of a plan."""

    def __init__(self, plan: PatternPlan, usable: Mask) -> None:
        sums: list[Weights] = []
        differences: list[Weights] = []
        for k in plan.distinct:
            plus, minus = (
                dict.fromkeys(np.flatnonzero(shown).tolist(), 1 / max(np.count_nonzero(shown), 1))
                for shown in (usable & (plan.index == k) & (plan.polarity == p) for p in (1, -1))
            )
            if plus and minus:
                sums.append(plus | minus)
                differences.append(plus | {reading: -value for reading, value in minus.items()})
        self._sums, self._differences = (
            matrix_of(each, plan.exposures) for each in (sums, differences)
        )

    def score(self, signal: NDArray[np.float64]) -> float:
        """Spearman's correlation of sums with the size of differences, in standard errors.

        0 where too few pairs are shown.
        """
        pairs = self._sums.shape[0]
        if pairs < FEWEST or np.iscomplexobj(signal):
            return 0.0
        sums = self._sums @ signal
        ranks = _ranks(sums - course(sums)), _ranks(np.abs(self._differences @ signal))
        return float(np.corrcoef(*ranks)[0, 1]) * np.sqrt(pairs - 1)

    def probability_of_noise(self, signal: NDArray[np.float64]) -> float:
        """How likely sums scatter by noise alone, where that is as likely as not beforehand.

        The score is normal, of variance 1 by noise and of 1 + n/4 for n pairs of which throughputs
        correlate with differences by some 0.5. Up to `USUAL` it is taken for noise.
        """
        score, spread = self.score(signal), self._sums.shape[0] / 4
        if score <= USUAL:
            return 1.0
        odds = np.sqrt(1 + spread) * np.exp(-(score**2) / 2 * spread / (1 + spread))
        return float(odds / (1 + odds))


def course(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median of each sum and its neighbours."""
    padded = np.pad(sums, NEIGHBOURS // 2, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS)
    return np.asarray(np.median(windows, axis=-1))


def _ranks(values: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.argsort(np.argsort(values, kind="stable"), kind="stable")
