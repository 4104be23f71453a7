"""Plots of a study: one for each quantity, with error bars."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from spisim.study.labels import axis_label, brief, condition_label, group_label
from spisim.study.metrics import METRICS
from spisim.study.results import Condition, Results, Summary

#: M. Okabe & K. Ito's colours, which the colour-blind tell apart, without the pale yellow.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
#: Of the methods of one quantity: the line, and whether its marks are filled.
METHODS = (("-", True), ("--", False), (":", False))
#: Between curves side by side, and to what stands beside the axis, as shares of its length.
DODGE, BESIDE = 0.012, 0.09
#: Ratio of means from which an axis of errors is logarithmic.
LOG_FROM = 30
#: That a line of the legend has room for.
LEGEND_CHARACTERS = 110
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "svg.hashsalt": "spisim",
    "figure.dpi": 150,
}


@dataclass(frozen=True)
class Plot:
    """A plot as files, and the metrics that it shows."""

    name: str
    metrics: tuple[str, ...]
    png: bytes
    svg: bytes


@dataclass(frozen=True)
class _Curve:
    """One method over all values of x of a group, which has the label and the colour."""

    label: str
    colour: str
    marker: str
    line: str
    filled: bool
    points: Sequence[Summary]


def study_plots(results: Results) -> list[Plot]:
    """One plot for each quantity among the metrics, in their order."""
    quantities: dict[str, list[str]] = {}
    for name in results.metrics:
        quantities.setdefault(METRICS[name].quantity, []).append(name)
    return [_plot(results, tuple(names)) for names in quantities.values()]


def _plot(results: Results, metrics: tuple[str, ...]) -> Plot:
    values = [condition[0] for condition in results.conditions if condition[0] is not None]
    numeric = all(isinstance(x, int | float) and not isinstance(x, bool) for x in values)
    draw = _over_numbers if numeric else _over_names
    return saved(metrics[0], metrics, lambda: draw(results, metrics))


def saved(name: str, metrics: tuple[str, ...], draw: Callable[[], Figure]) -> Plot:
    """A figure in the style of all plots, as files; equal figures give equal files."""
    with rc_context(STYLE):
        figure = draw()
        png, svg = io.BytesIO(), io.BytesIO()
        figure.savefig(png, format="png", dpi=150)
        figure.savefig(svg, format="svg", metadata={"Date": None})
    return Plot(name, metrics, png.getvalue(), svg.getvalue())


def _curves(results: Results, metrics: Sequence[str], conditions: list[Condition]) -> list[_Curve]:
    """All curves through these combinations, those of one group in one colour."""
    groups: dict[Condition, list[Condition]] = {}
    for condition in conditions:
        groups.setdefault(condition[1:], []).append(condition)
    colours = zip(islice(cycle(COLOURS), len(groups)), cycle(MARKERS), strict=False)
    return [
        _Curve(
            group_label(results.planned.study, group) or results.planned.study.reference,
            colour,
            marker,
            *METHODS[method],
            [results.summaries[condition, name] for condition in chosen],
        )
        for (group, chosen), (colour, marker) in zip(groups.items(), colours, strict=True)
        for method, name in enumerate(metrics)
    ]


def _over_numbers(results: Results, metrics: tuple[str, ...]) -> Figure:
    """Curves over x; combinations without x stand beside its axis."""
    study = results.planned.study
    figure = Figure(figsize=(8, 4.6), layout="constrained")
    axes = figure.subplots()
    along = [c for c in results.conditions if c[0] is not None]
    beside = [c for c in results.conditions if c[0] is None]
    values = sorted({float(condition[0]) for condition in along})
    place = np.log10 if study.x_scale == "log" else np.asarray
    low, high = float(place(values[0])), float(place(values[-1]))
    span = (high - low) or 1.0
    curves = _curves(results, metrics, along)
    middle = (len(curves) - 1) / 2
    for number, curve in enumerate(curves):
        points = sorted(curve.points, key=lambda point: point.condition[0])
        xs = [float(place(p.condition[0])) + (number - middle) * DODGE * span for p in points]
        _draw(axes, curve, points, xs)
    ticks = {float(place(value)): brief(value) for value in values}
    for number, condition in enumerate(beside, start=1):
        at = high + (number + 0.5) * BESIDE * span
        ticks[at] = condition_label(study, condition)
        _draw_beside(axes, [results.summaries[condition, name] for name in metrics], at, span)
    if beside:
        axes.axvline(high + 0.75 * BESIDE * span, color="0.8", lw=1)
        _line_across(axes, results.summaries[beside[0], metrics[0]])
    axes.set_xticks(list(ticks), list(ticks.values()))
    for label in axes.get_xticklabels()[len(values) :]:
        label.set(rotation=35, ha="right", rotation_mode="anchor")
    axes.set_xlabel(axis_label(study.x))
    axes.set_ylabel(METRICS[metrics[0]].title)
    _finish(axes, results, metrics)
    _legend(axes, curves, metrics)
    return figure


def _over_names(results: Results, metrics: tuple[str, ...]) -> Figure:
    """A line of marks for each value of x, from above to below."""
    study = results.planned.study
    names = list(dict.fromkeys(condition[0] for condition in results.conditions))
    curves = _curves(results, metrics, list(results.conditions))
    height = 1.6 + len(names) * max(0.3, 0.13 * len(curves))
    figure = Figure(figsize=(8, height), layout="constrained")
    axes = figure.subplots()
    rows = {name: row for row, name in enumerate(names)}
    offsets = np.linspace(-0.32, 0.32, len(curves)) if len(curves) > 1 else [0.0]
    for curve, offset in zip(curves, offsets, strict=True):
        _draw(axes, curve, curve.points, [rows[p.condition[0]] + offset for p in curve.points], "x")
    axes.set_yticks(range(len(names)), [study.reference if n is None else brief(n) for n in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    for row in range(1, len(names)):
        axes.axhline(row - 0.5, color="0.9", lw=0.8, zorder=0)
    axes.set_ylabel(axis_label(study.x))
    axes.set_xlabel(METRICS[metrics[0]].title)
    _finish(axes, results, metrics, across="x")
    _legend(axes, curves, metrics)
    return figure


def _draw(
    axes: Axes, curve: _Curve, points: Sequence[Summary], places: list[float], along: str = "y"
) -> None:
    """Means with their intervals; `along` is the axis of the metric."""
    known = [
        (place, p.estimate) for place, p in zip(places, points, strict=True) if p.estimate.n > 0
    ]
    at = [place for place, _ in known]
    means: Any = [estimate.mean for _, estimate in known]
    bars = _bars([estimate for _, estimate in known])
    style: dict[str, Any] = {
        "color": curve.colour,
        "marker": curve.marker,
        "ms": 5,
        "mfc": curve.colour if curve.filled else "white",
        "ls": curve.line if along == "y" else "none",
        "lw": 1.3,
        "elinewidth": 1.1,
        "capsize": 2.5,
    }
    if along == "y":
        axes.errorbar(at, means, yerr=bars, **style)
    else:
        axes.errorbar(means, at, xerr=bars, **style)


def _draw_beside(axes: Axes, points: Sequence[Summary], at: float, span: float) -> None:
    for number, (point, (_, filled)) in enumerate(zip(points, METHODS, strict=False)):
        curve = _Curve("", "0.25", "o", "none", filled, [point])
        _draw(axes, curve, [point], [at + number * DODGE * span])


def _bars(estimates: Sequence[Any]) -> Any:
    """Lengths below and above the means (2, n); none where there is no interval."""
    lengths = [
        (0.0, 0.0) if e.low is None else (max(e.mean - e.low, 0.0), max(e.high - e.mean, 0.0))
        for e in estimates
    ]
    return np.transpose(lengths) if lengths else None


def _line_across(axes: Axes, point: Summary) -> None:
    if point.estimate.mean is not None:
        axes.axhline(point.estimate.mean, color="0.5", lw=1, ls=(0, (6, 4)), zorder=0)


def _finish(axes: Axes, results: Results, metrics: Sequence[str], across: str = "y") -> None:
    """Scale of the metric's axis, and its zero."""
    shown = [s.estimate.mean for (_, name), s in results.summaries.items() if name in metrics]
    means = [mean for mean in shown if mean is not None]
    if len(set(means)) == 1:  # not a scale of rounding errors
        (axes.set_ylim if across == "y" else axes.set_xlim)(0, 1.1 * means[0] or 1)
    if METRICS[metrics[0]].better == "near zero":
        (axes.axhline if across == "y" else axes.axvline)(0, color="0.3", lw=0.8)
    elif METRICS[metrics[0]].better == "low" and means and 0 < LOG_FROM * min(means) < max(means):
        (axes.set_yscale if across == "y" else axes.set_xscale)("log", nonpositive="clip")
        plain_log(axes.yaxis if across == "y" else axes.xaxis)


