"""Least squares under a prior that follows the edges of the image itself.

Where an image is smooth its gradients are small, and along an edge they are across it. The estimate
of the round before tells how: with its structure tensors, smoothed by a Gaussian window G,

    T = G * (grad x  grad x^T) + e^2 I

(W. Foerstner, E. Guelch, Proc. ISPRS Intercommission Workshop (1987) 281), e the mean gradient, for
what the estimate does not show, the next round minimises

    sum_k (R x - m)_k^2 / s_k^2 + c sum_pixels grad x^T (T / t)^-1 grad x,    t = mean trace T / 2.

Were T the same everywhere this would be the 1/f prior of the least-squares image, whose contrast
gives c. It is anisotropic diffusion (J. Weickert, Anisotropic Diffusion in Image Processing,
Teubner 1998) that agrees with the readings. The rounds begin at the least-squares image, whose
posterior covariance is the preconditioner, on a grid no finer than what the patterns can tell.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.dct import DICTIONARY
from ..gaussian import Field, GaussianModel, Posterior
from ..gradient import divergence, gradient
from ..grid import Grid, at_most, band
from ..method import Estimate
from .least_squares import METHOD as LEAST_SQUARES

ROUNDS = 3
STEPS = 5
"""Of conjugate gradients in each round."""
WINDOW = 1.0
"""Deviation of the Gaussian window in pixels of the grid."""
SEEN = 0.99
"""Share of what the patterns see that half the frequencies of the grid hold."""


@dataclass(frozen=True)
class EdgePreserving:
    """Edge-preserving least squares."""

    title = "edge-preserving least squares"

    def compile(self, operator: MeasurementOperator) -> "EdgePreservingSolver":
        """Solver of one operator's coefficients."""
        return EdgePreservingSolver(operator)


class EdgePreservingSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator) -> None:
        self._linear = linear = LEAST_SQUARES.compile(operator)
        field = linear.field
        high, wide = band(linear.seen, SEEN)
        height, width = at_most((2 * high, 2 * wide), field.shape)
        self._grid = Grid((height, width), field.shape)
        rows = linear.rows.reshape(len(linear.rows), *field.shape)
        self._rows: Floats = self._grid.coarser(rows).reshape(len(rows), height * width)
        atoms = DICTIONARY.atoms(height), DICTIONARY.atoms(width)
        self._model = GaussianModel(self._rows, Field(*atoms, field.variance[:height, :width]))
        # The 1/f prior is in frequencies per two pixels of the image, of which a cosine of one
        # has gradients of pi: differences on the grid are taken back to these pixels.
        sides = operator.image_shape
        self._tensors = Tensors((height, width), (height / sides[0], width / sides[1]))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image whose edges agree with itself."""
        linear, grid = self._linear, self._grid
        start = linear.posterior(coefficients)
        if start is None:
            return linear.flat(coefficients)
        measured, noise = linear.varying(coefficients)
        fine = start.mean - grid.finer(grid.coarser(start.mean))
        image, energy = self._followed(measured - linear.rows @ fine.ravel(), noise)
        unevenness = grid.finer_density(energy / energy.mean())
        variance = linear.variance(start, start.variance * unevenness)
        followed = linear.grid.finer(fine + grid.finer(image))
        return linear.with_level(followed, variance, coefficients)

    def _followed(self, measured: NDArray[Any], noise: Floats) -> tuple[NDArray[Any], Floats]:
        """Image on the grid, and the energy of its gradients."""
        start = self._model.given(measured, noise)
        image = start.mean
        for _ in range(ROUNDS):
            stiffness = self._tensors.of(image, 1 / (np.pi**2 * start.contrast))
            image = self._towards_minimum(image, measured, stiffness, start)
        return image, self._tensors.energy(image)

    def _towards_minimum(
        self,
        image: NDArray[Any],
        measured: NDArray[Any],
        stiffness: "Stiffness",
        start: Posterior,
    ) -> NDArray[Any]:
        """Some steps of preconditioned conjugate gradients."""
        rows, weight = self._rows, 1 / start.noise**2
        misfit = weight * (measured - rows @ image.ravel())
        residual = (misfit @ rows).reshape(image.shape) - stiffness(image)
        step = ready = start.covariance(residual)
        size = np.vdot(residual, ready).real
        for _ in range(STEPS):
            curved = ((weight * (rows @ step.ravel())) @ rows).reshape(image.shape)
            curved = curved + stiffness(step)
            length = size / np.vdot(step, curved).real
            image = image + length * step
            residual = residual - length * curved
            ready = start.covariance(residual)
            before, size = size, np.vdot(residual, ready).real
            step = ready + (size / before) * step
        return image


class Tensors:
    """Structure tensors of images on a ``grid``; ``scale`` takes differences to gradients."""

    def __init__(self, grid: tuple[int, int], scale: tuple[float, float]) -> None:
        self._scale = scale
        self._windows = _window(grid[0]), _window(grid[1]).T

    def of(self, image: NDArray[Any], contrast: float) -> "Stiffness":
        """What holds images back where this one is smooth; see `Stiffness`."""
        vertical, horizontal, across = self._smoothed(image)
        determinant = vertical * horizontal - across**2
        scale = contrast * (vertical + horizontal).mean() / 2 / determinant
        return Stiffness(scale * horizontal, scale * vertical, -scale * across, self._scale)

    def energy(self, image: NDArray[Any]) -> Floats:
        """Trace of the tensors (h, w)."""
        vertical, horizontal, _ = self._smoothed(image)
        return np.asarray(vertical + horizontal)

    def _smoothed(self, image: NDArray[Any]) -> tuple[Floats, Floats, Floats]:
        down, along = gradient(image, self._scale)
        mean = (np.abs(down).mean() + np.abs(along).mean()) / 2
        products = np.abs(down) ** 2, np.abs(along) ** 2, (down * np.conj(along)).real
        vertical, horizontal, across = (
            self._windows[0] @ product @ self._windows[1] for product in products
        )
        return vertical + mean**2, horizontal + mean**2, across


class Stiffness:
    """The matrix D^T W D, D the gradient and W (2, 2) at each pixel; applied to images (h, w)."""

    def __init__(
        self, vertical: Floats, horizontal: Floats, across: Floats, scale: tuple[float, float]
    ) -> None:
        self._vertical, self._horizontal, self._across = vertical, horizontal, across
        self._scale = scale

    def __call__(self, image: NDArray[Any]) -> NDArray[Any]:
        """The matrix times an image."""
        down, along = gradient(image, self._scale)
        return divergence(
            self._vertical * down + self._across * along,
            self._across * down + self._horizontal * along,
            self._scale,
        )


def _window(side: int) -> Floats:
    """The matrix (side, side) that smooths one axis by the Gaussian window, mirrored at edges."""
    place = np.arange(side)
    direct, mirrored = np.subtract.outer(place, place), np.add.outer(place, place) + 1
    distances = np.array([direct, mirrored, 2 * side - mirrored])
    weights = np.exp(-((distances / WINDOW) ** 2) / 2).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))


METHOD = EdgePreserving()
