"""`spisim serve`."""

from spisim_serving.cli import serve

COMMANDS = {"serve": serve}
"""Modules by subcommand of `spisim`, each with a `command` and an `EXAMPLE`."""
