"""Packages that may be missing: optional ones, and the program that stands on this library."""

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


def import_app(module: str) -> Any:
    """Import a module of `spisim_app`, the commands and pages built on this library.

    The library knows them by these names alone; all imports go the other way.

    Raises
    ------
    InputError
        If the package is not installed.
    """
    try:
        return import_module(f"spisim_app.{module}")
    except ModuleNotFoundError as error:
        if error.name != "spisim_app":
            raise
        raise InputError(
            "the commands and pages that come with spisim are missing; reinstall it: "
            "pip install spisim"
        ) from None
