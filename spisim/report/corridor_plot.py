"""The probability that the corridor ahead is free, over distance."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from reconstruction.base.arrays import Floats
from reconstruction.depth import DISTANCES_M

from .inline import WIDE_IN
from .style import CURVE_COLOURS, drawn


def corridor_figure(
    free: Mapping[str, Floats], min_free: float, true_m: float | None, width_in: float = WIDE_IN
) -> Figure | None:
    """Curves (K,) by method, and the probability below which an obstacle is reported.

    The true distance of the nearest obstacle is a dashed line; None without any curve.
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
