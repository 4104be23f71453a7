"""The ranges of the four spots, by the method with which they were recorded."""

import numpy as np

from ..spots import CwSpots, HistogramSpots, PulsedSpots, Spots
from .cw import cw_paths
from .dtof import dtof_paths
from .geometry import range_from_path
from .pulsed import pulsed_paths
from .ranges import Paths, Ranges


def measure_ranges(spots: Spots, frame: int = 0) -> Ranges:
    """Ranges of one frame; where a spot has none, its status says why (the first reason found)."""
    paths = _paths(spots, frame)
    range_m, slope = range_from_path(paths.path_m, spots.directions, spots.detector_positions_m)
    reasons = {
        "saturated": paths.saturated,
        "no signal": paths.no_signal,
        "ambiguous": paths.ambiguous,
        "too close": paths.path_m <= np.linalg.norm(spots.detector_positions_m, axis=1),
    }
    status = np.select(list(reasons.values()), list(reasons), "ok")
    return Ranges(
        range_m=np.where(status == "ok", range_m, np.nan),
        sigma_m=np.where(status == "ok", slope * paths.sigma_m, np.nan),
        signal_electrons=paths.signal_electrons,
        background_electrons=paths.background_electrons,
        status=tuple(status.tolist()),
    )


def _paths(spots: Spots, frame: int) -> Paths:
    match spots:
        case CwSpots():
            return cw_paths(spots, frame)
        case PulsedSpots():
            return pulsed_paths(spots, frame)
        case HistogramSpots():
            return dtof_paths(spots, frame)
    raise TypeError(f"no ranging for {type(spots).__name__}")