def _legend(axes: Axes, curves: Sequence[_Curve], metrics: Sequence[str]) -> None:
    """Groups by colour and mark; methods, where there are several, by line and filling."""
    handles = []
    groups = {curve.label: curve for curve in curves}
    if len(groups) > 1:
        handles += [
            Line2D([], [], color=c.colour, marker=c.marker, ms=5, label=label)
            for label, c in groups.items()
        ]
    if len(metrics) > 1:
        handles += [
            Line2D([], [], color="0.25", marker="o", ms=5, ls=line, label=METRICS[name].method,
                   mfc="0.25" if filled else "white")
            for name, (line, filled) in zip(metrics, METHODS, strict=False)
        ]  # fmt: skip
    if handles:
        figure = axes.get_figure(root=True)
        assert isinstance(figure, Figure)
        legend_above(figure, handles, [str(handle.get_label()) for handle in handles])


def legend_above(figure: Figure, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """A legend in as many columns as there is room for."""
    columns = max(1, min(len(labels), LEGEND_CHARACTERS // (max(map(len, labels)) + 8)))
    figure.legend(
        handles, labels, loc="outside upper left", ncols=columns, frameon=False, fontsize=8.5
    )


def plain_log(axis: Axis) -> None:
    """Numbers of a logarithmic axis as 0.05, not as powers of ten."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
