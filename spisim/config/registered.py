"""Fields of configuration files that hold sections of a registry.

Sections are loaded when the first file is read, so that a package that registers one may import the
module of the field.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Union

from pydantic import Discriminator, GetCoreSchemaHandler
from pydantic_core import CoreSchema

from spisim.config.fields import Section


class OneOf:
    """Marks a field as one of several sections, told apart by the value of one of their fields."""

    def __init__(self, sections: Mapping[str, type[Section]], field: str) -> None:
        self._sections = sections
        self._field = field

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        one: Any = Union[tuple(self._sections.values())]  # noqa: UP007 - of as many as there are
        return handler.generate_schema(Annotated[one, Discriminator(self._field)])


class Named:
    """Marks a field as the section of this name."""

    def __init__(self, sections: Mapping[str, type[Section]], name: str) -> None:
        self._sections = sections
        self._name = name

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return handler.generate_schema(self._sections[self._name])
