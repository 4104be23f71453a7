"""Images as Gaussian fields of known covariance, given some of their coefficients.

Before they are measured, images x are taken for Gaussian with covariance v C, where C is diagonal
in the atoms of a dictionary and the contrast v is fitted. Of coefficients m = R x + n, with
noise n of variance s^2 T^2, T diagonal, the posterior is

    mean = C R^T (R C R^T + s^2 T^2 / v)^-1 m,
    covariance = v (C - C R^T (R C R^T + s^2 T^2 / v)^-1 R C)

(C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006,
ch. 2). One eigendecomposition of T^-1 R C R^T T^-1 = U diag(l) U^T serves every v, every s and
every frame: the components U^T T^-1 m of coefficients vary independently, by v l + s^2.
"""

from collections import OrderedDict
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .prior import fit_scale

LEAST_NOISE = 1e-6
"""Least noise over the rms of coefficients: without any the posterior is a limit."""
MAX_KEPT = 4
"""Kinds of noise of which the eigendecomposition is kept."""


class Field:
    """Images (H, W) with independent coefficients of ``variance`` (H, W) in separable atoms.

    ``vertical`` (H, H) and ``horizontal`` (W, W) have orthonormal atoms in their columns.
    """

    def __init__(self, vertical: Floats, horizontal: Floats, variance: Floats) -> None:
        self.vertical, self.horizontal, self.variance = vertical, horizontal, variance
        height, width = variance.shape
        self.shape = height, width

    def image(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """The sum of atoms (..., H, W) with these coefficients."""
        return np.asarray(self.vertical @ spectrum @ self.horizontal.T)

    def spectrum(self, image: NDArray[Any]) -> NDArray[Any]:
        """Coefficients (..., H, W) of an image."""
        return np.asarray(self.vertical.T @ image @ self.horizontal)

    @property
    def pixel_variance(self) -> Floats:
        """Variance of each pixel, (H, W)."""
        return np.asarray(self.vertical**2 @ self.variance @ self.horizontal.T**2)


class Posterior:
    """Of one frame: ``mean`` (H, W), a spectrum, complex where coefficients are; ``contrast`` v.

    ``noise`` (K,) is that of the coefficients, nowhere too small to divide by.
    """

    def __init__(
        self, measured: NDArray[Any], noise: Floats, rms: float, components: "Components"
    ) -> None:
        turned = components.turn @ measured
        self.noise = noise
        self.contrast = fit_scale(turned, components.spread, rms**2)
        shrinking = self.contrast / (self.contrast * components.spread + rms**2)
        self.mean = ((shrinking * turned) @ components.spectra).reshape(components.shape)
        self._explained = self.contrast * shrinking
        self._components = components

    @property
    def variance(self) -> Floats:
        """Of each pixel (H, W)."""
        components = self._components
        weights = self._explained.astype(np.float32)
        prior = components.pixel_variance
        explained = (weights @ components.squared).reshape(prior.shape)
        return np.maximum(self.contrast * prior - explained, 0)

    def covariance(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """The posterior covariance times a spectrum (H, W)."""
        components = self._components
        explained = (self._explained * (components.spectra @ spectrum.ravel())) @ components.spectra
        prior = self.contrast * components.field.variance * spectrum
        return np.asarray(prior - explained.reshape(spectrum.shape))


class Components:
    """What varies independently in coefficients of which the noise has ``relative`` size (K,).

    ``spread`` (K,): the l above; ``turn`` (K, K): U^T T^-1; ``spectra`` (K, N): U^T T^-1 R C.
    """

    def __init__(self, field: Field, rows: Floats, relative: Floats) -> None:
        self.field = field
        self.shape = field.shape
        seen = rows * field.variance.ravel()
        spread, turn = np.linalg.eigh(rows @ seen.T / np.outer(relative, relative))
        self.spread: Floats = np.maximum(spread, 0)
        self.turn: Floats = turn.T / relative
        self.spectra: Floats = self.turn @ seen
        self.pixel_variance = field.pixel_variance

    @cached_property
    def squared(self) -> NDArray[np.float32]:
        """Squared images (K, N) of the spectra."""
        images = self.field.image(self.spectra.reshape(-1, *self.shape))
        return np.asarray(images**2, np.float32).reshape(len(images), -1)


class GaussianModel:
    """Images of a field, times v, of which ``rows`` (K, N), spectra of any length, are measured."""

    def __init__(self, rows: Floats, field: Field) -> None:
        self.field = field
        self.rows = rows
        self._kept: OrderedDict[bytes, Components] = OrderedDict()

    def given(self, measured: NDArray[Any], noise: Floats) -> Posterior:
        """The posterior of coefficients (K,), not all 0, with standard deviations ``noise`` (K,).

        Those of which the noise is infinite are not looked at.
        """
        known = np.isfinite(noise)
        least = LEAST_NOISE * float(np.sqrt(np.mean(np.abs(measured[known]) ** 2)))
        noise = np.maximum(noise, least)
        rms = float(np.sqrt(np.mean(noise[known] ** 2)))
        # Rounded, so that frames of one kind of noise have the same, to the last bit.
        components = self._components((noise / rms).astype(np.float32).astype(np.float64))
        return Posterior(measured[known], noise, rms, components)

    def _components(self, relative: Floats) -> Components:
        key = relative.tobytes()
        if key not in self._kept:
            known = np.isfinite(relative)
            self._kept[key] = Components(self.field, self.rows[known], relative[known])
        self._kept.move_to_end(key)
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)
        return self._kept[key]
