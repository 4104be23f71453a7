"""Ranges through fog that changes slowly: what a frame tells of the fog helps with the next.

For recordings whose frames are reconstructed in their order, as of a flight. The extinction and
backscattering of each frame are those of the one before but for a drift, and now and then another
fog altogether: a Bayesian filter over the extinctions, each with a log-normal backscattering.
"""

from ...capture import Optics, Spots
from ..brightness import Brightness
from ..fog.solvers import fog_solver
from ..method import RangingSolver
from ..ranges import Ranges
from .fog import Fog


class FogCarried(Fog):
    """The joint likelihood of `Fog`, with the fog of the frame before in place of any fog."""

    title = "fog of the last frame and target"
    carries = True

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver that remembers the fog of the frame that it solved last; InputError as `Fog`."""
        prior, solver = fog_solver(spots, optics)
        predicted = prior

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            nonlocal predicted
            ranges, posterior = solver(spots, predicted, brightness)
            predicted = posterior.predict(prior)
            return ranges

        return solve


METHOD = FogCarried()
