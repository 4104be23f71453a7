"""Images to reconstruct, reconstructions of them, and how alike two of them are."""

import numpy as np

from reconstruction.image import Coefficients, image_method
from reconstruction.operators import RowOperator, decoder_for
from reconstruction.operators.bases.hadamard import Hadamard


def natural_image(side, seed):
    """Overlapping discs of all sizes, random grey: edges and a 1/f^2 power spectrum."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side]
    image = np.zeros((side, side))
    for radius in np.sort(side * rng.uniform(0.02, 1, 150) ** 2)[::-1]:
        row, column = rng.uniform(0, side, 2)
        image[(y - row) ** 2 + (x - column) ** 2 < radius**2] = rng.uniform(0.1, 1)
    return image


def image_from(coefficients, index, shape, method="pursuit", noise=0.0):
    """The image that a method makes of coefficients (K,) of Hadamard rows (K,)."""
    solve = image_method(method).compile(RowOperator(Hadamard(shape), index))
    return solve(Coefficients(coefficients, np.full(coefficients.shape, noise))).image


def correlation(a, b):
    return np.corrcoef(a.ravel(), b.ravel())[0, 1]


def signed_coefficients(plan, readings):
    """Distinct indices (K,), and the coefficients (..., K) that bucket readings decode to."""
    decoder = decoder_for(plan)
    return decoder.index, decoder.decode(np.asarray(readings, dtype=np.float64))
