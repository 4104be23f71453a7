"""Fog ranging: from the readings of a frame and a prior of the fog to ranges and a posterior."""

import numpy as np

from ...base.constants import c
from ...base.errors import InputError
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness
from ..ranges import MAX_FOG_RANGE_M, Ranges, redirected
from ..unwrap import unambiguous_path_m
from .fog_state import FogSolver, FogState
from .modes import MIN_RANGE_M
from .of_charge import charge_solver
from .overlap import require_optics


def unambiguous_range_m(spots: Spots) -> float:
    """Range beyond which an echo falls outside the readings or appears nearer than it is."""
    if isinstance(spots, CwSpots):
        return unambiguous_path_m(np.unique(spots.tap_frequencies_hz)) / 2
    if isinstance(spots, HistogramSpots):
        gate_s = spots.start_s + spots.counts.shape[-1] * spots.bin_width_s
        return float(c * (gate_s - spots.delay_offset_s) / 2)
    assert isinstance(spots, PulsedSpots)
    return float(c * (spots.window_starts_s[-1] - spots.delay_offset_s) / 2)


def max_fog_range_m(spots: Spots) -> float:
    """Maximum range at which fog ranging looks for targets."""
    return min(unambiguous_range_m(spots), MAX_FOG_RANGE_M)


def fog_solver(spots: Spots, optics: Optics | None = None) -> FogSolver:
    """Solver for a recording's readings; ``optics`` only help if these hardly separate fog and
    target.

    Raises InputError if the recording lacks the optics of `overlap` or the light of the lasers, or
    its readings show no range.
    """
    require_optics(spots)
    max_range_m = max_fog_range_m(spots)
    if max_range_m <= MIN_RANGE_M:
        raise InputError(
            f"the spots' readings end at {max_range_m:.3g} m, but ranging in fog begins at "
            f"{MIN_RANGE_M} m: their frequencies, or times and delay_offset_s, must be wrong"
        )
    if isinstance(spots, HistogramSpots):
        from .of_histograms import histogram_solver  # slow to import

        solver = histogram_solver(spots, max_range_m)
    else:
        assert isinstance(spots, CwSpots | PulsedSpots)
        solver = charge_solver(spots, optics, max_range_m)
    return solver if spots.pointing is None else _steered(solver, spots)


def _steered(solver: FogSolver, home: Spots) -> FogSolver:
    """Solver of frames with their own directions, from one of the home directions.

    The echo of fog and target by path length hardly depends on the direction: of the detector's
    position, a beam sees the part across it, which changes by its cosine.
    """

    def solve(
        spots: Spots, prior: FogState, brightness: Brightness | None
    ) -> tuple[Ranges, FogState]:
        ranges, fog = solver.solve(spots, prior, brightness)
        return redirected(ranges, home, spots), fog

    return FogSolver(solver.prior, solve)
