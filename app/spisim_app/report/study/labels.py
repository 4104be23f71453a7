"""Readable names of parameters, combinations and metrics."""

from collections.abc import Sequence
from typing import Any

from reconstruction.evaluation import method_title
from spisim.dataset.study.metrics import Metric
from spisim.dataset.study.plan import Study

#: Suffixes of fields and their units, longer ones first.
UNITS = {
    "_mm_per_h": "mm/h",
    "_g_per_m3": "g/m³",
    "_per_m": "1/m",
    "_deg_s": "°/s",
    "_m_s": "m/s",
    "_klx": "klx",
    "_deg": "°",
    "_mrad": "mrad",
    "_nm": "nm",
    "_mm": "mm",
    "_hz": "Hz",
    "_m": "m",
    "_w": "W",
    "_s": "s",
}


def split_unit(path: str) -> tuple[str, str]:
    """Return name and unit of a field: "scene.fog.visibility_m" is ("fog visibility", "m")."""
    words = path.removeprefix("scene.").removeprefix("instrument.").removeprefix("parameters.")
    unit = ""
    for ending, meant in UNITS.items():
        if words.endswith(ending):
            words, unit = words.removesuffix(ending), meant
            break
    return words.replace(".", " ").replace("_", " "), unit


def axis_label(path: str) -> str:
    """Return the name of a field with its unit."""
    name, unit = split_unit(path)
    return f"{name}, {unit}" if unit else name


def value_label(path: str, value: Any) -> str:
    """Return a value of a field: text as it is, numbers with name and unit."""
    if isinstance(value, str):
        return value
    name, unit = split_unit(path)
    return f"{name} {brief(value)}{f' {unit}' if unit else ''}"


def brief(value: Any) -> str:
    """Format a value briefly."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(brief, value))})"
    return str(value)


def group_label(study: Study, group: Sequence[Any]) -> str:
    """Return the label of a curve: the values of the study's groups, or its reference."""
    return condition_label(study, (None, *group))


def condition_label(study: Study, condition: Sequence[Any]) -> str:
    """Return the label of a combination: curve and value of x."""
    x, *group = condition
    labels = [
        value_label(name, value)
        for name, value in zip(study.groups, group, strict=True)
        if value is not None
    ]
    if x is not None:
        labels.append(value_label(study.x, x))
    return ", ".join(labels) or study.reference


def method_label(name: str) -> str:
    """Return the title of a metric's method."""
    metric = Metric.of(name)
    station, method = metric.quantity.station, metric.method
    return "default" if method is None else method_title(station, method)


def metric_label(name: str) -> str:
    """Return the quantity with its unit, and the method if there is one."""
    metric = Metric.of(name)
    label = metric.quantity.label
    return label if metric.method is None else f"{label} ({method_label(name)})"
