"""The page of a comparison."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from reconstruction.base.arrays import Floats
from spisim.report.page import write_page
from spisim.report.pictures import Scale, intensity_scale
from spisim.report.style import CURVE_COLOURS, WIDE_IN, drawn, plot_in_page, plot_style

from .comparison import Comparison, in_words, named, parameters

PARTS = 3
"""Maximum number of rows of plots: patterns, and readings of spots."""
BAND = 2.0
"""Standard deviations that 95 % of equal readings stay within."""


@plot_style()
def write_comparison(path: Path, kind: str, title: str, comparison: Comparison) -> None:
    """Write the page; raises OSError if the file cannot be written."""
    verdict = comparison.verdict
    pictures = comparison.pictures
    shown = [image for name, image in pictures.items() if "less" not in name]
    limit = max(
        (float(np.quantile(np.abs(each), 0.99)) for each in list(pictures.values())[2:]), default=1
    )
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
        groups=comparison.by_group,
        worst=comparison.worst,
        tests=sorted(verdict.probabilities.items(), key=lambda each: each[1]),
        noise=comparison.noise,
        facts=dict(comparison.facts),
        probability=probability,
    )


def _cards(comparison: Comparison) -> list[tuple[str, str, str]]:
    verdict = comparison.verdict
    return [
        (named(verdict), "verdict", "the strongest cause" if verdict.alarm else "within the noise"),
        (probability(verdict.probability), "probability of equality", "of all tests together"),
        (
            f"{verdict.chi_squared / max(verdict.freedom, 1):.2f}",
            "χ² per reading",
            f"{verdict.freedom} readings",
        ),
        (probability(verdict.rest), "probability of the rest", "after the causes"),
    ]


def probability(value: float) -> str:
    """Format a probability; below a millionth only its bound."""
    return "< 10⁻⁶" if value < 1e-6 else f"{value:.2g}"


def readings_figure(comparison: Comparison, width_in: float = WIDE_IN) -> Figure:
    """Plot the difference of each reading over its sigma, before and after the causes."""
    number, names = comparison.groups
    first = number == 0
    rows = [(names[0], first)]
    if not first.all():
        rows.append(("spots", ~first))
    figure = Figure(figsize=(width_in, 2.2 * len(rows) + 0.4), layout="constrained")
    axes = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    for axis, (name, some) in zip(axes, rows, strict=True):
        _draw(
            axis, comparison.z[some], comparison.remainder[some], bool(comparison.verdict.explained)
        )
        axis.set(ylabel="difference / σ", title=drawn(name))
    axes[-1].set_xlabel("reading")
    axes[0].legend(loc="upper right", ncols=2)
    return figure


def _draw(axis: object, z: Floats, remainder: Floats, explained: bool) -> None:
    plot: object = axis
    at = np.arange(z.size)
    plot.axhspan(-BAND, BAND, color="#e5e5e5", linewidth=0)  # type: ignore[attr-defined]
    plot.plot(at, z, ".", markersize=3, color=CURVE_COLOURS[0], label="as recorded")  # type: ignore[attr-defined]
    if explained:
        plot.plot(
            at, remainder, ".", markersize=3, color=CURVE_COLOURS[1], label="after the causes"
        )  # type: ignore[attr-defined]
