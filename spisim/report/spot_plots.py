"""The four laser spots over path length: light, or arrivals."""

from typing import Protocol

import numpy as np
from matplotlib.figure import Figure
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.capture.readings.dtof import HistogramSpots

from .inline import WIDE_IN
from .style import SPOT_COLOURS
from .units import prefix_axis, prefix_log

DECADES = 6  # of light shown below the highest value
LINEAR_M = 200.0  # longest path on a linear scale


class SpotHistograms(Protocol):
    """What the plot needs of a transport result."""

    @property
    def spot_histogram(self) -> Floats:
        """Fraction of each laser's power per bin of path length (4, bins)."""

    @property
    def path_length_m(self) -> Floats:
        """Path length of each bin (bins,), ascending."""


def light_figure(
    transport: SpotHistograms, true_length_m: Floats | None, width_in: float = WIDE_IN
) -> Figure | None:
    """Light per metre of path length and watt of each laser; None without any light.

    `true_length_m` (4,): the true way to each spot and back, marked by a dashed line.
    """
    lengths_m: Floats = np.asarray(transport.path_length_m, np.float64)
    if lengths_m.size == 0:  # an instrument without lasers
        return None
    density = np.asarray(transport.spot_histogram, float) / np.gradient(lengths_m)
    lit = np.flatnonzero(density.max(axis=0) > 0)
    if lit.size == 0:
        return None
    displayed = lengths_m <= lengths_m[lit[-1]]
    if true_length_m is not None and np.isfinite(true_length_m).any():
        displayed &= lengths_m <= 1.25 * np.nanmax(true_length_m)
    top = 10.0 ** np.ceil(np.log10(density.max()))
    limits = top / 10**DECADES, top
    curves = lengths_m[displayed], density[:, displayed], true_length_m, limits
    figure = _figure(*curves, "light per watt of laser", width_in)
    prefix_log(figure.axes[0].yaxis, "W/m")
    return figure


def arrival_figure(
    spots: HistogramSpots, frame: int, true_length_m: Floats | None, width_in: float = WIDE_IN
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
    lengths_m: Floats = np.arange(counts.shape[1], dtype=np.float64) * c * spots.bin_width_s
    figure = _figure(lengths_m, counts, true_length_m, limits, "arrivals per bin", width_in)
    prefix_log(figure.axes[0].yaxis)
    return figure


def _figure(
    lengths_m: Floats,
    values: Floats,
    true_length_m: Floats | None,
    limits: tuple[float, float],
    label: str,
    width_in: float,
) -> Figure:
    """Curves (4, bins) on a logarithmic scale; the path too, where it is long."""
    figure = Figure(figsize=(width_in, 2.9), layout="constrained")
    axes = figure.subplots()
    for k, (row, colour) in enumerate(zip(values, SPOT_COLOURS, strict=True)):
        axes.plot(lengths_m, row, color=colour, lw=1.3, label=f"spot {k}")
        if true_length_m is not None and np.isfinite(true_length_m[k]):
            axes.axvline(true_length_m[k], color=colour, lw=1, ls="--")
    axes.set_yscale("log", nonpositive="clip")
    farthest_m = lengths_m[-1] + lengths_m[1]
    if farthest_m > LINEAR_M:
        axes.set_xscale("log")
    axes.set(ylim=limits, xlim=(1.0 if farthest_m > LINEAR_M else 0, farthest_m))
    axes.set(ylabel=label)
    prefix_axis(axes.xaxis, "path length, m")
    figure.legend(loc="outside upper right", ncols=len(values) if width_in == WIDE_IN else 2)
    return figure
