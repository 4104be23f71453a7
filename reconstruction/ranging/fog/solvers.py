"""From the readings of a frame and what is held of the fog to ranges, and what is held then."""

from ...base.errors import InputError
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from .belief import FogSolver
from .modes import NEAREST_M
from .of_charge import charge_solver
from .overlap import require_optics


def fog_solver(spots: Spots, longest_m: float, optics: Optics | None = None) -> FogSolver:
    """Solver of one recording's readings, of targets up to a range.

    Of its ``optics`` only readings that tell fog and target badly apart make use.

    Raises InputError where the recording does not tell what the detectors see of the beams, or how
    much light the lasers send, or where its readings tell of no range at all.
    """
    require_optics(spots)
    if longest_m <= NEAREST_M:
        raise InputError(
            f"the spots' readings tell of ranges up to {longest_m:.3g} m, and ranging in fog "
            f"begins at {NEAREST_M} m: their frequencies, or times and delay_offset_s, cannot be "
            "right"
        )
    if isinstance(spots, HistogramSpots):
        from .of_histograms import histogram_solver  # slow to import

        return histogram_solver(spots, longest_m)
    assert isinstance(spots, CwSpots | PulsedSpots)
    return charge_solver(spots, optics, longest_m)
