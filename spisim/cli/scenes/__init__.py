"""`spisim scenes`: what is shipped, what can be drawn, and what they look like."""

import typer

from . import listing, show

EXAMPLE = "spisim scenes list"

app = typer.Typer(
    name="scenes",
    help="What there is to look at.",
    no_args_is_help=True,
    epilog=f"Example: {EXAMPLE}",
)

COMMANDS = {"list": listing, "show": show}

for name, module in COMMANDS.items():
    app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)
