"""Least squares under a prior that adapts to the edges of the image itself.

Where an image is smooth its gradients are small, and at an edge they are perpendicular to it. The
previous estimate shows where: with its structure tensors, smoothed by a Gaussian window G,

    T = G * (grad x  grad x^T) + e^2 I

(W. Foerstner, E. Guelch, Proc. ISPRS Intercommission Workshop (1987) 281), where e is the mean
gradient and stands for unresolved structure, the next round minimises

    sum_k (R x - m)_k^2 / s_k^2 + c sum_pixels grad x^T (T / t)^-1 grad x,    t = mean trace T / 2.

For a constant T this is the 1/f prior. In general it is anisotropic diffusion (J. Weickert,
Anisotropic Diffusion in Image Processing, Teubner 1998) consistent with the readings. The rounds
start from the least-squares image of the fitted covariance, whose contrast gives c and whose
posterior covariance is the preconditioner, on a grid no finer than the patterns resolve. As edges
of noise are worthless, the difference between the last and the first round is added to the
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
"""Conjugate-gradient steps per round."""
WINDOW = 1.0
"""Standard deviation of the Gaussian window, in pixels of the grid."""
MIN_SEEN = 0.99
"""Fraction of what the patterns see that half the frequencies of the grid contain."""


@dataclass(frozen=True)
class EdgePreserving:
    """Edge-preserving least squares."""

    title = "edge-preserving least squares"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of an operator's coefficients; least squares beyond its size limit."""
        linear = FITTED_COVARIANCE.compile(operator)
        if not isinstance(linear, LeastSquaresSolver):
            return linear
        return EdgePreservingSolver(linear)


class EdgePreservingSolver:
    """Solver with all that depends on the operator alone."""

    def __init__(self, linear: LeastSquaresSolver) -> None:
        self.linear = linear
        model = linear.model
        sides = linear.operator.image_shape
        all_of_them = model.field.shape
        high, wide = band(linear.seen, MIN_SEEN)
        self._grid = Grid(at_most((2 * high, 2 * wide), all_of_them), sides)
        height, width = self._grid.shape
        # The 1/f prior counts frequencies per two image pixels, where a cosine of frequency 1 has
        # gradients of pi, so differences on the grid are converted to image pixels.
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
        """Image whose prior agrees with its own edges."""
        start = self.linear.posterior(coefficients)
        if start is None:
            return self.linear.flat(coefficients)
        spectrum, variance = self.followed(start, coefficients)
        return self.linear.estimate(spectrum, variance, coefficients)

    def followed(self, start: Posterior, coefficients: Coefficients) -> tuple[NDArray[Any], Floats]:
        """Spectrum refined from the least-squares posterior, and the variance of its pixels."""
        linear = self.linear
        measured, noise = linear.varying(coefficients)
        height, width = self._grid.shape
        # Subtract the response of the rows to frequencies beyond the grid.
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
        """Weight of the refinement: the squared fraction of gradient energy that is not noise."""
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
        self, spectrum: NDArray[Any], measured: NDArray[Any], stiffness: Linear, start: OwnPosterior
    ) -> NDArray[Any]:
        """Conjugate-gradient steps, preconditioned by the first posterior covariance P."""
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
    """Distinct entries (h, w) of the structure tensor at each pixel."""

    vertical: Floats
    horizontal: Floats
    across: Floats

    @property
    def energy(self) -> Floats:
        """Trace of the tensors."""
        return self.vertical + self.horizontal


class Slopes:
    """Gradients of images on a ``grid``, from spectra (h, w), with factors ``scale``."""

    def __init__(self, grid: tuple[int, int], scale: tuple[float, float]) -> None:
        vertical, horizontal = (DICTIONARY.atoms(side) for side in grid)
        self.atoms = vertical, horizontal
        # Left and right factors of the derivatives of a spectrum, down and along.
        self._left = np.array([scale[0] * _derivative(vertical), vertical])
        self._right = np.array([horizontal.T, scale[1] * _derivative(horizontal).T])
        self._back = self._left.swapaxes(1, 2).copy(), self._right.swapaxes(1, 2).copy()
        self._windows = _window(grid[0]), _window(grid[1]).T

    def gradient(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Gradients (2, h, w) between neighbouring pixels, down and along."""
        return np.asarray(self._left @ spectrum @ self._right)

    def tensors(self, spectrum: NDArray[Any]) -> Tensors:
        """Structure tensors in the Gaussian window, with the mean gradient on their diagonal."""
        slopes = self.gradient(spectrum)
        size = np.abs(slopes)
        mean = size.sum() / size.size
        products = np.empty((3, *size.shape[1:]))
        products[:2] = size**2
        products[2] = (slopes[0] * np.conj(slopes[1])).real
        vertical, horizontal, across = self._windows[0] @ products @ self._windows[1]
        return Tensors(vertical + mean**2, horizontal + mean**2, across)

    def stiffness(self, tensors: Tensors, weight: float) -> Linear:
        """D^T W D on spectra, with D the gradient and W the inverse tensors times their mean."""
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
    """Derivatives of cosines (side, side), in columns, between neighbouring pixels."""
    side = len(cosines)
    differences = np.diff(cosines, axis=0, append=cosines[-1:])
    return np.asarray(differences / np.sinc(np.arange(side) / (2 * side)))


def _window(side: int) -> Floats:
    """Matrix (side, side) of Gaussian smoothing along one axis, mirrored at the edges."""
    position = np.arange(side)
    direct, mirrored = np.subtract.outer(position, position), np.add.outer(position, position) + 1
    distances = np.array([direct, mirrored, 2 * side - mirrored])
    weights = np.exp(-((distances / WINDOW) ** 2) / 2).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))


METHOD = EdgePreserving()
