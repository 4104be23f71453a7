"""YAML files read into pydantic models, with errors that say what to change.

Every configuration file of the simulator goes through `read_model`; whatever is wrong with one
ends as a single `InputError` naming file, field, value and what is allowed.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from reconstruction.errors import InputError, nearest


def not_a_truth_value(value: Any) -> Any:
    """YAML reads `yes` and `on` as true, which would silently become the number 1."""
    if isinstance(value, bool):
        raise PydanticCustomError("truth_value", "should be a number")
    return value


Number = Annotated[float, BeforeValidator(not_a_truth_value)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Fraction = Annotated[Number, Field(ge=0, le=1)]
Count = Annotated[int, BeforeValidator(not_a_truth_value), Field(gt=0)]
Vector = tuple[Number, Number, Number]
Name = Annotated[str, Field(min_length=1)]


class Section(BaseModel):
    """Base of every part of a configuration file: no unknown fields, no NaN, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_fields(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            for field in data:
                if field not in cls.model_fields:
                    raise PydanticCustomError(
                        "unknown_field",
                        "unknown field {field}: {nearest}",
                        {"field": repr(field), "nearest": nearest(str(field), cls.model_fields)},
                    )
        return data


Model = TypeVar("Model", bound=Section)


class _Loader(yaml.SafeLoader):
    """Safe YAML in which a repeated key is an error; plain PyYAML keeps the last one silently."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        self.flatten_mapping(node)
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"field {key!r} is given twice", problem_mark=key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


def read_text(path: Path) -> str:
    """Text of a UTF-8 file; InputError where it is missing, unreadable or not text."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; a YAML file in UTF-8 is expected") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def read_mapping(text: str, model: type[Section], source: Path | str) -> dict[Any, Any]:
    """Fields of a YAML file that should be of `model`, unchecked.

    Raises InputError, naming `source`, for YAML that does not parse or is not a mapping.
    """
    try:
        # The loader derives from SafeLoader: plain data only, no Python objects.
        data = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        where = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise InputError(f"{source}{where}: not valid YAML: {error.problem}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{source}: not valid YAML: {reason}") from None
    if not isinstance(data, dict):
        fields = ", ".join(model.model_fields)
        raise InputError(
            f"{source}: expected a mapping with the fields {fields}, found {_show(data)}"
        )
    return data


def parse_model(text: str, model: type[Model], source: Path | str) -> Model:
    """Check YAML text against a model.

    Parameters
    ----------
    text: the YAML.
    model: the `Section` that describes the whole file.
    source: what error messages call the file.

    Raises InputError for YAML that does not parse, is not a mapping, or does not fit the model.
    """
    return check_fields(read_mapping(text, model, source), model, source)


def check_fields(data: Mapping[Any, Any], model: type[Model], source: Path | str) -> Model:
    """Check the fields of a file against a model. Raises InputError where they do not fit."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(_describe(error, data, source)) from None
    except RecursionError:
        raise InputError(f"{source}: a value of it contains itself") from None


def find_named(name: str, folder: Path, kind: str) -> Path:
    """Path of `name`: a YAML file that the user has, else the shipped `folder/name.yaml`.

    Raises InputError, with the nearest shipped name, where there is neither.
    """
    given = Path(name)
    if given.suffix in {".yaml", ".yml"} or given.is_file():
        return given
    shipped = {path.stem: path for path in folder.glob("*.yaml")}
    if name in shipped:
        return shipped[name]
    if given.is_dir():
        raise InputError(f"{name} is a folder; the name of a YAML file is needed")
    raise InputError(
        f"no {kind} {name!r}: neither a file nor the name of a shipped {kind}; "
        f"{nearest(name, sorted(shipped))}"
    )


#: Errors of values that should be no mapping, so that one which is has to be shown.
_SCALAR = {"float_type", "int_type", "string_type", "bool_type"}


def _describe(error: ValidationError, data: Mapping[Any, Any], source: Path | str) -> str:
    # One at a time: later errors are often only the consequence of the first.
    details = error.errors(include_url=False)[0]
    field, value = _locate(details["loc"], data, details["type"] == "missing")
    message = f"{source}: {field}{': ' if field else ''}{reason(details)}"
    if details["type"] == "missing" or (
        isinstance(value, Mapping) and details["type"] not in _SCALAR
    ):
        return message
    return f"{message}; found {_show(value)}"


def _locate(loc: tuple[int | str, ...], data: Any, missing: bool) -> tuple[str, Any]:
    """Field path as a person writes it, `objects[2].size_m`, and the value that stands there.

    pydantic puts the tags of unions into its locations; they are no part of the file and dropped,
    so no tag may be the name of a field.
    """
    path = ""
    for position, key in enumerate(loc):
        is_last = position == len(loc) - 1
        if isinstance(key, int) and not isinstance(data, Mapping):
            path = f"{path}[{key}]"
            data = data[key] if isinstance(data, list) and key < len(data) else None
        elif isinstance(data, Mapping) and (key in data or (missing and is_last)):
            path = f"{path}.{key}" if path else str(key)
            data = data.get(key)
    return path, data


_MESSAGES = {
    "missing": "is missing",
    "tuple_type": "should be a list",
    "model_type": "should be a mapping of fields",
    "model_attributes_type": "should be a mapping of fields",
}


def reason(details: ErrorDetails) -> str:
    """What is wrong with a value, in the words of all messages."""
    if details["type"] == "value_error":  # raised by a validator of ours
        return str(details["ctx"]["error"])
    if details["type"] == "union_tag_invalid":
        tag, field = details["ctx"]["tag"], details["ctx"]["discriminator"].strip("'")
        expected = [name.strip("' ") for name in details["ctx"]["expected_tags"].split(",")]
        return f"{field} {tag!r} is unknown: {nearest(tag, expected)}"
    if details["type"] == "union_tag_not_found":
        return f"{details['ctx']['discriminator'].strip(chr(39))} is missing"
    if details["type"] in ("too_short", "too_long"):
        bounds = details["ctx"]
        limit = (
            f"at least {bounds['min_length']}"
            if "min_length" in bounds
            else f"at most {bounds['max_length']}"
        )
        return f"should have {limit} items, not {bounds['actual_length']}"
    text = _MESSAGES.get(details["type"], details["msg"].removeprefix("Input "))
    return text[0].lower() + text[1:]


def _show(value: Any, limit: int = 60) -> str:
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"
