"""`spisim fit` and `spisim design`."""

from types import ModuleType

from spisim_inverse.design import command as design
from spisim_inverse.fit import command as fit

#: Modules by subcommand of `spisim`, each with a `command` and an `EXAMPLE`.
COMMANDS: dict[str, ModuleType] = {"fit": fit, "design": design}
