"""Methods of making images, one module each."""

from dataclasses import replace
from typing import Any, cast

from ...errors import InputError
from ...registry import Registry
from ..dictionaries import DICTIONARIES
from ..method import ImageMethod

IMAGE_METHODS: Registry[ImageMethod] = Registry(
    "image method", package=__name__, attribute="METHOD", group="reconstruction.images"
)


def image_method(name: str) -> ImageMethod:
    """Method of this name; ``method:dictionary`` is one with another dictionary than its own.

    Raises InputError for unknown names, and a method that has no dictionary.
    """
    name, colon, dictionary = name.partition(":")
    method: Any = IMAGE_METHODS[name]
    if not colon:
        return cast(ImageMethod, method)
    if not hasattr(method, "dictionary"):
        raise InputError(f"image method {name!r} uses no dictionary; {dictionary!r} is not needed")
    return cast(ImageMethod, replace(method, dictionary=DICTIONARIES[dictionary]))
