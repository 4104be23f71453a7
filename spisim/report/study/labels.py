"""Names of parameters, combinations and metrics as people read them."""

from collections.abc import Sequence
from typing import Any

from reconstruction.evaluation import method_title
from spisim.dataset.study.metrics import Metric
from spisim.dataset.study.plan import Study

#: Endings of fields and the units that they mean, longer ones first.
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
    """Name and unit of a field: "scene.fog.visibility_m" is ("fog visibility", "m")."""
    words = path.removeprefix("scene.").removeprefix("instrument.").removeprefix("parameters.")
    unit = ""
    for ending, meant in UNITS.items():
        if words.endswith(ending):
            words, unit = words.removesuffix(ending), meant
            break
    return words.replace(".", " ").replace("_", " "), unit


def axis_label(path: str) -> str:
    """Name of a field with its unit."""
    name, unit = split_unit(path)
    return f"{name}, {unit}" if unit else name


def value_label(path: str, value: Any) -> str:
    """A value of a field: words as they are, numbers with name and unit."""
    if isinstance(value, str):
        return value
    name, unit = split_unit(path)
    return f"{name} {brief(value)}{f' {unit}' if unit else ''}"


def brief(value: Any) -> str:
    """A value in few characters."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(brief, value))})"
    return str(value)


def group_label(study: Study, group: Sequence[Any]) -> str:
    """Name of a curve: the values of the study's groups; its reference where there are none."""
    return condition_label(study, (None, *group))


def condition_label(study: Study, condition: Sequence[Any]) -> str:
    """Name of a combination: curve and value of x."""
    x, *group = condition
    reported = [
        value_label(name, value)
        for name, value in zip(study.groups, group, strict=True)
        if value is not None
    ]
    if x is not None:
        reported.append(value_label(study.x, x))
    return ", ".join(reported) or study.reference


def method_label(name: str) -> str:
    """Of a metric by its name: what the method is called."""
    metric = Metric.of(name)
    station, method = metric.quantity.station, metric.method
    return "default" if method is None else method_title(station, method)


def metric_label(name: str) -> str:
    """Quantity with its unit, and the method where one is named."""
    metric = Metric.of(name)
    label = metric.quantity.label
    return label if metric.method is None else f"{label} ({method_label(name)})"
