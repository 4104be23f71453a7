"""Plots of a capture: light of the spots over path length, and the free corridor ahead."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.depth import DISTANCES_M

from .style import CURVE_COLOURS, WIDE_IN, drawn, spot_looks
from .units import prefix_axis, prefix_log

DECADES = 6  # displayed below the maximum
LINEAR_M = 200.0  # maximum path on a linear scale


class SpotHistograms(Protocol):
    """The part of a transport result that the plot uses."""

    @property
    def spot_histogram(self) -> Floats:
        """Fraction of each laser's power per bin of path length (spots, bins)."""

    @property
    def path_length_m(self) -> Floats:
        """Path length of each bin (bins,), ascending."""


def light_figure(
    transport: SpotHistograms, true_length_m: Floats | None, width_in: float = WIDE_IN
) -> Figure | None:
    """Plot light per metre of path length and watt of each laser; None without any light.

    `true_length_m` (spots,), the true path to each spot and back, is marked by a dashed line.
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
    """Plot the recorded arrivals of each time bin over its path length; None without any.

    The first bin is drawn at its own path, with nothing before it. `true_length_m` as in
    `light_figure`.
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
    """Plot curves (spots, bins) on a logarithmic scale; the path too, if it is long."""
    figure = Figure(figsize=(width_in, 2.9), layout="constrained")
    axes = figure.subplots()
    for k, (row, (colour, spots)) in enumerate(zip(values, spot_looks(len(values)), strict=True)):
        axes.plot(lengths_m, row, color=colour, lw=1.3, label=spots)
        if true_length_m is not None and np.isfinite(true_length_m[k]):
            axes.axvline(true_length_m[k], color=colour, lw=1, ls="--")
    axes.set_yscale("log", nonpositive="clip")
    farthest_m = lengths_m[-1] + lengths_m[1]
    if farthest_m > LINEAR_M:
        axes.set_xscale("log")
    axes.set(ylim=limits, xlim=(1.0 if farthest_m > LINEAR_M else 0, farthest_m))
    axes.set(ylabel=label)
    prefix_axis(axes.xaxis, "path length, m")
    figure.legend(loc="outside upper right", ncols=4 if width_in == WIDE_IN else 2)
    return figure


def corridor_figure(
    free: Mapping[str, Floats], min_free: float, true_m: float | None, width_in: float = WIDE_IN
) -> Figure | None:
    """Plot the probability that the corridor is free over distance, (K,) by method.

    A dotted line marks the probability below which an obstacle is reported, and a dashed one the
    true distance of the nearest obstacle. Returns None without any curve.
    """
    if not free:
        return None
    figure = Figure(figsize=(width_in, 2.9), layout="constrained")
    axes = figure.subplots()
    for (name, values), colour in zip(free.items(), CURVE_COLOURS, strict=False):
        axes.plot(DISTANCES_M, values, color=colour, lw=1.3, label=drawn(name))
    axes.axhline(min_free, color="#555555", lw=1, ls=":")
    if true_m is not None and np.isfinite(true_m):
        axes.axvline(true_m, color="#555555", lw=1, ls="--")
    axes.set_xscale("log")
    axes.set(ylim=(0, 1.02), xlim=(DISTANCES_M[0], DISTANCES_M[-1]))
    axes.set(xlabel="distance ahead, m", ylabel="probability, free up to there")
    ticks = [0.2, 0.5, 1, 2, 5, 10, 20, 40]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    figure.legend(loc="outside upper right", ncols=min(len(free), 4 if width_in == WIDE_IN else 2))
    return figure
