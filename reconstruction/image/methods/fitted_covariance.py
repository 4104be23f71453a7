"""Least squares under the covariance of synthetic scenes instead of the 1/f prior.

It is the linear minimum-mean-square-error estimate of images with this covariance. Man-made
structure is upright, and so are the strongest frequencies: the variance of cosines falls with
frequency f and depends on their direction t,

    S = f^-2p exp(a cos 4 t).

Exponent p and strength a are fitted to synthetic scenes and dead leaves by
`tools/fitted_covariance.py`.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ...base.arrays import Floats
from ..prior import Sigma
from .least_squares import LeastSquares

FITTED = Path(__file__).with_suffix(".json")


def fitted_sigma(shape: tuple[int, int]) -> Floats:
    """Relative standard deviation of cosines (H, W), 0 for the constant."""
    return axial_sigma(shape, *_fitted())


def axial_sigma(shape: tuple[int, int], exponent: float, axes: float) -> Floats:
    """f^-p exp(a / 2 cos 4 t) of cosines (H, W), 0 for the constant."""
    vertical, horizontal = (np.arange(side) / side for side in shape)
    frequency = np.hypot.outer(vertical, horizontal)
    frequency[0, 0] = np.inf
    fourfold = np.cos(4 * np.arctan2.outer(vertical, horizontal))
    return np.asarray(frequency**-exponent * np.exp(axes / 2 * fourfold))


@cache
def _fitted() -> tuple[float, float]:
    fields = json.loads(FITTED.read_text())
    return fields["exponent"], fields["axes"]


@dataclass(frozen=True)
class FittedCovariance(LeastSquares):
    """Posterior mean and standard deviation under a fitted covariance."""

    title = "least squares, fitted covariance"
    sigma: Sigma = fitted_sigma


METHOD = FittedCovariance()
