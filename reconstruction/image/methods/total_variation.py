"""Total variation: of all images that agree with the readings, the one with the weakest edges.

Minimises sum |grad x| subject to |(R x - m) / s| <= sqrt(K), with s the noise of the K
coefficients, by the primal-dual iteration of A. Chambolle, T. Pock, J. Math. Imaging Vis. 40, 120
(2011), Algorithm 1. As R has orthonormal rows, the projection onto the constraint needs
coefficients only: one step for uniform noise, else Newton's iteration for its multiplier, as in
trust regions (J. J. More, D. C. Sorensen, SIAM J. Sci. Stat. Comput. 4, 553 (1983)). The stopping
criterion is that both residuals of the optimality conditions are small (T. Goldstein et al.,
arXiv:1305.0546).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..method import Estimate
from .least_squares import METHOD as LEAST_SQUARES

Image = NDArray[Any]
Pair = tuple[Image, Image]

RESIDUAL = 0.01
"""Relative residuals at which the iteration stops."""
MAX_ITERATIONS = 2000
CHECK_INTERVAL = 20
"""Iterations between checks of the residuals."""
STEP = 0.3
"""Primal step, relative to the standard deviation of the image, that converges fast."""
MIN_NOISE = 1e-9
"""Minimum noise, relative to the norm of the coefficients."""
NEWTON_STEPS, TOLERANCE = 10, 1e-6
NORM = np.sqrt(8)
"""Upper bound of the norm of the gradient operator."""


@dataclass(frozen=True)
class TotalVariation:
    """Image of minimum total variation that agrees with the readings within their noise."""

    title = "total variation"

    def compile(self, operator: MeasurementOperator) -> "TotalVariationSolver":
        return TotalVariationSolver(operator)


class TotalVariationSolver:
    """Solver with all that depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator) -> None:
        self._operator = operator
        self._linear = LEAST_SQUARES.compile(operator)

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image; total variation gives no standard deviation."""
        start = self._linear(coefficients).image
        if not np.ptp(np.abs(start)):
            return Estimate(start)
        return Estimate(_min_variation(start, Near(self._operator, coefficients)))


class Near:
    """Images that agree with coefficients within their noise, and with the DC coefficient."""

    def __init__(self, operator: MeasurementOperator, coefficients: Coefficients) -> None:
        self._operator, self._values = operator, coefficients.values
        self._measured = coefficients.measured
        self._noisy = self._measured & operator.varying
        minimum = MIN_NOISE * float(np.linalg.norm(coefficients.values[self._noisy]))
        self._variance = np.maximum(coefficients.noise[self._noisy], minimum) ** 2

    def nearest(self, image: NDArray[Any]) -> NDArray[Any]:
        """Nearest of them to an image (H, W)."""
        misfit = np.where(self._measured, self._operator.forward(image) - self._values, 0)
        misfit[self._noisy] -= self._allowed(misfit[self._noisy])
        return image - self._operator.min_norm(misfit)

    def _allowed(self, misfit: NDArray[Any]) -> NDArray[Any]:
        """Nearest misfit (K,) within the noise: v / (v + t) of it, with v its variance."""
        scaled, multiplier = np.abs(misfit) ** 2 * self._variance, 0.0
        for _ in range(NEWTON_STEPS):
            weight = 1 / (self._variance + multiplier)
            size, slope = scaled @ weight**2, scaled @ weight**3
            if size <= (1 + TOLERANCE) * misfit.size:
                break
            multiplier += size / slope * (np.sqrt(size / misfit.size) - 1)
        return np.asarray(misfit * self._variance / (self._variance + multiplier))


def _min_variation(image: NDArray[Any], near: Near) -> NDArray[Any]:
    """Image of minimum total variation among those that are ``near``, from an initial one."""
    step = STEP * float(np.std(image))  # images and normalised gradients differ in unit
    rise = 1 / (NORM**2 * step)
    normals = gradient(np.zeros_like(image))
    ahead = image
    for iteration in range(MAX_ITERATIONS):
        risen = [p + rise * d for p, d in zip(normals, gradient(ahead), strict=True)]
        length = np.maximum(1, np.sqrt(np.abs(risen[0]) ** 2 + np.abs(risen[1]) ** 2))
        turned = risen[0] / length, risen[1] / length
        moved = near.nearest(image - step * divergence(*turned))
        if iteration % CHECK_INTERVAL == CHECK_INTERVAL - 1 and _converged(
            image, moved, normals, turned, step, rise
        ):
            return moved
        ahead = 2 * moved - image
        image, normals = moved, turned
    return image


def _converged(
    image: Image, moved: Image, normals: Pair, turned: Pair, step: float, rise: float
) -> bool:
    """Whether the relative primal and dual residuals are below `RESIDUAL`."""
    moves, turns = image - moved, [a - b for a, b in zip(normals, turned, strict=True)]
    primal = moves / step - divergence(*turns)
    dual = [t / rise - d for t, d in zip(turns, gradient(moves), strict=True)]
    slopes = np.linalg.norm(gradient(moved))
    return bool(
        np.linalg.norm(primal) < RESIDUAL * np.linalg.norm(divergence(*turned))
        and np.linalg.norm(dual) < RESIDUAL * slopes
    )


def gradient(image: Image) -> Pair:
    """Differences to the next pixel down and along; 0 at the last."""
    down, along = np.zeros_like(image), np.zeros_like(image)
    np.subtract(image[1:], image[:-1], out=down[:-1])
    np.subtract(image[:, 1:], image[:, :-1], out=along[:, :-1])
    return down, along


def divergence(down: Image, along: Image) -> Image:
    """Transpose of `gradient`."""
    total = np.zeros_like(down)
    total[1:] = down[:-1]
    total[:-1] -= down[:-1]
    total[:, 1:] += along[:, :-1]
    total[:, :-1] -= along[:, :-1]
    return total


METHOD = TotalVariation()
