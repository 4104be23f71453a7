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
from .posterior import Components, Field, Posterior

LEAST_NOISE = 1e-6
"""Least noise over the rms of coefficients: without any the posterior is a limit."""
MAX_KEPT = 4
"""Kinds of noise of which the eigendecomposition is kept."""

ALIKE = 1e-6
"""Relative difference of noise that is none."""


class GaussianModel:
    """Images of a field, times v, of which ``rows`` (K, N), spectra of any length, are measured."""

    def __init__(self, rows: Floats, field: Field) -> None:
        self.field = field
        self.rows = rows
        self._kept: OrderedDict[bytes, Components] = OrderedDict()

    def given(
        self, measured: NDArray[Any], noise: Floats, expected: float | None = None
    ) -> Posterior:
        """The posterior of coefficients (K,), not all 0, with standard deviations ``noise`` (K,).

        Those of which the noise is infinite are not looked at. ``expected``: median contrast v
        before they are, where something tells.
        """
        known = np.isfinite(noise)
        least = LEAST_NOISE * float(np.sqrt(np.mean(np.abs(measured[known]) ** 2)))
        noise = np.maximum(noise, least)
        if np.ptp(noise[known]) > ALIKE * noise[known].max():
            from .factorised import Factorised  # SciPy takes long to import

            return Factorised(
                measured, noise, self.rows, self.gram, self.seen, self.field, expected
            )
        rms = float(np.sqrt(np.mean(noise[known] ** 2)))
        # Rounded, so that frames of one kind of noise have the same, to the last bit.
        components = self._components((noise / rms).astype(np.float32).astype(np.float64))
        return Posterior(measured[known], noise, rms, components, expected)

    @cached_property
    def gram(self) -> Floats:
        """R C R^T, (K, K)."""
        return np.asarray(self.rows @ (self.rows * self.field.variance.ravel()).T)

    @cached_property
    def seen(self) -> Floats:
        """Images of R C, (K, N)."""
        spectra = self.rows.reshape(-1, *self.field.variance.shape) * self.field.variance
        return self.field.image(spectra).reshape(len(spectra), -1)

    def _components(self, relative: Floats) -> Components:
        key = relative.tobytes()
        if key not in self._kept:
            known = np.isfinite(relative)
            self._kept[key] = Components(self.field, self.rows[known], relative[known])
        self._kept.move_to_end(key)
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)
        return self._kept[key]
