"""What is wrong with a configuration file, in words that say what to change."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from reconstruction.errors import nearest

#: Errors of values that should be no mapping, so that one which is has to be shown.
_SCALAR = {"float_type", "int_type", "string_type", "bool_type"}


def describe(error: ValidationError, data: Mapping[Any, Any], source: Path | str) -> str:
    """The first thing wrong, with file, field and value."""
    # One at a time: later errors are often only the consequence of the first.
    details = error.errors(include_url=False)[0]
    field, value = _locate(details["loc"], data, details["type"] == "missing")
    message = f"{source}: {field}{': ' if field else ''}{reason(details)}"
    if details["type"] == "missing" or (
        isinstance(value, Mapping) and details["type"] not in _SCALAR
    ):
        return message
    return f"{message}; found {show(value)}"


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
    """A value in little room."""
    text = repr(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"
