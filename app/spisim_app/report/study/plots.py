"""Plots of a study with error bars, one per quantity."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from textwrap import fill
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from spisim.dataset.study.metrics import Metric, Quantity
from spisim.dataset.study.results import Condition, Results, Summary
from spisim.dataset.study.statistics import FEW_UNITS, Estimate
from spisim_app.report.style import WIDE_IN, drawn, file_of, plot_in_page, plot_style
from spisim_app.report.units import prefix_axis

from .labels import axis_label, brief, condition_label, group_label, method_label

#: Marks of the groups; their number differs from that of the colours, so that pairs are unique.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
#: Lines of the methods of one quantity, and whether their marks are filled.
LINES = (("-", True), ("--", False), (":", False), ("-.", True))
#: Offsets between curves, and of points beside the axis, as fractions of its length.
DODGE, BESIDE = 0.012, 0.09
#: Ratio of means above which an axis of errors is logarithmic.
LOG_FROM = 30
#: Characters in a line of the legend.
LEGEND_CHARACTERS = 110
#: Characters in a line of a tick label.
NAME_CHARACTERS = 36

#: Style of marks as arguments of `errorbar`, without a group and for all groups.
Look = dict[str, Any]
NO_GROUP: Look = {"color": "0.25", "marker": "o", "ms": 5}


@dataclass(frozen=True)
class Plot:
    """A plot as files and inlined in a page; its quantity is None for a plot of something else."""

    name: str
    quantity: Quantity | None
    png: bytes
    svg: bytes
    in_page: Markup


def study_plots(results: Results) -> list[Plot]:
    """Return one plot for each quantity among the metrics, in their order."""
    values = [condition[0] for condition in results.conditions if condition[0] is not None]
    numeric = all(isinstance(x, int | float) and not isinstance(x, bool) for x in values)
    draw = _over_numbers if numeric else _over_names
    kinds: dict[str, list[str]] = {}
    for name in results.metrics:
        kinds.setdefault(Metric.of(name).kind, []).append(name)
    return [
        saved(kind, Metric.of(kind).quantity, partial(draw, results, names))
        for kind, names in kinds.items()
    ]


def saved(name: str, quantity: Quantity | None, draw: Callable[[float], Figure]) -> Plot:
    """Save a figure in the common style, drawn by `draw` for a width in inches."""
    with plot_style():
        figure = draw(WIDE_IN)
        files = file_of(figure, "study"), file_of(figure, "study", "svg")
        in_page = plot_in_page(name.replace("_", "-"), draw)
    assert in_page is not None
    return Plot(name, quantity, *files, in_page)


def group_look(number: int) -> Look:
    """Return the style of a group by its number."""
    return {"color": f"C{number}", "marker": MARKERS[number % len(MARKERS)], "ms": 5}


def _method_look(number: int, of: Look) -> Look:
    """Return the style of a method of a group by its number."""
    line, filled = LINES[number % len(LINES)]
    return {**of, "ls": line, "mfc": of["color"] if filled else "white"}


def _curves(
    results: Results, metrics: Sequence[str], conditions: list[Condition]
) -> list[tuple[Look, list[Summary]]]:
    """Return all curves through these combinations, each of one group and one method."""
    groups: dict[Condition, list[Condition]] = {}
    for condition in conditions:
        groups.setdefault(condition[1:], []).append(condition)
    return [
        (
            _method_look(method, group_look(number)),
            [results.summaries[condition, name] for condition in chosen],
        )
        for number, chosen in enumerate(groups.values())
        for method, name in enumerate(metrics)
    ]


def _over_numbers(results: Results, metrics: Sequence[str], width_in: float) -> Figure:
    """Draw curves over x; combinations without x stand beside its axis."""
    study = results.planned.study
    figure = Figure(figsize=(width_in, 4.6), layout="constrained")
    axes = figure.subplots()
    along = [c for c in results.conditions if c[0] is not None]
    beside = [c for c in results.conditions if c[0] is None]
    values = sorted({float(condition[0]) for condition in along})
    position = np.log10 if study.x_scale == "log" else np.asarray
    low, high = float(position(values[0])), float(position(values[-1]))
    span = (high - low) or 1.0
    curves = _curves(results, metrics, along)
    middle = (len(curves) - 1) / 2
    for number, (look, points) in enumerate(curves):
        points.sort(key=lambda point: point.condition[0])
        xs = [float(position(p.condition[0])) + (number - middle) * DODGE * span for p in points]
        draw_estimates(axes, look, xs, [point.estimate for point in points])
    ticks = {float(position(value)): brief(value) for value in values}
    for number, condition in enumerate(beside, start=1):
        at = high + (number + 0.5) * BESIDE * span
        ticks[at] = condition_label(study, condition)
        for method, name in enumerate(metrics):
            look = {**_method_look(method, NO_GROUP), "ls": "none"}
            estimate = results.summaries[condition, name].estimate
            draw_estimates(axes, look, [at + method * DODGE * span], [estimate])
    if beside:
        axes.axvline(high + 0.75 * BESIDE * span, color="0.8", lw=1)
        reference = results.summaries[beside[0], metrics[0]].estimate.mean
        if reference is not None:
            axes.axhline(reference, color="0.5", lw=1, ls=(0, (6, 4)), zorder=0)
    axes.set_xticks(list(ticks), list(map(drawn, ticks.values())))
    for label in axes.get_xticklabels()[len(values) :]:
        label.set(rotation=35, ha="right", rotation_mode="anchor")
    axes.set_xlabel(drawn(axis_label(study.x)))
    _scale(axes, results, metrics)
    prefix_axis(axes.yaxis, Metric.of(metrics[0]).quantity.label)
    _legend(figure, results, metrics, along)
    return figure


def _over_names(results: Results, metrics: Sequence[str], width_in: float) -> Figure:
    """Draw a row of marks for each value of x, from top to bottom."""
    study = results.planned.study
    names = list(dict.fromkeys(condition[0] for condition in results.conditions))
    curves = _curves(results, metrics, results.conditions)
    labels = [study.reference if name is None else brief(name) for name in names]
    labels = [fill(name, int(NAME_CHARACTERS * width_in / WIDE_IN)) for name in labels]
    lines = max(name.count("\n") for name in labels) + 1
    height = 1.6 + len(names) * max(0.3, 0.13 * len(curves), 0.18 * lines)
    figure = Figure(figsize=(width_in, height), layout="constrained")
    axes = figure.subplots()
    rows = {name: row for row, name in enumerate(names)}
    offsets = np.linspace(-0.32, 0.32, len(curves)) if len(curves) > 1 else [0.0]
    for (look, points), offset in zip(curves, offsets, strict=True):
        positions = [rows[point.condition[0]] + offset for point in points]
        estimates = [point.estimate for point in points]
        draw_estimates(axes, {**look, "ls": "none"}, positions, estimates, along="x")
    axes.set_yticks(range(len(names)), list(map(drawn, labels)))
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    for row in range(1, len(names)):
        axes.axhline(row - 0.5, color="0.9", lw=0.8, zorder=0)
    axes.set_ylabel(drawn(axis_label(study.x)))
    _scale(axes, results, metrics, along="x")
    prefix_axis(axes.xaxis, Metric.of(metrics[0]).quantity.label)
    _legend(figure, results, metrics, results.conditions)
    return figure


def draw_estimates(
    axes: Axes,
    look: Look,
    positions: Iterable[float],
    estimates: Iterable[Estimate],
    along: str = "y",
) -> None:
    """Draw means with their intervals at positions; `along` is the axis of the metric.

    Intervals of few units are left out: see `_interval`.
    """
    available = [(at, e) for at, e in zip(positions, estimates, strict=True) if e.mean is not None]
    at = np.array([position for position, _ in available])
    means = np.array([e.mean for _, e in available])
    low, high = np.array([_interval(e) for _, e in available]).reshape(-1, 2).T
    bars = np.maximum([means - low, high - means], 0)
    style: Look = {"lw": 1.3, "elinewidth": 1.1, "capsize": 2.5} | look
    if along == "y":
        axes.errorbar(at, means, yerr=bars, **style)
    else:
        axes.errorbar(means, at, xerr=bars, **style)


def _interval(estimate: Estimate) -> tuple[float, float]:
    """Return the ends of the drawn interval; the mean if there is none, or of few units.

    Those are so wide that they would dominate the plot.
    """
    assert estimate.mean is not None
    if estimate.low is None or estimate.high is None or estimate.units < FEW_UNITS:
        return estimate.mean, estimate.mean
    return estimate.low, estimate.high


def _scale(axes: Axes, results: Results, metrics: Sequence[str], along: str = "y") -> None:
    """Set the scale of the metric's axis, and its zero."""
    estimates = [s.estimate for (_, name), s in results.summaries.items() if name in metrics]
    estimates = [estimate for estimate in estimates if estimate.mean is not None]
    means = [estimate.mean for estimate in estimates if estimate.mean is not None]
    if len(set(means)) == 1:  # avoids a scale of rounding errors
        ends = [1.1 * end for estimate in estimates for end in _interval(estimate)]
        axes.set(**{f"{along}lim": (min(0, *ends), max(0, *ends) or 1)})
    better = Metric.of(metrics[0]).quantity.better
    if better == "near zero":
        (axes.axhline if along == "y" else axes.axvline)(0, color="0.3", lw=0.8)
    elif better == "low" and means and 0 < LOG_FROM * min(means) < max(means):
        (axes.set_yscale if along == "y" else axes.set_xscale)("log", nonpositive="clip")
        plain_log(axes.yaxis if along == "y" else axes.xaxis)


def _legend(
    figure: Figure, results: Results, metrics: Sequence[str], conditions: list[Condition]
) -> None:
    """Draw groups by colour and mark, and several methods by line and filling."""
    looks = {}
    groups = dict.fromkeys(condition[1:] for condition in conditions)
    if len(groups) > 1:
        for number, group in enumerate(groups):
            looks[group_label(results.planned.study, group)] = group_look(number)
    if len(metrics) > 1:
        for number, name in enumerate(metrics):
            looks[method_label(name)] = _method_look(number, NO_GROUP)
    if looks:
        legend_above(figure, [Line2D([], [], **look) for look in looks.values()], looks)


def legend_above(figure: Figure, handles: Sequence[Any], labels: Collection[str]) -> None:
    """Draw a legend in as many columns as fit."""
    room = LEGEND_CHARACTERS * figure.get_figwidth() / WIDE_IN
    columns = max(1, min(len(labels), int(room // (max(map(len, labels)) + 8))))
    filled = [drawn(fill(label, int(room) - 8)) for label in labels]
    figure.legend(handles, filled, loc="outside upper left", ncols=columns)


def plain_log(axis: Axis) -> None:
    """Label a logarithmic axis with numbers such as 0.05 instead of powers of ten."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
