"""Orthogonal matching pursuit that knows what natural images look like.

The image is sparse in the two-dimensional DCT; few low-sequency Hadamard rows see most DCT atoms
weakly or not at all, and a pursuit that normalises its columns then fits noise with invisible
atoms. Here each atom is scaled by its standard deviation in natural images, whose power falls with
the square of spatial frequency (D. J. Field, J. Opt. Soc. Am. A 4, 2379, 1987), and the pursuit
works in these coordinates: atoms compete by what they may be expected to explain, and the ridge
that matches the noise keeps the weak ones small.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idctn

from ..patterns import fwht
from .linear import zero_filled
from .omp import batch_omp

Floats = NDArray[np.float64]

ATOMS = 1024
"""Size of the dictionary: the atoms of greatest expected energy in the measurement."""
BUDGET = 128
"""Most atoms of one image."""


class WeightedPursuit:
    """Reconstructs images from the Walsh-Hadamard rows ``index`` (K,) of ``shape`` (H, W) pixels.

    Holds what depends on the rows alone; ``reconstruct`` is then cheap.
    """

    def __init__(self, shape: tuple[int, int], index: NDArray[np.int32]) -> None:
        self.shape = shape
        self.index = index
        self.varying = index != 0  # the constant atom is seen by row 0 and by no other
        rows = np.unravel_index(index[self.varying], shape)
        vertical, horizontal = (_hadamard_times_dct(side) for side in shape)
        deviation = natural_image_deviation(shape)
        sampled = np.zeros(shape)
        sampled[rows] = 1
        # Both transforms are outer products, so squared columns and rows sum up side by side.
        seen = deviation**2 * (vertical.T**2 @ sampled @ horizontal**2)
        expected = vertical**2 @ deviation**2 @ horizontal.T**2
        strongest = np.argsort(-seen, axis=None, kind="stable")[:ATOMS]
        self.atoms = np.unravel_index(strongest, shape)
        self.deviation = deviation[self.atoms]
        self.expected_variance: Floats = expected[rows]
        self.unseen_variance = float(expected.sum() - self.expected_variance.sum())
        self.dictionary: Floats = (
            vertical[rows[0][:, None], self.atoms[0]]
            * horizontal[rows[1][:, None], self.atoms[1]]
            * self.deviation
        )
        self.gram: Floats = self.dictionary.T @ self.dictionary

    def prior_variance(self, coefficients: NDArray[Any]) -> Floats:
        """Variance (K,) that coefficients (K,) like these have from image to image.

        Infinite for row 0, whose level may be any, and where nothing was measured.
        """
        variance = np.full(coefficients.size, np.inf)
        measured = coefficients[self.varying]
        if measured.any():
            scale, white = fit_variance(measured, self.expected_variance)
            variance[self.varying] = scale * (self.expected_variance + white)
        return variance

    def reconstruct(self, coefficients: NDArray[Any], noise: float = 0.0) -> NDArray[Any]:
        """Image (H, W) from coefficients (K,) whose noise has the standard deviation ``noise``.

        What the pursuit cannot explain is added back by the inverse transform, each coefficient
        weighted by signal / (signal + noise): without noise the image agrees with every
        coefficient, and the pursuit decides only what was not measured. Complex coefficients give
        a complex image; their noise is that of both parts together.
        """
        scale = np.sqrt(self.shape[0] * self.shape[1])
        measured = coefficients[self.varying] / scale
        image = zero_filled(self.shape, self.index[~self.varying], coefficients[~self.varying])
        if not measured.any():
            return image
        variance, ridge = fit_variance(measured, self.expected_variance)
        chosen, values = batch_omp(
            self.gram,
            self.dictionary.T @ measured,
            float(np.vdot(measured, measured).real),
            ridge=ridge,
            tolerance=measured.size * variance * ridge,
            budget=min(BUDGET, measured.size),
        )
        spectrum = np.zeros(self.shape, dtype=measured.dtype)
        spectrum[self.atoms[0][chosen], self.atoms[1][chosen]] = self.deviation[chosen] * values
        unexplained = measured - self.dictionary[:, chosen] @ values
        total = variance * (self.expected_variance + ridge)
        signal_share = np.clip(1 - (noise / scale) ** 2 / total, 0, 1)
        image += idctn(spectrum, norm="ortho")
        image += zero_filled(
            self.shape, self.index[self.varying], unexplained * signal_share * scale
        )
        return image

    def error(self, coefficients: NDArray[Any], noise: float = 0.0) -> float:
        """Standard deviation of a pixel of the reconstruction, rather too large than too small.

        From the noise of the coefficients, as if none of it were suppressed, and from what the rows
        that were not measured may be expected to hold, as if the pursuit told nothing of them.
        """
        pixels = self.shape[0] * self.shape[1]
        variance = 0.0
        measured = coefficients[self.varying] / np.sqrt(pixels)
        if measured.any():
            variance = fit_variance(measured, self.expected_variance)[0] * self.unseen_variance
        return float(np.sqrt((variance + coefficients.size * noise**2 / pixels) / pixels))


def pursuit_for(shape: tuple[int, int], index: NDArray[np.int32]) -> WeightedPursuit:
    """The pursuit of these rows, set up once for all frames that share them."""
    return _pursuit(shape, index.astype(np.int32).tobytes())


@lru_cache(maxsize=4)
def _pursuit(shape: tuple[int, int], index: bytes) -> WeightedPursuit:
    return WeightedPursuit(shape, np.frombuffer(index, dtype=np.int32))


def natural_image_deviation(shape: tuple[int, int]) -> Floats:
    """Relative standard deviation of the DCT coefficients of natural images, (H, W).

    Inverse to spatial frequency; 0 for the constant atom, which is measured by itself.
    """
    vertical, horizontal = (np.arange(side) / side for side in shape)
    frequency = np.hypot.outer(vertical, horizontal)
    frequency[0, 0] = np.inf
    return 1 / frequency


def fit_variance(measured: NDArray[Any], expected: Floats) -> tuple[float, float]:
    """Maximum-likelihood fit of var(measured) = v (expected + r): returns v and r.

    ``r`` is the white part, noise and what the expected spectrum misses, relative to v.
    """
    white = expected.mean() * np.logspace(-6, 3, 46)
    shape = expected + white[:, None]
    variance = (np.abs(measured) ** 2 / shape).mean(axis=1)
    cost = measured.size * np.log(variance) + np.log(shape).sum(axis=1)
    best = int(np.argmin(cost))
    return float(variance[best]), float(white[best])


def _hadamard_times_dct(side: int) -> Floats:
    """Orthonormal Hadamard rows seen through orthonormal DCT atoms, (row, atom)."""
    atoms = dct(np.eye(side), axis=0, norm="ortho")
    return fwht(atoms).T / np.sqrt(side)
