"""Values that a plan leaves open, and what each sample makes of them."""

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
    """Every one of several values, together with all those of other grids."""

    grid: Annotated[tuple[Any, ...], Field(min_length=1)]
    """All the values; the samples run through them."""


def openable(value: Any) -> Any:
    """What a field of a plan may be: a grid, or as in `open_value`, also within a grid."""
    if not _is_grid(value):
        return open_value(value)
    grid = _checked(TypeAdapter(Grid), value)
    for choice in grid.grid:
        open_value(choice)
    return grid


def open_value(value: Any) -> Any:
    """A value as it stands, once whatever is a distribution in it has proved to be a sound one.

    Raises PydanticCustomError where it is none, or where there is a grid in it.
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
    """Every value of a grid or choice; the value itself where it is neither."""
    if isinstance(value, Grid):
        return [choice for one in value.grid for choice in possible(one)]
    if isinstance(value, Mapping) and "choice" in value:
        return list(value["choice"])
    return [value]


def drawn_value(value: Any, seed: int, *keys: str | int) -> Any:
    """What a sample gets: distributions drawn, also within lists and mappings, the rest as it is.

    Each distribution has a random stream of its own, named by `keys` and its place in the value.
    """
    if is_distribution(value):
        drawn = _DISTRIBUTION.validate_python(value).draw(stream(seed, *keys))
        # A choice stands in the plan, which no sample may change, and may be open itself.
        return drawn_value(copy.deepcopy(drawn), seed, *keys, "choice")
    if isinstance(value, Mapping):
        return {name: drawn_value(part, seed, *keys, str(name)) for name, part in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [drawn_value(part, seed, *keys, i) for i, part in enumerate(value)]
    return value


def set_field(fields: dict[str, Any], path: str, value: Any) -> None:
    """Set a field of a configuration file, in place; `path` as in "fog.visibility_m".

    Sections on the way are made where they are missing or null. Raises InputError if the path goes
    through something that has no fields.
    """
    *sections, last = path.split(".")
    position = fields
    for section in sections:
        position = section_of(position, section, path)
    position[last] = value


def section_of(fields: dict[str, Any], name: str, path: str) -> dict[str, Any]:
    """A section of a configuration file, made where it is missing or null.

    Raises InputError, naming the `path` of what is to be set, where it is no section.
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
        details = error.errors(include_url=False)[-1]  # of whole numbers or any: the latter
        raise PydanticCustomError(
            "open_value",
            "{reason}; found {value}",
            {"reason": reason(details), "value": show(value)},
        ) from None
