"""Least squares under the covariance of drawn scenes instead of the 1/f prior.

The linear estimate of least mean squared error of such images, if their covariance is that of the
`scenes-dct` dictionary, which `tools/fitted_covariance.py` fitted.
"""

from dataclasses import dataclass

from ..dictionaries.scenes_dct import DICTIONARY
from ..dictionary import Dictionary
from .least_squares import LeastSquares


@dataclass(frozen=True)
class FittedCovariance(LeastSquares):
    """Posterior mean and deviation under a fitted covariance."""

    title = "least squares, fitted covariance"
    dictionary: Dictionary = DICTIONARY


METHOD = FittedCovariance()
"""Cosines stronger along the axes than across."""
