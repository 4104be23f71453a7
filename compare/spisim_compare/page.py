"""The page of a comparison."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim_app.report.page import write_page
from spisim_app.report.pictures import Scale, intensity_scale
from spisim_app.report.style import CURVE_COLOURS, WIDE_IN, drawn, plot_in_page, plot_style

from .comparison import Comparison, in_words, named, parameters, probability

BAND = 2.0
"""Standard deviations that 95 % of equal readings stay within."""


@plot_style()
def write_comparison(path: Path, kind: str, title: str, comparison: Comparison) -> None:
    """Write the page; raises OSError if the file cannot be written."""
    verdict = comparison.verdict
    pictures = comparison.pictures
    shown = [image for name, image in pictures.items() if "less" not in name]
    apart = [np.quantile(np.abs(image), 0.99) for name, image in pictures.items() if "less" in name]
    limit = float(max(apart, default=1.0))
    write_page(
        path,
        kind,
        "comparison",
        title=title,
        lines=in_words(comparison),
        cards=_cards(comparison),
        causes=[
            (each.cause.name, name.replace("_", " "), value, sigma)
            for each in verdict.explained
            for name, value, sigma in parameters(each)
        ],
        pictures=list(pictures.items()),
        scales=[
            *[intensity_scale(*shown, unit=comparison.unit)] * len(shown),
            Scale(-limit, limit, "RdBu_r", comparison.unit),
        ],
        plot=plot_in_page("readings", lambda width_in: readings_figure(comparison, width_in)),
        groups=comparison.groups,
        worst=comparison.worst,
        tests=sorted(verdict.probabilities.items(), key=lambda each: each[1]),
        noise=comparison.noise,
        facts=dict(comparison.facts),
        probability=probability,
    )


def _cards(comparison: Comparison) -> list[tuple[str, str, str]]:
    verdict = comparison.verdict
    per_reading = verdict.chi_squared / max(verdict.freedom, 1)
    return [
        (named(verdict), "verdict", "the strongest cause" if verdict.alarm else "within the noise"),
        (probability(verdict.probability), "probability of equality", "of all tests together"),
        (
            f"{per_reading:.2f}",
            "χ² per reading",
            f"{verdict.freedom} readings",
        ),
        (probability(verdict.rest), "probability of the rest", "after the causes"),
    ]


def readings_figure(comparison: Comparison, width_in: float = WIDE_IN) -> Figure:
    """Plot the difference of each reading over its sigma, before and after the causes."""
    series = {"as recorded": comparison.z}
    if comparison.verdict.explained:
        series["after the causes"] = comparison.remainder
    return z_figure(series, comparison.group, comparison.groups[0].name, width_in)


def z_figure(
    series: Mapping[str, Floats], group: NDArray[np.intp], first: str, width_in: float = WIDE_IN
) -> Figure:
    """Plot differences (n,) of readings over their sigma, those of the first group by themselves.

    ``group`` (n,) are numbers of groups, of which ``first`` is the first one's name.
    """
    rows = [(first, group == 0), ("spots", group > 0)]
    rows = [(name, some) for name, some in rows if some.any()]
    figure = Figure(figsize=(width_in, 2.2 * len(rows) + 0.4), layout="constrained")
    axes = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    for axis, (name, some) in zip(axes, rows, strict=True):
        at = np.arange(np.count_nonzero(some))
        axis.axhspan(-BAND, BAND, color="#e5e5e5", linewidth=0)
        for (label, z), colour in zip(series.items(), CURVE_COLOURS, strict=False):
            axis.plot(at, z[some], ".", markersize=3, color=colour, label=label)
        axis.set(ylabel="difference / σ", title=drawn(name))
    axes[-1].set_xlabel("reading")
    axes[0].legend(loc="upper right", ncols=2)
    return figure
