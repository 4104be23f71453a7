"""`spisim instrument`: files of instruments."""

import typer

from . import new

EXAMPLE = "spisim instrument new -o mine.yaml"

app = typer.Typer(
    name="instrument",
    help="Files of instruments: write one from data sheets.",
    no_args_is_help=True,
    epilog=f"Example: {EXAMPLE}",
)

COMMANDS = {"new": new}

for name, module in COMMANDS.items():
    app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)


@app.callback()
def _group() -> None:
    """Keep Typer from replacing a group of one command by that command."""
