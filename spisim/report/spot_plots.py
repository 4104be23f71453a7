"""The four laser spots over path length: light, or arrivals."""

from typing import Protocol

import numpy as np
from matplotlib.figure import Figure
from scipy.constants import c

from reconstruction.arrays import Floats
from reconstruction.capture.readings.dtof import HistogramSpots

from .style import SPOT_COLOURS

DECADES = 6  # of light shown below the highest value


class SpotHistograms(Protocol):
    """What the plot needs of a transport result."""

    @property
    def spot_histogram(self) -> Floats:
        """Fraction of each laser's power per bin of path length (4, bins)."""

    @property
    def path_length_m(self) -> Floats:
        """Path length of each bin (bins,), evenly spaced from 0."""


def light_figure(transport: SpotHistograms, true_length_m: Floats | None) -> Figure | None:
    """The share of each laser's power per metre of path length; None without any light.

    `true_length_m` (4,): the true way to each spot and back, marked by a dashed line.
    """
    bin_width_m = float(transport.path_length_m[1])
    density = np.asarray(transport.spot_histogram, float) / bin_width_m
    lit = np.flatnonzero(density.max(axis=0) > 0)
    if lit.size == 0:
        return None
    bins = int(lit[-1]) + 1
    if true_length_m is not None and np.isfinite(true_length_m).any():
        bins = min(bins, int(1.25 * np.nanmax(true_length_m) / bin_width_m) + 1)
    top = 10.0 ** np.ceil(np.log10(density.max()))
    limits = top / 10**DECADES, top
    return _figure(density[:, :bins], bin_width_m, true_length_m, limits, "share of power per m")


def arrival_figure(
    spots: HistogramSpots, frame: int, true_length_m: Floats | None
) -> Figure | None:
    """The arrivals in each time bin as recorded, over the path that the time stands for.

    The first bin is drawn at its own path, and nothing before it; None without any arrival.
    `true_length_m` as `light_figure`.
    """
    ahead = round((spots.start_s - spots.delay_offset_s) / spots.bin_width_s)
    counts = np.asarray(spots.counts[frame], float)
    counts = np.pad(counts, ((0, 0), (max(ahead, 0), 0)))[:, max(-ahead, 0) :]
    if counts.size == 0 or counts.max() <= 0:
        return None
    limits = 0.1, 10.0 ** max(np.ceil(np.log10(counts.max())), 1)
    return _figure(counts, c * spots.bin_width_s, true_length_m, limits, "arrivals per bin")


def _figure(
    values: Floats,
    bin_width_m: float,
    true_length_m: Floats | None,
    limits: tuple[float, float],
    label: str,
) -> Figure:
    """Curves (4, bins) on a logarithmic scale."""
    figure = Figure(figsize=(9.6, 2.9), layout="constrained")
    axes = figure.subplots()
    length_m = np.arange(values.shape[1]) * bin_width_m
    for k, (row, colour) in enumerate(zip(values, SPOT_COLOURS, strict=True)):
        axes.plot(length_m, row, color=colour, lw=1.3, label=f"spot {k}")
        if true_length_m is not None and np.isfinite(true_length_m[k]):
            axes.axvline(true_length_m[k], color=colour, lw=1, ls="--")
    axes.set_yscale("log", nonpositive="clip")
    axes.set(ylim=limits, xlim=(0, values.shape[1] * bin_width_m))
    axes.set(xlabel="path length, m", ylabel=label)
    figure.legend(loc="outside upper right", ncols=len(values))
    return figure
