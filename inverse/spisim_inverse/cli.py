"""`spisim fit` and `spisim design`."""

from types import ModuleType

#: Modules by subcommand of `spisim`, each with a `command` and an `EXAMPLE`.
COMMANDS: dict[str, ModuleType] = {}
