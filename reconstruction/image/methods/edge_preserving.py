"""Least squares under a prior that follows the edges of the image itself.

Where an image is smooth its gradients are small, and along an edge they are across it. The estimate
of the round before tells how: with its structure tensors, smoothed by a Gaussian window G,

    T = G * (grad x  grad x^T) + e^2 I

(W. Foerstner, E. Guelch, Proc. ISPRS Intercommission Workshop (1987) 281), e the mean gradient, for
what the estimate does not show, the next round minimises

    sum_k (R x - m)_k^2 / s_k^2 + c sum_pixels grad x^T (T / t)^-1 grad x,    t = mean trace T / 2.

Were T the same everywhere this would be the 1/f prior. It is anisotropic diffusion (J. Weickert,
Anisotropic Diffusion in Image Processing, Teubner 1998) that agrees with the readings. The rounds
begin at the least-squares image of the fitted covariance, whose contrast gives c and whose
posterior covariance is the preconditioner, on a grid no finer than what the patterns can tell. As
edges of noise are worth nothing, what the last round differs from the first in is added to the
least-squares image only as far as the gradients of the first are not noise.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.dct import DICTIONARY
from ..gaussian import Field, GaussianModel, OwnPosterior, Posterior
from ..grid import Grid, at_most, band
from ..method import Estimate, ImageSolver
from .fitted_covariance import METHOD as FITTED_COVARIANCE
from .least_squares import LeastSquaresSolver

Linear = Callable[[NDArray[Any]], NDArray[Any]]

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

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of one operator's coefficients.

        Of more than least squares reckons with that is the same: little is left to guess.
        """
        linear = FITTED_COVARIANCE.compile(operator)
        if not isinstance(linear, LeastSquaresSolver):
            return linear
        return EdgePreservingSolver(linear)


class EdgePreservingSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, linear: LeastSquaresSolver) -> None:
        self.linear = linear
        model = linear.model
        sides = linear.operator.image_shape
        all_of_them = model.field.shape
        high, wide = band(linear.seen, SEEN)
        self._grid = Grid(at_most((2 * high, 2 * wide), all_of_them), sides)
        height, width = self._grid.shape
        # The 1/f prior is in frequencies per two pixels of the image, of which a cosine of one
        # has gradients of pi: differences on the grid are taken back to these pixels.
        self._slopes = Slopes(self._grid.shape, (height / sides[0], width / sides[1]))
        variance = model.field.variance[:height, :width]
        self._precision = linear.precision[:height, :width]
        self._model = model
        if self._grid.shape != all_of_them:
            low = model.rows.reshape(-1, *all_of_them)[:, :height, :width]
            vertical, horizontal = self._slopes.atoms
            field = Field(vertical, horizontal, variance)
            low = low.reshape(len(model.rows), height * width)
            self._model = GaussianModel(low, field, model.usual)

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image whose edges agree with itself."""
        start = self.linear.posterior(coefficients)
        if start is None:
            return self.linear.flat(coefficients)
        spectrum, variance = self.followed(start, coefficients)
        return self.linear.estimate(spectrum, variance, coefficients)

    def followed(self, start: Posterior, coefficients: Coefficients) -> tuple[NDArray[Any], Floats]:
        """Spectrum whose edges agree with itself, from least squares, and variance of pixels."""
        linear = self.linear
        measured, noise = linear.varying(coefficients)
        height, width = self._grid.shape
        # Without what rows see of the frequencies that are beyond the grid.
        low = measured - start.seen + self._model.rows @ start.mean[:height, :width].ravel()
        first = self._model.own(low, noise, linear.expected_contrast(coefficients))
        edges = self._rounds(low, first)
        energy = self._slopes.tensors(edges).energy
        trusted = self._trusted(first)
        spectrum = start.mean.copy()
        spectrum[:height, :width] += trusted * (edges - first.own_mean)
        unevenness = 1 + trusted * (self._grid.finer_density(energy / energy.mean()) - 1)
        return spectrum, linear.variance(start) * unevenness

    def _trusted(self, first: OwnPosterior) -> float:
        """How far edges are followed: the square of the share of gradients that is no noise.

        Of a prior near 1/f, x^T C^-1 x is about the energy of the gradients, up to a factor.
        """
        energy = float((np.abs(first.own_mean) ** 2 * self._precision).sum())
        return max(0.0, 1 - first.noise_energy / energy) ** 2 if energy > 0 else 0.0

    def _rounds(self, measured: NDArray[Any], first: OwnPosterior) -> NDArray[Any]:
        """Spectrum on the grid after the last round."""
        spectrum = first.own_mean
        for _ in range(ROUNDS):
            tensors = self._slopes.tensors(spectrum)
            stiffness = self._slopes.stiffness(tensors, 1 / (np.pi**2 * first.contrast))
            spectrum = self._towards_minimum(spectrum, measured, stiffness, first)
        return spectrum

    def _towards_minimum(
        self,
        spectrum: NDArray[Any],
        measured: NDArray[Any],
        stiffness: Linear,
        start: OwnPosterior,
    ) -> NDArray[Any]:
        """Some steps of conjugate gradients, preconditioned by the first posterior covariance P.

        The matrix of this round is P^-1 less the first prior's precision plus the stiffness. With
        P^-1 of the step at hand, carried along as the step itself is, readings do not enter.
        """
        precision = self._precision / start.contrast
        rows = self._model.rows
        misfit = (measured - rows @ spectrum.ravel()) / start.noise**2
        residual = (misfit @ rows).reshape(spectrum.shape) - stiffness(spectrum)
        step, unconditioned = start.covariance(residual), residual
        size = np.vdot(residual, step).real
        for left in reversed(range(STEPS)):
            curved = unconditioned - precision * step + stiffness(step)
            length = size / np.vdot(step, curved).real
            spectrum = spectrum + length * step
            if left:
                residual = residual - length * curved
                ready = start.covariance(residual)
                before, size = size, np.vdot(residual, ready).real
                step = ready + (size / before) * step
                unconditioned = residual + (size / before) * unconditioned
        return spectrum


@dataclass(frozen=True, eq=False)
class Tensors:
    """The three different entries (h, w) of the structure tensor at each pixel."""

    vertical: Floats
    horizontal: Floats
    across: Floats

    @property
    def energy(self) -> Floats:
        """The trace."""
        return self.vertical + self.horizontal


class Slopes:
    """Gradients of images on a ``grid``, of their spectra (h, w).

    ``scale``: what differences between pixels are multiplied by.
    """

    def __init__(self, grid: tuple[int, int], scale: tuple[float, float]) -> None:
        vertical, horizontal = (DICTIONARY.atoms(side) for side in grid)
        self.atoms = vertical, horizontal
        # Down and along: what makes slopes of a spectrum, from the left and from the right.
        self._left = np.array([scale[0] * _derivative(vertical), vertical])
        self._right = np.array([horizontal.T, scale[1] * _derivative(horizontal).T])
        self._back = self._left.swapaxes(1, 2).copy(), self._right.swapaxes(1, 2).copy()
        self._windows = _window(grid[0]), _window(grid[1]).T

    def gradient(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Slopes (2, h, w) between each pixel and the next, down and along."""
        return np.asarray(self._left @ spectrum @ self._right)

    def tensors(self, spectrum: NDArray[Any]) -> Tensors:
        """Structure tensors in the Gaussian window, and on their diagonal the mean gradient."""
        slopes = self.gradient(spectrum)
        size = np.abs(slopes)
        mean = size.sum() / size.size
        products = np.empty((3, *size.shape[1:]))
        products[:2] = size**2
        products[2] = (slopes[0] * np.conj(slopes[1])).real
        vertical, horizontal, across = self._windows[0] @ products @ self._windows[1]
        return Tensors(vertical + mean**2, horizontal + mean**2, across)

    def stiffness(self, tensors: Tensors, weight: float) -> Linear:
        """D^T W D of spectra, D the gradient and W the inverse tensors times their mean."""
        determinant = tensors.vertical * tensors.horizontal - tensors.across**2
        scale = weight * tensors.energy.mean() / 2 / determinant
        own = scale * np.array([tensors.horizontal, tensors.vertical])
        across = -scale * tensors.across
        left, right = self._back

        def apply(spectrum: NDArray[Any]) -> NDArray[Any]:
            slopes = self.gradient(spectrum)
            back = left @ (own * slopes + across * slopes[::-1]) @ right
            return np.asarray(back[0] + back[1])

        return apply


def _derivative(cosines: Floats) -> Floats:
    """Of cosines (side, side), in their columns, between each pixel and the next; 0 at the last.

    Differences between pixels are less than that, by the sinc of half the phase between them.
    """
    side = len(cosines)
    differences = np.diff(cosines, axis=0, append=cosines[-1:])
    return np.asarray(differences / np.sinc(np.arange(side) / (2 * side)))


def _window(side: int) -> Floats:
    """The matrix (side, side) that smooths one axis by the Gaussian window, mirrored at edges."""
    position = np.arange(side)
    direct, mirrored = np.subtract.outer(position, position), np.add.outer(position, position) + 1
    distances = np.array([direct, mirrored, 2 * side - mirrored])
    weights = np.exp(-((distances / WINDOW) ** 2) / 2).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))


METHOD = EdgePreserving()
