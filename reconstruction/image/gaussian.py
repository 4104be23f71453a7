"""Images as Gaussian fields of known covariance, given some of their coefficients.

A priori, images x are Gaussian with covariance v C, where C is diagonal in the atoms of a
dictionary and the contrast v is fitted. For coefficients m = R x + n with noise n of variance s^2
T^2, T diagonal, the posterior is

    mean = C R^T (R C R^T + s^2 T^2 / v)^-1 m,
    covariance = v (C - C R^T (R C R^T + s^2 T^2 / v)^-1 R C)

(C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, ch.
2). One eigendecomposition of T^-1 R C R^T T^-1 = U diag(l) U^T serves every v, every s and every
frame: the components U^T T^-1 m of the coefficients vary independently, with variance v l + s^2. If
the noise is non-uniform and changes from frame to frame, a Cholesky factorisation per frame is
cheaper; v is then fitted as if coefficients were independent, and the variance of one pixel
represents its neighbours.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .noise import CERTAIN, NoiseLevels
from .posterior import Combined, Components, Field, OwnPosterior, Posterior

MIN_NOISE = 1e-6
"""Minimum noise, relative to the rms of the coefficients; without noise the posterior is singular.
"""
MAX_LOST = 32
"""Maximum number of unmeasured coefficients that are removed from the eigendecomposition of all;
with more, the measured ones get their own."""
AT_A_TIME = 16
"""Frames per batch, so that their contrast grids fit into the processor's cache."""
ALIKE = 1e-6
"""Relative difference of noise that is neglected."""


class _Turned(NamedTuple):
    """Components of one frame's coefficients, as `Posterior` takes them."""

    components: Components
    turned: NDArray[Any]
    lost: Floats
    noise: Floats
    rms: float


class GaussianModel:
    """Gaussian images of a field, measured by ``rows`` (K, N), spectra of any length.

    ``usual`` (K,): relative noise for the eigendecomposition, uniform by default; ``combined``:
    sums of rows weighted by (..., K), if faster than a matrix product.
    """

    def __init__(
        self,
        rows: Floats,
        field: Field,
        usual: Floats | None = None,
        combined: Combined | None = None,
    ) -> None:
        self.field = field
        self.rows = rows
        self._combined = combined
        self.usual = np.ones(len(rows)) if usual is None else usual
        self._fewer: tuple[bytes, Components] | None = None

    def given(
        self,
        measured: NDArray[Any],
        noise: Floats,
        expected: float | None = None,
        levels: NoiseLevels = CERTAIN,
    ) -> Posterior:
        """Posterior given coefficients (K,), not all 0, with standard deviations ``noise`` (K,).

        Coefficients of infinite noise are ignored. ``expected``: prior median of the contrast v, if
        known; ``levels``: possible noise levels relative to ``noise``, used if the noise is the
        usual one.
        """
        noise, relative = self._noise(measured, noise)
        if relative is None:
            return self._factorised(measured, noise, expected)
        return Posterior(*self._turned(measured, noise, relative), expected, levels)

    def many(
        self, measured: NDArray[Any], rms: Floats, expected: Floats
    ) -> Iterator[tuple[NDArray[Any], Floats, float]]:
        """Mean, variance and contrast of frames (F, K) with the usual noise times ``rms`` (F,)."""
        for start in range(0, len(measured), AT_A_TIME):
            some = np.s_[start : start + AT_A_TIME]
            turned = measured[some] @ self._components.turn.T
            result = self._components.posteriors(turned, rms[some], expected[some])
            yield from zip(*result, strict=True)

    def usual_rms(self, measured: NDArray[Any], noise: Floats) -> float | None:
        """Ratio of ``noise`` (K,) to the usual noise, None if it is not constant."""
        if not np.isfinite(noise).all():
            return None
        return self._noise(measured, noise)[1]

    def own(
        self, measured: NDArray[Any], noise: Floats, expected: float | None = None
    ) -> OwnPosterior:
        """Posterior for the prior's own exponent and one contrast."""
        noise, relative = self._noise(measured, noise)
        if relative is None:
            return self._factorised(measured, noise, expected)
        turned = self._turned(measured, noise, relative)
        components, values, lost, _, rms = turned
        own = components.contrasts(values, lost, rms, expected, exponents=1)
        return OwnPosterior(*turned, float(own.given[0]))

    def _noise(self, measured: NDArray[Any], noise: Floats) -> tuple[Floats, float | None]:
        """Positive noise (K,), and its ratio to the usual noise, None if that is not constant."""
        finite, usual = np.isfinite(noise), self.usual
        if not finite.all():
            measured, usual = measured[finite], usual[finite]
        size = np.abs(measured / usual)
        minimum = MIN_NOISE * float(np.sqrt(size @ size / size.size))
        noise = np.maximum(noise, minimum * self.usual)
        relative = (noise if finite.all() else noise[finite]) / usual
        largest = relative.max()
        if largest - relative.min() > ALIKE * largest:
            return noise, None
        return noise, float(np.sqrt(relative @ relative / relative.size))

    def _factorised(
        self, measured: NDArray[Any], noise: Floats, expected: float | None
    ) -> Posterior:
        from .factorised import Factorised  # SciPy is slow to import

        return Factorised(measured, noise, self.rows, self.gram, self.seen, self.field, expected)

    def _turned(self, measured: NDArray[Any], noise: Floats, rms: float) -> _Turned:
        finite = np.isfinite(noise)
        (lost,) = np.nonzero(~finite)
        if lost.size > MAX_LOST:
            components, lost = self._of_some(finite), lost[:0]
        else:
            components = self._components
        turn = components.turn
        turned = turn @ np.where(finite, measured, 0)
        return _Turned(components, turned, turn[:, lost], noise, rms)

    @cached_property
    def _components(self) -> Components:
        return Components(self.field, self.rows, self.usual, combined=self._combined)

    @cached_property
    def gram(self) -> Floats:
        """R C R^T, (K, K)."""
        return np.asarray(self.rows @ (self.rows * self.field.variance.ravel()).T)

    @cached_property
    def seen(self) -> Floats:
        """Images of R C, (K, N)."""
        spectra = self.rows.reshape(-1, *self.field.variance.shape) * self.field.variance
        return self.field.image(spectra).reshape(len(spectra), -1)

    def _of_some(self, given: NDArray[np.bool_]) -> Components:
        """Components of the measured coefficients, cached while these are the same."""
        key = given.tobytes()
        if self._fewer is None or self._fewer[0] != key:
            self._fewer = key, Components(self.field, self.rows, self.usual, given)
        return self._fewer[1]
