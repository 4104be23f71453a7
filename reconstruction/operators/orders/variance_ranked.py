"""Rows sorted by their variance across scenes, under a model fitted to synthetic scenes."""

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..basis import Basis
from ..hadamard import fwht, require_hadamard

DOWN, ALONG = 0.2, 0.13
"""Correlation lengths down and along the image, relative to its longer side.

`python tools/variance_order.py images.npz` fits them to synthetic scenes and compares the order
with others on held-out families of scenes.
"""
DIGITS = 9
"""Decimals to which log variances are rounded, so that the order is the same on every machine."""


def by_variance(basis: Basis) -> NDArray[np.int64]:
    """Row indices of a Hadamard basis, highest variance first; InputError for other bases."""
    require_hadamard(basis, "variance-ranked")
    return ranked(basis, DOWN, ALONG)


def ranked(basis: Basis, down: float, along: float) -> NDArray[np.int64]:
    """The DC row, then rows by their variance in images with these correlation lengths.

    Pixels are correlated by exp(-|dy| / l_down - |dx| / l_along), the separable first-order Markov
    model of W. K. Pratt, Digital Image Processing (1978), chapter 10. The variance of a row is the
    product of those of its factors, h^T C h.
    """
    height, width = basis.shape
    longer = max(height, width)
    variance = np.multiply.outer(
        _variances(height, down * longer), _variances(width, along * longer)
    )
    log_variance = np.round(np.log(variance.ravel()), DIGITS)
    log_variance[0] = np.inf
    return np.argsort(-log_variance, kind="stable")


def _variances(side: int, length: float) -> Floats:
    """Variance (side,) of one-dimensional Hadamard rows for pixels with a correlation length."""
    pixels = np.arange(side)
    covariance = np.exp(-np.abs(np.subtract.outer(pixels, pixels)) / length)
    return np.asarray(np.einsum("kk->k", fwht(fwht(covariance, axis=0), axis=1)))


ORDER = by_variance
