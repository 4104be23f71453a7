"""Gaussian fields, and what coefficients tell of one; see `gaussian`."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .contrast import contrasts, shrunk
from .noise import NoiseLevels

POWERS = (1.0, 0.5, 1.5, 2.0)
"""Of the spread of components: exponents of 2, the prior's own, and 1, 3 and 4 of frequency."""


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
    """Of one frame: ``mean`` (H, W), a spectrum, complex where coefficients are.

    Mean and variance are averages over contrasts and, for what is measured, exponents: the rest is
    as the prior's own exponent has it. ``contrast`` v is the mean one of that exponent, for which
    are `own_mean`, `covariance` and ``noise_energy``: what noise adds to own_mean^T C^-1 own_mean,
    on average. ``noise`` (K,) is that of the coefficients, nowhere too small to divide by. Where
    it may have several ``levels``, mean and variance are those over all of them.
    """

    def __init__(
        self,
        measured: NDArray[Any],
        noise: Floats,
        rms: float,
        components: "Components",
        expected: float | None,
        levels: NoiseLevels,
    ) -> None:
        turned = components.turn @ measured
        spread = components.spread
        levels = levels.and_one  # of which is `contrast`
        known = contrasts(turned, components.spreads, rms**2, expected, levels)
        each = shrunk(known, components.spreads, rms**2, levels)
        self.noise = noise
        self.contrast = float(known.given[0])
        shrinking = each.gain * components.inverse
        self.mean = ((shrinking * turned) @ components.spectra).reshape(components.shape)
        left = each.by_noise + each.between * np.abs(turned) ** 2
        self._explained = (self.contrast * spread - left) * components.inverse**2
        own = self.contrast / (self.contrast * spread + rms**2)
        self.noise_energy = float((own**2 * spread).sum() * rms**2)
        self._of_one = self.contrast * own
        self._turned, self._components = own * turned, components

    @property
    def own_mean(self) -> NDArray[Any]:
        """The mean (H, W) of contrast v and the prior's own exponent."""
        components = self._components
        return np.asarray((self._turned @ components.spectra).reshape(components.shape))

    @property
    def variance(self) -> Floats:
        """Of each pixel (H, W), as if what contrasts differ in were independent of each other."""
        components = self._components
        # Relative: squares of readings in any unit may be beyond single precision.
        weights = (self._explained / self.contrast).astype(np.float32)
        prior = components.pixel_variance
        explained = (weights @ components.squared).reshape(prior.shape)
        return self.contrast * np.maximum(prior - explained, 0)

    def covariance(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """The posterior covariance of contrast v times a spectrum (H, W)."""
        components = self._components
        explained = (self._of_one * (components.spectra @ spectrum.ravel())) @ components.spectra
        prior = self.contrast * components.field.variance * spectrum
        return np.asarray(prior - explained.reshape(spectrum.shape))


class Components:
    """What varies independently in coefficients of which the noise has ``relative`` size (K,).

    ``spread`` (K,): the l above, ``inverse`` (K,) its inverse, 0 for 0; ``turn`` (K, K): U^T T^-1;
    ``spectra`` (K, N): U^T T^-1 R C; ``spreads`` (E, K): the same l to several powers, all of
    the same sum.
    """

    def __init__(self, field: Field, rows: Floats, relative: Floats) -> None:
        self.field = field
        self.shape = field.shape
        seen = rows * field.variance.ravel()
        spread, turn = np.linalg.eigh(rows @ seen.T / np.outer(relative, relative))
        self.spread: Floats = np.maximum(spread, 0)
        told = spread > 1e-12 * spread.max()
        self.inverse: Floats = np.divide(1, spread, out=np.zeros_like(spread), where=told)
        self.turn: Floats = turn.T / relative
        self.spectra: Floats = self.turn @ seen
        powers = self.spread ** np.array(POWERS)[:, None]
        self.spreads: Floats = powers * (self.spread.sum() / powers.sum(axis=1, keepdims=True))
        self.pixel_variance = field.pixel_variance

    @cached_property
    def squared(self) -> NDArray[np.float32]:
        """Squared images (K, N) of the spectra."""
        images = self.field.image(self.spectra.reshape(-1, *self.shape))
        return np.asarray(images**2, np.float32).reshape(len(images), -1)
