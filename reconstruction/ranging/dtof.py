"""Direct time of flight: histogram of arrivals -> delay -> path length."""

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c
from scipy.stats import norm

from ..spots import HistogramSpots
from .histogram import find_pulses
from .ranges import LEAST_SIGNAL, Paths

Floats = NDArray[np.float64]

NO_PILE_UP = 10_000
"""Cycles per cycle where each can have one arrival only without hiding another."""


def dtof_paths(spots: HistogramSpots, frame: int) -> Paths:
    """Paths of one frame by maximum likelihood (see `find_pulses`).

    A pulse is no signal if as strong a one is as likely anywhere in noise as one of LEAST_SIGNAL
    standard deviations at a given place, and ambiguous if its centre lies outside of the bins.
    """
    known = np.isfinite(spots.response_sigma_s)
    width = spots.response_sigma_s / spots.bin_width_s if known else None
    counts = spots.counts[frame].astype(np.float64)
    # Of very many cycles with few arrivals each, none would hide another.
    cycles = spots.pulses if spots.piles_up else NO_PILE_UP * spots.pulses
    pulses = find_pulses(counts, cycles, width)
    bins = counts.shape[-1]
    places = np.maximum(bins / (2 * pulses.width), 1)
    least = norm.isf(norm.sf(LEAST_SIGNAL) / places)
    delay = spots.start_s + spots.bin_width_s * pulses.delay - spots.delay_offset_s
    return Paths(
        path_m=c * delay,
        sigma_m=c * spots.bin_width_s * pulses.delay_sigma,
        signal_electrons=cycles * pulses.arrivals,
        background_electrons=cycles * pulses.background,
        saturated=spots.saturated[frame],
        no_signal=pulses.arrivals < least * pulses.arrivals_sigma,
        ambiguous=(pulses.delay < 0) | (pulses.delay > bins),
    )
