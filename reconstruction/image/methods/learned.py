"""Neural correction of the edge-preserving image, constrained by the readings.

The network receives the least-squares image, the edge-preserving one and its standard deviation,
and predicts the error of the latter. It was trained on dead leaves and synthetic scenes by
`tools/learned_network.py`. The residual of its image with respect to the readings is estimated by
least squares, as a field with its own contrast, so that the result fits the readings up to noise.
Inputs out of distribution get the edge-preserving image.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..method import Estimate, ImageSolver
from ..network import Network, NetworkInput, load
from .edge_preserving import METHOD as EDGE_PRESERVING
from .edge_preserving import EdgePreservingSolver

WEIGHTS = Path(__file__).parents[1] / "learned.npz"


@dataclass(frozen=True)
class Learned:
    """A learned correction of edge-preserving least squares."""

    title = "learned"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of an operator's coefficients; edge-preserving beyond its size limit."""
        edges = EDGE_PRESERVING.compile(operator)
        return LearnedSolver(edges, shipped()) if isinstance(edges, EdgePreservingSolver) else edges


class LearnedSolver:
    """Solver with all that depends on the operator alone."""

    def __init__(self, edges: EdgePreservingSolver, network: Network) -> None:
        self.edges, self._network = edges, network

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Corrected image, and the standard deviation that the network predicts."""
        linear = self.edges.linear
        start = linear.posterior(coefficients)
        if start is None:
            return linear.flat(coefficients)
        spectrum, variance = self.edges.followed(start, coefficients)
        field = linear.model.field
        if np.iscomplexobj(spectrum):
            return linear.estimate(spectrum, variance, coefficients)
        measured, noise = linear.varying(coefficients)
        finite = np.isfinite(noise)
        inputs = NetworkInput(
            field.image(start.mean),
            field.image(spectrum),
            np.sqrt(variance),
            float(finite.mean()) * len(finite) / variance.size,
            float(np.median(noise[finite])),
        )
        out_of_distribution = self._network.out_of_distribution(inputs)
        if out_of_distribution is not None:
            plain = linear.estimate(spectrum, variance, coefficients)
            return replace(plain, note=f"edge-preserving, not learned: {out_of_distribution}")
        correction, unsure = self._network(inputs)
        spectrum = field.spectrum(inputs.better + inputs.sigma * correction)
        spectrum[0, 0] = 0  # DC is measured separately
        left = measured - linear.model.rows @ spectrum.ravel()
        left[~finite] = 0
        spectrum = spectrum + linear.model.given(left, noise).mean
        return linear.estimate(spectrum, variance * np.exp(2.0 * unsure), coefficients)


@lru_cache(maxsize=1)
def shipped() -> Network:
    """Network of this package."""
    return load(WEIGHTS)


METHOD = Learned()
