"""Readings that enter many coefficients, and the error that they share.

A single-ended plan decodes to 2 y - all - dark: the errors of the all-on and the dark reading are
part of every coefficient, and the inverse transform gathers them into one false pixel in the
corner. The covariance of the coefficients' errors is S V S^T + diag(own), with S the columns of the
decoder that belong to shared readings, V = diag(v) the variance of these, and ``own`` the variance
due to all other readings.

Before they are measured, the coefficients of an image are taken for independent, of zero mean and
variance ``prior``. With m = c + S n + (own errors), the shared errors n that are the most probable
given m minimise

    sum_k w_k (m - S n)_k^2 + sum_j n_j^2 / v_j,    w = 1 / (prior + own),

so n = (S^T W S + V^-1)^-1 S^T W m. A single number e common to all has
e = sum(w m) / (sum(w) + 1/v): rows that hardly any image excites tell it. What remains after
m - S n are own errors and those of n, of covariance (S^T W S + V^-1)^-1.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats


def without_shared_errors(
    columns: Floats, coefficients: NDArray[Any], *, own: Floats, shared: Floats, prior: Floats
) -> tuple[NDArray[Any], Floats]:
    """Coefficients (K,) without the errors that they share, and the variance (K,) of the rest.

    ``columns`` (K, S) tell how the shared readings, of variance ``shared`` (S,), enter the
    coefficients; ``own`` (K,) is the variance due to all other readings; ``prior`` (K,) that of
    the coefficients before they are measured, infinite where nothing is known. Complex
    coefficients have the variance of both parts together.
    """
    weighted = columns / (prior + own)[:, None]
    # Both sides times V: a reading without error, v = 0, is fine.
    system = np.eye(shared.size) + shared[:, None] * (columns.T @ weighted)
    inverse = np.linalg.inv(system)
    errors, covariance = inverse @ (shared * (weighted.T @ coefficients)), inverse * shared
    left = ((columns @ covariance) * columns).sum(axis=1)
    return coefficients - columns @ errors, own + left
