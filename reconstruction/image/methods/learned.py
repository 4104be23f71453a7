"""What a small network makes of the edge-preserving image, as far as the readings agree.

The network sees the least-squares image, the edge-preserving one and its deviation, and tells what
is wrong with the latter; it was trained on dead leaves and drawn scenes by
`tools/learned_network.py`. What its image leaves of the readings is estimated by least squares, as
a field of its own contrast, so that the image fits them as far as they are no noise. Of what is
unlike all that the network was trained on it is not asked: the image is then the edge-preserving
one.
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
        """Solver of one operator's coefficients; of very many, that of edge-preserving images."""
        edges = EDGE_PRESERVING.compile(operator)
        return LearnedSolver(edges, shipped()) if isinstance(edges, EdgePreservingSolver) else edges


class LearnedSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, edges: EdgePreservingSolver, network: Network) -> None:
        self.edges, self._network = edges, network

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The corrected image, and the deviation that the network expects of it."""
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
        displayed = NetworkInput(
            field.image(start.mean),
            field.image(spectrum),
            np.sqrt(variance),
            float(finite.mean()) * len(finite) / variance.size,
            float(np.median(noise[finite])),
        )
        out_of_distribution = self._network.out_of_distribution(displayed)
        if out_of_distribution is not None:
            plain = linear.estimate(spectrum, variance, coefficients)
            return replace(plain, note=f"edge-preserving, not learned: {out_of_distribution}")
        correction, unsure = self._network(displayed)
        spectrum = field.spectrum(displayed.better + displayed.sigma * correction)
        spectrum[0, 0] = 0  # the level is measured by itself
        left = measured - linear.model.rows @ spectrum.ravel()
        left[~finite] = 0
        spectrum = spectrum + linear.model.given(left, noise).mean
        return linear.estimate(spectrum, variance * np.exp(2.0 * unsure), coefficients)


@lru_cache(maxsize=1)
def shipped() -> Network:
    """The network of this package."""
    return load(WEIGHTS)


METHOD = Learned()
