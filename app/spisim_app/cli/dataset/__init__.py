"""`spisim dataset`: make many captures, monitor, verify, view and export them."""

from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from . import export, pack, run, sheet, status, verify

EXAMPLE = "spisim dataset plan.yaml -o out/fog"


class PlanOrCommand(TyperGroup):
    """Subcommands; a plan instead of one is run."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the word `run` before a plan, or before an option that is not the group's."""
        if args and args[0] not in self.commands and args[0] not in ctx.help_option_names:
            first = Path(args[0])
            if args[0].startswith("-") or first.suffix in {".yaml", ".yml"} or first.is_file():
                args = ["run", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=PlanOrCommand,
    name="dataset",
    help="Many captures of a plan: make, check, show, pack and export them.",
    no_args_is_help=True,
    epilog=f"Example: {EXAMPLE}",
)

COMMANDS = {
    "run": run,
    "status": status,
    "verify": verify,
    "sheet": sheet,
    "export": export,
    "pack": pack,
}

for name, module in COMMANDS.items():
    app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)
