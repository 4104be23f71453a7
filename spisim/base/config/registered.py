"""Fields of configuration files that hold sections of a registry.

Sections are loaded when the first file is read, so that a package that registers one may import the
module of the field.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Union

from pydantic import Discriminator, GetPydanticSchema

from reconstruction.base.registry import Registry


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
