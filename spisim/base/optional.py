"""Optional packages."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from reconstruction.base.errors import InputError


def import_optional(module: str, extra: str) -> Any:
    """Import a module of an optional package. Raises InputError, naming the extra to install."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        if package == "spisim":
            raise
        raise InputError(
            f"this needs the package {package}: pip install 'spisim[{extra}]'"
        ) from None
