"""How much of the throughput that pairs of patterns show acts on their differences.

A lamp that flickers, or an aperture that takes a fraction t of a pattern's light, takes it from
pattern and complement alike, and their difference is t h x. Light that stays coherent behaves
otherwise: for any linear optics A and the field e on the display, the difference

    |A (1 + h) e / 2|^2 - |A (1 - h) e / 2|^2 = Re <A e, A h e>

is linear in h and keeps its scale, while the sum (|A e|^2 + |A h e|^2) / 2 falls to one half for
patterns too fine to pass. Real optics lie between. Differences are therefore modelled as t^g h x
with an exponent g from 0 to 1. Its likelihood is that of a Gaussian image, for the rows that see
most of it and a range of contrasts and powers of the spectrum. Half of the prior is on g = 1.
Throughput that scatters by a few per cent leaves the likelihood flat, and g is taken for 1.
"""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..operators import RowOperator
from .prior import Prior

EXPONENTS = np.linspace(0, 1, 5)
"""Exponents g."""
POWERS = (0.75, 1.0, 1.25)
"""Powers of the variances of the spectrum."""
CONTRASTS = 10.0 ** np.arange(-4, 8.1, 0.25)
"""Variance of the coefficients over that of their noise."""
PRIOR = np.array([0.125, 0.125, 0.125, 0.125, 0.5])
"""Their prior probability."""
MIN_SCATTER = 0.1
"""Rms scatter of the throughput below which its exponent is 1,"""
ALL_OF_IT = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
"""with this probability."""
MAX_ROWS = 128
"""Maximum number of rows; the strongest coefficients tell most."""
MAX_SIDE = 64
"""Maximum number of frequencies along each side."""


class ThroughputExponent:
    """Likelihood of the exponents, for rows of an ``operator`` of orthogonal patterns."""

    def __init__(self, operator: RowOperator) -> None:
        prior = Prior(operator)
        strongest = np.argsort(-prior.expected, kind="stable")[:MAX_ROWS]
        self._rows = np.flatnonzero(operator.varying)[np.sort(strongest)]
        height, width = (min(side, MAX_SIDE) for side in operator.image_shape)
        lowest = np.indices((height, width)).reshape(2, -1)
        seen = Prior(RowOperator(operator.basis, operator.index[self._rows]))
        rows = seen.atoms.of((lowest[0], lowest[1]))
        sigma = seen.sigma[:height, :width].ravel()
        powers = [sigma ** (2 * power) for power in POWERS]
        self._covariances = [(rows * each) @ rows.T for each in powers]

    def gains(
        self, values: NDArray[np.float64], noise: Floats, factors: Floats, measured: Mask
    ) -> Floats:
        """Mean of t^-g (K,), by which differences are multiplied; see `probability`."""
        probability = self.probability(values, noise, factors, measured)
        return np.asarray(probability @ factors ** -EXPONENTS[:, None])

    def probability(
        self, values: NDArray[np.float64], noise: Floats, factors: Floats, measured: Mask
    ) -> Floats:
        """Posterior probability of each of `EXPONENTS`.

        Parameters
        ----------
        values
            Coefficients (K,), as decoded.
        noise
            Their standard deviation (K,), positive.
        factors
            Throughput (K,) of their patterns.
        measured
            Mask (K,) of the coefficients to use.
        """
        seen = measured[self._rows]
        rows = self._rows[seen]
        if np.std(factors[measured]) < MIN_SCATTER:
            return ALL_OF_IT
        if not rows.size:
            return PRIOR
        white, scaled = 1 / noise[rows], np.log(factors[rows])
        logs = []
        for covariance in self._covariances:
            some = covariance[np.ix_(seen, seen)]
            some = some / np.trace(some) * len(some)
            for exponent in EXPONENTS:
                gain = white * np.exp(exponent * scaled)
                gain /= np.sqrt(np.mean(gain**2))
                logs.append(_log_evidence(some * np.outer(gain, gain), values[rows] * white))
        evidence = np.array(logs).reshape(len(POWERS), -1)
        weights = PRIOR * np.exp(evidence - evidence.max()).sum(axis=0)
        return np.asarray(weights / weights.sum())


def _log_evidence(covariance: Floats, values: Floats) -> float:
    """Log evidence of values (K,) with noise of variance 1, averaged over `CONTRASTS`."""
    spread, turn = np.linalg.eigh(covariance)
    variance = 1 + CONTRASTS[:, None] * np.maximum(spread, 0)
    logs = -(np.log(variance) + (turn.T @ values) ** 2 / variance).sum(axis=1) / 2
    return float(logs.max() + np.log(np.exp(logs - logs.max()).sum()))
