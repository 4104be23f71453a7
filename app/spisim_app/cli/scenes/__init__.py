"""`spisim scenes`: list, view and draw scenes."""

from collections.abc import Mapping
from typing import Any

import typer

from reconstruction.base.registry import Registry

from . import draw, listing, show

EXAMPLE = "spisim scenes list"

app = typer.Typer(
    name="scenes",
    help="Scenes to fly in: list, show, draw, import and export them.",
    no_args_is_help=True,
    epilog=f"Example: {EXAMPLE}",
)

OWN = {"list": listing, "show": show, "draw": draw}
OTHERS: Registry[Mapping[str, Any]] = Registry(
    "command of scenes", attribute="COMMANDS", group="spisim.scenes_commands"
)
"""Modules as in `OWN`, by their words, of packages that add some."""

for commands in (OWN, *(each for _, each in OTHERS.loadable())):
    for name, module in commands.items():
        app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)
