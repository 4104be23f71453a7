"""From the readings of a frame and what is held of the fog to ranges, and what is held then."""

from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from .belief import FogSolver
from .of_charge import charge_solver
from .overlap import check_known


def fog_solver(spots: Spots, longest_m: float) -> FogSolver:
    """Solver of one recording's readings, of targets up to a range.

    Raises InputError where the recording does not tell what the detectors see of the beams, or how
    much light the lasers send.
    """
    check_known(spots)
    if isinstance(spots, HistogramSpots):
        from .of_histograms import histogram_solver  # slow to import

        return histogram_solver(spots, longest_m)
    assert isinstance(spots, CwSpots | PulsedSpots)
    return charge_solver(spots, longest_m)
