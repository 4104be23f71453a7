"""Ranges through fog: target and the fog's echo fitted together, all four spots at once.

The fog is taken to be alike in all directions and of unknown extinction and backscattering; what it
deviates from that counts as noise. See `reconstruction.ranging.fog`.
"""

import numpy as np

from ...base.constants import c
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness
from ..fog.solvers import fog_solver
from ..method import RangingSolver
from ..ranges import LONGEST_IN_FOG_M, Ranges
from ..unwrap import unambiguous_path_m


class Fog:
    """A joint likelihood of the four spots and the fog that they share, frame by frame.

    Needs to know what the detectors see of the beams, and the laser's light in each reading.
    """

    title = "fog and target together"
    reads = (CwSpots, PulsedSpots, HistogramSpots)

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver of one recording's readings; InputError as `fog_solver`."""
        longest_m = min(self.unambiguous_range_m(spots), LONGEST_IN_FOG_M)
        prior, solver = fog_solver(spots, longest_m, optics)

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            ranges, _ = solver(spots, prior, brightness)
            return ranges

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range from which on a spot looks nearer than it is, or is not looked for."""
        if isinstance(spots, CwSpots):
            return unambiguous_path_m(np.unique(spots.tap_frequencies_hz)) / 2
        if isinstance(spots, HistogramSpots):
            gate_s = spots.start_s + spots.counts.shape[-1] * spots.bin_width_s
            return float(c * (gate_s - spots.delay_offset_s) / 2)
        assert isinstance(spots, PulsedSpots)
        return float(c * (spots.window_starts_s[-1] - spots.delay_offset_s) / 2)


METHOD = Fog()
