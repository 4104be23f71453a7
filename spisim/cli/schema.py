"""`spisim schema`: JSON Schema of the configuration files."""

from enum import StrEnum
from typing import Annotated

import typer

from .console import print_json

EXAMPLE = "spisim schema instrument > instrument.schema.json"


class Kind(StrEnum):
    """A kind of configuration file."""

    scene = "scene"
    instrument = "instrument"


def command(kind: Annotated[Kind, typer.Argument(help="Which file.", show_default=False)]) -> None:
    """Print the JSON Schema of scene or instrument files, for editors that check as one types."""
    if kind is Kind.scene:
        from spisim.scene.description import SceneDescription

        print_json(SceneDescription.model_json_schema())
    else:
        from spisim.instrument import Instrument

        print_json(Instrument.model_json_schema())
