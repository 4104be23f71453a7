"""Error messages for configuration files that say what to change."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from reconstruction.base.errors import nearest

#: Errors of values that should not be a mapping: a mapping found there is quoted.
_SCALAR = {"float_type", "int_type", "string_type", "bool_type"}
#: Error type of an unknown field.
UNKNOWN_FIELD = "unknown_field"
#: Maximum number of errors listed for one file.
MAX_ERRORS = 20


def describe(error: ValidationError, data: Mapping[Any, Any], source: Path | str) -> str:
    """One message for all errors of a file, with fields and values."""
    errors = error.errors(include_url=False)
    unknown = {each["loc"] for each in errors if each["type"] == UNKNOWN_FIELD}
    messages: list[str] = []
    of_unions: list[str] = []
    for details in errors:
        if details["type"] == "default_factory_not_called":
            continue  # a consequence of other wrong fields
        is_missing = details["type"] == "missing"
        if is_missing and details["loc"][:-1] in unknown:
            continue  # the unknown field may be this one, misspelt
        if details["type"] == "too_short" and _has_errors_within(details["loc"], errors):
            continue  # a consequence of wrong items
        field, value, in_union = _locate(details["loc"], data, is_missing)
        if field and any(_is_within(field, other) for other in of_unions):
            continue  # only the first branch of a union is described
        if in_union:
            of_unions.append(field)
        messages.append(_sentence(field, value, details))
    if len(messages) == 1:
        return f"{source}: {messages[0]}"
    numbered = [f"({number}) {text}" for number, text in enumerate(messages[:MAX_ERRORS], 1)]
    if len(messages) > MAX_ERRORS:
        numbered.append(f"and {len(messages) - MAX_ERRORS} more")
    return f"{source}: {len(messages)} errors: {' '.join(numbered)}"


def _has_errors_within(loc: tuple[int | str, ...], errors: list[ErrorDetails]) -> bool:
    """Whether items of a list have their own errors."""
    return any(each["loc"][: len(loc)] == loc != each["loc"] for each in errors)


def _sentence(field: str, value: Any, details: ErrorDetails) -> str:
    message = f"{field}{': ' if field else ''}{reason(details)}"
    if details["type"] in ("missing", UNKNOWN_FIELD) or (
        isinstance(value, Mapping) and details["type"] not in _SCALAR
    ):
        return message
    return f"{message}; found {show(value)}"


def _is_within(field: str, section: str) -> bool:
    """Whether a field is this section or lies in it."""
    return field == section or field.startswith((f"{section}.", f"{section}["))


def _locate(loc: tuple[int | str, ...], data: Any, missing: bool) -> tuple[str, Any, bool]:
    """Field path in user notation, `objects[2].size_m`, its value, and whether it is in a union.

    pydantic puts the branches of unions into its locations. They are not in the file, so they are
    dropped, and no branch may have the name of a field. Only a branch at the end of a location
    counts: earlier ones were chosen by a valid field.
    """
    path, in_union = "", False
    for index, key in enumerate(loc):
        is_last = index == len(loc) - 1
        in_union = False
        if isinstance(key, int) and not isinstance(data, Mapping):
            path = f"{path}[{key}]"
            data = data[key] if isinstance(data, list) and key < len(data) else None
        elif isinstance(data, Mapping) and (key in data or (missing and is_last)):
            path = f"{path}.{key}" if path else str(key)
            data = data.get(key)
        else:
            in_union = not isinstance(data, Mapping)
    return path, data, in_union


_MESSAGES = {
    "missing": "is missing",
    "tuple_type": "should be a list",
    "model_type": "should be a mapping of fields",
    "model_attributes_type": "should be a mapping of fields",
}


def reason(details: ErrorDetails) -> str:
    """What is wrong with a value, by an error of pydantic, in the words of all messages."""
    if details["type"] == "value_error":  # raised by a validator of this package
        return str(details["ctx"]["error"])
    if details["type"] == "union_tag_invalid":
        tag, field = details["ctx"]["tag"], details["ctx"]["discriminator"].strip("'")
        expected = [name.strip("' ") for name in details["ctx"]["expected_tags"].split(",")]
        return f"{field} {show(tag)} is unknown: {nearest(tag, expected)}"
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


def show(value: Any, limit: int = 60) -> str:
    """`repr` of a value, shortened to a limit."""
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"
