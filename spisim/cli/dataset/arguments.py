"""Arguments that the subcommands share."""

from pathlib import Path
from typing import Annotated

import typer

Folder = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of a data set.", show_default=False)
]
