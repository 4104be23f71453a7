"""Parameters of a family of scenes, each with the distribution that it is drawn from."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import Field, TypeAdapter, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.base.errors import nearest
from spisim.base.config import Section, check_fields
from spisim.base.config.distributions import Choice, Distribution, LogUniform, Uniform, stream

_DISTRIBUTION: TypeAdapter[Distribution] = TypeAdapter(Distribution)


class Parameters(Section):
    """Base of a family's parameters; make fields with `drawn`, `drawn_log` and `one_of`."""

    @model_validator(mode="before")
    @classmethod
    def _accepted_words(cls, data: Any) -> Any:
        for name, distribution in ranges(cls).items():
            given = distribution.get("choice", ())
            if given and name in data and data[name] not in given:
                raise PydanticCustomError(
                    "unknown_word",
                    "unknown {field} {word}: {hint}",
                    {
                        "field": name,
                        "word": repr(data[name]),
                        "hint": nearest(str(data[name]), given),
                    },
                )
        return data


Model = TypeVar("Model", bound=Parameters)


def drawn(low: float, high: float, text: str) -> Any:
    """A parameter uniform between two bounds, an integer if both are; `text` describes it."""
    integer = isinstance(low, int) and isinstance(high, int)
    return _field(Uniform(uniform=(low, high), integer=integer), text, ge=low, le=high)


def drawn_log(low: float, high: float, text: str) -> Any:
    """A parameter log-uniform between two positive bounds; `text` describes it."""
    return _field(LogUniform(log_uniform=(low, high)), text, ge=low, le=high)


def one_of(*words: str, text: str) -> Any:
    """A parameter that is one of several words, equally likely; `text` describes it."""
    return _field(Choice(choice=words), text)


def _field(distribution: Distribution, text: str, **limits: Any) -> Any:
    extra: dict[str, Any] = {"drawn": distribution.model_dump(mode="json", exclude_defaults=True)}
    return Field(description=text, json_schema_extra=extra, **limits)


def ranges(model: type[Parameters]) -> dict[str, dict[str, Any]]:
    """The distribution of every parameter, as in a configuration file."""
    result = {}
    for name, field in model.model_fields.items():
        assert isinstance(field.json_schema_extra, dict)  # made by `drawn` and the like
        result[name] = field.json_schema_extra["drawn"]
    return result  # type: ignore[return-value]


def draw_parameters(
    model: type[Model], seed: int, attempt: int, given: Mapping[str, Any], source: str
) -> Model:
    """The given parameters, the others drawn; InputError, naming `source`, for unfit ones."""
    values = dict(given)
    for name, text in ranges(model).items():
        if name not in values:
            distribution = _DISTRIBUTION.validate_python(text)
            values[name] = distribution.draw(stream(seed, attempt, name))
    return check_fields(values, model, source)
