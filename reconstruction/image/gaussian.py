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
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from ..arrays import Floats
from .prior import fit_scale

LEAST_NOISE = 1e-6
"""Least noise over the rms of coefficients: without any the posterior is a limit."""
MAX_KEPT = 4
"""Kinds of noise of which the eigendecomposition is kept."""

ALIKE = 1e-6
"""Relative difference of noise that is none."""
BLOCK = 4
"""Side of the blocks of pixels of which one stands for all, where noise is of many sizes."""


class Field:
    """Covariance C of images (H, W), diagonal with ``variance`` (H, W) in separable atoms.

    ``vertical`` (H, H) and ``horizontal`` (W, W) have orthonormal atoms in their columns.
    """

    def __init__(self, vertical: Floats, horizontal: Floats, variance: Floats) -> None:
        self.vertical, self.horizontal, self.variance = vertical, horizontal, variance
        height, width = variance.shape
        self.shape = height, width

    def __call__(self, images: NDArray[Any]) -> NDArray[Any]:
        """C of images (..., H, W)."""
        spectrum = self.vertical.T @ images @ self.horizontal
        return np.asarray(self.vertical @ (self.variance * spectrum) @ self.horizontal.T)

    @property
    def pixel_variance(self) -> Floats:
        """Diagonal of C, (H, W)."""
        return np.asarray(self.vertical**2 @ self.variance @ self.horizontal.T**2)


class Posterior:
    """Of one frame: ``mean`` (H, W), complex where coefficients are, and ``contrast`` v.

    ``noise`` (K,) is that of the coefficients, nowhere too small to divide by.
    """

    def __init__(
        self, measured: NDArray[Any], noise: Floats, rms: float, components: "Components"
    ) -> None:
        turned = components.turn @ measured
        self.noise = noise
        self.contrast = fit_scale(turned, components.spread, rms**2)
        shrinking = self.contrast / (self.contrast * components.spread + rms**2)
        self.mean = ((shrinking * turned) @ components.images).reshape(components.shape)
        self._explained = self.contrast * shrinking
        self._components = components

    @property
    def variance(self) -> Floats:
        """Of each pixel (H, W)."""
        components = self._components
        explained = (self._explained @ components.squared).reshape(components.shape)
        return np.maximum(self.contrast * components.pixel_variance - explained, 0)

    def covariance(self, image: NDArray[Any]) -> NDArray[Any]:
        """The posterior covariance times an image (H, W)."""
        components = self._components
        explained = (self._explained * (components.images @ image.ravel())) @ components.images
        return np.asarray(self.contrast * components.field(image) - explained.reshape(image.shape))


class Factorised(Posterior):
    """The same where coefficients have noise of different sizes.

    ``seen`` (K, N) is R C and ``gram`` (K, K) R C R^T; coefficients of infinite noise are left out.
    """

    def __init__(
        self, measured: NDArray[Any], noise: Floats, seen: Floats, gram: Floats, field: Field
    ) -> None:
        known = np.isfinite(noise)
        if not known.all():
            measured, seen, gram = measured[known], seen[known], gram[np.ix_(known, known)]
        variance = noise[known] ** 2
        self.noise = noise
        self.contrast = fit_scale(measured, np.diag(gram), variance)
        matrix = self.contrast * gram
        matrix[np.diag_indices_from(matrix)] += variance
        self._factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
        self._seen, self._field = seen, field
        self.mean = (self.contrast * self._solved(measured) @ seen).reshape(field.shape)

    def _solved(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(cho_solve(self._factor, coefficients, check_finite=False))

    @property
    def variance(self) -> Floats:
        """Of each pixel (H, W), by one of every few: a scattered one, as patterns are regular."""
        height, width = self._field.shape
        down, across = (np.arange(0, side, BLOCK) for side in (height, width))
        offset = np.add.outer(7 * np.arange(down.size), 3 * np.arange(across.size)) % BLOCK**2
        row = np.minimum(down[:, None] + offset // BLOCK, height - 1)
        column = np.minimum(across + offset % BLOCK, width - 1)
        lower, _ = self._factor
        seen = self._seen[:, (row * width + column).ravel()]
        told = solve_triangular(lower, seen, lower=True, check_finite=False)
        explained = self.contrast**2 * (told**2).sum(axis=0).reshape(row.shape)
        left = self.contrast * self._field.pixel_variance[row, column] - explained
        blocks = np.repeat(np.repeat(left, BLOCK, axis=0), BLOCK, axis=1)
        return np.maximum(blocks[:height, :width], 0)

    def covariance(self, image: NDArray[Any]) -> NDArray[Any]:
        """The posterior covariance times an image (H, W)."""
        explained = self._solved(self._seen @ image.ravel()) @ self._seen
        prior = self.contrast * self._field(image)
        return np.asarray(prior - self.contrast**2 * explained.reshape(image.shape))


class Components:
    """What varies independently in coefficients of which the noise has ``relative`` size (K,).

    ``spread`` (K,): the l above; ``turn`` (K, K): U^T T^-1; ``images`` (K, N): U^T T^-1 R C.
    """

    def __init__(self, field: Field, rows: Floats, seen: Floats, relative: Floats) -> None:
        self.field = field
        self.shape = field.shape
        spread, turn = np.linalg.eigh(rows @ seen.T / np.outer(relative, relative))
        self.spread: Floats = np.maximum(spread, 0)
        self.turn: Floats = turn.T / relative
        self.images: Floats = self.turn @ seen
        self.squared: Floats = self.images**2
        self.pixel_variance = field.pixel_variance


class GaussianModel:
    """Images of covariance v C, of which ``rows`` (K, N) of any length are measured."""

    def __init__(self, rows: Floats, field: Field) -> None:
        self.field = field
        self._rows = rows
        self._seen: Floats = field(rows.reshape(-1, *field.shape)).reshape(len(rows), -1)
        self._kept: OrderedDict[bytes, Components] = OrderedDict()

    def given(self, measured: NDArray[Any], noise: Floats) -> Posterior:
        """The posterior of coefficients (K,), not all 0, with standard deviations ``noise`` (K,).

        Those of which the noise is infinite are not looked at.
        """
        known = np.isfinite(noise)
        least = LEAST_NOISE * float(np.sqrt(np.mean(np.abs(measured[known]) ** 2)))
        noise = np.maximum(noise, least)
        if np.ptp(noise[known]) > ALIKE * noise[known].max():
            return Factorised(measured, noise, self._seen, self._gram, self.field)
        rms = float(np.sqrt(np.mean(noise[known] ** 2)))
        # Rounded, so that frames of one kind of noise have the same, to the last bit.
        components = self._components((noise / rms).astype(np.float32).astype(np.float64))
        return Posterior(measured[known], noise, rms, components)

    @cached_property
    def _gram(self) -> Floats:
        return np.asarray(self._rows @ self._seen.T)

    def _components(self, relative: Floats) -> Components:
        key = relative.tobytes()
        if key not in self._kept:
            known = np.isfinite(relative)
            self._kept[key] = Components(
                self.field, self._rows[known], self._seen[known], relative[known]
            )
        self._kept.move_to_end(key)
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)
        return self._kept[key]
