"""Least squares under a 1/f prior: the most probable image, if images were Gaussian.

The power of natural images, and so the variance of their cosines, falls with the square of spatial
frequency (D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987)).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..contrast import ContrastByDc
from ..dictionaries.dct import DICTIONARY
from ..gaussian import Field, GaussianModel, Posterior
from ..grid import at_most, band
from ..method import Estimate
from ..noise import CERTAIN
from ..prior import Prior, Sigma
from ..shrinking import ShrinkingSolver

MAX_NUMBERS = 2**23
"""Maximum size of the spectra of rows; beyond it, coefficients are shrunk one by one."""
MAX_ROWS = 2500
"""Maximum number of rows whose correlations are taken into account."""
MIN_SEEN = 0.99
"""Minimum fraction of what the rows see that the frequencies must contain."""


@dataclass(frozen=True)
class LeastSquares:
    """Posterior mean and standard deviation of Gaussian images, independent in cosines."""

    title = "least squares"
    sigma: Sigma = DICTIONARY.sigma

    def compile(self, operator: MeasurementOperator) -> "LeastSquaresSolver | ShrinkingSolver":
        """Solver of an operator's coefficients, shared by all methods that start from it."""
        result = operator.shared.get(self.sigma)
        if result is None:
            result = operator.shared[self.sigma] = _compiled(operator, self.sigma)
        return result


def _compiled(
    operator: MeasurementOperator, sigma: Sigma
) -> "LeastSquaresSolver | ShrinkingSolver":
    prior = Prior(operator, sigma)
    high, wide = band(prior.atoms.by_atom() * prior.sigma**2, MIN_SEEN)
    rows = len(prior.expected)
    if rows > MAX_ROWS or rows * high * wide > MAX_NUMBERS:
        return ShrinkingSolver(operator, prior)
    return LeastSquaresSolver(operator, prior)


class LeastSquaresSolver:
    """Solver with all that depends on the operator alone.

    ``model`` holds the spectra of images, without the highest frequencies if all would exceed
    `MAX_NUMBERS`. ``seen`` (H, W): mean energy of each frequency that the rows see; ``precision``:
    inverse variance of the field.
    """

    def __init__(self, operator: MeasurementOperator, prior: Prior) -> None:
        self.operator = operator
        variance = prior.sigma**2
        self.seen: Floats = prior.atoms.by_atom() * variance
        tall, wide = (DICTIONARY.atoms(side) for side in operator.image_shape)
        height, width = shape = _sides(self.seen, len(prior.expected))
        lowest = np.indices(shape).reshape(2, -1)
        self.model = GaussianModel(
            prior.atoms.of((lowest[0], lowest[1])),
            Field(tall[:, :height], wide[:, :width], variance[:height, :width]),
            operator.usual_noise[operator.varying],
            prior.atoms.combined if shape == operator.image_shape else None,
        )
        low = variance[:height, :width]
        self.precision: Floats = np.divide(1, low, out=np.zeros_like(low), where=low > 0)
        higher = variance.copy()
        higher[:height, :width] = 0
        self._higher: Floats = Field(tall, wide, higher).pixel_variance
        self.expected_contrast = ContrastByDc(operator, float(variance.mean()))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Most probable image."""
        posterior = self.posterior(coefficients)
        if posterior is None:
            return self.flat(coefficients)
        return self.estimate(posterior.mean, self.variance(posterior), coefficients)

    def many(self, frames: Sequence[Coefficients]) -> list[Estimate]:
        """Most probable images of several frames, by matrix products over all with known noise."""
        plain = [number for number, each in enumerate(frames) if self._is_plain(each)]
        result: dict[int, Estimate] = {}
        if plain:
            pairs = [self.varying(frames[number]) for number in plain]
            rms = [self.model.usual_rms(*each) for each in pairs]
            expected = [self.expected_contrast(frames[number]) for number in plain]
            values = np.array([measured for measured, _ in pairs])
            posteriors = self.model.many(values, np.array(rms), np.array(expected, np.float64))
            for number, (mean, variance, contrast) in zip(plain, posteriors, strict=True):
                whole = variance + contrast * self._higher
                result[number] = self.estimate(mean, whole, frames[number])
        return [result.get(number) or self(each) for number, each in enumerate(frames)]

    def _is_plain(self, coefficients: Coefficients) -> bool:
        measured, noise = self.varying(coefficients)
        return (
            bool(measured.any())
            and coefficients.levels is CERTAIN
            and self.model.usual_rms(measured, noise) is not None
            and self.expected_contrast(coefficients) is not None
        )

    def flat(self, coefficients: Coefficients) -> Estimate:
        """Image of the DC coefficient alone."""
        return self.estimate(np.zeros(self.model.field.variance.shape), None, coefficients)

    def posterior(self, coefficients: Coefficients) -> Posterior | None:
        """Posterior given the coefficients other than DC; None if all of them are 0."""
        measured, noise = self.varying(coefficients)
        if not measured.any():
            return None
        expected = self.expected_contrast(coefficients)
        return self.model.given(measured, noise, expected, coefficients.levels)

    def variance(self, posterior: Posterior) -> Floats:
        """Variance of each pixel (H, W)."""
        return posterior.variance + posterior.contrast * self._higher

    def varying(self, coefficients: Coefficients) -> tuple[NDArray[Any], Floats]:
        """Coefficients other than DC, for rows of length 1, and their noise."""
        varying, length = self.operator.varying, self.operator.row_length
        return coefficients.values[varying] / length, coefficients.noise[varying] / length

    def estimate(
        self, spectrum: NDArray[Any], variance: Floats | None, coefficients: Coefficients
    ) -> Estimate:
        """Image of a spectrum with this ``variance`` (H, W), plus the DC coefficient."""
        image = self.model.field.image(spectrum)
        dc_row, dc_offset = self.operator.dc_row, self.operator.dc_offset
        error = 0.0
        if dc_row is not None and coefficients.measured[dc_row]:
            error = dc_offset(coefficients.noise[dc_row], np.zeros_like(image))
            image = image + dc_offset(coefficients.values[dc_row], image)
        return Estimate(image, None if variance is None else np.sqrt(variance + error**2))


def _sides(seen: Floats, rows: int) -> tuple[int, int]:
    """Number of lowest frequencies, down and along, whose spectra fit `MAX_NUMBERS`."""
    height, width = seen.shape
    if rows * height * width <= MAX_NUMBERS:
        return height, width
    high, wide = band(seen, MIN_SEEN)
    room = np.sqrt(MAX_NUMBERS / (rows * high * wide))
    return at_most((max(high, int(room * high)), max(wide, int(room * wide))), (height, width))


METHOD = LeastSquares()
