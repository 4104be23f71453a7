"""Images as Gaussian fields of known covariance, given some of their coefficients.

Before they are measured, images x are taken for Gaussian with covariance v C, where C is diagonal
in the atoms of a dictionary and the contrast v is fitted. Of coefficients m = R x + n, with
noise n of variance s^2 T^2, T diagonal, the posterior is

    mean = C R^T (R C R^T + s^2 T^2 / v)^-1 m,
    covariance = v (C - C R^T (R C R^T + s^2 T^2 / v)^-1 R C)

(C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006,
ch. 2). One eigendecomposition of T^-1 R C R^T T^-1 = U diag(l) U^T serves every v, every s and
every frame: the components U^T T^-1 m of coefficients vary independently, by v l + s^2. Noise of
many sizes, which is another in every frame, is not worth one: there a Cholesky factorisation serves
the frame, v is fitted as if coefficients were independent, and the variance of one pixel stands for
those around it.
"""

from collections import OrderedDict
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .noise import CERTAIN, NoiseLevels
from .posterior import Components, Field, Posterior

LEAST_NOISE = 1e-6
"""Least noise over the rms of coefficients: without any the posterior is a limit."""
MAX_KEPT = 4
"""Sets of coefficients of which the eigendecomposition is kept."""

ALIKE = 1e-6
"""Relative difference of noise that is none."""


class GaussianModel:
    """Images of a field, times v, of which ``rows`` (K, N), spectra of any length, are measured.

    ``usual`` (K,): relative noise for which the eigendecomposition is made, equal noise if None.
    """

    def __init__(self, rows: Floats, field: Field, usual: Floats | None = None) -> None:
        self.field = field
        self.rows = rows
        self.usual = np.ones(len(rows)) if usual is None else usual
        self._kept: OrderedDict[bytes, Components] = OrderedDict()

    def given(
        self,
        measured: NDArray[Any],
        noise: Floats,
        expected: float | None = None,
        levels: NoiseLevels = CERTAIN,
    ) -> Posterior:
        """The posterior of coefficients (K,), not all 0, with standard deviations ``noise`` (K,).

        Those of which the noise is infinite are not looked at. ``expected``: median contrast v
        before they are, where something tells; ``levels``: what noise may be, over ``noise``,
        which is looked at where it is the usual one.
        """
        known = np.isfinite(noise)
        usual = self.usual[known]
        least = LEAST_NOISE * float(np.sqrt(np.mean(np.abs(measured[known] / usual) ** 2)))
        noise = np.maximum(noise, least * self.usual)
        relative = noise[known] / usual
        if np.ptp(relative) > ALIKE * relative.max():
            from .factorised import Factorised  # SciPy takes long to import

            return Factorised(
                measured, noise, self.rows, self.gram, self.seen, self.field, expected
            )
        rms = float(np.sqrt(np.mean(relative**2)))
        return Posterior(measured[known], noise, rms, self._components(known), expected, levels)

    @cached_property
    def gram(self) -> Floats:
        """R C R^T, (K, K)."""
        return np.asarray(self.rows @ (self.rows * self.field.variance.ravel()).T)

    @cached_property
    def seen(self) -> Floats:
        """Images of R C, (K, N)."""
        spectra = self.rows.reshape(-1, *self.field.variance.shape) * self.field.variance
        return self.field.image(spectra).reshape(len(spectra), -1)

    def _components(self, known: NDArray[np.bool_]) -> Components:
        key = known.tobytes()
        if key not in self._kept:
            self._kept[key] = Components(self.field, self.rows[known], self.usual[known])
        self._kept.move_to_end(key)
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)
        return self._kept[key]
