"""Distributions and grids in a plan, and the value that each sample draws from them."""

import copy
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from reconstruction.base.errors import InputError
from spisim.base.config import Section, reason
from spisim.base.config.distributions import Distribution, is_distribution, stream
from spisim.base.config.messages import show

_DISTRIBUTION: TypeAdapter[Any] = TypeAdapter(Distribution)


class Grid(Section):
    """Several values, each combined with all values of other grids."""

    grid: Annotated[tuple[Any, ...], Field(min_length=1)]
    """The values; samples run through all of them."""


_GRID: TypeAdapter[Grid] = TypeAdapter(Grid)


def openable(value: Any) -> Any:
    """Validate a field that may be a grid, or whatever `open_value` allows, also within a grid."""
    if not _is_grid(value):
        return open_value(value)
    grid = _checked(_GRID, value)
    for choice in grid.grid:
        open_value(choice)
    return grid


def open_value(value: Any) -> Any:
    """Validate all distributions within a value and return it unchanged.

    Raises PydanticCustomError for an invalid distribution or a nested grid.
    """
    if _is_grid(value):
        raise PydanticCustomError("grid", "a grid can only stand for a whole field of vary")
    if is_distribution(value):
        for choice in getattr(_checked(_DISTRIBUTION, value), "choice", ()):
            open_value(choice)
    elif isinstance(value, Mapping):
        for part in value.values():
            open_value(part)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for part in value:
            open_value(part)
    return value


def possible(value: Any) -> Sequence[Any]:
    """Return all values of a grid or choice, or the value itself."""
    if isinstance(value, Grid):
        return [choice for one in value.grid for choice in possible(one)]
    if isinstance(value, Mapping) and "choice" in value:
        return list(value["choice"])
    return [value]


def has_integer_bounds(value: Any) -> bool:
    """Whether a value holds `{uniform: [-3, 3]}`, which drew integers before `integer` was asked.

    Real numbers are drawn now, so samples of both do not belong together.
    """
    if is_distribution(value) and "uniform" in value:
        bounds = value["uniform"]
        return not value.get("integer") and all(isinstance(bound, int) for bound in bounds)
    if isinstance(value, Mapping):
        return any(map(has_integer_bounds, value.values()))
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    return is_list and any(map(has_integer_bounds, value))


def drawn_value(value: Any, seed: int, *keys: str | int) -> Any:
    """Draw all distributions within a value; everything else stays as it is.

    Each distribution has its own random stream, named by `keys` and its position in the value.
    """
    if is_distribution(value):
        drawn = _DISTRIBUTION.validate_python(value).draw(stream(seed, *keys))
        # A chosen value belongs to the plan, so it is copied; it may contain distributions itself.
        return drawn_value(copy.deepcopy(drawn), seed, *keys, "choice")
    if isinstance(value, Mapping):
        return {name: drawn_value(part, seed, *keys, str(name)) for name, part in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [drawn_value(part, seed, *keys, i) for i, part in enumerate(value)]
    return value


def set_field(fields: dict[str, Any], path: str, value: Any) -> None:
    """Set a field of a configuration in place; `path` is dotted as in "fog.visibility_m".

    Missing or null sections on the way are created. Raises InputError if the path runs through a
    value without fields.
    """
    *sections, last = path.split(".")
    for section in sections:
        fields = section_of(fields, section, path)
    fields[last] = value


def section_of(fields: dict[str, Any], name: str, path: str) -> dict[str, Any]:
    """Return a section of a configuration, created if it is missing or null.

    Raises InputError, naming the `path` to set, if it is not a section.
    """
    if fields.get(name) is None:
        fields[name] = {}
    section = fields[name]
    if not isinstance(section, dict):
        raise InputError(f"{path}: {name} has no fields; it is {show(section)}")
    return section


def _is_grid(value: Any) -> bool:
    return isinstance(value, Mapping) and "grid" in value


def _checked(kind: TypeAdapter[Any], value: Any) -> Any:
    try:
        return kind.validate_python(value)
    except ValidationError as error:
        details = error.errors(include_url=False)[-1]  # of a union, the more general member
        raise PydanticCustomError(
            "open_value",
            "{reason}; found {value}",
            {"reason": reason(details), "value": show(value)},
        ) from None
