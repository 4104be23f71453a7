"""A study: a data set with grids, and what to compare."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.base.errors import InputError, nearest
from spisim.base.config import (
    Count,
    Name,
    Section,
    dump_yaml,
    find_named,
    load_yaml,
    parse_model,
    read_text,
    shipped,
)
from spisim.base.config.distributions import KINDS
from spisim.base.config.messages import show
from spisim.dataset.plan import Plan, is_field
from spisim.dataset.planned import PlannedSet
from spisim.dataset.records import flat
from spisim.dataset.study.metrics import Metric

#: Mappings of `study.quick` that are merged with those of the plan rather than replacing them.
_MERGED = ("vary", "materials", "study")


class Study(Section):
    """What is compared: metrics over the parameter `x`, one curve for each value of `groups`.

    Combinations without `x`, such as clear air among fogs of several visibilities, are drawn as
    horizontal lines; one without `groups` as well is labelled `reference`. All combinations are
    made in each of the `rounds`, which differ in all random values. `quick` holds fields of the
    plan with other values for a small run.
    """

    x: Name
    """Parameter of the x axis: one of the grids, `scene`, or a field of a bundle."""
    groups: tuple[Name, ...] = ()
    """Parameters with one curve for each combination of their values."""
    metrics: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Metrics to compare, see below; `name[method]` is of one method."""
    rounds: Count = 1
    """How often all combinations are made, each time with other random values."""
    x_scale: Literal["linear", "log"] = "linear"
    """Scale of the x axis."""
    reference: Name = "without"
    """Label of a combination with neither `x` nor groups."""
    quick: dict[Name, Any] = Field(default_factory=dict)
    """Fields of the plan with other values for `--quick`; `vary` and `study` are merged."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Study:
        for name in self.metrics:
            Metric.of(name)
        for what, names in (("metrics", self.metrics), ("x and groups", self.parameters)):
            twice = [name for name in names if names.count(name) > 1]
            if twice:
                raise InputError(f"{what}: {twice[0]} is repeated")
        return self

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters that distinguish the combinations."""
        return (self.x, *self.groups)


class StudyPlan(Plan):
    """The plan of a data set with a section `study`."""

    study: Study
    """What is compared."""

    @model_validator(mode="after")
    def _fits(self) -> StudyPlan:
        if not self.axes:
            raise PydanticCustomError(
                "study", "needs a grid to compare: in vary, materials or instrument, or every_scene"
            )
        if self.samples is not None:
            raise PydanticCustomError("study", "samples follow from study.rounds; remove samples")
        if not self.keep.truth:
            raise PydanticCustomError("study", "needs keep.truth for comparison")
        values = list(self._grid_values())
        given = dict.fromkeys(name for each in values for name in each)
        for name in self.study.parameters:
            if any(f"{name}.{kind}" in given for kind in KINDS):
                raise InputError(
                    f"study: {name!r} is random; it should have the same values in all rounds"
                )
            if name not in given:
                raise InputError(f"study: {name!r} is not among the grids: {nearest(name, given)}")
        self._check_distinct(values)
        if self.study.x_scale == "log":
            _check_positive(self.study.x, [each.get(self.study.x) for each in values])
        return self

    def _grid_values(self) -> Iterator[dict[str, Any]]:
        """Yield the fields that the grids set in each combination."""
        for values in product(*self.axes.values()):
            fields: dict[str, Any] = {}
            for name, value in zip(self.axes, values, strict=True):
                together = name in self.vary and not is_field(name)
                fields |= flat(value if together else {name: value})
            yield fields

    def _check_distinct(self, values: list[dict[str, Any]]) -> None:
        seen: dict[str, dict[str, Any]] = {}
        for each in values:
            key = repr((each.get("scene"), *condition_of(each, self.study)))  # may be lists
            if key in seen:
                other = seen[key]
                differing = [n for n in {**other, **each} if other.get(n) != each.get(n)]
                raise PydanticCustomError(
                    "study",
                    "x and groups do not distinguish all combinations; add {names} to groups",
                    {"names": " or ".join(differing) or "another parameter"},
                )
            seen[key] = each


def _check_positive(name: str, values: list[Any]) -> None:
    for value in values:
        if value is not None and not (isinstance(value, int | float) and value > 0):
            raise InputError(
                f"study: x_scale log needs positive numbers; found {value!r} in {name}"
            )


def condition_of(parameters: Mapping[str, Any], study: Study) -> tuple[Any, ...]:
    """Return the values of x and the groups, by which samples are combined; None if missing."""
    return tuple(_hashable(parameters.get(name)) for name in study.parameters)


def _hashable(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return tuple(map(_hashable, value))
    return value


@dataclass(frozen=True)
class PlannedStudy:
    """The plan of a study, its text, and its file."""

    plan: StudyPlan
    text: str
    path: Path

    @property
    def study(self) -> Study:
        """What is compared."""
        return self.plan.study

    @property
    def _fields(self) -> dict[str, Any]:
        fields: dict[str, Any] = load_yaml(self.text, self.path)
        return fields

    @cached_property
    def data_set(self) -> PlannedSet:
        """The data set alone, which does not depend on what is compared."""
        fields = {name: value for name, value in self._fields.items() if name != "study"}
        fields["samples"] = self.plan.combinations * self.study.rounds
        text = dump_yaml(fields)
        return PlannedSet(parse_model(text, Plan, self.path), text, self.path)

    def quick(self) -> PlannedStudy:
        """Return the small version. Raises InputError if the plan has none, or it is invalid."""
        fields = self._fields
        changes = fields["study"].pop("quick", None)
        if not changes:
            raise InputError(f"{self.path}: study.quick is missing; it says what --quick changes")
        for name in _MERGED:
            if name in changes:
                if not isinstance(changes[name], dict):
                    raise InputError(
                        f"{self.path}: study.quick.{name}: should be a mapping of fields; "
                        f"found {show(changes[name])}"
                    )
                changes[name] = {**fields.get(name, {}), **changes[name]}
        if "spp" in changes:
            fields.pop("transport_noise_share", None)
        if "transport_noise_share" in changes:
            fields.pop("spp", None)
        text = dump_yaml({**fields, **changes})
        plan = parse_model(text, StudyPlan, f"{self.path}, study.quick")
        return replace(self, plan=plan, text=text)

    @cached_property
    def conditions(self) -> list[tuple[Any, ...]]:
        """All compared values of x and groups, in the order of the grids."""
        samples = (self.data_set.sample(index) for index in range(self.plan.combinations))
        return list(
            dict.fromkeys(condition_of(dict(flat(s.parameters)), self.study) for s in samples)
        )


def load_study(name: str | Path) -> PlannedStudy:
    """Read a study.

    Parameters
    ----------
    name
        A YAML file, or the name of a shipped study such as "fog-and-rain".

    Raises
    ------
    InputError
        For an invalid study, naming file and field.
    """
    path = find_named(str(name), shipped("studies"), "study")
    text = read_text(path)
    return PlannedStudy(parse_model(text, StudyPlan, path), text, path.absolute())
