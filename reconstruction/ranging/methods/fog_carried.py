"""Ranges through slowly changing fog: the posterior of a frame predicts the prior of the next.

For recordings reconstructed in order, as of a flight: a Bayesian filter over the extinctions, each
with a log-normal backscattering, which drift from frame to frame and rarely change altogether.
"""

from ...capture import Optics, Spots
from ..brightness import Brightness
from ..fog.solvers import fog_solver
from ..method import RangingSolver
from ..ranges import Ranges
from .fog import Fog


class FogCarried(Fog):
    """The joint likelihood of `Fog`, with the predicted fog of the last frame as its prior."""

    title = "fog of the last frame and target"
    carries = True

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver that remembers the fog of the last frame; raises InputError as `Fog`."""
        prior, solver = fog_solver(spots, optics)
        predicted = prior

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            nonlocal predicted
            ranges, posterior = solver(spots, predicted, brightness)
            predicted = posterior.predict(prior)
            return ranges

        return solve


METHOD = FogCarried()
