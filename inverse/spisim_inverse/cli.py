"""`spisim fit` and `spisim design`."""

from types import ModuleType

from spisim_inverse.design import command as design

#: Modules by subcommand of `spisim`, each with a `command` and an `EXAMPLE`.
COMMANDS: dict[str, ModuleType] = {"design": design}
