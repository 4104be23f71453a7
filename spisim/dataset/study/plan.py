"""A study: a data set with grids, and what is to be seen of them."""

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

#: Fields of a quick setting that add to those of the full one instead of replacing them.
_MERGED = ("vary", "materials", "study")


class Study(Section):
    """What is compared: metrics over the parameter `x`, one curve for each value of `groups`.

    Combinations without `x`, such as clear air among fogs of several visibilities, are drawn as
    lines across; one without any value of `groups` either is called by the name `reference`.
    All combinations are made in each of so many `rounds`, which differ in all that is random.
    `quick` has fields of the plan, with other values for a small run.
    """

    x: Name
    """Parameter along the axis: one of the grids, `scene`, or a field of a bundle."""
    groups: tuple[Name, ...] = ()
    """Parameters of which each combination of values has a curve."""
    metrics: Annotated[tuple[Name, ...], Field(min_length=1)]
    """What is compared, see below; `name[method]` is of one method."""
    rounds: Count = 1
    """How often all combinations are made, each time with other random values."""
    x_scale: Literal["linear", "log"] = "linear"
    """Of the axis."""
    reference: Name = "without"
    """What a combination is called that has neither `x` nor groups."""
    quick: dict[Name, Any] = Field(default_factory=dict)
    """Fields of the plan with other values, for `--quick`; of `vary` and `study` one by one."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Study:
        for name in self.metrics:
            Metric.of(name)
        for what, names in (("metrics", self.metrics), ("x and groups", self.parameters)):
            twice = [name for name in names if names.count(name) > 1]
            if twice:
                raise InputError(f"{what}: {twice[0]} is given twice")
        return self

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters that tell the combinations apart."""
        return (self.x, *self.groups)


class StudyPlan(Plan):
    """The plan of a data set with a section `study`."""

    study: Study
    """What is asked."""

    @model_validator(mode="after")
    def _fits(self) -> StudyPlan:
        if not self.axes:
            raise PydanticCustomError(
                "study",
                "needs a grid to compare: in vary or materials, of instruments, or every_scene",
            )
        if self.samples is not None:
            raise PydanticCustomError("study", "samples follow from study.rounds; leave them out")
        if not self.keep.truth:
            raise PydanticCustomError("study", "needs keep.truth, to which it compares")
        values = list(self._grid_values())
        given = dict.fromkeys(name for each in values for name in each)
        for name in self.study.parameters:
            if any(f"{name}.{kind}" in given for kind in KINDS):
                raise InputError(
                    f"study: {name!r} is drawn; it needs the same values in all rounds"
                )
            if name not in given:
                raise InputError(f"study: {name!r} is not among the grids: {nearest(name, given)}")
        self._check_distinct(values)
        if self.study.x_scale == "log":
            _check_positive(self.study.x, [each.get(self.study.x) for each in values])
        return self

    def _grid_values(self) -> Iterator[dict[str, Any]]:
        """What the grids set in each combination, by field."""
        for values in product(*self.axes.values()):
            reported: dict[str, Any] = {}
            for name, value in zip(self.axes, values, strict=True):
                together = name in self.vary and not is_field(name)
                reported |= flat(value if together else {name: value})
            yield reported

    def _check_distinct(self, values: list[dict[str, Any]]) -> None:
        seen: dict[str, dict[str, Any]] = {}
        for each in values:
            key = repr((each.get("scene"), *condition_of(each, self.study)))  # may be lists
            if key in seen:
                other = seen[key]
                differing = [n for n in {**other, **each} if other.get(n) != each.get(n)]
                raise PydanticCustomError(
                    "study",
                    "study: x and groups do not tell all combinations apart; add {names} to groups",
                    {"names": " or ".join(differing) or "another parameter"},
                )
            seen[key] = each


def _check_positive(name: str, values: list[Any]) -> None:
    for value in values:
        if value is not None and not (isinstance(value, int | float) and value > 0):
            raise InputError(f"study: x_scale log needs positive numbers; {name} has {value!r}")


def condition_of(parameters: Mapping[str, Any], study: Study) -> tuple[Any, ...]:
    """Values of x and the groups, by which samples are put together; None for what is not there."""
    return tuple(_hashable(parameters.get(name)) for name in study.parameters)


def _hashable(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return tuple(map(_hashable, value))
    return value


@dataclass(frozen=True)
class PlannedStudy:
    """A study's plan, its text, and the file it stands in."""

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
        """The data set alone: what is compared may change without making it anew."""
        fields = {name: value for name, value in self._fields.items() if name != "study"}
        fields["samples"] = self.plan.combinations * self.study.rounds
        text = dump_yaml(fields)
        return PlannedSet(parse_model(text, Plan, self.path), text, self.path)

    def quick(self) -> PlannedStudy:
        """The small setting; InputError where the plan has none, or one that does not fit."""
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
        """All values of x and groups that are compared, in the order of the grids."""
        samples = (self.data_set.sample(index) for index in range(self.plan.combinations))
        return list(
            dict.fromkeys(condition_of(dict(flat(s.parameters)), self.study) for s in samples)
        )


def load_study(name: str | Path) -> PlannedStudy:
    """Study from a YAML file, or a shipped one by its name ("fog-and-rain").

    Raises InputError, naming file and field, for whatever is wrong with it.
    """
    path = find_named(str(name), shipped("studies"), "study")
    text = read_text(path)
    return PlannedStudy(parse_model(text, StudyPlan, path), text, path.absolute())
