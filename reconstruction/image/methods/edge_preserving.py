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
from ..method import Estimate
from .least_squares import LeastSquaresSolver

ROUNDS = 4
STEPS = 6
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
        self._linear = linear = LeastSquaresSolver(operator, DICTIONARY)
        field = linear.field
        spectra = field.vertical.T @ linear.rows.reshape(-1, *field.shape) @ field.horizontal
        height, width = grid = _grid((spectra**2).sum(axis=0) * field.variance)
        vertical, horizontal = (DICTIONARY.atoms(side) for side in grid)
        self._down: Floats = field.vertical[:, :height] @ vertical.T
        self._across: Floats = field.horizontal[:, :width] @ horizontal.T
        low = vertical @ spectra[:, :height, :width] @ horizontal.T
        self._rows: Floats = low.reshape(len(low), -1)
        self._model = GaussianModel(
            self._rows, Field(vertical, horizontal, field.variance[:height, :width])
        )
        # Frequencies of the 1/f prior are in cycles per two pixels of the image, and a cosine of
        # one has gradients of pi times as much.
        spacing = field.shape[0] / height, field.shape[1] / width
        self._tensors = Tensors(grid, (1 / spacing[0], 1 / spacing[1]))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image whose edges agree with itself."""
        linear = self._linear
        start = linear.posterior(coefficients)
        if start is None:
            return linear(coefficients)
        measured, noise = linear.varying(coefficients)
        fine = start.mean - self._finer(self._coarser(start.mean))
        image, unevenness = self._followed(measured - linear.rows @ fine.ravel(), noise)
        finer = self._finer(unevenness)
        variance = start.variance * np.maximum(finer / finer.mean(), 0)
        return linear.with_level(fine + self._finer(image), variance, coefficients)

    def _finer(self, image: NDArray[Any]) -> NDArray[Any]:
        """An image on the grid as one of (H, W)."""
        return np.asarray(self._down @ image @ self._across.T)

    def _coarser(self, image: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(self._down.T @ image @ self._across)

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
        return _divergence(
            self._vertical * down + self._across * along,
            self._across * down + self._horizontal * along,
            self._scale,
        )


def gradient(image: NDArray[Any], scale: tuple[float, float]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Differences to the next pixel down and along, times scale; 0 at the last."""
    down, along = np.zeros_like(image), np.zeros_like(image)
    np.subtract(image[1:], image[:-1], out=down[:-1])
    np.subtract(image[:, 1:], image[:, :-1], out=along[:, :-1])
    return down * scale[0], along * scale[1]


def _divergence(
    down: NDArray[Any], along: NDArray[Any], scale: tuple[float, float]
) -> NDArray[Any]:
    """The transpose of the gradient."""
    down, along = down * scale[0], along * scale[1]
    total = np.zeros_like(down)
    total[1:] = down[:-1]
    total[:-1] -= down[:-1]
    total[:, 1:] += along[:, :-1]
    total[:, :-1] -= along[:, :-1]
    return total


def _window(side: int) -> Floats:
    """The matrix (side, side) that smooths one axis by the Gaussian window, mirrored at edges."""
    place = np.arange(side)
    direct, mirrored = np.subtract.outer(place, place), np.add.outer(place, place) + 1
    distances = np.array([direct, mirrored, 2 * side - mirrored])
    weights = np.exp(-((distances / WINDOW) ** 2) / 2).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))


def _grid(seen: Floats) -> tuple[int, int]:
    """Sides of the grid that holds twice the frequencies of what is ``seen`` (H, W) of them."""
    halves = (
        int(np.searchsorted(np.cumsum(seen.sum(axis=1 - axis)), SEEN * seen.sum())) + 1
        for axis in (0, 1)
    )
    height, width = (min(2 * half, side) for half, side in zip(halves, seen.shape, strict=True))
    return height, width


METHOD = EdgePreserving()
