"""Fields that configuration files are made of, and the base of their sections."""

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal, Self, Union, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    GetPydanticSchema,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic_core import (
    CoreSchema,
    ErrorDetails,
    InitErrorDetails,
    PydanticCustomError,
)
from pydantic_core.core_schema import ErrorType

from reconstruction.base.errors import nearest
from reconstruction.base.registry import Registry
from spisim.base.config.json_schema import add_descriptions, name_bounds
from spisim.base.config.messages import UNKNOWN_FIELD, show

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


_KINDS = frozenset(get_args(ErrorType))


def _renamed(details: ErrorDetails, names: Iterable[str]) -> InitErrorDetails:
    """An error of a section to be raised again; that of an unknown field names the nearest."""
    kind, loc, context = details["type"], details["loc"], details.get("ctx", {})
    again = InitErrorDetails(type=kind, loc=loc, input=details["input"], ctx=context)
    if kind == "extra_forbidden" and len(loc) == 1:
        field = str(loc[0])
        sentence = f"unknown field {show(field)}: {nearest(field, names)}"
        again["type"] = PydanticCustomError(UNKNOWN_FIELD, "{sentence}", {"sentence": sentence})
        again["loc"] = ()
    elif kind not in _KINDS:
        again["type"] = PydanticCustomError(kind, "{message}", {"message": details["msg"]})
    return again


class Section(BaseModel):
    """Base of every part of a configuration file: no unknown fields, no NaN, immutable.

    The text below a field is its description in the JSON Schema.
    """

    # Built when first used: what other packages add to a file may import what it is part of.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="wrap")
    @classmethod
    def _accepted_fields(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Name the nearest to each unknown field."""
        try:
            return handler(data)
        except ValidationError as error:
            raise ValidationError.from_exception_data(
                cls.__name__,
                [_renamed(each, cls.model_fields) for each in error.errors(include_url=False)],
            ) from None

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        schema = handler(core_schema)
        section = handler.resolve_ref_schema(schema)
        name_bounds(section)
        add_descriptions(section, cls)
        return schema


#: Whether light is traced, or a fast stand-in; see `spisim.simulation.light.surrogate`.
LightSource = Literal["traced", "surrogate"]


def one_of(sections: Registry[Any], field: str) -> GetPydanticSchema:
    """Marks a field as one of several sections, told apart by the value of one of their fields."""

    def union() -> Any:
        return Union[tuple(section for _, section in sections.loadable())]  # noqa: UP007 - as many

    return GetPydanticSchema(
        lambda _, handler: handler.generate_schema(Annotated[union(), Discriminator(field)])
    )


def named(sections: Mapping[str, Any], name: str) -> GetPydanticSchema:
    """Marks a field as the section of this name."""
    return GetPydanticSchema(lambda _, handler: handler.generate_schema(sections[name]))
