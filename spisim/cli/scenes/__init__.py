"""`spisim scenes`: what is shipped, what can be drawn, and what they look like."""

import typer

from . import draw, exporting, importing, listing, show

EXAMPLE = "spisim scenes list"

app = typer.Typer(
    name="scenes",
    help="Scenes to fly in: list, show, draw, import and export them.",
    no_args_is_help=True,
    epilog=f"Example: {EXAMPLE}",
)

COMMANDS = {"list": listing, "show": show, "draw": draw, "import": importing, "export": exporting}

for name, module in COMMANDS.items():
    app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)
