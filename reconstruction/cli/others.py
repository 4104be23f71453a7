"""Commands of other packages, such as those of live streams."""

import sys
import warnings
from typing import Any

from ..base.registry import Registry
from ..base.text import printable

OTHERS: Registry[Any] = Registry("command", attribute="COMMAND", group="reconstruction.commands")
"""Modules by the words of their commands, each with `SUMMARY`, `EXAMPLE`, `add_options`, `run`."""


def listed() -> dict[str, Any]:
    """Modules of all commands; those that cannot be loaded are named, and left out."""
    with warnings.catch_warnings(record=True) as failures:
        warnings.simplefilter("always")
        others = dict(OTHERS.loadable())
    for failure in failures:
        print(printable(f"warning: {failure.message}"), file=sys.stderr)
    return others
