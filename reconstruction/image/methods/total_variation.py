"""Total variation: of all images that agree with the readings the one with the least edges.

Minimises sum |grad x| subject to |R x - m| <= s sqrt(K), s the noise of the K coefficients, by the
primal-dual iterations of A. Chambolle, T. Pock, J. Math. Imaging Vis. 40, 120 (2011), Algorithm 1.
R has orthonormal rows, so the nearest image that agrees is found in one step. The iterations end
where both residuals of the optimality conditions are small (T. Goldstein et al., arXiv:1305.0546).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..gaussian import GaussianModel
from ..gradient import divergence, gradient
from ..method import Estimate
from .least_squares import METHOD as LEAST_SQUARES

RESIDUAL = 0.01
"""Relative residuals at which iterations end."""
MOST = 2000
"""Iterations at most."""
LOOKED = 20
"""Iterations after which residuals are looked at."""
STEP = 0.3
"""Primal step over the deviation of the image, which iterations are fast with."""
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
        self._linear = LEAST_SQUARES.compile(operator)

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image; how far off a pixel is total variation does not tell."""
        measured, noise = self._linear.varying(coefficients)
        start = self._linear.posterior(coefficients)
        if start is None:
            return self._linear.flat(coefficients)
        near = Near(self._linear.model, measured, noise)
        field = self._linear.model.field
        edges = _least_edges(field.image(start.mean), near)
        return self._linear.estimate(field.spectrum(edges), None, coefficients)


class Near:
    """Images that agree with coefficients (K,) of a model's orthonormal rows within the noise."""

    def __init__(self, model: GaussianModel, measured: NDArray[Any], noise: Floats) -> None:
        known = np.isfinite(noise)
        self._field, self._rows = model.field, model.rows[known]
        self._measured = measured[known]
        self._radius = float(np.linalg.norm(noise[known]))

    def nearest(self, image: NDArray[Any]) -> NDArray[Any]:
        """The nearest of them to an image (H, W)."""
        misfit = self._rows @ self._field.spectrum(image).ravel() - self._measured
        length = float(np.linalg.norm(misfit))
        if length <= self._radius:
            return image
        excess = misfit * (1 - self._radius / length)
        return image - self._field.image((excess @ self._rows).reshape(self._field.variance.shape))


def _least_edges(image: NDArray[Any], near: Near) -> NDArray[Any]:
    """The image of least total variation among those that are ``near``, from a first one."""
    step = STEP * float(np.std(image))  # images and their normalised gradients differ in unit
    rise = 1 / (NORM**2 * step)
    normals = gradient(np.zeros_like(image))
    ahead = image
    for iteration in range(MOST):
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
