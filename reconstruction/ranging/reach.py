"""The least range that a spot sees: nearer, its beam lies outside the field of its detector."""

import numpy as np

from ..base.arrays import Floats
from ..base.errors import InputError
from ..capture import Spots
from ..capture.readings.cw import CwSpots
from ..capture.readings.dtof import HistogramSpots
from ..capture.readings.pulsed import PulsedSpots
from .first_surface import USUAL_REACH_M
from .fog.overlap import NEEDED, overlap
from .fog.solvers import max_fog_range_m

STEP_M = 0.01
"""Step of the ranges at which the overlap is computed."""


def blind_below_m(spots: Spots) -> Floats:
    """Range (spots,) below which a target returns less light than at the end of its range.

    The noise that limits a spot's range hides the same target, whatever its reflectance, where the
    overlap of beam and field is as small: in clear air, without any noise being known. nan if the
    optics are unknown or contradictory.
    """
    if any(np.isnan(getattr(spots, name)).any() for name in NEEDED):
        return np.full(len(spots.directions), np.nan)
    range_m = np.arange(STEP_M, _end_m(spots) + STEP_M, STEP_M)
    try:
        weight_sr, _ = overlap(spots, range_m)
    except InputError:  # ranging in fog says what is wrong
        return np.full(len(spots.directions), np.nan)
    first = (weight_sr >= weight_sr[:, -1:]).argmax(axis=1)
    return np.where(first == 0, 0.0, range_m[first])


def _end_m(spots: Spots) -> float:
    """Maximum range of targets; of readings of other packages that of the usual ones."""
    known = isinstance(spots, CwSpots | HistogramSpots | PulsedSpots)
    return max_fog_range_m(spots) if known else USUAL_REACH_M


def reach_m(spots: Spots) -> float:
    """Range beyond which nothing is known of targets: where histograms end, or `USUAL_REACH_M`."""
    return max_fog_range_m(spots) if isinstance(spots, HistogramSpots) else USUAL_REACH_M
