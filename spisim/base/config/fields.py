"""Field types of configuration files, and the base class of their sections."""

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
from pydantic_core import CoreSchema, ErrorDetails, InitErrorDetails, PydanticCustomError
from pydantic_core.core_schema import ErrorType

from reconstruction.base.errors import nearest
from reconstruction.base.registry import Registry
from spisim.base.config.json_schema import add_descriptions, name_bounds
from spisim.base.config.messages import UNKNOWN_FIELD, show

#: Every physical quantity lies well within these magnitudes.
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-18, 1e30


def not_a_truth_value(value: Any) -> Any:
    """Reject booleans: YAML reads `yes` and `on` as true, which would become the number 1."""
    if isinstance(value, bool):
        raise PydanticCustomError("truth_value", "should be a number")
    return value


def of_usable_size(value: Any) -> Any:
    """Reject huge numbers and round tiny ones to 0, so that squares and quotients stay finite."""
    not_a_truth_value(value)
    size = 0.0
    with suppress(TypeError, ValueError, OverflowError):
        size = abs(float(value))
    if math.isfinite(size) and size > MAX_MAGNITUDE:
        raise PydanticCustomError(
            "size", "should be within ±{largest}", {"largest": f"{MAX_MAGNITUDE:g}"}
        )
    return 0.0 if 0 < size < MIN_MAGNITUDE else value


Number = Annotated[float, BeforeValidator(of_usable_size)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Fraction = Annotated[Number, Field(ge=0, le=1)]
Count = Annotated[int, BeforeValidator(not_a_truth_value), Field(gt=0)]
Vector = tuple[Number, Number, Number]
Name = Annotated[str, Field(min_length=1, max_length=1000)]


_KINDS = frozenset(get_args(ErrorType))


def _renamed(details: ErrorDetails, names: Iterable[str]) -> InitErrorDetails:
    """The error of a section, to raise again; for an unknown field with the nearest name."""
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
    """Base of every section of a configuration file: no unknown fields, no NaN, immutable.

    The string below a field is its description in the JSON Schema.
    """

    # Built on first use: a package that extends a section may import the module that uses it.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @model_validator(mode="wrap")
    @classmethod
    def _accepted_fields(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Suggest the nearest name for each unknown field."""
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


#: Light transport: traced, or the fast model of `spisim.simulation.light.surrogate`.
LightSource = Literal["traced", "surrogate"]


def one_of(sections: Registry[Any], field: str) -> GetPydanticSchema:
    """Mark a field as one of several registered sections, discriminated by one of their fields.

    The sections load when the first file is read, so a package that registers one may import the
    module of the field.
    """

    def union() -> Any:
        return Union[tuple(section for _, section in sections.loadable())]  # noqa: UP007 - as many

    return GetPydanticSchema(
        lambda _, handler: handler.generate_schema(Annotated[union(), Discriminator(field)])
    )


def named(sections: Mapping[str, Any], name: str) -> GetPydanticSchema:
    """Mark a field as the registered section of this name, loaded when the first file is read."""
    return GetPydanticSchema(lambda _, handler: handler.generate_schema(sections[name]))
