"""Ranges through fog: target and the fog's echo fitted together, all four spots at once.

The fog is taken to be alike in all directions and of unknown extinction and backscattering; what it
deviates from that counts as noise. See `reconstruction.ranging.fog`.
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
    """A joint likelihood of the four spots and the fog that they share, frame by frame.

    Needs to know what the detectors see of the beams, and the laser's light in each reading.
    """

    title = "fog and target together"
    reads = (CwSpots, PulsedSpots, HistogramSpots)

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver of one recording's readings; InputError as `fog_solver`."""
        prior, solver = fog_solver(spots, optics)

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            ranges, _ = solver(spots, prior, brightness)
            return ranges

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range from which on a spot looks nearer than it is, or is not looked for."""
        return unambiguous_range_m(spots)


METHOD = Fog()
