"""Direct time of flight: histogram of arrivals -> delay -> path length."""

import numpy as np
from scipy.special import ndtr, ndtri

from ...base.constants import c
from ...capture import Optics, Spots
from ...capture.readings.dtof import HistogramSpots
from ..brightness import Brightness
from ..histogram import find_pulses
from ..method import RangingSolver
from ..ranges import MIN_SIGNAL, Paths, Ranges, ranges_from_paths

NO_PILE_UP = 10_000
"""Factor on the cycles that makes pile-up negligible."""
MAX_SCATTER_M = 0.3
"""Maximum scatter, in range, of a threshold's stamps of one surface. At a threshold of six times
the noise that of a Gaussian pulse is at most a third of its own: 0.26 m for 12 ns. Where the echo
of fog ends it is metres."""


class DirectTof:
    """Maximum-likelihood pulse in the histogram (see `find_pulses`).

    A pulse is no signal if noise makes one as strong anywhere as often as one of MIN_SIGNAL
    standard deviations at a given position, and ambiguous if its centre lies outside the bins or a
    threshold's stamps scatter as those of no single surface.
    """

    title = "strongest pulse"
    reads = HistogramSpots

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver for a recording's histograms."""
        return _solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range beyond which a spot appears nearer than it is."""
        return np.inf


def _solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
    assert isinstance(spots, HistogramSpots)
    finite = np.isfinite(spots.response_sigma_s)
    width = spots.response_sigma_s / spots.bin_width_s if finite else None
    counts = spots.counts[0].astype(np.float64)
    # With very many cycles of few arrivals each, no arrival hides another.
    cycles = spots.pulses if spots.piles_up else NO_PILE_UP * spots.pulses
    pulses = find_pulses(counts, cycles, width)
    bins = counts.shape[-1]
    positions = np.maximum(bins / (2 * pulses.width), 1)
    minimum = -ndtri(ndtr(-MIN_SIGNAL) / positions)
    scatter_m = c / 2 * spots.bin_width_s * pulses.width
    scattered = (not spots.piles_up) & (scatter_m > MAX_SCATTER_M)
    delay = spots.start_s + spots.bin_width_s * pulses.delay - spots.delay_offset_s
    paths = Paths(
        path_m=c * delay,
        sigma_m=c * spots.bin_width_s * pulses.delay_sigma,
        signal_electrons=cycles * pulses.arrivals,
        background_electrons=cycles * pulses.background,
        saturated=spots.saturated[0],
        no_signal=pulses.arrivals < minimum * pulses.arrivals_sigma,
        ambiguous=(pulses.delay < 0) | (pulses.delay > bins) | scattered,
    )
    return ranges_from_paths(paths, spots)


METHOD = DirectTof()
