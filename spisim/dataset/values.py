"""Values that a plan leaves open, and what each sample makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from reconstruction.errors import InputError
from spisim.config import Section
from spisim.distributions import Distribution, is_distribution, stream

_DISTRIBUTION: TypeAdapter[Any] = TypeAdapter(Distribution)


class Grid(Section):
    """Every one of several values, together with all those of other grids."""

    grid: Annotated[tuple[Any, ...], Field(min_length=1)]


def is_grid(value: Any) -> bool:
    """Whether a value of a plan is a grid."""
    return isinstance(value, Mapping) and "grid" in value


def drawn_value(value: Any, seed: int, *keys: str | int) -> Any:
    """What a sample gets: distributions drawn, also within lists and mappings, the rest as it is.

    Each distribution has a random stream of its own, named by `keys` and its place in the value.
    Raises InputError for a distribution that is none.
    """
    if is_distribution(value):
        return _distribution(value, keys).draw(stream(seed, *keys))
    if isinstance(value, Mapping):
        return {name: drawn_value(part, seed, *keys, str(name)) for name, part in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [drawn_value(part, seed, *keys, i) for i, part in enumerate(value)]
    return value


def _distribution(value: Mapping[str, Any], keys: Sequence[str | int]) -> Any:
    try:
        return _DISTRIBUTION.validate_python(value)
    except ValidationError as error:
        reason = error.errors(include_url=False)[0]["msg"]
        raise InputError(f"{keys[0]}: {reason}; found {dict(value)}") from None


def set_field(fields: dict[str, Any], path: str, value: Any) -> None:
    """Set a field of a configuration file, in place; `path` as in "fog.visibility_m".

    Sections on the way are made where they are missing or null. Raises InputError if the path goes
    through something that has no fields.
    """
    *sections, last = path.split(".")
    place = fields
    for section in sections:
        if place.get(section) is None:
            place[section] = {}
        place = place[section]
        if not isinstance(place, dict):
            raise InputError(f"{path}: {section} has no fields; it is {place!r}")
    place[last] = value
