"""Ranges through fog: joint fit of target and fog echo for all spots.

The fog is assumed homogeneous, with unknown extinction and backscattering; unevenness counts as
noise. See `reconstruction.ranging.fog`.
"""

from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness
from ..fog.solvers import fog_solver, unambiguous_range_m
from ..method import RangingSolver
from ..ranges import Ranges


class Fog:
    """Joint likelihood of the spots and the fog they share, frame by frame.

    Needs the overlap of beams and detector fields, and the laser light in each reading.
    """

    title = "fog and target together"
    reads = (CwSpots, PulsedSpots, HistogramSpots)

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver for a recording's readings; raises InputError as `fog_solver`."""
        prior, solver = fog_solver(spots, optics)

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            ranges, _ = solver(spots, prior, brightness)
            return ranges

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range beyond which a spot appears nearer than it is, or outside the readings."""
        return unambiguous_range_m(spots)


METHOD = Fog()
