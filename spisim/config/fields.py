"""Fields that configuration files are made of, and the base of their sections."""

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError

from reconstruction.errors import nearest
from spisim.config.json_schema import add_descriptions, name_bounds
from spisim.config.messages import show

#: Whatever has a unit here lies far between.
SMALLEST, LARGEST = 1e-18, 1e30


def not_a_truth_value(value: Any) -> Any:
    """YAML reads `yes` and `on` as true, which would silently become the number 1."""
    if isinstance(value, bool):
        raise PydanticCustomError("truth_value", "should be a number")
    return value


def of_usable_size(value: Any) -> Any:
    """What calculates with a number squares it and divides by it: next to nothing is nothing."""
    not_a_truth_value(value)
    size = 0.0
    with suppress(TypeError, ValueError, OverflowError):
        size = abs(float(value))
    if math.isfinite(size) and size > LARGEST:
        raise PydanticCustomError(
            "size", "should be within ±{largest}", {"largest": f"{LARGEST:g}"}
        )
    return 0.0 if 0 < size < SMALLEST else value


Number = Annotated[float, BeforeValidator(of_usable_size)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Fraction = Annotated[Number, Field(ge=0, le=1)]
Count = Annotated[int, BeforeValidator(not_a_truth_value), Field(gt=0)]
Vector = tuple[Number, Number, Number]
Name = Annotated[str, Field(min_length=1, max_length=1000)]


class Section(BaseModel):
    """Base of every part of a configuration file: no unknown fields, no NaN, immutable.

    The text below a field is its description in the JSON Schema.
    """

    # Built when first used: what other packages add to a file may import what it is part of.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _known_fields(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            for field in data:
                if field not in cls.model_fields:
                    raise PydanticCustomError(
                        "unknown_field",
                        "unknown field {field}: {nearest}",
                        {"field": show(field), "nearest": nearest(str(field), cls.model_fields)},
                    )
        return data

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        schema = handler(core_schema)
        section = handler.resolve_ref_schema(schema)
        name_bounds(section)
        add_descriptions(section, cls)
        return schema


#: Whether light is traced, or a fast stand-in; see `spisim.transport.surrogate`.
LightSource = Literal["traced", "surrogate"]
