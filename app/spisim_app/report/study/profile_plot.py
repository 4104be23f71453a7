"""The plot of estimated against true depth over all scenes of a study."""

from matplotlib.figure import Figure

from reconstruction.evaluation import method_title
from spisim.dataset.study.metrics import CENTRES_M
from spisim.dataset.study.results import Results, Row, over_units
from spisim.dataset.study.statistics import Estimate
from spisim_app.report.style import WIDE_IN

from .labels import group_label
from .plots import Plot, draw_estimates, group_look, legend_above, plain_log, saved

NAME = "depth_profile"
#: Independent scenes or rounds needed for a bin.
MIN_UNITS = 3


def profile_plot(results: Results) -> Plot:
    """Plot mean estimated over true depth, one curve per group and one panel per method."""
    return saved(NAME, None, lambda width_in: _figure(results, width_in))


def _figure(results: Results, width_in: float) -> Figure:
    groups = results.groups()
    methods = list(dict.fromkeys(name for row in results.rows for name in row.profile))
    count = max(len(methods), 1)
    columns = min(count, 3 if width_in == WIDE_IN else 1)
    lines = -(-count // columns)
    figure = Figure(figsize=(width_in, lines * min(width_in / columns, 4.3)), layout="constrained")
    panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, method in zip(panels, methods, strict=False):
        for number, (group, rows) in enumerate(groups.items()):
            look = {**group_look(number), "label": group_label(results.planned.study, group)}
            profile = profile_of(rows, method)
            positions = [true_m * 1.02**number for true_m in profile]  # side by side
            draw_estimates(axes, look, positions, profile.values())
        axes.axline((1, 1), (2, 2), color="0.3", lw=0.8, zorder=0)
        axes.set(xscale="log", yscale="log")
        axes.set_title(method_title("depths", method))
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        axes.set_aspect("equal")
    limits = panels[0].dataLim.union([axes.dataLim for axes in panels])
    reach = min(limits.min) / 1.2, max(limits.max) * 1.2
    panels[0].set(xlim=reach, ylim=reach)
    for axes in panels[len(methods) :]:
        axes.set_visible(False)
    figure.supxlabel("true depth, m", fontsize="medium")
    figure.supylabel("mean estimated depth, m", fontsize="medium")
    if len(groups) > 1:
        handles, labels = panels[0].get_legend_handles_labels()
        legend_above(figure, handles, labels)
    return figure


def profile_of(rows: list[Row], method: str) -> dict[float, Estimate]:
    """Return the mean estimate by true depth for bins with enough scenes or rounds."""
    result = {}
    for number, true_m in enumerate(CENTRES_M):
        values = [(row, row.profile[method][number]) for row in rows if method in row.profile]
        available = [(row, value) for row, value in values if value is not None]
        estimate = over_units([row for row, _ in available], [value for _, value in available])
        if estimate.units >= MIN_UNITS:
            result[float(true_m)] = estimate
    return result
