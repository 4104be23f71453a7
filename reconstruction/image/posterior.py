"""Gaussian fields and their posteriors; see `gaussian`."""

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from .contrast import Contrasts, contrasts, contrasts_of_frames, shrunk
from .noise import CERTAIN, NoiseLevels

Combined = Callable[[NDArray[Any]], NDArray[Any]]
"""Sums (..., H, W) of rows of spectra by their weights (..., K)."""
POWERS = (1.0, 0.5, 1.5, 2.0)
"""Powers of the component variances: frequency exponents 2, as in the prior, and 1, 3 and 4."""


class Field:
    """Images (H, W) with coefficients of ``variance`` (H, W) in orthonormal separable atoms."""

    def __init__(self, vertical: Floats, horizontal: Floats, variance: Floats) -> None:
        self.vertical, self.horizontal, self.variance = vertical, horizontal, variance
        height, width = variance.shape
        self.shape = height, width

    def image(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Image (..., H, W) of a spectrum."""
        return np.asarray(self.vertical @ spectrum @ self.horizontal.T)

    def spectrum(self, image: NDArray[Any]) -> NDArray[Any]:
        """Coefficients (..., H, W) of an image."""
        return np.asarray(self.vertical.T @ image @ self.horizontal)

    @property
    def pixel_variance(self) -> Floats:
        """Variance of each pixel, (H, W)."""
        return np.asarray(self.vertical**2 @ self.variance @ self.horizontal.T**2)


class OwnPosterior:
    """Posterior of one frame for one contrast v and the prior's own exponent.

    ``noise_energy`` is the mean contribution of noise to own_mean^T C^-1 own_mean. ``noise`` (K,)
    is the positive noise of the coefficients, ``rms`` that of the components. The combinations
    ``lost`` (K, f) of components are unmeasured: infinite noise, which is a downdate of rank f.
    """

    def __init__(
        self,
        components: "Components",
        turned: NDArray[Any],
        lost: Floats,
        noise: Floats,
        rms: float,
        contrast: float,
    ) -> None:
        self.noise, self.contrast = noise, contrast
        spread = components.spread
        precision = 1 / (contrast * spread + rms**2)
        energy = (spread * precision**2).sum()
        weights = precision * turned
        self._lost = lost
        if lost.shape[1]:
            missing = precision[:, None] * lost
            factor = np.linalg.cholesky(lost.T @ missing)
            missing = np.linalg.solve(factor, missing.T).T
            weights = weights - missing @ (missing.T @ turned)
            weighed = spread[:, None] * missing
            energy -= 2 * (precision[:, None] * missing * weighed).sum()
            energy += ((missing.T @ weighed) * (missing.T @ missing)).sum()
            self._lost = contrast * missing
        self.noise_energy = float(contrast**2 * rms**2 * energy)
        self._of_one = contrast**2 * precision
        self._own_weights, self._components = contrast * weights, components
        self._filled = weights / precision

    @property
    def own_mean(self) -> NDArray[Any]:
        """Mean spectrum (H, W), complex if the coefficients are."""
        return self._components.spectrum(self._own_weights)

    def covariance(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Product of the posterior covariance and a spectrum (H, W)."""
        components = self._components
        seen = components.spectra @ spectrum.ravel()
        explained = self._of_one * seen
        if self._lost.shape[1]:
            explained -= self._lost @ (self._lost.T @ seen)
        prior = self.contrast * components.field.variance * spectrum
        return np.asarray(prior - components.spectrum(explained))


class Posterior(OwnPosterior):
    """Posterior whose mean and variance are averages over contrasts, exponents and noise levels.

    This applies to measured components; the rest follows the prior's own exponent, whose mean
    contrast is ``contrast``, or that of all exponents where it is larger: patterns that see few of
    the low frequencies determine no exponent. ``mean`` (H, W) is a spectrum.
    """

    def __init__(
        self,
        components: "Components",
        turned: NDArray[Any],
        lost: Floats,
        noise: Floats,
        rms: float,
        expected: float | None,
        levels: NoiseLevels,
    ) -> None:
        levels = levels.and_one  # `contrast` is that of level 1
        given = components.contrasts(turned, lost, rms, expected, levels)
        super().__init__(components, turned, lost, noise, rms, float(given.given[0]))
        each = shrunk(given, components.spreads, rms**2, levels)
        weights = each.gain * components.inverse * self._filled
        self.mean = components.spectrum(weights)
        self._weights = weights
        left = each.by_noise + each.between * np.abs(self._filled) ** 2
        self._explained = (self.contrast * components.spread - left) * components.inverse**2
        self._more = float(given.of_all) - self.contrast

    @property
    def seen(self) -> NDArray[Any]:
        """Products of the rows (K,) of the components with the mean."""
        components = self._components
        return np.asarray(components.back @ (components.spread * self._weights))

    @property
    def variance(self) -> Floats:
        """Variance of each pixel (H, W), as if differences between contrasts were independent."""
        components = self._components
        # Divided by the contrast, as squared readings may exceed single precision.
        weights = (self._explained / self.contrast).astype(np.float32)
        prior = components.pixel_variance
        explained = (weights @ components.squared).reshape(prior.shape)
        variance = self.contrast * np.maximum(prior - explained, 0)
        if self._more > 0:
            variance += self._more * components.unseen
        if self._lost.shape[1]:
            images = components.field.image(components.spectrum(self._lost.T))
            variance += (np.abs(images) ** 2).sum(axis=0)
        return variance


class Posteriors(NamedTuple):
    """Posteriors of several frames: ``mean`` (F, h, w), pixel ``variance``, ``contrast`` (F,)."""

    mean: NDArray[Any]
    variance: Floats
    contrast: Floats


class Components:
    """Independent components of coefficients whose noise has ``relative`` size (K,).

    Only ``given`` (K,) coefficients count, all by default; there are as many components. ``spread``
    (K,): the variances l of `gaussian`; ``inverse`` (K,): 1 / l, or 0; ``turn`` (K, K): U^T T^-1,
    and ``back`` its inverse; ``spectra`` (K, N): U^T T^-1 R C; ``spreads`` (E, K): powers of l with
    equal sums.
    """

    def __init__(
        self,
        field: Field,
        rows: Floats,
        relative: Floats,
        given: Mask | None = None,
        combined: Combined | None = None,
    ) -> None:
        self.field, self._combined = field, combined
        self.shape = field.shape
        given = np.ones(len(rows), dtype=bool) if given is None else given
        rows, relative = rows[given], relative[given]
        seen = rows * field.variance.ravel()
        spread, turn = np.linalg.eigh(rows @ seen.T / np.outer(relative, relative))
        self.spread: Floats = np.maximum(spread, 0)
        positive = spread > 1e-12 * spread.max()
        self.inverse: Floats = np.divide(1, spread, out=np.zeros_like(spread), where=positive)
        self.turn: Floats = np.zeros((len(rows), given.size))
        self.turn[:, given] = turn.T / relative
        self.back: Floats = np.zeros((given.size, len(rows)))
        self.back[given] = relative[:, None] * turn
        self.spectra: Floats = self.turn[:, given] @ seen
        powers = self.spread ** np.array(POWERS)[:, None]
        self.spreads: Floats = powers * (self.spread.sum() / powers.sum(axis=1, keepdims=True))
        self._usual: Floats = self.spreads.mean(axis=0)
        self.pixel_variance = field.pixel_variance

    def spectrum(self, weights: NDArray[Any]) -> NDArray[Any]:
        """Sum (..., H, W) of the spectra, weighted by (..., K)."""
        if self._combined is not None:
            return self.field.variance * self._combined(weights @ self.turn)
        return np.asarray((weights @ self.spectra).reshape(*weights.shape[:-1], *self.shape))

    def contrasts(
        self,
        turned: NDArray[Any],
        lost: Floats,
        rms: float,
        expected: float | None,
        levels: NoiseLevels = CERTAIN,
        exponents: int | None = None,
    ) -> Contrasts:
        """Contrasts of the first exponents, for components (K,) with noise ``rms``."""
        missing, spreads = lost if lost.shape[1] else None, self.spreads[:exponents]
        return contrasts(turned, spreads, rms**2, expected, levels, self._usual, missing)

    def posteriors(self, turned: NDArray[Any], rms: Floats, expected: Floats | None) -> Posteriors:
        """Posteriors of frames with components (F, K) and noise ``rms`` (F,); see `Posterior`."""
        noise = rms[:, None] ** 2
        given = contrasts_of_frames(turned, self.spreads, noise, expected, usual=self._usual)
        contrast = given.given[:, :1]
        each = shrunk(given, self.spreads, noise[..., None, None])
        left = each.by_noise + each.between * np.abs(turned) ** 2
        explained = (contrast * self.spread - left) * self.inverse**2 / contrast
        pixels = (explained.astype(np.float32) @ self.squared).reshape(
            -1, *self.pixel_variance.shape
        )
        return Posteriors(
            self.spectrum(each.gain * self.inverse * turned),
            contrast[..., None] * np.maximum(self.pixel_variance - pixels, 0)
            + np.maximum(given.of_all - contrast[:, 0], 0)[:, None, None] * self.unseen,
            contrast[:, 0],
        )

    @cached_property
    def unseen(self) -> Floats:
        """Variance (H, W) of what no component sees, for contrast 1."""
        seen = (self.inverse.astype(np.float32) @ self.squared).reshape(self.pixel_variance.shape)
        return np.maximum(self.pixel_variance - seen, 0)

    @cached_property
    def squared(self) -> NDArray[np.float32]:
        """Squared images (K, N) of the spectra."""
        images = self.field.image(self.spectra.reshape(-1, *self.shape))
        return np.asarray(images**2, np.float32).reshape(len(images), -1)
