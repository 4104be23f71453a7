"""Fits of fog and targets to single-photon histograms."""

from dataclasses import replace

import numpy as np
from scipy.special import chdtri, ndtr

from ...base.arrays import Floats, Mask
from ...base.errors import InputError
from ...capture import Spots
from ...capture.readings.dtof import HistogramSpots
from ..brightness import Brightness
from ..histogram import BLOCKS
from ..ranges import MIN_SIGNAL, Ranges
from ..shape import shape_of
from ..weather import weather_of
from .answer import ranges_of, statuses
from .echoes import with_echoes
from .fog_state import FogSolver, FogState
from .fog_visibility import visibility_of
from .histograms import find_histogram_modes, make_histogram_templates
from .posterior import posterior
from .templates import EXTINCTIONS_PER_M, NOMINAL_ELECTRONS_PER_JOULE


def histogram_solver(spots: HistogramSpots, max_range_m: float) -> FogSolver:
    """Solver of a recording's histograms.

    Raises InputError if they are not of single photons, or the laser's energy or the detector's
    response is unknown.
    """
    if not spots.piles_up:
        raise InputError(
            "ranging in fog needs histograms of single photons; time stamps of whole pulses that "
            "cross a threshold do not show how much light the fog sends back"
        )
    for name in ("response_sigma_s", "laser_energy_j"):
        if np.isnan(getattr(spots, name)):
            raise InputError(f"spots/{name} is unknown (nan), but ranging in fog needs it")
    shape = shape_of(spots)
    assert shape is not None
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    electrons = spots.electrons_per_joule if scaled else NOMINAL_ELECTRONS_PER_JOULE
    arrivals = electrons * spots.laser_energy_j
    templates = make_histogram_templates(spots, shape, arrivals / spots.pulses, max_range_m)

    def solve(
        spots: Spots, prior: FogState, brightness: Brightness | None
    ) -> tuple[Ranges, FogState]:
        assert isinstance(spots, HistogramSpots)
        counts, saturated = spots.counts[0].astype(np.float64), spots.saturated[0]
        modes = find_histogram_modes(templates, counts, spots.pulses, ~saturated, scaled)
        estimate = posterior(modes, prior, len(counts))
        revised = tuple(
            with_echoes(each, templates, counts[spot], spots.pulses, spot)
            for spot, each in enumerate(estimate.spots)
        )
        estimate = replace(estimate, spots=revised)
        dark = _is_even(counts)
        median = np.median(counts, axis=1)
        ranges = ranges_of(
            estimate.spots,
            statuses(estimate, saturated, dark),
            median,
            estimate.fog.optics(EXTINCTIONS_PER_M),
            visibility_of(estimate.fog, EXTINCTIONS_PER_M) if scaled else None,
        )
        return ranges, estimate.fog

    return FogSolver(FogState.prior(EXTINCTIONS_PER_M, weather_of(spots)), solve)


def _is_even(counts: Floats) -> Mask:
    """Whether histograms (spots, B) show only arrivals at random times, (spots,)."""
    blocks = np.stack([part.sum(axis=1) for part in np.array_split(counts, BLOCKS, axis=1)])
    mean = np.maximum(blocks.mean(axis=0), 1e-12)
    squares = ((blocks - mean) ** 2 / mean).sum(axis=0)
    return np.asarray(squares < chdtri(BLOCKS - 1, ndtr(-MIN_SIGNAL)))
