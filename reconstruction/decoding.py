"""From the signals of displayed patterns to Walsh-Hadamard coefficients and their noise."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .image import pursuit_for, without_shared_errors
from .patterns import PatternPlan

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def decodable(plan: PatternPlan, usable: Mask) -> Mask:
    """Which of the plan's distinct rows (K,) rest on ``usable`` (M,) readings alone."""
    return np.asarray(abs(plan.decoder) @ (~usable).astype(float) == 0)


def decode(
    plan: PatternPlan, signal: NDArray[Any], variance: Floats, usable: Mask
) -> tuple[NDArray[np.int32], NDArray[Any], float]:
    """Coefficients in the unit of the signal: rows (K,), values (K,), their noise.

    ``signal`` (M,), one value per exposure, may be complex; its ``variance`` (M,) is then that of
    real and imaginary part together. Coefficients that rest on a reading that is not ``usable``
    (M,) are left out, which may leave none, and errors that many share are taken off. The noise is
    the standard deviation of a typical coefficient. Where a variance is not known (nan), it is 0,
    and every reading taken at its word.
    """
    complete = decodable(plan, usable)
    index, decoder = plan.distinct[complete], plan.decoder[complete]
    coefficients = decoder @ signal
    if not index.size or not np.isfinite(variance).all():
        return index, coefficients, 0.0
    prior = pursuit_for(plan.shape, index).prior_variance(coefficients)
    coefficients, left = without_shared_errors(decoder, coefficients, variance, prior)
    return index, coefficients, float(np.sqrt(np.median(left)))
