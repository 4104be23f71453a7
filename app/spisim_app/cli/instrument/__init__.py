"""`spisim instrument`: files of instruments."""

import typer

from . import new, presets

EXAMPLE = presets.COPY_EXAMPLE

app = typer.Typer(
    name="instrument",
    help="Files of instruments: list, show and copy presets, or write one from data sheets.",
    no_args_is_help=True,
    epilog=f"Example: {EXAMPLE}",
)

app.command("list", epilog=f"Example: {presets.LIST_EXAMPLE}")(presets.list_command)
app.command("show", epilog=f"Example: {presets.SHOW_EXAMPLE}")(presets.show_command)
app.command("copy", epilog=f"Example: {presets.COPY_EXAMPLE}")(presets.copy_command)
app.command("new", epilog=f"Example: {new.EXAMPLE}")(new.command)
