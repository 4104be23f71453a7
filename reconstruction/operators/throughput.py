"""Whether patterns differ in how much of their light arrives.

A pattern and its complement together are the fully lit display, so that their sums scatter by noise
alone (see `redundancy`). Where fine patterns lose more light than coarse ones, by diffraction at a
mirror array or by an aperture, sums scatter by pattern, again and again, and tell nothing of the
noise; but then they are larger where the difference is: coarse patterns, of which images have most,
keep most of their light. Noise of sums and differences is independent.
"""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Mask
from .plan import PatternPlan
from .redundancy import complements, matrix_of

FEWEST = 9
"""Pairs that are compared, at least."""
ERROR = 1.8
"""Standard error of a ratio of two medians of n magnitudes, times sqrt(n): 1.17 of each, and some
more of sums that follow each other."""
USUAL = 1.0
"""Score that noise alone often has,"""
CERTAIN = 3.5
"""and one that it has in one recording of several thousand."""


class Throughput:
    """Of patterns that are shown with their complements, by ``usable`` (M,) readings of a plan."""

    def __init__(self, plan: PatternPlan, usable: Mask) -> None:
        pairs = complements(plan, usable)
        less = [{reading: -value for reading, value in minus.items()} for _, minus in pairs]
        self._sums = matrix_of([plus | minus for plus, minus in pairs], plan.exposures)
        self._differences = matrix_of(
            [plus | minus for (plus, _), minus in zip(pairs, less, strict=True)], plan.exposures
        )

    def score(self, signal: NDArray[np.float64], usable: Mask | None = None) -> float:
        """How far sums are from those of noise alone, in standard errors; 0 of too few pairs.

        Of those alone that rest on ``usable`` (M,) readings, where not all do. The larger of
        Spearman's correlation of sums with the size of differences, and of what the median of the
        latter lacks to that of noise.
        """
        of_sums, of_differences = self._sums, self._differences
        if usable is not None:
            retained = of_sums.resting_on(usable)
            of_sums, of_differences = of_sums.only(retained), of_differences.only(retained)
        pairs = of_sums.shape[0]
        if pairs < FEWEST or np.iscomplexobj(signal):
            return 0.0
        sums, differences = of_sums @ signal, np.abs(of_differences @ signal)
        sharp = sums[1:-1] - (sums[2:] + sums[:-2]) / 2  # without a slow drift
        correlation = _correlation(_ranks(sharp), _ranks(differences[1:-1])) * np.sqrt(pairs - 3)
        scatter = float(np.median(np.abs(np.diff(sums)))) / np.sqrt(2)
        lacking = 1 - float(np.median(differences)) / scatter if scatter > 0 else 0.0
        return max(correlation, lacking * np.sqrt(pairs) / ERROR)

    def probability_of_noise(
        self, signal: NDArray[np.float64], usable: Mask | None = None
    ) -> float:
        """How likely sums scatter by noise alone, where that is as likely as not beforehand.

        The score is about normal, of variance 1 by noise and of 1 + n/4 for n pairs of which
        throughputs correlate with differences by some 0.5. Up to `USUAL` it is taken for noise.
        """
        score, spread = self.score(signal, usable), self._sums.shape[0] / 4
        if score <= USUAL:
            return 1.0
        odds = np.sqrt(1 + spread) * np.exp(-(score**2) / 2 * spread / (1 + spread))
        return float(odds / (1 + odds))


def _ranks(values: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.argsort(np.argsort(values, kind="stable"), kind="stable")


def _correlation(first: NDArray[np.intp], second: NDArray[np.intp]) -> float:
    """Of two permutations of the same numbers from 0."""
    last = first.size - 1
    variance = last * (last + 2) / 12
    return float(np.mean((first - last / 2) * (second - last / 2)) / variance)
