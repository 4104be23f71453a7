"""A study as plots, and as one HTML page that needs no other file."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from reconstruction.base.files import Output, is_marked, write_atomically
from spisim import __version__
from spisim.dataset.study.metrics import Metric
from spisim.dataset.study.plan import PlannedStudy
from spisim.dataset.study.results import SPOTS_LEFT, Condition, Results, Row
from spisim.dataset.study.statistics import FEW_UNITS, Estimate
from spisim_app.report.page import write_page

from .labels import axis_label, condition_label, method_label, metric_label
from .plots import Plot, study_plots
from .profile_plot import NAME, profile_plot

#: Estimates by combination, and by column.
Columns = dict[str, dict[Condition, Estimate]]

#: The kind of file in the marks.
KIND = "study"
#: Listed failures.
MAX_FAILURES = 20
#: Listed warnings of samples.
MAX_WARNINGS = 5


def study_outputs(folder: Path, planned: PlannedStudy) -> list[Output]:
    """Return plots and page that a study writes beside its data set."""
    names = [NAME, SPOTS_LEFT, *(Metric.of(name).kind for name in planned.study.metrics)]
    plots = [folder / "plots" / f"{name}{suffix}" for name in names for suffix in (".png", ".svg")]
    return [Output(path, KIND) for path in (folder / "report.html", *dict.fromkeys(plots))]


def write_study(folder: Path, results: Results) -> tuple[Path, ...]:
    """Write page and plots of a study into its folder; return them, the page first.

    Other plots of an earlier run are removed. Raises OSError if a file cannot be written.
    """
    plots = study_plots(results)
    if results.planned.study.x == "scene":
        plots.append(profile_plot(results))
    pictures = {}
    for plot in plots:
        pictures[folder / "plots" / f"{plot.name}.png"] = plot.png
        pictures[folder / "plots" / f"{plot.name}.svg"] = plot.svg
    for path, content in pictures.items():
        write_atomically(path, content)
    for path in set((folder / "plots").iterdir()) - set(pictures):
        if path.is_file() and is_marked(path, KIND):
            path.unlink()
    write_study_page(folder / "report.html", results, plots)
    return (folder / "report.html", *pictures)


def write_study_page(path: Path, results: Results, plots: Sequence[Plot]) -> None:
    """Write the page: plots, tables, failures, the plan, and an explanation."""
    plan, study = results.planned.plan, results.planned.study
    good = [row for row in results.rows if row.metrics]
    failed = [row for row in results.rows if not row.metrics]
    first = results.conditions[0]
    means = {
        metric_label(name): {c: results.summaries[c, name].estimate for c in results.conditions}
        for name in results.metrics
    }
    differences: Columns = {}
    methods: Columns = {}
    for each in results.differences:
        head, columns = metric_label(each.metric), differences
        if each.condition == each.minus_condition:
            quantity = Metric.of(each.metric).quantity.label
            names = method_label(each.metric), method_label(each.minus_metric)
            head, columns = f"{quantity}: {' minus '.join(names)}", methods
        columns.setdefault(head, {})[each.condition] = each.estimate
    write_page(
        path,
        KIND,
        "study",
        title=plan.name,
        description=plan.description,
        cards=[
            (f"{len(good):,}", "samples", f"{len(failed)} failed"),
            (plan.combinations, "combinations", "of all grids"),
            (len({row.scene_name for row in good}), "scenes", "different ones"),
            (len({row.round for row in good}), "rounds", "of other seeds"),
        ],
        warnings=_warnings(results),
        plots=[(plot.quantity, plot.in_page) for plot in plots],
        parameters=" and ".join(map(axis_label, study.parameters)),
        first=condition_label(study, (None, *first[1:]) if study.x == "scene" else first),
        means=_rows(results, means),
        differences=_rows(results, differences),
        methods=_rows(results, methods),
        failed=len(failed),
        failures=_failures(failed),
        plan=results.planned.text,
        version=__version__,
    )


def _rows(results: Results, columns: Columns) -> tuple[list[str], list[tuple[str, list[Estimate]]]]:
    """Return the column names, and the rows of all combinations by name."""
    return list(columns), [
        (condition_label(results.planned.study, c), [column[c] for column in columns.values()])
        for c in results.conditions
        if columns and all(c in column for column in columns.values())
    ]


def _warnings(results: Results) -> list[str]:
    messages = []
    units = [s.estimate.units for s in results.summaries.values() if s.estimate.n]
    if units and min(units) < FEW_UNITS:
        messages.append(
            f"Some means rest on {min(units)} independent scenes or rounds: their intervals are "
            "wide and hold for normal values alone, or are missing, and plots leave them out. Five "
            "are needed, ten are better."
        )
    for name in results.metrics:
        lacking = [
            condition_label(results.planned.study, condition)
            for condition in results.conditions
            if results.summaries[condition, name].estimate.n < results.tried[condition] / 2
        ]
        if lacking:
            messages.append(
                f"{metric_label(name)}: more than half of the samples have none in "
                f"{_some(lacking)}; the means are those of the others."
            )
    return messages + _of_samples(results.rows)


def _of_samples(rows: Sequence[Row]) -> list[str]:
    """Return the warnings of captures, the most frequent first."""
    counted = Counter(warning for row in rows for warning in row.warnings).most_common()
    lines = [f"{count} of {len(rows)} samples: {each}" for each, count in counted[:MAX_WARNINGS]]
    if len(counted) > MAX_WARNINGS:
        lines.append(f"and {len(counted) - MAX_WARNINGS} other warnings, in results.csv")
    return lines


def _failures(failed: Sequence[Row]) -> list[str]:
    lines = [f"sample {row.index}: {row.error}" for row in failed[:MAX_FAILURES]]
    if len(failed) > MAX_FAILURES:
        lines.append(f"and {len(failed) - MAX_FAILURES} more, in results.csv")
    return lines


def _some(names: list[str], maximum: int = 4) -> str:
    more = f" and {len(names) - maximum} more" if len(names) > maximum else ""
    return "; ".join(names[:maximum]) + more
