"""A study as one HTML page that needs no other file."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from reconstruction.files import write_atomically
from spisim.report.markup import card, details, page, section, table
from spisim.report.study.plots import Plot
from spisim.study.labels import axis_label, condition_label
from spisim.study.metrics import METRICS
from spisim.study.results import Condition, Results
from spisim.study.statistics import FEW_UNITS, Estimate
from spisim.version import __version__

#: Failures that are listed.
MOST_FAILURES = 20

HOW_TO_READ = (
    "Every mark is the mean over all samples of a combination, its bar the 95 % confidence "
    "interval of that mean, by bootstrap: scenes are drawn anew where there are several, rounds "
    "(other seeds) where there is one. Bars that overlap do not mean that nothing differs: the "
    "same scenes and rounds were recorded in every combination, so that the tables of differences, "
    "made sample by sample, are sharper. A difference of at least five scenes or rounds whose "
    "interval excludes zero is bold. No correction is "
    "made for the number of comparisons: of twenty without any effect, one is bold."
)

PROFILE = (
    "Mean estimate over the pixels whose true depth lies in a bin, mean over captures, with the "
    "95 % confidence interval over scenes. On the line, depth is right on average; flatter than "
    "the line, depth maps are flatter than the world. Each bin holds scenes of its own: not all "
    "have something at every depth."
)


def write_report(path: Path, results: Results, plots: Sequence[Plot]) -> None:
    """Write the page: plots, tables, what failed, the plan, and how to read it."""
    plan = results.planned.plan
    body = (
        f"<header><h1>{escape(plan.name)}</h1><p>{escape(plan.description)}</p></header>"
        f"{_cards(results)}{_warnings(results)}"
        f"{section('How to read this', HOW_TO_READ, '')}"
        f"{''.join(_plot(plot) for plot in plots)}"
        f"{_means(results)}{_against_first(results)}{_methods(results)}{_failures(results)}"
        f"{details('The plan', results.planned.text)}"
        f"<footer>spisim {__version__}; results.csv has every sample, summary.csv and "
        "differences.csv what is on this page.</footer>"
    )
    style = files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    write_atomically(path, page(plan.name, body, style).encode())


def _cards(results: Results) -> str:
    rows = results.rows
    good = [row for row in rows if row.metrics]
    scenes = {row.scene_name for row in good}
    rounds = {row.round for row in good}
    cards = (
        card(f"{len(good):,}", "samples", f"{len(rows) - len(good)} failed"),
        card(str(results.planned.plan.combinations), "combinations", "of all grids"),
        card(str(len(scenes)), "scenes", "different ones"),
        card(str(len(rounds)), "rounds", "of other seeds"),
    )
    return f'<div class="cards">{"".join(cards)}</div>'


def _warnings(results: Results) -> str:
    told = []
    units = [s.estimate.units for s in results.summaries.values() if s.estimate.n]
    if units and min(units) < FEW_UNITS:
        told.append(
            f"Some means rest on {min(units)} independent scenes or rounds: their intervals are "
            f"too narrow, or missing. Five are needed, ten are better."
        )
    for name in results.metrics:
        lacking = [
            condition_label(results.planned.study, condition)
            for condition in results.conditions
            if results.summaries[condition, name].estimate.n < results.tried[condition] / 2
        ]
        if lacking:
            told.append(
                f"{METRICS[name].title}: more than half of the samples have none in "
                f"{_some(lacking)}; the means are those of the others."
            )
    items = "".join(f"<li>{escape(text)}</li>" for text in told)
    return f'<ul class="warnings">{items}</ul>' if told else ""


def _plot(plot: Plot) -> str:
    title, text = _told(plot)
    picture = base64.b64encode(plot.svg).decode()
    image = f'<img class="plot" alt="{escape(title)}" src="data:image/svg+xml;base64,{picture}">'
    return section(title, text, image)


def _told(plot: Plot) -> tuple[str, str]:
    """Title and explanation of a plot."""
    if not plot.metrics:
        return "Estimated against true depth", PROFILE
    metric = METRICS[plot.metrics[0]]
    good = {"high": "Higher is better.", "low": "Lower is better.", "near zero": "Zero is best."}
    meaning = f"{metric.meaning[0].upper()}{metric.meaning[1:]}. {good[metric.better]}"
    return metric.quantity[0].upper() + metric.quantity[1:], meaning


def _means(results: Results) -> str:
    study = results.planned.study
    heads = (axis_label(study.x), *map(axis_label, study.groups))
    rows = (
        (
            escape(condition_label(study, condition)),
            *(
                _estimate(results.summaries[condition, name].estimate, bold=False)
                for name in results.metrics
            ),
        )
        for condition in results.conditions
    )
    return section(
        "Means",
        f"Over {' and '.join(heads)}: mean, 95 % interval, number of samples that have a value.",
        table(("", *map(_head, results.metrics)), rows),
    )


def _against_first(results: Results) -> str:
    """Differences from the first combination, where there is another."""
    study = results.planned.study
    found = {
        (each.condition, each.metric): each.estimate
        for each in results.differences
        if each.condition != each.minus_condition
    }
    rows = [
        (
            escape(condition_label(study, condition)),
            *(_estimate(found[condition, name]) for name in results.metrics),
        )
        for condition in results.conditions
        if (condition, results.metrics[0]) in found
    ]
    if not rows:
        return ""
    first = results.conditions[0]
    alone = (None, *first[1:]) if study.x == "scene" else first
    return section(
        f"Less {condition_label(study, alone)}",
        "Mean difference from the first combination, of samples of the same scene and round; 95 % "
        "interval, number of pairs.",
        table(("", *map(_head, results.metrics)), rows),
    )


def _methods(results: Results) -> str:
    """A table in which methods are compared, where several are."""
    pairs: dict[tuple[str, str], dict[Condition, Estimate]] = {}
    for each in results.differences:
        if each.condition == each.minus_condition:
            found = pairs.setdefault((each.metric, each.minus_metric), {})
            found[each.condition] = each.estimate
    if not pairs:
        return ""
    heads = [
        f"{METRICS[one].title}: {METRICS[one].method} less {METRICS[other].method}"
        for one, other in pairs
    ]
    rows = (
        (
            escape(condition_label(results.planned.study, condition)),
            *(_estimate(found[condition]) for found in pairs.values()),
        )
        for condition in results.conditions
    )
    return section(
        "One method less another",
        "Mean difference on the same captures; 95 % interval, number of pairs.",
        table(("", *heads), rows),
    )


def _failures(results: Results) -> str:
    failed = [row for row in results.rows if not row.metrics]
    if not failed:
        return ""
    lines = [f"sample {row.index}: {row.error}" for row in failed[:MOST_FAILURES]]
    if len(failed) > MOST_FAILURES:
        lines.append(f"and {len(failed) - MOST_FAILURES} more, in results.csv")
    return details(f"{len(failed)} samples failed", "\n".join(lines))


def _head(name: str) -> str:
    metric = METRICS[name]
    return f"{metric.title} ({metric.method})" if metric.method else metric.title


def _estimate(estimate: Estimate, *, bold: bool = True) -> str:
    if estimate.mean is None:
        return "–"
    mean = f"{estimate.mean:.3g}"
    if bold and estimate.settled:
        mean = f"<b>{mean}</b>"
    interval = "" if estimate.low is None else f" [{estimate.low:.3g}, {estimate.high:.3g}]"
    return f"{mean}<small>{interval} {estimate.n}</small>"


def _some(names: list[str], most: int = 4) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return "; ".join(names[:most]) + more
