"""`spisim scenes import` and `spisim scenes export`."""

from spisim_formats.cli import exporting, importing

COMMANDS = {"import": importing, "export": exporting}
"""Modules by subcommand of `spisim scenes`, each with a `command` and an `EXAMPLE`."""
