"""Methods of making images, one module each."""

from dataclasses import replace
from typing import Any, cast

from ...base.errors import InputError
from ...base.registry import Registry
from ..dictionaries import DICTIONARIES
from ..method import ImageMethod

IMAGE_METHODS: Registry[ImageMethod] = Registry(
    "image method", package=__name__, attribute="METHOD", group="reconstruction.images"
)


def image_method(name: str) -> ImageMethod:
    """Method of this name; ``method:dictionary`` is one with another dictionary than its own.

    What stands behind the colon of one that carries is the method that makes its images, as in
    ``recursive:pursuit``. Raises InputError for unknown names, and a method that has no dictionary.
    """
    name, colon, dictionary = name.partition(":")
    method: Any = IMAGE_METHODS[name]
    if not colon:
        return cast(ImageMethod, method)
    if hasattr(method, "inner"):
        return cast(ImageMethod, replace(method, inner=dictionary))
    if not hasattr(method, "dictionary"):
        raise InputError(f"image method {name!r} uses no dictionary; {dictionary!r} is not needed")
    return cast(ImageMethod, replace(method, dictionary=DICTIONARIES[dictionary]))
