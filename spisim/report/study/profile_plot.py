"""The plot of estimated against true depth, for all scenes of a study together."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spisim.report.study.plots import COLOURS, MARKERS, Plot, legend_above, plain_log, saved
from spisim.study.labels import group_label
from spisim.study.profile import CENTRES_M, MAPS
from spisim.study.results import Results, Row, over_units
from spisim.study.statistics import Estimate

NAME = "depth_profile"
#: Bins of fewer independent scenes or rounds are left out.
LEAST_UNITS = 3


def profile_plot(results: Results) -> Plot:
    """Mean estimated over true depth, one curve for each group, one panel for each kind of map."""
    return saved(NAME, (), lambda: _figure(results))


def _figure(results: Results) -> Figure:
    figure = Figure(figsize=(8, 4.3), layout="constrained")
    panels = figure.subplots(1, len(MAPS), sharex=True, sharey=True)
    groups = results.groups()
    for axes, (kind, title) in zip(panels, MAPS.items(), strict=True):
        for number, (group, rows) in enumerate(groups.items()):
            label = group_label(results.planned.study, group) or results.planned.study.reference
            _draw(axes, profile_of(rows, kind), COLOURS[number % len(COLOURS)], number, label)
        axes.axline((1, 1), (2, 2), color="0.3", lw=0.8, zorder=0)
        axes.set(xscale="log", yscale="log", title=title, xlabel="true depth, m")
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        axes.set_aspect("equal")
    limits = panels[0].dataLim.union([axes.dataLim for axes in panels])
    reach = min(limits.min) / 1.2, max(limits.max) * 1.2
    panels[0].set(xlim=reach, ylim=reach)
    panels[0].set_ylabel("mean estimated depth, m")
    if len(groups) > 1:
        handles, labels = panels[0].get_legend_handles_labels()
        legend_above(figure, handles, labels)
    return figure


def profile_of(rows: list[Row], kind: str) -> dict[float, Estimate]:
    """Mean estimate by true depth, of the bins that enough scenes or rounds have."""
    found = {}
    for place, true_m in enumerate(CENTRES_M):
        having = [row for row in rows if row.profile and row.profile[kind][place] is not None]
        values = [float(row.profile[kind][place] or 0) for row in having]
        estimate = over_units(having, values)
        if estimate.units >= LEAST_UNITS:
            found[float(true_m)] = estimate
    return found


def _draw(axes: Axes, profile: dict[float, Estimate], colour: str, number: int, label: str) -> None:
    if not profile:
        return
    means = [estimate.mean or 0.0 for estimate in profile.values()]
    low = [mean - (e.low or mean) for mean, e in zip(means, profile.values(), strict=True)]
    high = [(e.high or mean) - mean for mean, e in zip(means, profile.values(), strict=True)]
    at = [true_m * 1.02**number for true_m in profile]  # side by side
    axes.errorbar(
        at,
        means,
        yerr=(low, high),
        color=colour,
        marker=MARKERS[number % len(MARKERS)],
        ms=4,
        lw=1.2,
        elinewidth=0.9,
        capsize=2,
        label=label,
    )
