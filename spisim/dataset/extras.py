"""Packages that only some uses need."""

from importlib import import_module
from typing import Any

from reconstruction.base.errors import InputError


def needed(module: str, extra: str) -> Any:
    """Import a module; InputError, naming the extra that brings its package, if it is missing."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        if package == "spisim":
            raise
        raise InputError(
            f"this needs the package {package}: pip install 'spisim[{extra}]'"
        ) from None
