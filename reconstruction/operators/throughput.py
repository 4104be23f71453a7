"""Whether the optical throughput differs from pattern to pattern, and by how much.

A pattern and its complement add up to the fully lit display, so their sums scatter by noise alone
(see `redundancy`). If fine patterns lose more light than coarse ones, by diffraction at a mirror
array or at an aperture, sums vary reproducibly from pattern to pattern and do not measure the
noise. In that case sums are larger where differences are larger: most images are dominated by
coarse patterns, which keep most of their light. The noise of sums and differences is independent.

Without background, the sum over its mean is the pattern's throughput t, with the noise of the sum.
The scatter beyond noise, s^2, is the prior variance of t about 1, so that t is estimated by

    1 + (sum / mean - 1) s^2 / (s^2 + noise^2).

A lamp that flickers, or an aperture that takes a fraction t of a pattern's light, takes it from
pattern and complement alike, and their difference is t h x. Diffracted light behaves otherwise: for
any linear optics A and the field e on the display, the difference

    |A (1 + h) e / 2|^2 - |A (1 - h) e / 2|^2 = Re <A e, A h e>

is linear in h and keeps its scale, while the sum (|A e|^2 + |A h e|^2) / 2 falls to half of that of
the all-on pattern where h is too fine to pass. Real optics lie between: where the all-on pattern
passes much more than the mean pair, differences are taken for t^g h x with an exponent g anywhere
from 0 to 1, and divided by 1 / mean(t^-g) = t ln t / (t - 1).
"""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from .plan import PatternPlan
from .redundancy import complements, matrix_of

MIN_PAIRS = 9
"""Minimum number of pairs that are compared."""
RATIO_ERROR = 1.8
"""Standard error of a ratio of two medians of n magnitudes, times sqrt(n): 1.17 for each, and
slightly more for successive sums."""
USUAL_SCORE = 1.0
"""Score that noise alone often reaches,"""
MAX_SCORE = 3.5
"""and one that it reaches in one recording of several thousand."""
MIN_EXCESS = 5.0
"""Scatter beyond noise, in standard errors, that is taken for throughput."""
MEDIAN_OF_NORMAL = 0.6745
MAX_SCATTER = 0.5
"""Maximum scatter of throughput; more is no loss of light, but light that comes and goes."""
MIN_ESTIMATE = 0.05
"""Minimum estimate of a throughput."""
MIN_BEYOND = 1e-6
"""Difference from 1 below which a throughput is 1."""
MAX_ALL_ON = 1.5
"""Throughput of the all-on pattern, relative to the mean pair, above which light is diffracted."""


