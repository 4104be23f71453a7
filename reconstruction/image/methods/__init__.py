"""Image methods, one module each."""

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
    """Return an image method by name.

    Parameters
    ----------
    name
        Entry of `IMAGE_METHODS`. ``method:dictionary`` replaces the dictionary of a method, and
        ``recursive:method`` the method that makes the images.

    Raises
    ------
    InputError
        If a name is unknown, or the method uses no dictionary.
    """
    name, colon, dictionary = name.partition(":")
    method: Any = IMAGE_METHODS[name]
    if not colon:
        return cast(ImageMethod, method)
    if hasattr(method, "inner"):
        return cast(ImageMethod, replace(method, inner=dictionary))
    if not hasattr(method, "dictionary"):
        raise InputError(f"image method {name!r} uses no dictionary, got {dictionary!r}")
    return cast(ImageMethod, replace(method, dictionary=DICTIONARIES[dictionary]))
