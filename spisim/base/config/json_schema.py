"""Descriptions and bounds in the JSON Schema of a section."""

import ast
import inspect
import sys
from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel

#: Names that pydantic keeps where a validator precedes a bound, and those of JSON Schema.
BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}


def name_bounds(schema: Any) -> None:
    """Rename bounds in place to the names of JSON Schema."""
    if isinstance(schema, list):
        for part in schema:
            name_bounds(part)
    if not isinstance(schema, dict):
        return
    if schema.get("type") in ("number", "integer"):
        for ours, theirs in BOUNDS.items():
            if ours in schema:
                schema[theirs] = schema.pop(ours)
    for part in schema.values():
        name_bounds(part)


def add_descriptions(schema: dict[str, Any], section: type[BaseModel]) -> None:
    """Add the strings below a section's fields, in place, as their descriptions."""
    texts = field_texts(section)
    for name, field in schema.get("properties", {}).items():
        if name in texts:
            field.setdefault("description", texts[name])


def field_texts(section: type[BaseModel]) -> dict[str, str]:
    """String below each field of a section or its bases; parsed on request, as it is slow."""
    texts: dict[str, str] = {}
    for base in reversed(section.__mro__):
        if issubclass(base, BaseModel):
            texts.update(_texts_in(base.__module__).get(base.__qualname__, {}))
    return texts


@cache
def _texts_in(module: str) -> Mapping[str, dict[str, str]]:
    """Strings by class and field; empty if there is no source."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError):
        return {}
    return {node.name: _texts_of(node) for node in tree.body if isinstance(node, ast.ClassDef)}


def _texts_of(section: ast.ClassDef) -> dict[str, str]:
    texts = {}
    for field, text in zip(section.body, section.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
            and isinstance(text.value.value, str)
        ):
            texts[field.target.id] = inspect.cleandoc(text.value.value)
    return texts
