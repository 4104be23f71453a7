"""Total variation: of all images that agree with the readings the one with the least edges.

Minimises sum |grad x| subject to |(R x - m) / s| <= sqrt(K), s the noise of the K coefficients, by
the primal-dual iterations of A. Chambolle, T. Pock, J. Math. Imaging Vis. 40, 120 (2011), Algorithm
1.
R has orthonormal rows, so the nearest image that agrees is found from its coefficients alone, in
one step where their noise is equal: by Newton's iterations for the multiplier of the constraint, as
in trust regions (J. J. More, D. C. Sorensen, SIAM J. Sci. Stat. Comput. 4, 553 (1983)). Those end
where both residuals of the optimality conditions are small (T. Goldstein et al., arXiv:1305.0546).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..gradient import divergence, gradient
from ..method import Estimate
from .least_squares import METHOD as LEAST_SQUARES

RESIDUAL = 0.01
"""Relative residuals at which iterations end."""
MAX = 2000
"""Iterations at most."""
LOOKED = 20
"""Iterations after which residuals are looked at."""
STEP = 0.3
"""Primal step over the deviation of the image, which iterations are fast with."""
MIN_NOISE = 1e-9
"""Least noise over the norm of coefficients."""
NEWTON_STEPS, TOLERANCE = 10, 1e-6
NORM = np.sqrt(8)
"""Norm of the gradient operator, at most."""


@dataclass(frozen=True)
class TotalVariation:
    """The image of least total variation that agrees with the readings within their noise."""

    title = "total variation"

    def compile(self, operator: MeasurementOperator) -> "TotalVariationSolver":
        """Solver of one operator's coefficients."""
        return TotalVariationSolver(operator)


class TotalVariationSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator) -> None:
        self._operator = operator
        self._linear = LEAST_SQUARES.compile(operator)

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image; how far off a pixel is total variation does not tell."""
        start = self._linear(coefficients).image
        if not np.ptp(np.abs(start)):
            return Estimate(start)
        return Estimate(_fewest_edges(start, Near(self._operator, coefficients)))


class Near:
    """Images that agree with coefficients within their noise, and with their level."""

    def __init__(self, operator: MeasurementOperator, coefficients: Coefficients) -> None:
        self._operator, self._values = operator, coefficients.values
        self._reported = coefficients.measured
        self._noisy = self._reported & operator.varying
        minimum = MIN_NOISE * float(np.linalg.norm(coefficients.values[self._noisy]))
        self._variance = np.maximum(coefficients.noise[self._noisy], minimum) ** 2

    def nearest(self, image: NDArray[Any]) -> NDArray[Any]:
        """The nearest of them to an image (H, W)."""
        misfit = np.where(self._reported, self._operator.forward(image) - self._values, 0)
        misfit[self._noisy] -= self._allowed(misfit[self._noisy])
        return image - self._operator.min_norm(misfit)

    def _allowed(self, misfit: NDArray[Any]) -> NDArray[Any]:
        """The nearest misfit (K,) that is noise: v / (v + t) of it, v the variance, some t."""
        scaled, multiplier = np.abs(misfit) ** 2 * self._variance, 0.0
        for _ in range(NEWTON_STEPS):
            weight = 1 / (self._variance + multiplier)
            size, slope = scaled @ weight**2, scaled @ weight**3
            if size <= (1 + TOLERANCE) * misfit.size:
                break
            multiplier += size / slope * (np.sqrt(size / misfit.size) - 1)
        return np.asarray(misfit * self._variance / (self._variance + multiplier))


def _fewest_edges(image: NDArray[Any], near: Near) -> NDArray[Any]:
    """The image of least total variation among those that are ``near``, from a first one."""
    step = STEP * float(np.std(image))  # images and their normalised gradients differ in unit
    rise = 1 / (NORM**2 * step)
    normals = gradient(np.zeros_like(image))
    ahead = image
    for iteration in range(MAX):
        risen = [p + rise * d for p, d in zip(normals, gradient(ahead), strict=True)]
        length = np.maximum(1, np.sqrt(np.abs(risen[0]) ** 2 + np.abs(risen[1]) ** 2))
        turned = risen[0] / length, risen[1] / length
        moved = near.nearest(image - step * divergence(*turned))
        if iteration % LOOKED == LOOKED - 1 and _settled(image, moved, normals, turned, step, rise):
            return moved
        ahead = 2 * moved - image
        image, normals = moved, turned
    return image


def _settled(
    image: NDArray[Any],
    moved: NDArray[Any],
    normals: tuple[NDArray[Any], NDArray[Any]],
    turned: tuple[NDArray[Any], NDArray[Any]],
    step: float,
    rise: float,
) -> bool:
    """Whether primal and dual residual are below `RESIDUAL` of what they are differences of."""
    moves, turns = image - moved, [a - b for a, b in zip(normals, turned, strict=True)]
    primal = moves / step - divergence(*turns)
    dual = [t / rise - d for t, d in zip(turns, gradient(moves), strict=True)]
    slopes = np.linalg.norm(gradient(moved))
    return bool(
        np.linalg.norm(primal) < RESIDUAL * np.linalg.norm(divergence(*turned))
        and np.linalg.norm(dual) < RESIDUAL * slopes
    )


METHOD = TotalVariation()
