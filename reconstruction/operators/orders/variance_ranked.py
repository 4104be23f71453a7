"""Rows by how much they vary from scene to scene, of a model fitted to drawn scenes."""

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..basis import Basis
from ..hadamard import fwht, require_hadamard

DOWN, ALONG = 0.2, 0.13
"""Correlation lengths down and along the image, over its longer side.

`python tools/variance_order.py images.npz` fits them to drawn scenes, and compares the order with
others on families of scenes that it has not seen.
"""
DIGITS = 9
"""Of logarithms, beyond which variances count as equal whatever the machine's rounding."""


def by_variance(basis: Basis) -> NDArray[np.int64]:
    """All row numbers of a Hadamard basis, the most varying first; InputError for another basis."""
    require_hadamard(basis, "variance-ranked")
    return ranked(basis, DOWN, ALONG)


def ranked(basis: Basis, down: float, along: float) -> NDArray[np.int64]:
    """The level, then rows by their variance in images with these correlation lengths.

    Pixels are correlated by exp(-|dy| / l_down - |dx| / l_along), the separable first-order Markov
    model of W. K. Pratt, Digital Image Processing (1978), chapter 10. The variance of a row is then
    the product of those of its factors, h^T C h.
    """
    height, width = basis.shape
    longer = max(height, width)
    variance = np.multiply.outer(
        _variances(height, down * longer), _variances(width, along * longer)
    )
    reported = np.round(np.log(variance.ravel()), DIGITS)
    reported[0] = np.inf
    return np.argsort(-reported, kind="stable")


def _variances(side: int, length: float) -> Floats:
    """Variance (side,) of Hadamard rows of a line whose pixels are correlated over a length."""
    pixels = np.arange(side)
    covariance = np.exp(-np.abs(np.subtract.outer(pixels, pixels)) / length)
    return np.asarray(np.einsum("kk->k", fwht(fwht(covariance, axis=0), axis=1)))


ORDER = by_variance
