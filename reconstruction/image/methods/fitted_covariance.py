"""Least squares under the covariance of drawn scenes instead of the 1/f prior.

The linear estimate of least mean squared error of such images, if their covariance is that of
`fitted_spectrum`.
"""

from dataclasses import dataclass

from ..fitted_spectrum import fitted_sigma
from ..prior import Sigma
from .least_squares import LeastSquares


@dataclass(frozen=True)
class FittedCovariance(LeastSquares):
    """Posterior mean and deviation under a fitted covariance."""

    title = "least squares, fitted covariance"
    sigma: Sigma = fitted_sigma


METHOD = FittedCovariance()
