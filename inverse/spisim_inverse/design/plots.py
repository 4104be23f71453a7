"""Plots of a design: the search, its front, and the judgement on unseen scenes."""

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from reconstruction.base.arrays import Floats
from spisim_app.report.style import CURVE_COLOURS, WIDE_IN, drawn
from spisim_app.report.units import prefix_axis
from spisim_inverse.design.judgement import BY_BOTH, Compared
from spisim_inverse.design.objectives import OBJECTIVES
from spisim_inverse.design.run import Design

QUIET, FRONT, JUDGED = "#b0b0b0", CURVE_COLOURS[0], CURVE_COLOURS[1]
NARROW_CHARACTERS, LABEL_CHARACTERS = 22, 24
"""Characters in a line of the judgement's labels in a narrow window, and of an axis' label."""
ROOM = 0.15
"""Room at the ends of an axis, over its length."""


def search_figure(design: Design, width_in: float = WIDE_IN) -> Figure:
    """The best figure so far over the number of evaluations, one plot for each objective."""
    names = design.planned.plan.objectives
    figure = Figure(figsize=(width_in, 2.3 * len(names) + 0.3), layout="constrained")
    axes = figure.subplots(len(names), 1, squeeze=False, sharex=True)[:, 0]
    for axis, name in zip(axes, names, strict=True):
        values = np.array([_of(each.figures, name) for each in design.evaluations])
        at = np.arange(len(values))
        axis.plot(at, values, ".", markersize=4, color=QUIET, label="an instrument")
        axis.plot(at, np.minimum.accumulate(values), color=FRONT, label="best so far")
        axis.axhline(values[0], color=JUDGED, linestyle="--", label="base")
        axis.set_ylim(*_limits(values))
        _label(name, axis.yaxis)
    _legend(figure, axes[0], width_in)
    axes[-1].set_xlabel("evaluation")
    return figure


def front_figure(design: Design, width_in: float = WIDE_IN) -> Figure | None:
    """Two objectives of all instruments, with the front on the scenes of search and judgement.

    None with a single objective. Of more than two the first two are drawn.
    """
    names = design.planned.plan.objectives[:2]
    if len(names) < 2:
        return None
    figure = Figure(figsize=(width_in, 0.6 * width_in + 0.8), layout="constrained")
    axis = figure.subplots()
    clouds: dict[tuple[str, str, str, str], list[Any]] = {
        ("an instrument", QUIET, ".", ""): [each.figures for each in design.evaluations],
        ("front, scenes of the search", FRONT, "o", "-"): [each.figures for each in design.front],
        ("the same, unseen scenes", JUDGED, "s", ""): list(design.front_judged),
        ("base, scenes of the search", FRONT, "*", ""): [design.evaluations[0].figures],
        ("base, unseen scenes", JUDGED, "*", ""): [design.base_judged],
    }
    for (label, colour, marker, line), figures in clouds.items():
        x, y = ([_of(each, name) for each in figures] for name in names)
        size = {"*": 12, ".": 4}.get(marker, 6)
        axis.plot(x, y, marker=marker, linestyle=line, color=colour, markersize=size, label=label)
    for name, set_limits, axes in (
        (names[0], axis.set_xlim, axis.xaxis),
        (names[1], axis.set_ylim, axis.yaxis),
    ):
        kept = [*design.front_judged, design.base_judged, design.evaluations[0].figures]
        values = [_of(each, name) for each in [*kept, *(each.figures for each in design.front)]]
        room = ROOM * (max(values) - min(values))
        set_limits(min(values) - room, max(values) + room)
        _label(name, axes)
    _legend(figure, axis, width_in)
    return figure


def judgement_figure(design: Design, width_in: float = WIDE_IN) -> Figure:
    """Ratios of chosen to base on unseen scenes, with 95 % intervals."""
    rows = [each for each in design.judged if not each.is_fraction and np.isfinite(each.change)]
    lines = 1 if width_in == WIDE_IN else 2
    figure = Figure(figsize=(width_in, 0.32 * lines * len(rows) + 1.0), layout="constrained")
    axis = figure.subplots()
    at = np.arange(len(rows))[::-1]
    change = np.array([each.change for each in rows])
    low, high = np.array([each.interval() for each in rows]).reshape(-1, 2).T
    bars = np.where(np.isfinite([change - low, high - change]), [change - low, high - change], 0)
    axis.axvline(1.0, color="#5a646e", linewidth=1)
    for number, (y, row) in enumerate(zip(at, rows, strict=True)):
        colour = {True: CURVE_COLOURS[2], False: CURVE_COLOURS[1], None: "#808080"}[row.better]
        axis.errorbar(
            change[number], y, xerr=bars[:, number : number + 1], fmt="o", color=colour, capsize=3
        )
    axis.set_yticks(at, [_row_label(row, width_in) for row in rows])
    axis.set_xlim(*_around_one(change))  # intervals of few scenes lie beyond
    axis.set_xlabel("chosen over base")
    return figure


def _row_label(row: Compared, width_in: float) -> str:
    name = "rms error" if row.name == BY_BOTH else row.name.split(",")[0]
    text = drawn(f"{row.weather}: {name}")
    return text if width_in == WIDE_IN else "\n".join(wrap(text, NARROW_CHARACTERS)[:2])


def _around_one(change: Floats) -> tuple[float, float]:
    low, high = min(float(change.min()), 1.0), max(float(change.max()), 1.0)
    room = max(high - low, 0.5)
    return max(low - room, 0.0), high + room


def _legend(figure: Figure, axis: Axes, width_in: float) -> None:
    """A legend above the plots, which leaves all points in view."""
    handles, labels = axis.get_legend_handles_labels()
    columns = 3 if width_in == WIDE_IN else 1
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


def _of(figures: Mapping[str, float] | None, name: str) -> float:
    assert figures is not None
    return figures[name]


def _limits(values: Floats) -> tuple[float, float]:
    """Ends of an axis with the best half of the instruments; the worst ones lie beyond."""
    top = max(float(values[0]), float(np.median(values)))
    room = ROOM * (top - float(values.min()) or top)
    return float(values.min()) - room, top + 3 * room


def _label(name: str, axis: Axis) -> None:
    objective = OBJECTIVES[name]
    title = objective.title.split(",")[0]
    if objective.unit:
        prefix_axis(axis, f"{title}, {objective.unit}")
    else:
        axis.set_label_text(title)
    label = axis.get_label_text().replace(", ", ",\N{NO-BREAK SPACE}")
    axis.set_label_text("\n".join(wrap(label, LABEL_CHARACTERS)))
