"""Tables of a study: one row per sample, per combination, and per comparison."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reconstruction.base.display import drawing, figure, html_summary, panels, text_summary
from reconstruction.base.files import Output
from spisim.base.config.files import csv_table
from spisim.dataset.records import Record
from spisim.dataset.study.evaluation import Evaluation
from spisim.dataset.study.metrics import Metric, Profile
from spisim.dataset.study.plan import PlannedStudy, Study, condition_of
from spisim.dataset.study.statistics import FEW_UNITS, Estimate, estimate

Condition = tuple[Any, ...]

ALL_SCENES = "all scenes"
SPOTS_LEFT, SPOTS_LOST = "valid_spots", "lost_spots"
#: Metrics that a notebook displays.
DISPLAYED = 3


@dataclass(frozen=True)
class Row:
    """One sample: its parameters, and its metrics unless it failed."""

    index: int
    round: int
    scene_name: str
    parameters: Mapping[str, Any]
    metrics: Mapping[str, float | None]
    profile: Profile
    warnings: Sequence[str]
    error: str | None


@dataclass(frozen=True)
class Summary:
    """A metric averaged over all samples of a combination."""

    condition: Condition
    metric: str
    estimate: Estimate


@dataclass(frozen=True)
class Difference:
    """A metric of a combination minus that of the first, or minus that of another method.

    Samples of the same round and scene are paired: all their random values are equal, except for
    the noise of light transport and detection.
    """

    condition: Condition
    metric: str
    minus_condition: Condition
    minus_metric: str
    estimate: Estimate


@dataclass(frozen=True)
class Results:
    """All tables of a study.

    `metrics` are the requested ones, and the number of remaining spots if spots are lost. `tried`
    maps each condition (values of x and groups in the grids' order) to its number of samples. If x
    is the scene, ALL_SCENES follow.
    """

    planned: PlannedStudy
    metrics: tuple[str, ...]
    rows: Sequence[Row]
    tried: Mapping[Condition, int]
    summaries: Mapping[tuple[Condition, str], Summary]
    differences: Sequence[Difference]

    def _repr_html_(self) -> str:
        pictures = [self._means(name) for name in self.metrics[:DISPLAYED]]
        return html_summary(self._title, self._facts, pictures)

    def __repr__(self) -> str:
        return text_summary(self._title, self._facts)

    @property
    def _title(self) -> str:
        return f"Study {self.planned.plan.name}"

    @property
    def _facts(self) -> dict[str, Any]:
        x = self.planned.plan.study.x
        return {"samples": len(self.rows), "combinations": len(self.tried), "x": x}

    def plot(self) -> Any:
        """Plot the mean of each metric and its interval over x, one line per group.

        Returns Matplotlib's axes (metrics,); InputError if it is not installed.
        """
        study = self.planned.study
        axes = panels(len(self.metrics))
        for axis, name in zip(axes, self.metrics, strict=True):
            for group in self.groups():
                points = [
                    (each[0], estimate)
                    for each in self.conditions
                    if each[1:] == group
                    and (estimate := self.summaries[each, name].estimate).mean is not None
                ]
                values, estimates = [value for value, _ in points], [each for _, each in points]
                label = ", ".join(map(str, group)) or None
                axis.plot(values, [each.mean for each in estimates], "o-", label=label)
                sure = [(value, each) for value, each in points if each.low is not None]
                axis.vlines(
                    [value for value, _ in sure],
                    [each.low for _, each in sure],
                    [each.high for _, each in sure],
                )
            axis.set(title=name, xlabel=study.x)
            if study.x_scale == "log":
                axis.set_xscale("log")
            if study.groups:
                axis.legend(title=", ".join(study.groups))
        return axes

    def _means(self, name: str) -> str:
        """Draw the means with their intervals, one combination beside the other."""
        estimates = [self.summaries[condition, name].estimate for condition in self.conditions]
        available = [(at, each) for at, each in enumerate(estimates) if each.mean is not None]
        sure = [each for _, each in available if each.units >= FEW_UNITS]
        ends = [end for each in sure for end in (each.low, each.high) if end is not None]
        values = [*ends, *(each.mean for _, each in available if each.mean is not None)] or [0.0]
        low, span = min(values), (max(values) - min(values)) or 1.0

        def y(value: float) -> str:
            return f"{(value - low) / span * len(estimates):.5g}"

        drawn = []
        for at, each in available:
            assert each.mean is not None
            drawn.append(
                f'<circle cx="{at + 0.5}" cy="{y(each.mean)}" r="{len(estimates) / 60:.4g}" '
                'fill="currentColor" stroke="none"/>'
            )
            if each in sure and each.low is not None and each.high is not None:
                drawn.append(
                    f'<path d="M {at + 0.5} {y(each.low)} V {y(each.high)}" '
                    'vector-effect="non-scaling-stroke"/>'
                )
        edge = len(estimates) / 40
        svg = drawing(drawn, (-edge, -edge), (len(estimates) + edge, len(estimates) + edge))
        return figure(svg, f"{name}, {low:.3g} to {low + span:.3g}, by combination")

    @property
    def conditions(self) -> list[Condition]:
        """All compared combinations."""
        return list(self.tried)

    def groups(self) -> dict[Condition, list[Row]]:
        """Return all rows with metrics by the values of the study's groups."""
        result: dict[Condition, list[Row]] = {condition[1:]: [] for condition in self.conditions}
        for row in self.rows:
            if row.metrics:
                result[condition_of(row.parameters, self.planned.study)[1:]].append(row)
        return result


def results_of(
    planned: PlannedStudy, records: Iterable[Record], evaluations: Mapping[int, Evaluation]
) -> Results:
    """Combine the samples of a study; `records` are all attempted ones."""
    combinations = planned.plan.combinations
    rows = [_row(record, evaluations, combinations) for record in records]
    rows.sort(key=lambda row: row.index)
    by_condition: dict[Condition, list[Row]] = {each: [] for each in planned.conditions}
    for row in rows:
        condition = condition_of(row.parameters, planned.study)
        if condition in by_condition:  # a sample that killed its worker has no parameters
            by_condition[condition].append(row)
    if planned.study.x == "scene":
        for (_, *group), chosen in list(by_condition.items()):
            by_condition.setdefault((ALL_SCENES, *group), []).extend(chosen)
    metrics = (*planned.study.metrics, *_spots_left(planned.study.metrics, rows))
    tried = {condition: len(chosen) for condition, chosen in by_condition.items()}
    summaries = {
        (condition, name): Summary(condition, name, _estimate(chosen, name))
        for condition, chosen in by_condition.items()
        for name in metrics
    }
    differences = _differences(planned, metrics, by_condition)
    return Results(planned, metrics, rows, tried, summaries, differences)


def _spots_left(metrics: Sequence[str], rows: Sequence[Row]) -> list[str]:
    """Return the count of valid spots, by the methods of spot metrics, if some spots are lost.

    The other metrics improve when difficult spots drop out.
    """
    of_spots = [Metric.of(name) for name in metrics if Metric.of(name).quantity.station == "spots"]
    methods = dict.fromkeys(
        "" if metric.method is None else f"[{metric.method}]" for metric in of_spots
    )
    return [
        SPOTS_LEFT + method
        for method in methods
        if SPOTS_LEFT + method not in metrics
        and any(row.metrics.get(SPOTS_LOST + method) for row in rows)
    ]


def _row(record: Record, evaluations: Mapping[int, Evaluation], combinations: int) -> Row:
    evaluation = evaluations.get(record.index, Evaluation({}, error=record.error))
    return Row(
        record.index,
        record.index // combinations,
        record.scene or "",
        record.parameters,
        evaluation.metrics,
        evaluation.profile,
        record.warnings,
        evaluation.error,
    )


def _estimate(rows: Iterable[Row], name: str) -> Estimate:
    available = [(row, value) for row in rows if (value := row.metrics.get(name)) is not None]
    return over_units([row for row, _ in available], [value for _, value in available])


def over_units(rows: Sequence[Row], values: Sequence[float]) -> Estimate:
    """Estimate a mean; scenes are the independent units, or rounds if there is a single scene."""
    scenes = [row.scene_name for row in rows]
    several = len(set(scenes)) > 1
    return estimate(values, scenes if several else [row.round for row in rows])


def _differences(
    planned: PlannedStudy, metrics: Sequence[str], by_condition: Mapping[Condition, Sequence[Row]]
) -> list[Difference]:
    made = []
    first = planned.conditions[0]
    for condition, rows in by_condition.items():
        for name in metrics:
            if condition != (base := _base(condition, first, planned.study)):
                estimated = _paired(rows, name, by_condition[base], name)
                made.append(Difference(condition, name, base, name, estimated))
            for other in _other_methods(name, metrics):
                estimated = _paired(rows, name, rows, other)
                made.append(Difference(condition, name, condition, other, estimated))
    return made


def _base(condition: Condition, first: Condition, study: Study) -> Condition:
    """Return the reference of a combination: the first; of its own scene if x is the scene."""
    return (condition[0], *first[1:]) if study.x == "scene" else first


def _other_methods(name: str, metrics: Sequence[str]) -> list[str]:
    """Return later metrics of the same quantity by another method."""
    following = metrics[metrics.index(name) + 1 :]
    return [other for other in following if Metric.of(other).kind == Metric.of(name).kind]


def _paired(rows: Sequence[Row], name: str, others: Sequence[Row], other_name: str) -> Estimate:
    partners = {(row.round, row.scene_name): row.metrics.get(other_name) for row in others}
    paired, values = [], []
    for row in rows:
        value, other = row.metrics.get(name), partners.get((row.round, row.scene_name))
        if value is not None and other is not None:
            paired.append(row)
            values.append(value - other)
    return over_units(paired, values)


def tables(folder: Path, results: Results) -> dict[Path, str]:
    """Return the text of all tables by their files in the folder of a study."""
    texts = (results_csv(results), summary_csv(results), differences_csv(results))
    return dict(zip((output.path for output in table_outputs(folder)), texts, strict=True))


def table_outputs(folder: Path) -> list[Output]:
    """Return the tables in the folder of a study, recognized by their columns."""
    ends = f"metric,{','.join(ESTIMATE)}"
    signs = {
        "results.csv": "index,round,scene_name,",
        "summary.csv": ends,
        "differences.csv": f"minus_{ends}",
    }
    return [Output(folder / name, "study", sign=sign) for name, sign in signs.items()]


def results_csv(results: Results) -> str:
    """One row per sample: index, round, scene, parameters, all metrics, warnings, error."""
    parameters = dict.fromkeys(name for row in results.rows for name in row.parameters)
    metrics = dict.fromkeys(name for row in results.rows for name in row.metrics)
    head = ("index", "round", "scene_name", *parameters, *metrics, "warnings", "error")
    return _csv(
        head,
        (
            (
                row.index,
                row.round,
                row.scene_name,
                *(row.parameters.get(name) for name in parameters),
                *(row.metrics.get(name) for name in metrics),
                " | ".join(row.warnings),
                row.error,
            )
            for row in results.rows
        ),
    )


ESTIMATE: Mapping[str, Callable[[Estimate], float | None]] = {
    "mean": lambda e: e.mean,
    "low": lambda e: e.low,
    "high": lambda e: e.high,
    "median": lambda e: e.median,
    "n": lambda e: e.n,
    "units": lambda e: e.units,
}


def summary_csv(results: Results) -> str:
    """One row per combination and metric."""
    head = (*results.planned.study.parameters, "metric", *ESTIMATE)
    return _csv(
        head,
        (
            (*each.condition, each.metric, *(read(each.estimate) for read in ESTIMATE.values()))
            for each in results.summaries.values()
        ),
    )


def differences_csv(results: Results) -> str:
    """One row per comparison; the columns minus_… identify what was subtracted."""
    names = results.planned.study.parameters
    minus = [f"minus_{name}" for name in names]
    head = (*names, "metric", *minus, "minus_metric", *ESTIMATE)
    return _csv(
        head,
        (
            (
                *each.condition,
                each.metric,
                *each.minus_condition,
                each.minus_metric,
                *(read(each.estimate) for read in ESTIMATE.values()),
            )
            for each in results.differences
        ),
    )


def _csv(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    return csv_table([head, *([_cell(value) for value in row] for row in rows)])


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, list | tuple | dict) else value