class Throughput:
    """Throughput test by ``usable`` (M,) readings of patterns and their complements."""

    def __init__(self, plan: PatternPlan, usable: Mask) -> None:
        pairs = complements(plan, usable)
        self._plan = plan
        self._rows = np.array([plan.index[next(iter(plus))] for plus, _ in pairs], dtype=np.int64)
        less = [{reading: -value for reading, value in minus.items()} for _, minus in pairs]
        self._sums = matrix_of([plus | minus for plus, minus in pairs], plan.exposures)
        self._differences = matrix_of(
            [plus | minus for (plus, _), minus in zip(pairs, less, strict=True)], plan.exposures
        )

    @property
    def pairs(self) -> int:
        """Number of patterns exposed with their complement, all-on not counted."""
        return int(np.count_nonzero(self._rows != self._plan.patterns.dc_row))

    def score(self, signal: NDArray[np.float64], usable: Mask | None = None) -> float:
        """Deviation of the sums from pure noise, in standard errors; 0 for too few pairs.

        The larger of Spearman's correlation between sums and magnitudes of differences, and the
        deficit of the median magnitude relative to that of noise. If ``usable`` (M,) is given, only
        pairs of usable readings count.
        """
        of_sums, of_differences = self._sums, self._differences
        if usable is not None:
            retained = of_sums.resting_on(usable)
            of_sums, of_differences = of_sums.only(retained), of_differences.only(retained)
        pairs = of_sums.shape[0]
        if pairs < MIN_PAIRS or np.iscomplexobj(signal):
            return 0.0
        sums, differences = of_sums @ signal, np.abs(of_differences @ signal)
        sharp = sums[1:-1] - (sums[2:] + sums[:-2]) / 2  # removes slow drift
        correlation = _correlation(_ranks(sharp), _ranks(differences[1:-1])) * np.sqrt(pairs - 3)
        scatter = float(np.median(np.abs(np.diff(sums)))) / np.sqrt(2)
        lacking = 1 - float(np.median(differences)) / scatter if scatter > 0 else 0.0
        return max(correlation, lacking * np.sqrt(pairs) / RATIO_ERROR)

    def probability_of_noise(
        self, signal: NDArray[np.float64], usable: Mask | None = None
    ) -> float:
        """Posterior probability that the sums scatter by noise alone, with a prior of one half.

        The score is about normal, of variance 1 for noise and of 1 + n/4 for n pairs whose
        throughput correlates with differences by some 0.5. Up to `USUAL_SCORE` it is attributed to
        noise.
        """
        score, spread = self.score(signal, usable), self._sums.shape[0] / 4
        if score <= USUAL_SCORE:
            return 1.0
        odds = np.sqrt(1 + spread) * np.exp(-(score**2) / 2 * spread / (1 + spread))
        return float(odds / (1 + odds))

    def estimated(
        self, signal: Floats, variance: Floats, usable: Mask | None = None
    ) -> Floats | None:
        """Relative throughput of each row of the basis, by the pairs of one frame.

        Parameters
        ----------
        signal
            Readings (M,).
        variance
            Their variance (M,); with nan, scatter is judged by `score` and none of it is noise.
        usable
            Mask (M,) of the readings to use, all by default.

        Returns
        -------
        ndarray or None
            Factors (rows,) of the sums, nan for rows without a pair; None if noise may explain the
            scatter, or if the plan states them.
        """
        sums, rows, differences = self._sums, self._rows, np.abs(self._differences @ signal)
        if usable is not None:
            retained = sums.resting_on(usable)
            sums, rows, differences = sums.only(retained), rows[retained], differences[retained]
        varying = rows != self._plan.patterns.dc_row
        if self._plan.throughput is not None or np.iscomplexobj(signal):
            return None
        if np.count_nonzero(varying) < MIN_PAIRS:
            return None
        net = sums @ signal - 2 * self._background(signal, usable)
        noise = sums**2 @ variance
        scale = float(net[varying].mean())
        scatter = self._excess(net[varying], noise[varying], signal, usable)
        if scatter <= 0 or not 0 < np.sqrt(scatter) < MAX_SCATTER * scale:
            return None
        if (differences > (1 + MAX_SCATTER) * np.maximum(net, scale)).any():
            return None  # the sums are not all light, as with AC coupling
        weight = scatter / (scatter + np.nan_to_num(noise))
        factors = np.full(self._plan.patterns.rows, np.nan)
        factors[rows] = np.maximum(1 + weight * (net / scale - 1), MIN_ESTIMATE)
        return factors

    def acting(self, signal: Floats, variance: Floats, usable: Mask | None = None) -> Floats | None:
        """The same as it acts on differences of pattern and complement; see the module."""
        factors, dc_row = self.estimated(signal, variance, usable), self._plan.patterns.dc_row
        if factors is None or (dc_row is not None and factors[dc_row] <= MAX_ALL_ON):
            return factors
        beyond = np.where(np.abs(factors - 1) < MIN_BEYOND, MIN_BEYOND, factors - 1)
        return np.asarray((1 + beyond) * np.log1p(beyond) / beyond)

    def _background(self, signal: Floats, usable: Mask | None) -> float:
        """Mean of the dark exposures; 0 if there is none."""
        plan = self._plan
        dark = (plan.index == plan.patterns.dc_row) & (plan.polarity == -1)
        dark = dark if usable is None else dark & usable
        return float(signal[dark].mean()) if dark.any() else 0.0

    def _excess(self, sums: Floats, noise: Floats, signal: Floats, usable: Mask | None) -> float:
        """Variance of the sums beyond ``noise``; 0 if that may explain it."""
        variance, expected = float(sums.var()), float(noise.mean())
        if not np.isfinite(expected):
            return variance if self.score(signal, usable) > MAX_SCORE else 0.0
        typical = float(np.median(np.abs(sums - np.median(sums))) / MEDIAN_OF_NORMAL) ** 2
        error = expected * np.sqrt(2 / sums.size)
        significant = variance - expected > MIN_EXCESS * error  # and not for a few outliers alone
        return variance - expected if significant and typical > expected + 2 * error else 0.0


def _ranks(values: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.argsort(np.argsort(values, kind="stable"), kind="stable")


def _correlation(first: NDArray[np.intp], second: NDArray[np.intp]) -> float:
    """Correlation of two permutations of the same numbers from 0."""
    last = first.size - 1
    variance = last * (last + 2) / 12
    return float(np.mean((first - last / 2) * (second - last / 2)) / variance)
