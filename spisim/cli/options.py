"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

SceneArgument = Annotated[
    str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a shipped scene.")
]
CaptureArgument = Annotated[
    Path, typer.Argument(metavar="CAPTURE", help="A capture file (HDF5).", show_default=False)
]
InstrumentOption = Annotated[
    str, typer.Option("--instrument", help="An instrument file, or the name of a preset.")
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all randomness.")]
Spp = Annotated[
    int, typer.Option(min=1, help="Light paths per virtual pixel; the noise falls as 1/√spp.")
]
Visibility = Annotated[
    float | None,
    typer.Option("--visibility", metavar="M", help="Fog of this visibility, in metres."),
]
Clear = Annotated[bool, typer.Option("--clear", help="Clear air, in place of the scene's fog.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Bar = Annotated[
    bool | None,
    typer.Option("--progress/--no-progress", help="Progress bar; by default on a terminal."),
]
