"""`spisim paper`."""

from spisim_paper import command

COMMANDS = {"paper": command}
"""Modules by subcommand of `spisim`, each with a `command` and an `EXAMPLE`."""
