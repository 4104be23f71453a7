"""`spisim compare`."""

from spisim_compare import command

COMMANDS = {"compare": command}
"""Modules by subcommand of `spisim`, each with a `command` and an `EXAMPLE`."""
